//! Light map and shadow map of the document.

use std::borrow::Cow;
use std::fmt;

use glam::DVec2;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error as _, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::scene::{self, Grid, MapSettings};

use super::flaw::{At, Built, within};

/// The light map that is looked for.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LightMap {
    /// Texels: N for N × N, or [width, height]; each side from 1 to 8192. When not given, texels are square, and at most 512 × 512 in all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<MapSize>,
    /// Where it lies in the plane of the light; fitted as `fit` says when not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extent: Option<Extent>,
    /// What its place is fitted to.
    pub fit: Fit,
    /// What lies between its values.
    pub basis: Basis,
    /// Whether it is a slide, which only dims: no texel is brighter than the light in any channel, unless `solve.upper` says so. When not
    /// given, it is where paint is a tint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gobo: Option<bool>,
}

/// What the place of a light map is fitted to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Fit {
    /// 95 % of the light that painted pixels scatter, under occluders or in open air.
    #[default]
    Scattered,
    /// What rays through painted pixels pass, but not beyond the occluders: light from elsewhere keeps its colour.
    Seen,
}

/// The shadow map of the light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ShadowMap {
    /// Texels: N for a square, or [width, height]; each side from 64 to 8192.
    pub size: MapSize,
    /// Where it lies in the plane of the light; fitted to what the views see when not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extent: Option<Extent>,
}

/// A rectangle in the (u, v) plane of the light, in metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Extent {
    /// Least u and v.
    pub min: [f64; 2],
    /// Greatest u and v.
    pub max: [f64; 2],
}

/// What lies between the values of a light map.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// Constant in each texel.
    Nearest,
    /// Bilinear between texel centres.
    #[default]
    Bilinear,
}

/// Resolution of a map: one number for a square, or `[width, height]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapSize {
    /// As wide as high.
    Square(usize),
    /// Width and height.
    Sides([usize; 2]),
}

/// Texels along each side of a light map that nothing is said about, if it is a square.
const LIGHT_SIDE: usize = 512;
const LIGHT_SIDES: [usize; 2] = [1, 8192];
const SHADOW_SIDES: [usize; 2] = [64, 8192];

impl Default for ShadowMap {
    fn default() -> Self {
        Self { size: MapSize::Square(2048), extent: None }
    }
}

impl LightMap {
    fn size_or_default(&self) -> MapSize {
        self.size.unwrap_or(MapSize::Square(LIGHT_SIDE))
    }

    /// How many texels it has at most.
    pub(super) fn texels(&self) -> usize {
        match self.size_or_default() {
            MapSize::Square(side) => side.saturating_mul(side),
            MapSize::Sides([width, height]) => width.saturating_mul(height),
        }
    }

    pub(super) fn build(&self) -> Built<MapSettings> {
        let map = settings(self.size_or_default(), self.extent.as_ref(), LIGHT_SIDES)?;
        let fit = match self.fit {
            Fit::Scattered => scene::MapFit::Scattered,
            Fit::Seen => scene::MapFit::Seen,
        };
        Ok(MapSettings { fit, square_texels: self.size.is_none(), ..map })
    }
}

impl ShadowMap {
    pub(super) fn build(&self) -> Built<MapSettings> {
        settings(self.size, self.extent.as_ref(), SHADOW_SIDES)
    }
}

impl From<Basis> for scene::Basis {
    fn from(basis: Basis) -> Self {
        match basis {
            Basis::Nearest => Self::Nearest,
            Basis::Bilinear => Self::Bilinear,
        }
    }
}

fn settings(size: MapSize, extent: Option<&Extent>, sides: [usize; 2]) -> Built<MapSettings> {
    let size = match size {
        MapSize::Square(side) => [within("size", side, sides)?; 2],
        MapSize::Sides([width, height]) => {
            [within("size[0]", width, sides)?, within("size[1]", height, sides)?]
        }
    };
    let Some(extent) = extent else { return Ok(MapSettings::new(size)) };
    let (min, max) = (DVec2::from_array(extent.min), DVec2::from_array(extent.max));
    let grid = Grid::new(scene::Extent { min, max }, size)?;
    // Two finite corners may still be infinitely far apart, or too close for their texels to have a width.
    super::flaw::checked("", grid.density().element_product(), "an extent of ordinary size", f64::is_normal)
        .at("extent")?;
    Ok(MapSettings { extent: Some(grid.extent), ..MapSettings::new(size) })
}

impl Serialize for MapSize {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Square(side) => side.serialize(serializer),
            Self::Sides(sides) => sides.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for MapSize {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(MapSizeVisitor)
    }
}

struct MapSizeVisitor;

impl<'de> Visitor<'de> for MapSizeVisitor {
    type Value = MapSize;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a whole number or [width, height]")
    }

    fn visit_u64<E: serde::de::Error>(self, side: u64) -> Result<MapSize, E> {
        let too_large = |_| E::invalid_value(serde::de::Unexpected::Unsigned(side), &self);
        usize::try_from(side).map(MapSize::Square).map_err(too_large)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<MapSize, A::Error> {
        let mut sides = [0; 2];
        for (length, side) in sides.iter_mut().enumerate() {
            *side = sequence.next_element()?.ok_or_else(|| A::Error::invalid_length(length, &self))?;
        }
        let mut length = sides.len();
        while sequence.next_element::<IgnoredAny>()?.is_some() {
            length += 1;
        }
        if length > 2 { Err(A::Error::invalid_length(length, &self)) } else { Ok(MapSize::Sides(sides)) }
    }
}

impl JsonSchema for MapSize {
    fn schema_name() -> Cow<'static, str> {
        "MapSize".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let side =
            serde_json::json!({ "type": "integer", "minimum": LIGHT_SIDES[0], "maximum": LIGHT_SIDES[1] });
        json_schema!({
            "description": "Resolution of a map: N for a square, or [width, height].",
            "anyOf": [side, { "type": "array", "items": side, "minItems": 2, "maxItems": 2 }]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::flaw::Flaw;
    use super::*;

    fn flaw_of(text: &str) -> Option<String> {
        let map: ShadowMap = serde_json::from_str(text).unwrap();
        match map.build() {
            Err(Flaw::Document { path, .. }) => Some(path),
            _ => None,
        }
    }

    #[test]
    fn sizes_and_extents_are_bounded() {
        let table = [
            (r#"{"size": 64}"#, None),
            (r#"{"size": [64, 8192]}"#, None),
            (r#"{"size": 63}"#, Some("size")),
            (r#"{"size": [64, 8193]}"#, Some("size[1]")),
            (r#"{"size": 18446744073709551615}"#, Some("size")),
            (r#"{"extent": {"min": [0, 0], "max": [1, 2]}}"#, None),
            (r#"{"extent": {"min": [0, 0], "max": [1, 0]}}"#, Some("extent")),
            (r#"{"extent": {"min": [-1e308, 0], "max": [1e308, 1]}}"#, Some("extent")),
            (r#"{"extent": {"min": [0, 0], "max": [1e-320, 1e-320]}}"#, Some("extent")),
        ];
        for (text, path) in table {
            assert_eq!(flaw_of(text).as_deref(), path, "{text}");
        }
    }

    #[test]
    fn a_size_is_one_or_two_whole_numbers() {
        let read = |text: &str| serde_json::from_str::<MapSize>(text);
        assert_eq!(read("7").unwrap(), MapSize::Square(7));
        assert_eq!(read("[7, 9]").unwrap(), MapSize::Sides([7, 9]));
        for bad in ["-7", "7.5", "[7]", "[7, 8, 9]", "[7, -8]", "\"7\"", "null", "{}"] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }
}
