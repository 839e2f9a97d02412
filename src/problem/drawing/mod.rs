//! Other ways than the exact rows to draw what the medium scatters of the sun: those of the literature, and slices.

#[cfg(feature = "gpu")]
mod adapter;
mod bilateral;
mod marched;
mod method;
mod rays;
mod scattered;
mod sliced;

pub use method::{Drawing, DrawingMethod};
pub(super) use rays::SunLight;
pub(super) use scattered::scattered;
pub use scattered::{DrawnView, ScatteredView};
