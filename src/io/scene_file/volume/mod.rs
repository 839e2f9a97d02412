//! Scene files that describe a volume.

mod animated;
mod animation;
mod document;
mod environment;
mod field;
mod lights;
mod place;
mod properties;
mod shapes;
#[cfg(test)]
mod tests;
mod view;

pub use animated::AnimatedVolume;
pub use animation::{Animation, Between, Key, KeyView};
pub use document::{AlphaMeaning, Find, Pull, TransformsFile, VolumeDocument};
pub use environment::Environment;
pub use field::{Field, FieldSource, GridSize};
pub use lights::{Lights, Over};
pub use properties::{Extinction, Interpolation, PropertyBounds, Range, Refraction, Volume};
pub use shapes::{Capsule, Noise, Shape, Shapes, Sphere};
pub use view::VolumeView;
