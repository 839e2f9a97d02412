//! Writes the demo scenes of `strokes/`: `cargo run --release --example 03_demo_scenes -- DIR`.
//!
//! What one learns: how to make a scene file with the library's own types, how to load it, and how to ask
//! geometry over it and its cameras where light is seen, here to paint strokes along the shafts. Every run writes the same bytes.

#![allow(clippy::print_stdout, reason = "an example says what it does")]

use std::error::Error;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use unscatter::io::scene_file::{self, Document, VolumeDocument};
use unscatter::problem;
use unscatter::scene::VolumeScene;
use unscatter::visibility::Geometry;

mod canvas;
mod chapel;
mod citadel;
mod cloud;
mod evening;
mod forest;
mod glass;
mod glb;
mod hand;
mod nave;
mod numbers;
mod painter;
mod smoke;
mod stage;
mod sunrise;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("strokes"), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("forest.glb"), forest::model()?)?;
    std::fs::write(folder.join("chapel.glb"), chapel::windows()?)?;
    evening::write(&folder.join("evening.exr"))?;
    let demos = [
        // As many pixels as Kol 2017, fig. 17.
        Demo {
            document: citadel::document(),
            shafts: citadel::shafts(),
            share: 0.42,
            brush: 0.395,
            pixels: 41_240..=42_500,
        },
        Demo {
            document: chapel::document(),
            shafts: chapel::shafts(),
            share: 0.5,
            brush: 0.4,
            pixels: 4_000..=20_000,
        },
        Demo {
            document: forest::document(),
            shafts: forest::shafts(),
            share: 0.45,
            brush: 0.56,
            pixels: 45_000..=55_000,
        },
        Demo {
            document: nave::document(),
            shafts: nave::shafts(),
            share: 0.65,
            brush: 0.42,
            pixels: 50_000..=65_000,
        },
    ];
    demos.into_iter().zip(["citadel", "chapel", "forest", "nave"]).try_for_each(|(demo, name)| {
        let path = folder.join(name).with_extension("json");
        demo.write(&path)
    })?;
    std::fs::write(folder.join("sunrise.json"), scene_file::write(&sunrise::document())?)?;
    write_volume(&folder.join("hand.json"), &hand::write(&folder)?)?;
    write_volume(&folder.join("glass.json"), &glass::write(&folder)?)?;
    let mut cloud = cloud::write(&folder)?;
    let path = folder.join("cloud.json");
    let scene = write_volume(&path, &cloud)?;
    cloud.views.iter_mut().enumerate().for_each(|(index, view)| view.strokes = cloud::strokes(&scene, index));
    write_volume(&path, &cloud)?;
    let mut smoke = smoke::document();
    let path = folder.join("smoke.json");
    let scene = write_volume(&path, &smoke)?;
    smoke.animation = Some(smoke::animation(&scene));
    write_volume(&path, &smoke)?;
    Ok(())
}

/// Writes the scene of a volume, and reads it again.
fn write_volume(path: &Path, document: &VolumeDocument) -> Result<VolumeScene, Box<dyn Error>> {
    std::fs::write(path, scene_file::write_volume(document)?)?;
    let scene = scene_file::load_volume(path, &[])?;
    let strokes: usize = scene.views.iter().map(|view| view.view.strokes.len()).sum();
    println!("{}: {} views, {strokes} strokes", path.display(), scene.views.len());
    Ok(scene)
}

/// A scene, and what is to be painted on it.
struct Demo {
    document: Document,
    shafts: Vec<painter::Shaft>,
    /// How much of the light of a pixel must come from a shaft for it to be painted there.
    share: f64,
    /// Half the width of the strokes, relative to half the width of their shafts.
    brush: f64,
    /// How many pixels that should paint.
    pixels: RangeInclusive<usize>,
}

impl Demo {
    /// Writes the scene, looks at it, paints, and writes it again.
    fn write(mut self, path: &Path) -> Result<(), Box<dyn Error>> {
        std::fs::write(path, scene_file::write(&self.document)?)?;
        let scene = scene_file::load(path, &[])?;
        let geometry = Geometry::new(scene.mesh.clone())?;
        for (index, view) in self.document.views.iter_mut().enumerate() {
            view.strokes = painter::strokes(&scene, &geometry, index, &self.shafts, self.share, self.brush);
        }
        std::fs::write(path, scene_file::write(&self.document)?)?;
        let painted = problem::constraints(&scene_file::load(path, &[])?)?.len();
        println!("{}: {painted} pixels painted", path.display());
        if !self.pixels.contains(&painted) {
            return Err(format!("{painted} pixels are painted where {:?} are wanted", self.pixels).into());
        }
        Ok(())
    }
}
