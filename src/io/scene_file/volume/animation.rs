//! Volumes that change from frame to frame, as they are written: key frames, and what lies between them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::field::{Field, FieldSource};
use super::properties::Volume;
use super::view::{KEEP, Wanted};
use crate::io::image::Association;
use crate::io::scene_file::assets::Assets;
use crate::io::scene_file::file_name::FileName;
use crate::io::scene_file::flaw::{At, Built, Flaw, within};
use crate::io::scene_file::key_frames::{check_frames, views_of_key};
use crate::io::scene_file::stroke::Stroke;
use crate::scene::{self, Find, VolumeMedium, VolumeScene, VoxelGrid};

/// The largest number of the first file.
const LARGEST_NUMBER: usize = 1_000_000_000;

/// The number of the first file when not given.
const FIRST_FILE: usize = 0;

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
    #[schemars(!skip_serializing_if)]
    pub between: Between,
    /// The number of the file of frame 0, where `volume.extinction.file` has a run of `#` in the file's own name: that stands for the
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
    #[schemars(!skip_serializing_if)]
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
    pub picture: Option<FileName>,
    /// Weights of the picture's pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<FileName>,
    /// Where the volume is seen at this frame: a picture of the view's size, black outside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<FileName>,
    /// Painted strokes, in painting order, over the layers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub strokes: Vec<Stroke>,
    /// Painted pictures of the view's size, from the bottom up.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub layers: Vec<FileName>,
    /// Whether the colours of `picture` and `layers` are multiplied by their alpha: `associated` or `straight`. As their format has it
    /// when not given: those of an EXR are, those of a PNG are not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub association: Option<Association>,
    /// Weight with which unpainted pixels stay as they are; 1 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub keep: Option<f64>,
}

impl Animation {
    /// Whether something is painted at any key.
    pub(super) fn is_painted(&self) -> bool {
        let mut views = self.keys.iter().flat_map(|key| &key.views);
        views.any(|view| !view.strokes.is_empty() || !view.layers.is_empty())
    }

    /// What can be said before anything is read.
    pub(super) fn check(&self, volume: &Volume, stages: &[Find]) -> Built<()> {
        let keys: Vec<usize> = self.keys.iter().map(|key| key.frame).collect();
        check_frames(self.frames, &keys)?;
        let is_of_files = self.is_of_files(volume);
        if self.first_file.is_some() && !is_of_files {
            let problem =
                "there are no numbered files; give `volume.extinction.file` a run of `#` for the number";
            return Err(Flaw::new("first_file", problem));
        }
        within("first_file", self.first_file(), [0, LARGEST_NUMBER])?;
        let own = self.keys.iter().position(|key| key.extinction.is_some());
        if let (true, Some(index)) = (is_of_files, own) {
            let problem =
                "the files of `volume.extinction` give the extinction of every frame; leave it away here";
            return Err(Flaw::new(format!("keys[{index}].extinction"), problem));
        }
        let moves = is_of_files || self.between == Between::Shapes;
        if moves && stages.iter().any(|find| matches!(find, Find::Extinction | Find::Refinement)) {
            let problem = "extinction is looked for at the keys, and can only be blended between them";
            return Err(Flaw::new("between", problem));
        }
        if is_of_files && self.between == Between::Shapes {
            return Err(Flaw::new("between", "the extinction of all frames comes from files; leave it away"));
        }
        Ok(())
    }

    /// Puts in the settings that are not given.
    pub(super) fn settle(&mut self, volume: &Volume) {
        if self.is_of_files(volume) {
            self.first_file.get_or_insert(FIRST_FILE);
        }
        for view in self.keys.iter_mut().flat_map(|key| &mut key.views) {
            view.keep.get_or_insert(KEEP);
        }
    }

    /// The number of the file of frame 0.
    pub(super) fn first_file(&self) -> usize {
        self.first_file.unwrap_or(FIRST_FILE)
    }

    /// Where the extinction of keys and frames comes from, each with its path in the document.
    pub(super) fn extinctions(&self, volume: &Volume) -> Vec<(String, FieldSource)> {
        let of_volume = || ("volume.extinction".to_owned(), volume.extinction.source());
        if self.is_of_files(volume) {
            let numbered = |frame| {
                let (path, source) = of_volume();
                (path, source.numbered(self.first_file() + frame))
            };
            return (0..self.frames).map(numbered).collect();
        }
        let of_key = |(index, key): (usize, &Key)| match &key.extinction {
            Some(field) => (format!("animation.keys[{index}].extinction"), field.source()),
            None => of_volume(),
        };
        self.keys.iter().enumerate().map(of_key).collect()
    }

    /// Whether the volume's extinction comes from numbered files.
    pub(super) fn is_of_files(&self, volume: &Volume) -> bool {
        volume.extinction.source().is_numbered()
    }
}

impl KeyView {
    fn wanted(&self) -> Wanted<'_> {
        Wanted {
            picture: self.picture.as_ref(),
            weight: self.weight.as_ref(),
            mask: self.mask.as_ref(),
            strokes: &self.strokes,
            layers: &self.layers,
            association: self.association,
            keep: self.keep,
        }
    }
}

impl Key {
    /// The medium at this key before the solve; `frames` is what files of extinction fill at all frames together.
    pub(super) fn medium(
        &self,
        index: usize,
        (volume, stages): (&Volume, &[Find]),
        animation: &Animation,
        frames: Option<&VoxelGrid>,
        assets: &Assets,
    ) -> Built<VolumeMedium> {
        let is_of_files = animation.is_of_files(volume);
        let mut volume = volume.clone();
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
        if is_of_files {
            let number = animation.first_file() + self.frame;
            volume.extinction = Field::From(volume.extinction.source().numbered(number));
        }
        volume.build(assets, stages, frames).map_err(|flaw| {
            let is_own = own.iter().any(|name| flaw.is_at(name));
            flaw.inside(&if is_own { format!("animation.keys[{index}]") } else { "volume".to_owned() })
        })
    }

    /// Puts what is wanted at this key into a scene.
    pub(super) fn want(&self, scene: &mut VolumeScene, assets: &mut Assets) -> Built<()> {
        let names: Vec<&str> = scene.views.iter().map(|view| view.view.name.as_str()).collect();
        let numbers = views_of_key(self.views.iter().map(|wanted| wanted.name.as_str()), &names)?;
        for (index, (wanted, number)) in self.views.iter().zip(numbers).enumerate() {
            let view = &mut scene.views[number];
            let built = wanted.wanted().build(&wanted.name, view.view.camera.clone(), assets);
            let built = built.at(&format!("views[{index}]"))?;
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

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
