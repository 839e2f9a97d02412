//! Scene files: JSON that a person can write, and errors that say where it is wrong.
//!
//! A text becomes JSON values (`read`), overrides are put into them (`overrides`), they become a
//! [`Document`], and the document becomes a [`Scene`]. Whatever goes wrong on the way is told with file, line,
//! column and path (`scene_text`). A [`Resolved`] document has every setting, defaults included.

mod animated_scene;
mod assets;
mod channels;
mod defaults;
mod document;
pub mod edit;
mod exposure;
mod file_name;
mod flaw;
mod gltf_node;
mod heterogeneity;
mod key_frames;
mod light;
mod light_animation;
mod locate;
mod looks;
mod map;
mod medium;
mod occluder;
mod opened;
mod overrides;
mod path;
mod read;
mod resolved;
mod scene_text;
mod size;
mod solve;
mod stroke;
mod surface_light;
mod surroundings;
#[cfg(test)]
mod tests;
mod transfer;
mod transform;
mod unit;
mod view;
mod volume;
mod weight;
mod wording;
mod write;

use std::path::Path;

use serde_json::Value;

use crate::Result;
use crate::scene::{AnimatedScene, Scene, VolumeScene};

pub use channels::{Channels, Paint, Scale};
pub use defaults::Defaults;
pub use document::{Document, Opacity, Sought, Target};
pub use exposure::Exposure;
pub use file_name::FileName;
pub use gltf_node::GltfNode;
pub use light::Light;
pub use light_animation::{LightAnimation, LightKey, LightKeyView, LightMaps};
pub use looks::{Extrude, Fill, HoleSway, Kernel, Looks, OccluderEdit, Pierce};
pub use map::{Basis, Extent, Fit, LightMap, MapSize, ShadowMap};
pub use medium::Medium;
pub use occluder::{BoxShape, CylinderShape, GltfMesh, ObjMesh, Occluder, PlaneShape, SphereShape};
pub use opened::SceneFile;
pub use resolved::{Chosen, Resolved};
pub use size::{MemorySize, parse_size};
pub use solve::{MetricName, Quadrature, Skip, Solve, Solver, Strategy};
pub use stroke::{Group, Stroke};
pub use surroundings::{Sky, Surroundings};
pub use transfer::{
    Blend, Diffusion, Gradient, Solid, Transfer, TransferAxis, TransferImage, TransferLayer, TransferPoint,
    TransferRole,
};
pub use transform::{LookAt, Rotate, Transform};
pub use unit::Unit;
pub use view::{Camera, CameraLens, FovAxis, GltfCameraNode, View};
pub use volume::{
    AlphaMeaning, AnimatedVolume, Animation, Between, Capsule, Environment, Extinction, Field, FieldSource,
    Find, GridSize, Interpolation, Key, KeyView, Lights, Noise, Over, PropertyBounds, Pull, Range,
    Refraction, Shape, Shapes, Sphere, TransformsFile, Volume, VolumeDocument, VolumeView,
};
pub use weight::Weight;
pub use write::{write, write_volume};

use flaw::{Built, Flaw};
use locate::Aim;
use overrides::Override;
use scene_text::SceneText;

/// Reads a scene file and everything that it names; of an animation the first key frame.
///
/// Each of `overrides` is `path=value`, such as `views[0].camera.fov=50`, and takes the place of what the file
/// says; the value is JSON, or else a string.
///
/// Errors: [`crate::Error::Scene`] for what is wrong in the file or in a file that it names, with its place;
/// [`crate::Error::File`] and [`crate::Error::TooLarge`] when the scene file cannot be read or is larger than 64 MiB;
/// [`crate::Error::Value`] for an override that is not of that form.
pub fn load(path: &Path, overrides: &[String]) -> Result<Scene> {
    Ok(SceneFile::read(path)?.open::<Document>(overrides)?.0)
}

/// Reads a scene file that describes a volume, and everything that it names; of an animation the first key frame.
///
/// Errors: as [`load`].
pub fn load_volume(path: &Path, overrides: &[String]) -> Result<VolumeScene> {
    Ok(SceneFile::read(path)?.open::<VolumeDocument>(overrides)?.0)
}

/// Reads a scene file that describes a volume with an animation, and everything that it names.
///
/// Errors: as [`load`].
pub fn load_animation(path: &Path, overrides: &[String]) -> Result<AnimatedVolume> {
    Ok(SceneFile::read(path)?.open::<Animated>(overrides)?.0)
}

/// Reads a scene file of a light map with an animation, and everything that it names.
///
/// Errors: as [`load`].
pub fn load_animated_scene(path: &Path, overrides: &[String]) -> Result<AnimatedScene> {
    Ok(SceneFile::read(path)?.open::<AnimatedDocument>(overrides)?.0)
}

/// The scene of a text, as [`load`] reads it from a file; `name` stands for the file in messages and titles.
///
/// Errors: [`crate::Error::Scene`] and [`crate::Error::Value`], as [`load`].
pub fn parse(text: &str, name: &str, overrides: &[String]) -> Result<Scene> {
    scene_from_bytes(text.as_bytes(), Path::new(name), overrides)
}

/// The volume scene of a text.
///
/// Errors: as [`parse`].
pub fn parse_volume(text: &str, name: &str, overrides: &[String]) -> Result<VolumeScene> {
    Ok(scene_of::<VolumeDocument>(text.as_bytes(), Path::new(name), overrides)?.0)
}

/// What a scene file is about, as far as can be told from its outermost fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    /// Light in a homogeneous medium: [`Document`].
    LightMap,
    /// A volume: [`VolumeDocument`].
    Volume,
    /// A volume that changes from frame to frame: a [`VolumeDocument`] with an [`Animation`].
    Animation,
    /// Light that changes from frame to frame: a [`Document`] with a [`LightAnimation`].
    LightAnimation,
}

/// A kind of scene file.
pub(crate) trait Describes: serde::de::DeserializeOwned + serde::Serialize {
    /// What it describes.
    type Scene;
    const SUBJECT: Subject;

    fn scene(&self, file: &Path) -> Built<Self::Scene>;

    /// Puts in the settings that are not given and that the schema has no default for.
    fn settle(&mut self, file: &Path);
}

impl Describes for Document {
    type Scene = Scene;
    const SUBJECT: Subject = Subject::LightMap;

    fn scene(&self, file: &Path) -> Built<Scene> {
        match self.animation {
            Some(_) => Ok(self.animate(file)?.animation.keys.swap_remove(0).scene),
            None => self.scene(file, &mut self.assets(file)?),
        }
    }

    fn settle(&mut self, file: &Path) {
        self.settle(file);
    }
}

impl Describes for VolumeDocument {
    type Scene = VolumeScene;
    const SUBJECT: Subject = Subject::Volume;

    fn scene(&self, file: &Path) -> Built<VolumeScene> {
        self.build(file)
    }

    fn settle(&mut self, file: &Path) {
        self.settle(file);
    }
}

/// A document that is read for its animation.
#[derive(serde::Deserialize, serde::Serialize)]
#[serde(transparent)]
pub(crate) struct Animated(VolumeDocument);

impl Describes for Animated {
    type Scene = AnimatedVolume;
    const SUBJECT: Subject = Subject::Animation;

    fn scene(&self, file: &Path) -> Built<AnimatedVolume> {
        self.0.animate(file)
    }

    fn settle(&mut self, file: &Path) {
        self.0.settle(file);
    }
}

/// A document of a light map that is read for its animation.
#[derive(serde::Deserialize, serde::Serialize)]
#[serde(transparent)]
pub(crate) struct AnimatedDocument(Document);

impl Describes for AnimatedDocument {
    type Scene = AnimatedScene;
    const SUBJECT: Subject = Subject::LightAnimation;

    fn scene(&self, file: &Path) -> Built<AnimatedScene> {
        self.0.animate(file)
    }

    fn settle(&mut self, file: &Path) {
        self.0.settle(file);
    }
}

/// The JSON schema of scene files (draft 2020-12): of light maps, or of volumes.
pub fn schema(subject: Subject) -> Value {
    let (mut schema, title) = match subject {
        Subject::LightMap | Subject::LightAnimation => (schemars::schema_for!(Document), "unscatter scene"),
        Subject::Volume | Subject::Animation => {
            (schemars::schema_for!(VolumeDocument), "unscatter volume scene")
        }
    };
    schema.insert("title".to_owned(), Value::from(title));
    schema.to_value()
}

fn scene_from_bytes(bytes: &[u8], file: &Path, overrides: &[String]) -> Result<Scene> {
    Ok(scene_of::<Document>(bytes, file, overrides)?.0)
}

/// The scene, and the document that describes it.
fn scene_of<D: Describes>(bytes: &[u8], file: &Path, overrides: &[String]) -> Result<(D::Scene, D)> {
    let mut source = SceneText::of(bytes, file)?;
    let document: D = document(&mut source, overrides)?;
    Ok((source.placed(document.scene(file))?, document))
}

fn document<D: Describes>(source: &mut SceneText<'_>, overrides: &[String]) -> Result<D> {
    let mut value = source.value()?;
    for text in overrides {
        let change = Override::parse(text)?;
        let path = change.path.clone();
        source.set.push(path.clone());
        change.apply(&mut value).map_err(|problem| source.error(&path, Aim::Value, problem, None))?;
    }
    // Before all else: a file of another version has other fields, and each would be called unknown.
    source.placed(check_version(&value))?;
    if matches!(D::SUBJECT, Subject::LightMap | Subject::LightAnimation) {
        defaults::put_into(&mut value);
    }
    source.read(&value)
}

fn check_version(value: &Value) -> Result<(), Flaw> {
    match value.get("version") {
        Some(Value::Number(version)) if version.as_f64() != Some(Document::VERSION as f64) => {
            Err(document::unknown_version(version))
        }
        _ => Ok(()),
    }
}
