//! From two key frames to all frames: `cargo run --release --example 05_animation -- DIR`.
//!
//! What one learns: an animation is a volume scene with keys; the keys are solved, and the frames between them are drawn when the
//! solution is written.

#![allow(clippy::print_stdout, reason = "an example says what it does")]

use std::path::PathBuf;

use unscatter::job::{Job, Options, Quiet};

fn main() -> unscatter::Result<()> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("out"), PathBuf::from);
    let scene = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("strokes/smoke.json");
    // Fewer pixels and frames than the demo has.
    let options = Options { frames: Some(0..=4), ..Options::default() };
    let overrides = ["solve.iterations=10".to_owned()];
    let found = Job::open_with(scene, &overrides)?.with(options).solve(&mut Quiet)?;
    let written = found.write(folder)?;
    if let Some(animation) = &written.report.animation {
        println!("{} of {} frames, from {} keys", animation.drawn, animation.frames, animation.keys.len());
    }
    Ok(())
}
