//! Files in and out. Everything is written whole or not at all.

mod checkpoint;
mod cutout;
mod film;
pub mod gltf;
mod guard;
pub mod image;
pub(crate) mod input;
pub(crate) mod machine;
pub mod npy;
mod numbers;
pub mod obj;
pub mod scene_file;
pub mod transforms;
pub mod vdb;
pub mod volume;
mod whole;

pub use checkpoint::Checkpoint;
pub use guard::is_guarded;
pub use whole::write_whole;

/// A value as indented JSON.
///
/// Errors: [`crate::Error::Machine`] for what JSON cannot hold.
pub(crate) fn to_json(value: &impl serde::Serialize) -> crate::Result<String> {
    serde_json::to_string_pretty(value)
        .map_err(|error| crate::Error::Machine(format!("cannot write JSON: {error}")))
}
