//! What a benchmark measured: records as data in, `bench.json`, `bench.csv` and `bench.html` as text out.

mod data;
mod figures;
mod page;
mod pareto;
mod pictures;
mod scatter;

pub use data::{
    Against, Bench, Held, Law, MarchStanding, Measured, Pair, PictureRecord, Record, Skipped, Sweep,
    SweepPoint, compare, csv, exponent,
};
pub use page::page;
pub use pareto::front;
pub use pictures::{EQUAL_ERROR, PictureGrowth, growth};
pub use scatter::{Group, Mark, Scatter, scatter};
