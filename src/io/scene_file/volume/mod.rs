//! Scene files that describe a volume.

mod document;
mod field;
mod properties;
mod shapes;
mod view;

pub use document::{Environment, Find, Pull, TransformsFile, VolumeDocument};
pub use field::{Field, FieldSource, GridSize};
pub use properties::{Extinction, Interpolation, PropertyBounds, Range, Refraction, Volume};
pub use shapes::{Capsule, Noise, Shape, Shapes, Sphere};
pub use view::VolumeView;
