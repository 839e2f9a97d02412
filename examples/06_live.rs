//! Painting on a job that is kept warm: `cargo run --release --example 06_live -- DIR`.
//!
//! What one learns: [`LiveJob`](unscatter::job::LiveJob) keeps the rows of all pixels of small previews; strokes come and go, and the solve goes
//! on from where it is.

#![allow(clippy::print_stdout, reason = "an example says what it does")]

use std::path::{Path, PathBuf};

use unscatter::io::image::write_png;
use unscatter::job::{Job, Preview};
use unscatter::scene::Stroke;

fn main() -> unscatter::Result<()> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("out"), PathBuf::from);
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("strokes/citadel.json");
    let mut live = Job::open(scene)?.live(Preview::Width(160))?;
    let first = live.advance(100)?;
    println!("as it was painted: {} applications of T and its transpose", first.applications);
    std::fs::create_dir_all(&folder).map_err(|source| unscatter::Error::File {
        action: "create the folder",
        path: folder.clone(),
        source,
    })?;
    for (number, color) in [[0.1, 0.9, 0.3], [0.9, 0.1, 0.6]].into_iter().enumerate() {
        // Points are pixels of the full picture.
        let stroke = Stroke {
            points: vec![[300.0, 150.0], [330.0, 240.0]],
            radius: 18.0,
            hardness: 0.7,
            opacity: 1.0,
            weight: 1.0,
            pressure: Vec::new(),
            erases: false,
            color,
        };
        live.paint("court", stroke)?;
        let then = live.advance(100)?;
        println!("stroke {}: {} applications more", number + 1, then.applications);
        write_png(&folder.join(format!("court_{}.png", number + 1)), &live.picture("court")?, 0.0)?;
    }
    write_png(&folder.join("light_map.png"), &live.light_map()?, -3.0)
}
