//! Volumes that change from frame to frame: key frames, and what lies between them.

use std::path::Path;

use glam::DAffine3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::document::VolumeDocument;
use super::field::{Field, FieldSource};
use super::properties::{Volume, not_negative};
use super::view::Wanted;
use crate::io::scene_file::assets::Assets;
use crate::io::scene_file::flaw::{At, Built, Flaw, within};
use crate::io::scene_file::transform::Transform;
use crate::io::scene_file::view::Stroke;
use crate::scene::{self, Find, KeyFrame, VolumeMedium, VolumeScene, VoxelGrid, VoxelSet};
use crate::{Error, Result};

/// Frames at most.
const MOST_FRAMES: usize = 10_000;
/// How far corners of grids that are to be one may lie apart, relative to their size.
const SAME_PLACE: f64 = 1e-5;

/// Frames of a volume, and what the pictures of some of them should show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Animation {
    /// How many frames there are, from 2 to 10000; they are numbered from 0.
    #[schemars(range(min = 2, max = 10_000))]
    pub frames: usize,
    /// The key frames, in the order of their numbers; at least two.
    #[schemars(length(min = 2))]
    pub keys: Vec<Key>,
    /// The extinction of the frames between two keys, where it does not come from numbered files.
    #[serde(default, skip_serializing_if = "is_default")]
    pub between: Between,
    /// The number of the file of frame 0, where `volume.extinction.file` has a run of `#` in its name: that stands for the
    /// number, with zeros before it up to the length of the run; 0 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_file: Option<usize>,
}

/// The extinction of frames between two keys.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Between {
    /// The keys' own, blended: one fades out while the other comes in.
    #[default]
    Blend,
    /// Made of the keys' shapes on their way from one to the other; they must be `made`, of the same kinds of shapes.
    Shapes,
}

/// A frame, and what its pictures should show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Key {
    /// The number of the frame.
    pub frame: usize,
    /// Extinction at this frame; that of the volume when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extinction: Option<Field>,
    /// Albedo at this frame before the solve; that of the volume when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub albedo: Option<Field>,
    /// Emission at this frame before the solve; that of the volume when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emission: Option<Field>,
    /// What views of the scene should show at this frame. What the scene itself wants of the others counts here, too.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub views: Vec<KeyView>,
}

/// What a view should show at a key frame, in place of what the scene says.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KeyView {
    /// The name of a view of the scene.
    pub name: String,
    /// What the picture should show, as in a view of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<String>,
    /// Weights of the picture's pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<String>,
    /// Where the volume is seen at this frame: a picture of the view's size, black outside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<String>,
    /// Painted strokes, in painting order, over the layers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub strokes: Vec<Stroke>,
    /// Painted pictures of the view's size, from the bottom up.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<String>,
    /// Weight with which unpainted pixels stay as they are; 1 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub keep: Option<f64>,
}

/// An animation, and where the extinction of its frames comes from.
#[derive(Debug)]
pub struct AnimatedVolume {
    /// The keys, each a scene of its own.
    pub animation: scene::Animation,
    /// Where frames that are no keys have their extinction from: `blend`, `shapes` or `files`.
    pub between: &'static str,
    /// Where there is extinction in any frame that is no blend of its neighbours.
    pub occupied: VoxelSet,
    frames: Frames,
}

/// What makes the extinction of frames that are no keys.
#[derive(Debug)]
enum Frames {
    Blend,
    /// On the way from one key's to the next one's.
    Shapes {
        keys: Vec<(usize, FieldSource)>,
        grid: VoxelGrid,
    },
    Files(Files),
}

/// Numbered files.
#[derive(Debug)]
struct Files {
    pattern: FieldSource,
    first: usize,
    /// What the names are relative to.
    assets: Assets,
    /// Where the volume is put, if not where the files say.
    place: Option<DAffine3>,
    grid: VoxelGrid,
}

impl AnimatedVolume {
    /// The extinction of a frame, read or made anew; none at keys and where it is that of the neighbouring keys, blended.
    ///
    /// Errors: [`Error::Value`] where a file is no longer what it was when the scene was read.
    pub fn extinction(&self, frame: usize) -> Result<Option<scene::Volume>> {
        if self.animation.keys.iter().any(|key| key.frame == frame) {
            return Ok(None);
        }
        self.frames.extinction(frame).map_err(|flaw| match flaw {
            Flaw::Machine(error) => error,
            Flaw::Document { problem, .. } => {
                Error::value("animation", problem, "what it was when the scene was read")
            }
        })
    }
}

impl Frames {
    fn name(&self) -> &'static str {
        match self {
            Self::Blend => "blend",
            Self::Shapes { .. } => "shapes",
            Self::Files(_) => "files",
        }
    }

    fn extinction(&self, frame: usize) -> Built<Option<scene::Volume>> {
        match self {
            Self::Blend => Ok(None),
            Self::Shapes { keys, grid } => {
                let frames: Vec<usize> = keys.iter().map(|(frame, _)| *frame).collect();
                let between = scene::Between::of(&frames, frame);
                let [from, to] = between.keys.map(|key| &keys[key].1);
                let source = from.towards(to, between.share)?;
                let assets = Assets::beside(Path::new(""));
                Field::From(source).build(&assets, Some(grid.size()), Some(grid.world_from_cube())).map(Some)
            }
            Self::Files(files) => files.read(frame).map(Some),
        }
    }
}

impl Files {
    fn read(&self, frame: usize) -> Built<scene::Volume> {
        let source = self.pattern.numbered(self.first + frame);
        let name = source.file.clone().unwrap_or_default();
        let volume = Field::From(source).build(&self.assets, None, self.place)?;
        not_negative(&volume)?;
        same_grid(&volume, &self.grid, &format!("{name} (frame {frame})"), "the first key frame")?;
        Ok(volume)
    }
}

impl VolumeDocument {
    /// The scenes of the key frames, and what lies between them.
    pub(in crate::io::scene_file) fn animate(&self, file: &Path) -> Built<AnimatedVolume> {
        let Some(animation) = &self.animation else {
            return Err(Flaw::new("", "the scene has no `animation`; add one with `frames` and `keys`"));
        };
        let stages = self.find.stages();
        animation.check(&self.volume, &stages).at("animation")?;
        let mut assets = Assets::beside(file);
        let first = &animation.keys[0];
        let base = self.scene(file, &mut assets, |assets| first.medium(0, self, animation, assets))?;
        let grid = *base.medium.extinction.grid();
        let mut keys = Vec::with_capacity(animation.keys.len());
        for (index, key) in animation.keys.iter().enumerate() {
            let medium = match index {
                0 => base.medium.clone(),
                _ => key.medium(index, self, animation, &assets)?,
            };
            let place = format!("animation.keys[{index}]");
            same_grids(&medium, &base.medium).at(&place)?;
            let mut scene = VolumeScene { medium, ..base.clone() };
            key.want(&mut scene, &mut assets).at(&place)?;
            keys.push(KeyFrame { frame: key.frame, scene });
        }
        let frames = animation.frames_between(self, grid, assets)?;
        let mut is_occupied = vec![false; grid.len()];
        for frame in (0..animation.frames).filter(|frame| keys.iter().all(|key| key.frame != *frame)) {
            let place =
                if animation.is_of_files(&self.volume) { "volume.extinction" } else { "animation.between" };
            let Some(extinction) = frames.extinction(frame).at(place)? else { break };
            for (index, is_occupied) in is_occupied.iter_mut().enumerate() {
                *is_occupied |= extinction.color(index).iter().any(|&sigma_t| sigma_t > 0.0);
            }
        }
        Ok(AnimatedVolume {
            animation: scene::Animation { frames: animation.frames, keys },
            between: frames.name(),
            occupied: grid.set(|index| is_occupied[index]),
            frames,
        })
    }
}

impl Animation {
    /// What can be said before anything is read.
    fn check(&self, volume: &Volume, stages: &[Find]) -> Built<()> {
        within("frames", self.frames, [2, MOST_FRAMES])?;
        if self.keys.len() < 2 {
            let problem = format!("there is {} key frame; at least two are needed", self.keys.len());
            return Err(Flaw::new("keys", problem));
        }
        for (index, key) in self.keys.iter().enumerate() {
            let place = format!("keys[{index}].frame");
            if key.frame >= self.frames {
                let expected = format!("below {}, the number of frames", self.frames);
                return Err(Flaw::value(place, key.frame, &expected));
            }
            if let Some(before) = index.checked_sub(1).map(|before| self.keys[before].frame)
                && key.frame <= before
            {
                let expected = format!("above {before}, the frame of the key before it");
                return Err(Flaw::value(place, key.frame, &expected));
            }
        }
        let is_of_files = self.is_of_files(volume);
        if self.first_file.is_some() && !is_of_files {
            let problem =
                "there are no numbered files; give `volume.extinction.file` a run of `#` for the number";
            return Err(Flaw::new("first_file", problem));
        }
        let own = self.keys.iter().position(|key| key.extinction.is_some());
        if let (true, Some(index)) = (is_of_files, own) {
            let problem =
                "the files of `volume.extinction` give the extinction of every frame; leave it away here";
            return Err(Flaw::new(format!("keys[{index}].extinction"), problem));
        }
        let moves = is_of_files || self.between == Between::Shapes;
        if moves && stages.contains(&Find::Extinction) {
            let problem = "extinction is looked for at the keys, and can only be blended between them";
            return Err(Flaw::new("between", problem));
        }
        if is_of_files && self.between == Between::Shapes {
            return Err(Flaw::new("between", "the extinction of all frames comes from files; leave it away"));
        }
        Ok(())
    }

    /// Whether the volume's extinction comes from numbered files.
    fn is_of_files(&self, volume: &Volume) -> bool {
        volume.extinction.source().is_numbered()
    }

    fn frames_between(&self, document: &VolumeDocument, grid: VoxelGrid, assets: Assets) -> Built<Frames> {
        let source = document.volume.extinction.source();
        if self.is_of_files(&document.volume) {
            let place = document.volume.to_world.as_ref().map(Transform::build).transpose();
            let (first, place) = (self.first_file.unwrap_or(0), place.at("volume.to_world")?);
            return Ok(Frames::Files(Files { pattern: source, first, assets, place, grid }));
        }
        if self.between == Between::Blend {
            return Ok(Frames::Blend);
        }
        let own = |key: &Key| (key.frame, key.extinction.as_ref().map_or(source.clone(), Field::source));
        let keys: Vec<(usize, FieldSource)> = self.keys.iter().map(own).collect();
        for (index, pair) in keys.windows(2).enumerate() {
            pair[0].1.towards(&pair[1].1, 0.5).at(&format!("animation.keys[{}].extinction", index + 1))?;
        }
        Ok(Frames::Shapes { keys, grid })
    }
}

impl Key {
    /// The medium at this key before the solve.
    fn medium(
        &self,
        index: usize,
        document: &VolumeDocument,
        animation: &Animation,
        assets: &Assets,
    ) -> Built<VolumeMedium> {
        let mut volume = document.volume.clone();
        let of_key = [
            ("extinction", &self.extinction, &mut volume.extinction),
            ("albedo", &self.albedo, &mut volume.albedo),
            ("emission", &self.emission, &mut volume.emission),
        ];
        let mut own = Vec::new();
        for (name, field, place) in of_key {
            if let Some(field) = field {
                *place = field.clone();
                own.push(name);
            }
        }
        if animation.is_of_files(&document.volume) {
            let number = animation.first_file.unwrap_or(0) + self.frame;
            volume.extinction = Field::From(volume.extinction.source().numbered(number));
        }
        volume.build(assets, &document.find.stages()).map_err(|flaw| {
            let is_own = own.iter().any(|name| flaw.is_at(name));
            flaw.inside(&if is_own { format!("animation.keys[{index}]") } else { "volume".to_owned() })
        })
    }

    /// Puts what is wanted at this key into a scene.
    fn want(&self, scene: &mut VolumeScene, assets: &mut Assets) -> Built<()> {
        for (index, wanted) in self.views.iter().enumerate() {
            let place = format!("views[{index}]");
            let named = |view: &scene::VolumeView| view.view.name == wanted.name;
            if self.views[..index].iter().any(|other| other.name == wanted.name) {
                return Err(Flaw::value(format!("{place}.name"), &wanted.name, "the name of another view"));
            }
            let Some(view) = scene.views.iter_mut().find(|view| named(view)) else {
                return Err(Flaw::value(
                    format!("{place}.name"),
                    &wanted.name,
                    "the name of a view of the scene",
                ));
            };
            let built =
                Wanted::of_key(wanted).build(&wanted.name, view.view.camera.clone(), assets).at(&place)?;
            *view = scene::VolumeView { background: view.background.take(), ..built };
        }
        if scene.views.iter().any(scene::VolumeView::is_wanted) {
            return Ok(());
        }
        let problem =
            "no view says what its picture should show at this key; give `views` with pictures or strokes";
        Err(Flaw::new("", problem))
    }
}

/// Whether the properties of two keys can be blended.
fn same_grids(medium: &VolumeMedium, first: &VolumeMedium) -> Built<()> {
    let properties = [
        ("extinction", &medium.extinction, &first.extinction),
        ("albedo", &medium.albedo, &first.albedo),
        ("emission", &medium.emission, &first.emission),
    ];
    properties.into_iter().try_for_each(|(name, volume, first)| {
        same_grid(volume, first.grid(), "the volume", "that of the first key frame").at(name)
    })
}

fn same_grid(volume: &scene::Volume, grid: &VoxelGrid, what: &str, other: &str) -> Built<()> {
    let [size, expected] = [volume.grid().size(), grid.size()];
    if size != expected {
        let sides = |[x, y, z]: [usize; 3]| format!("{x} x {y} x {z}");
        let problem = format!(
            "{what} has {} voxels and {other} {}; all frames must have the same",
            sides(size),
            sides(expected)
        );
        return Err(Flaw::new("", problem));
    }
    let (corners, others) = (volume.grid().corners(), grid.corners());
    let diagonal = others[0].distance(others[7]);
    if corners.iter().zip(&others).any(|(a, b)| a.distance(*b) > SAME_PLACE * diagonal) {
        let problem = format!("{what} lies elsewhere than {other}; set `volume.to_world`");
        return Err(Flaw::new("", problem));
    }
    Ok(())
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
