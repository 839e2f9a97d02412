//! One property of a volume in the document.

use std::borrow::Cow;
use std::fmt;

use glam::DAffine3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::shapes::{Shapes, mixed};
use crate::io::scene_file::assets::Assets;
use crate::io::scene_file::channels::Channels;
use crate::io::scene_file::file_name::FileName;
use crate::io::scene_file::flaw::{At, Built, Flaw, checked};
use crate::io::volume::Stored;
use crate::scene::{self, VoxelGrid};

/// A property of a volume: a number or [r, g, b] for the same everywhere, or an object that says where it comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum Field {
    /// The same in every voxel.
    Constant(Channels),
    /// From a file, or made.
    From(FieldSource),
}

/// Where a property comes from: exactly one of `value`, `file` and `made`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FieldSource {
    /// The same in every voxel: one number or [r, g, b].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<Channels>,
    /// A .vdb, .vol, .npy, .npz or raw (.json header) file, relative to the scene file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<FileName>,
    /// Name of the grid in a .vdb file, or of the array in a .npz file, where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub member: Option<String>,
    /// Made of shapes and noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub made: Option<Shapes>,
    /// A factor for all values.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    #[schemars(!skip_serializing_if)]
    pub scale: f64,
    /// Voxels along each axis for what is constant or made: N, or [x, y, z]; the volume's when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<GridSize>,
    /// Whether values are kept in 16 bits.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schemars(!skip_serializing_if)]
    pub half: bool,
}

impl Default for FieldSource {
    fn default() -> Self {
        Self { value: None, file: None, member: None, made: None, scale: one(), size: None, half: false }
    }
}

/// Voxels along each axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GridSize {
    /// The same along every axis.
    Cube(usize),
    /// Along x, y and z.
    Sides([usize; 3]),
}

impl GridSize {
    /// Along x, y and z.
    pub fn sides(self) -> [usize; 3] {
        match self {
            Self::Cube(side) => [side; 3],
            Self::Sides(sides) => sides,
        }
    }
}

impl Field {
    /// A property made of shapes.
    pub fn made(shapes: Shapes) -> Self {
        Self::From(FieldSource { made: Some(shapes), ..FieldSource::default() })
    }

    /// Where it comes from.
    pub(super) fn source(&self) -> FieldSource {
        match self {
            Self::Constant(value) => FieldSource { value: Some(*value), ..FieldSource::default() },
            Self::From(source) => source.clone(),
        }
    }

    /// What its file holds, scaled; none where it comes from no file.
    pub(super) fn stored(&self, assets: &Assets) -> Built<Option<Stored>> {
        let source = self.source();
        let scale = source.check()?;
        let Some(file) = &source.file else { return Ok(None) };
        let mut stored = assets.volume(file, source.member.as_deref()).at("file")?;
        if scale != 1.0 {
            stored.volume = stored.volume.map(|value| value * scale).at("scale")?;
            stored.outside = stored.outside.map(|value| value * scale);
        }
        Ok(Some(stored))
    }

    /// What is constant or made, in voxels of its own number or `size` that fill a cube.
    pub(super) fn filled(
        &self,
        assets: &Assets,
        size: Option<[usize; 3]>,
        world_from_cube: DAffine3,
    ) -> Built<scene::Volume> {
        let source = self.source();
        let scale = source.check()?;
        let grid = |what: &str| -> Built<VoxelGrid> {
            let size = source.size.map(GridSize::sides).or(size).ok_or_else(|| {
                Flaw::new("", format!("a {what} property needs a number of voxels; give `volume.size`"))
            })?;
            let grid = VoxelGrid::over_cube(size, world_from_cube).at("size")?;
            assets.allow(&format!("a {what} property"), (grid.len() * size_of::<f32>()) as u64).at("size")?;
            Ok(grid)
        };
        let volume = match (&source.value, &source.made) {
            (Some(value), _) => {
                let color = value.wide().map(|value| value as f32);
                scene::Volume::constant(grid("constant")?, color).at("value")?
            }
            (_, Some(shapes)) => {
                let shapes = shapes.build().at("made")?;
                shapes.volume(grid("made")?).at("made")?
            }
            _ => return Err(Flaw::new("file", "a file is read and not made")),
        };
        if scale == 1.0 { Ok(volume) } else { volume.map(|value| value * scale).at("scale") }
    }

    /// The volume in as many bits as it is kept in.
    pub(super) fn kept(&self, volume: scene::Volume) -> Built<scene::Volume> {
        if self.source().half { volume.halved().at("half") } else { Ok(volume) }
    }
}

impl FieldSource {
    /// The factor, where nothing is wrong with what can be said before anything is read.
    fn check(&self) -> Built<f32> {
        let sources = [self.value.is_some(), self.file.is_some(), self.made.is_some()];
        if sources.iter().filter(|&&is_given| is_given).count() != 1 {
            return Err(Flaw::new("", "give exactly one of `value`, `file` and `made`"));
        }
        if self.size.is_some() && self.file.is_some() {
            return Err(Flaw::new("size", "a file has its own number of voxels; leave `size` away"));
        }
        if self.member.is_some() && self.file.is_none() {
            return Err(Flaw::new("member", "only a file has members; leave `member` away"));
        }
        Ok(checked("scale", self.scale, "finite", |_| true)? as f32)
    }

    /// Whether its file is one of many, with a run of `#` for the number.
    pub(super) fn is_numbered(&self) -> bool {
        self.file.as_ref().is_some_and(FileName::is_numbered)
    }

    /// The file with a number for the first run of `#`.
    pub(super) fn numbered(&self, number: usize) -> Self {
        Self { file: self.file.as_ref().map(|file| file.numbered(number)), ..self.clone() }
    }

    /// What is made of the shapes a `share` of the way to another's.
    pub(super) fn towards(&self, other: &Self, share: f64) -> Built<Self> {
        let (Some(from), Some(to)) = (&self.made, &other.made) else {
            return Err(Flaw::new("", "only what is `made` has shapes that could move to another key's"));
        };
        // Without rounding where nothing changes.
        let is_one_scale = self.scale == other.scale;
        let scale = if is_one_scale { self.scale } else { mixed(self.scale, other.scale, share) };
        Ok(Self { made: Some(from.towards(to, share).at("made")?), scale, ..self.clone() })
    }
}

fn one() -> f64 {
    1.0
}

fn is_one(scale: &f64) -> bool {
    *scale == one()
}

impl Serialize for Field {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Constant(value) => value.serialize(serializer),
            Self::From(source) => source.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Field {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FieldVisitor)
    }
}

struct FieldVisitor;

impl<'de> Visitor<'de> for FieldVisitor {
    type Value = Field;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, [r, g, b], or an object with `value`, `file` or `made`")
    }

    fn visit_f64<E>(self, value: f64) -> Result<Field, E> {
        Ok(Field::Constant(Channels::Grey(value)))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Field, E> {
        Ok(Field::Constant(Channels::Grey(value as f64)))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Field, E> {
        Ok(Field::Constant(Channels::Grey(value as f64)))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, sequence: A) -> Result<Field, A::Error> {
        Channels::deserialize(SeqAccessDeserializer::new(sequence)).map(Field::Constant)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Field, A::Error> {
        FieldSource::deserialize(MapAccessDeserializer::new(map)).map(Field::From)
    }
}

impl JsonSchema for Field {
    fn schema_name() -> Cow<'static, str> {
        "Field".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let (constant, source) =
            (generator.subschema_for::<Channels>(), generator.subschema_for::<FieldSource>());
        json_schema!({
            "description": "A property of a volume: a number or [r, g, b] for the same everywhere, or where it comes from.",
            "anyOf": [constant, source]
        })
    }
}

impl Serialize for GridSize {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Cube(side) => side.serialize(serializer),
            Self::Sides(sides) => sides.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for GridSize {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(GridSizeVisitor)
    }
}

struct GridSizeVisitor;

impl<'de> Visitor<'de> for GridSizeVisitor {
    type Value = GridSize;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a whole number or [x, y, z]")
    }

    fn visit_u64<E: serde::de::Error>(self, side: u64) -> Result<GridSize, E> {
        let too_large = |_| E::invalid_value(serde::de::Unexpected::Unsigned(side), &self);
        usize::try_from(side).map(GridSize::Cube).map_err(too_large)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, sequence: A) -> Result<GridSize, A::Error> {
        <[usize; 3]>::deserialize(SeqAccessDeserializer::new(sequence)).map(GridSize::Sides)
    }
}

impl JsonSchema for GridSize {
    fn schema_name() -> Cow<'static, str> {
        "GridSize".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let side = serde_json::json!({ "type": "integer", "minimum": 1, "maximum": VoxelGrid::MAX_SIDE });
        json_schema!({
            "description": "Voxels along each axis: N, or [x, y, z].",
            "anyOf": [side, { "type": "array", "items": side, "minItems": 3, "maxItems": 3 }]
        })
    }
}
