//! What sees what: a hierarchy over the triangles of a scene, the first surfaces on rays, and shadow maps.
//!
//! A scene holds triangles as plain data (`scene::Mesh`). Whoever computes with it builds one [`Geometry`] over them and shares
//! it.

mod build;
mod edits;
mod geometry;
mod hierarchy;
mod shadow_map;
mod triangle;

pub use edits::edited;
pub use geometry::{Geometry, Hit, Pane};
pub use shadow_map::{Behind, PaneDepth, ShadowMap};
