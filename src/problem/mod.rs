//! From a scene and what is painted on it to a least-squares problem, and from its solution to pictures.

mod assess;
mod canvas;
mod cells;
mod colors;
mod constraints;
mod diffusion;
mod drawing;
mod evenly;
mod extents;
mod fill;
mod formulation;
mod held_out;
mod heterogeneity;
mod key_frames;
mod light_map;
mod lit_texels;
mod looked_for;
mod painted_rows;
mod painting;
#[cfg(feature = "gpu")]
mod rasterized;
mod reach;
mod render;
mod scattered;
mod scattering;
mod segment;
mod sight;
mod sky;
mod sliced;
mod solution;
mod solved;
mod surface_light;
mod surfaces;
mod surroundings;
mod system;
mod transfer;
mod transfer_problem;
mod upsampling;
mod volume;

pub use assess::{Assessment, Assessor, Match};
pub use canvas::Canvas;
pub use constraints::{Constraint, constraints, pixels};
pub use diffusion::{Diffused, Known, diffuse};
pub use drawing::{Drawing, DrawingMethod, DrawnView, ScatteredView};
pub use evenly::evenly;
pub use extents::{Maps, fit};
pub use formulation::{Formulation, Lattice, Part, Start};
pub use held_out::HeldOut;
pub use heterogeneity::{HeterogeneousAir, UnseenAir, unseen_air};
pub use key_frames::settle_key_frames;
pub use light_map::LightMapProblem;
pub use looked_for::{Nouns, Problem, Unskipped};
pub use painting::{Painting, paint};
#[cfg(feature = "gpu")]
pub use rasterized::Rasterized;
pub use reach::{OutOfReach, held_back};
pub use render::{Backdrop, DrawnLight, Renderer, Rendering, render};
pub(crate) use sight::seen_distances;
pub use sky::SkyBeam;
use sliced::SlicedProblem;
pub use sliced::near;
pub use solution::{Begin, Paused, Snapshot, SystemOperator, measure, method, minimize, solve, vectors};
pub use solved::Solved;
pub use surface_light::{BentCone, LitSurfaces};
pub use surfaces::{Surfaces, Traced};
pub use system::{RegularizationWeights, System, Transports};
pub use transfer::{Tinted, TransferFunction, TransferTable};
pub use transfer_problem::TransferProblem;
pub use volume::{
    AllVoxels, Desired, Determined, HoldOut, LeftOut, LightColumns, LitRows, Model, Occupied, Optics,
    SeenLights, Spread, Spreading, VolumeProblem, VolumeRenderer, VolumeRows, VolumeState, light_bytes,
};
