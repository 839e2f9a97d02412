//! Volumes from pictures: emission, albedo, both, extinction, or the light around them (Klehm 2015, chapter 7).

mod animation;
mod desired;
mod environment;
mod extinction;
mod fixed;
mod held_out;
mod hull;
mod operator;
mod optics;
mod problem;
mod refinement;
mod renderer;
mod rows;
mod searched;
mod state;

pub use animation::{Determined, Occupied, Spread, Spreading};
pub use desired::Desired;
pub use environment::{LightColumns, LitRows, SeenLights, light_bytes};
pub use held_out::HoldOut;
pub use optics::Optics;
pub use problem::{AllVoxels, LeftOut, VolumeProblem};
pub use renderer::{Model, VolumeRenderer};
pub use rows::VolumeRows;
pub use state::VolumeState;
