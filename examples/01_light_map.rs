//! From painted strokes to a light map, in one file: `cargo run --release --example 01_light_map -- DIR`.
//!
//! What one learns: a scene is plain data (light, medium, triangles, views with strokes); a [`Job`] finds what is looked for in it, and its
//! solution has the light map, pictures, numbers and files. A scene file does as well: `Job::open("strokes/citadel.json")`.

#![allow(clippy::print_stdout, reason = "an example says what it does")]

use std::path::PathBuf;

use glam::{DAffine3, DVec3};
use unscatter::job::{Job, Quiet};
use unscatter::scene::{
    Camera, DirectionalLight, FovAxis, Looks, MapSettings, Medium, Mesh, Opacity, Primitive, Scene,
    SolveSettings, Sought, Stroke, Target, View, look_at,
};

/// A barn: a floor, three walls, and a roof of slats.
fn barn() -> unscatter::Result<Mesh> {
    let [along, across] = [DVec3::new(0.0, 0.0, 24.0), DVec3::new(30.0, 0.0, 0.0)];
    let floor = Primitive::Plane { centre: DVec3::ZERO, sides: [along, across] };
    let mut mesh = floor.mesh([0.05; 3])?;
    let mut add = |centre: [f64; 3], size: [f64; 3]| -> unscatter::Result<()> {
        let block = Primitive::Box { centre: centre.into(), size: size.into() };
        mesh.append(block.mesh([0.2; 3])?, DAffine3::IDENTITY);
        Ok(())
    };
    add([-9.0, 4.0, 0.0], [1.0, 8.0, 24.0])?;
    add([3.0, 4.0, -11.5], [24.0, 8.0, 1.0])?;
    add([3.0, 4.0, 11.5], [24.0, 8.0, 1.0])?;
    for slat in -5..=5 {
        add([3.0, 8.0, 2.2 * f64::from(slat)], [24.0, 0.2, 1.8])?;
    }
    Ok(mesh)
}

/// A stroke of 12 pixels half width; the colour is linear.
fn stroke(points: [[f32; 2]; 2], color: [f32; 3]) -> Stroke {
    Stroke {
        points: points.to_vec(),
        radius: 12.0,
        hardness: 0.8,
        opacity: 1.0,
        weight: 1.0,
        pressure: Vec::new(),
        erases: false,
        color,
    }
}

/// The barn from inside, two of its shafts painted.
fn scene() -> unscatter::Result<Scene> {
    let eye = look_at(DVec3::new(13.0, 2.4, 1.7), DVec3::new(0.0, 3.6, 0.3), DVec3::Y)?;
    let view = View {
        name: "side".to_owned(),
        camera: Camera::new(eye, 60.0, FovAxis::X, [320, 180])?,
        strokes: vec![
            stroke([[96.0, 60.0], [78.0, 120.0]], [1.0, 0.25, 0.02]),
            stroke([[214.0, 60.0], [196.0, 120.0]], [0.05, 0.3, 1.0]),
        ],
        layers: Vec::new(),
        keep: 0.0,
    };
    Ok(Scene {
        name: "barn".to_owned(),
        light: DirectionalLight::new(DVec3::new(0.05, -1.0, 0.3), [40.0; 3])?,
        medium: Medium::new([0.04; 3], [0.9; 3], 0.2)?,
        mesh: barn()?.into(),
        ambient: [0.02; 3],
        surroundings: None,
        looks: Looks::default(),
        views: vec![view],
        // Without an extent a map is fitted to what is seen.
        light_map: MapSettings::new([128, 128]),
        shadow_map: MapSettings::new([512, 512]),
        metres_per_unit: 1.0,
        find: Sought::LightMap,
        target: Target::Tint,
        opacity: Opacity::Strength,
        solve: SolveSettings::default(),
        exposure: None,
    })
}

fn main() -> unscatter::Result<()> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("out"), PathBuf::from);
    let found = Job::new(scene()?).solve(&mut Quiet)?;
    let (report, light_map) = (found.report(), found.light_map()?);
    println!("{} painted pixels, stopped for {}", report.problem.rows, report.stop.reason);
    let residual = report.weighted_residual;
    println!("residual {:.3} before, {:.3} after", residual.before, residual.after);
    println!(
        "a light map of {:?} texels, the side view {:?} pixels",
        light_map.size(),
        found.picture("side")?.size()
    );
    let written = found.write(folder)?;
    println!("everything is in {}", written.folder.display());
    Ok(())
}
