//! Volumes from pictures: emission, albedo, both, or extinction (Klehm 2015, chapter 7).

mod desired;
mod extinction;
mod hull;
mod operator;
mod optics;
mod renderer;
mod rows;

pub use desired::Desired;
pub use operator::VolumeOperator;
pub use optics::Optics;
pub use renderer::{Model, VolumeRenderer};
pub use rows::{AllVoxels, LeftOut, VolumeProblem};

use super::luminance;
