//! From pictures to a volume: `cargo run --release --example 04_volume -- DIR`.
//!
//! What one learns: a scene with a volume is solved by the same [`Job`], from a file or from a text; its solution has the volume that was
//! found, pictures and numbers. An [`Observer`] hears how far it is, and may stop it.

#![allow(clippy::print_stdout, reason = "an example says what it does")]

use std::path::PathBuf;

use unscatter::io::scene_file;
use unscatter::job::{Iteration, Job, Observer, Options, Step, Wish};

/// A ball of smoke that should glow orange from the front, and blue from the side.
const SCENE: &str = r##"{
  "version": 1,
  "volume": {
    "size": 24,
    "to_world": { "translate": [-1, -1, -1], "scale": 2 },
    "extinction": { "made": { "shapes": [{ "sphere": { "center": [0, 0, 0], "radius": 0.7 } }], "inside": 4, "edge": 0.2 } },
    "albedo": 0.8
  },
  "find": "emission",
  "target": "radiance",
  "environment": { "radiance": 0.05 },
  "views": [
    {
      "name": "front",
      "camera": { "to_world": { "look_at": { "origin": [0, 0, 4], "target": [0, 0, 0] } }, "fov": 35, "size": [64, 64] },
      "strokes": [{ "points": [[32, 22], [32, 42]], "radius": 6, "color": "#ff8020" }]
    },
    {
      "name": "side",
      "camera": { "to_world": { "look_at": { "origin": [4, 0, 0], "target": [0, 0, 0] } }, "fov": 35, "size": [64, 64] },
      "strokes": [{ "points": [[22, 32], [42, 32]], "radius": 6, "color": "#4080ff" }]
    }
  ]
}"##;

/// Says what begins, and stops when the pictures are near enough.
struct Listener;

impl Observer for Listener {
    fn begins(&mut self, step: &Step<'_>) {
        println!("{} …", step.name);
    }

    fn iterated(&mut self, at: &Iteration<'_>) -> Wish {
        if at.progress.iteration >= 40 { Wish::Stop } else { Wish::GoOn }
    }
}

fn main() -> unscatter::Result<()> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("out"), PathBuf::from);
    let scene = scene_file::parse_volume(SCENE, "glow", &[])?;
    let options = Options { turntable: 3, ..Options::default() };
    let found = Job::new(scene).with(options).solve(&mut Listener)?;
    let emission = &found.volume()?.medium.emission;
    let red = (0..emission.grid().len()).map(|index| emission.color(index)[0]);
    let brightest = red.fold(0.0, f32::max);
    println!("the brightest voxel glows with {brightest:.2}; {:?} pixels", found.picture("front")?.size());
    found.write(folder)?;
    Ok(())
}
