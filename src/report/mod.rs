//! What a solve did, for people and for programs: `report.json`, `report.html`, convergence plots.

mod axes;
pub mod bench;
mod data;
mod example;
mod html;
mod page;
mod plot;
mod ticks;
mod words;

pub use data::{
    AnimationRecord, Certificate, Change, Coverage, KeyRecord, Problem, Regularization, Report, RowStrategy,
    Share, StageRecord, Step, StopRecord, SunRecord, SurroundingsRecord, ViewMatch, Work,
};
pub use example::example;
pub use html::{Pictures, ViewPictures, html};
pub use plot::{Axis, Chart, Curve, Spacing, chart, convergence};
