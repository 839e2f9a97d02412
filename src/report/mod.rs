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
    AnimationRecord, Certificate, Change, Coverage, HueAngles, KeyRecord, LightRecord, ProblemSize, Report,
    RowStrategy, Share, StageRecord, StopRecord, SunRecord, SurroundingsRecord, ViewMatch, WishShares, Work,
};
pub use example::example;
pub use html::{FoundPicture, Pictures, ViewPictures, html};
pub use plot::{Chart, ChartAxis, Curve, chart, convergence};
pub use ticks::Spacing;
