//! Every kernel on a graphics adapter, and whole iterations.
//!
//!     cargo bench --bench kernels [-- FILTER] [-- --quick]     hardware where there is some, else a software adapter
//!     UNSCATTER_ADAPTER=NAME cargo bench --bench kernels       an adapter by a part of its name
//!     UNSCATTER_SIZE=tiny|small|paper|medium|large             `paper` on hardware, else `small`: scenes::field::Field;
//!                                                              volumes of Klehm 2015, fig. 7.3, for `small` half of each axis
//!     UNSCATTER_JSON=FILE                                      every figure as a line of JSON, too
//!
//! Seconds are the adapter's own where it has timestamps, and the clock's for iterations, overhead, and where something is read back (`largest_step`,
//! `surfaces`). Bytes are what must at least be moved: kept rows 8 bytes a non-zero, walked ones 160 bytes a ray, slices what they take, tiles their matrices, each
//! vector and index read and written once; an iteration two products, and each vector of the method. Shares are of the bytes a
//! second that multiplying long vectors moves.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic, reason = "a bench that cannot go on should stop")]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "figures are what it is for")]
#![allow(unreachable_pub, reason = "nothing here is public")]

mod fista;
mod overhead;
mod pictures;
#[path = "../rates/mod.rs"]
mod rates;
mod rows;
#[path = "../../tests/scenes/mod.rs"]
mod scenes;
mod tiles;
mod vectors;

use std::time::{Duration, Instant};

use rates::{Rates, Round};
use scenes::field::Field;
use unscatter::Result;
use unscatter::gpu::{Choice, Gpu, GpuVector, Tactics};
use unscatter::operator::Vector;

/// Bytes of an element of a vector.
const COLOR: u64 = 12;

fn main() {
    let name = std::env::var("UNSCATTER_ADAPTER").ok();
    let choice = Choice { name, software: true, ..Choice::default() };
    let both @ [plain, chosen] = &[Tactics::SOFTWARE, Tactics::HARDWARE].map(|tactics| {
        Gpu::open(&Choice { tactics: Some(tactics), ..choice.clone() }).unwrap_or_else(|error| {
            eprintln!("{error}");
            std::process::exit(1)
        })
    });
    // As it is used.
    let gpu = if plain.record().is_hardware() { chosen } else { plain };
    let mut sizes = [
        ("small", Field::SMALL),
        ("paper", Field::PAPER),
        ("medium", Field::MEDIUM),
        ("large", Field::LARGE),
        ("tiny", Field::TINY),
    ];
    if gpu.record().is_hardware() {
        sizes.swap(0, 1);
    }
    let (size, field) = rates::size_of(&sizes);
    let (elements, shrunk) = match size {
        "tiny" => (1 << 14, 8),
        "small" => (1 << 19, 2),
        _ if gpu.record().is_hardware() => (4 << 20, 1),
        _ => (1 << 19, 1),
    };
    let moved = bandwidth(gpu, if size == "tiny" { 1 << 20 } else { 16 << 20 });
    let record = gpu.record();
    println!("{} ({}, {}), moves {:.1} GB/s", record.name, record.kind, record.driver, moved * 1e-9);

    let mut rates = Rates::new(0.5).beside(moved);
    overhead::bench(&mut rates, both);
    vectors::bench(&mut rates, gpu, elements);
    rows::light_map(&mut rates, &format!("light map, {size}"), both, &field);
    rows::slices(&mut rates, &format!("light map, {size}"), gpu, &field);
    rows::fixed_point(&mut rates, gpu, &field);
    fista::bench(&mut rates, &format!("light map, {size}"), gpu, &field);
    rows::volumes(&mut rates, gpu, shrunk);
    tiles::bench(&mut rates, both, &field);
    tiles::surfaces(&mut rates, gpu);
    pictures::bench(&mut rates, gpu, shrunk);
    overhead::first_call(&mut rates, &choice);
    rates.finish();
}

/// A round of so much work that is recorded together, timed by the adapter; all of it done once before.
fn on_adapter<'a>(gpu: &'a Gpu, mut work: impl FnMut() -> Result<()> + 'a) -> Round<'a> {
    let times = if gpu.record().is_hardware() { 16 } else { 1 };
    work().unwrap();
    Box::new(move || {
        gpu.finish().unwrap();
        let clock = Instant::now();
        let own = gpu.seconds(|| (0..times).try_for_each(|_| work())).unwrap();
        gpu.finish().unwrap();
        own.map_or_else(|| clock.elapsed(), Duration::from_secs_f64) / times
    })
}

/// Bytes a second that multiplying vectors of so many elements moves: two are read and one is written.
fn bandwidth(gpu: &Gpu, elements: u64) -> f64 {
    let elements = (gpu.record().binding_limit / 16).min(elements) as usize;
    let (mut x, y) = (GpuVector::zeros(gpu, elements), GpuVector::zeros(gpu, elements));
    let mut round = on_adapter(gpu, || {
        x.multiply(&y);
        Ok(())
    });
    let mut took = [round(), round(), round()];
    took.sort();
    (3 * COLOR) as f64 * elements as f64 / took[1].as_secs_f64()
}
