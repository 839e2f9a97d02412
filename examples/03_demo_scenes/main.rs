//! Writes the demo scenes of `strokes/`: `cargo run --release --example 03_demo_scenes -- DIR`.
//!
//! What one learns: how to make a scene file with the library's own types, how to load it, and how to ask its
//! geometry and cameras where light is seen, here to paint strokes along the shafts. Every run writes the same bytes.

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::{Path, PathBuf};

use unscatter::io::scene_file::{self, Document};
use unscatter::problem;

mod citadel;
mod forest;
mod glb;
mod nave;
mod numbers;
mod painter;
mod stage;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("strokes"), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    let citadel =
        Demo { document: citadel::document(), shafts: citadel::shafts(), share: 0.5, pixels: 41_240 };
    citadel.write(&folder.join("citadel.json"))?;
    std::fs::write(folder.join("forest.glb"), forest::model()?)?;
    let forest = Demo { document: forest::document(), shafts: forest::shafts(), share: 0.45, pixels: 50_000 };
    forest.write(&folder.join("forest.json"))?;
    let nave = Demo { document: nave::document(), shafts: nave::shafts(), share: 0.65, pixels: 60_000 };
    nave.write(&folder.join("nave.json"))?;
    Ok(())
}

/// A scene, and what is to be painted on it.
struct Demo {
    document: Document,
    shafts: Vec<painter::Shaft>,
    /// How much of the light of a pixel must come from a shaft for it to be painted there.
    share: f64,
    /// About how many pixels are to be painted.
    pixels: usize,
}

impl Demo {
    /// Writes the scene, looks at it, and paints it with the brush that covers as many pixels as are wanted.
    fn write(mut self, path: &Path) -> Result<(), Box<dyn Error>> {
        std::fs::write(path, scene_file::write(&self.document)?)?;
        let scene = scene_file::load(path, &[])?;
        let [mut narrow, mut wide] = [0.05, 2.0];
        let mut painted = 0;
        for _ in 0..12 {
            let brush = 0.5 * (narrow + wide);
            for (index, view) in self.document.views.iter_mut().enumerate() {
                view.strokes = painter::strokes(&scene, index, &self.shafts, self.share, brush);
            }
            std::fs::write(path, scene_file::write(&self.document)?)?;
            painted = problem::constraints(&scene_file::load(path, &[])?)?.0.len();
            if painted < self.pixels { narrow = brush } else { wide = brush }
        }
        println!("{}: {painted} pixels painted, brush {narrow:.3}", path.display());
        Ok(())
    }
}
