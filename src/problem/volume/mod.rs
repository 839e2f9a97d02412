//! Volumes from pictures: emission, albedo, both, or extinction (Klehm 2015, chapter 7).

mod desired;
mod extinction;
mod fixed;
mod hull;
mod operator;
mod optics;
mod problem;
mod renderer;
mod searched;

pub use desired::Desired;
pub use operator::VolumeOperator;
pub use optics::Optics;
pub use problem::{AllVoxels, LeftOut, VolumeProblem};
pub use renderer::{Model, VolumeRenderer};

use super::luminance;
