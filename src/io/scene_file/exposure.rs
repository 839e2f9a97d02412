//! How much pictures are brightened for a screen: so many stops, or as many as make them readable.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Visitor;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::flaw::{Built, checked};

/// Stops, or none where they are as many as make pictures readable.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Exposure(pub Option<f64>);

const AUTO: &str = "auto";
const MOST: f64 = 64.0;

impl Exposure {
    pub(super) fn build(self) -> Built<Option<f64>> {
        let stops =
            self.0.map(|stops| checked("exposure", stops, "from -64 to 64 stops", |e| e.abs() <= MOST));
        stops.transpose()
    }
}

impl Serialize for Exposure {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Some(stops) => stops.serialize(serializer),
            None => AUTO.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Exposure {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ExposureVisitor)
    }
}

struct ExposureVisitor;

impl Visitor<'_> for ExposureVisitor {
    type Value = Exposure;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number of stops or `auto`")
    }

    fn visit_f64<E: serde::de::Error>(self, stops: f64) -> Result<Exposure, E> {
        Ok(Exposure(Some(stops)))
    }

    fn visit_u64<E: serde::de::Error>(self, stops: u64) -> Result<Exposure, E> {
        Ok(Exposure(Some(stops as f64)))
    }

    fn visit_i64<E: serde::de::Error>(self, stops: i64) -> Result<Exposure, E> {
        Ok(Exposure(Some(stops as f64)))
    }

    fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Exposure, E> {
        match name {
            AUTO => Ok(Exposure(None)),
            _ => Err(E::invalid_value(serde::de::Unexpected::Str(name), &self)),
        }
    }
}

impl JsonSchema for Exposure {
    fn schema_name() -> Cow<'static, str> {
        "Exposure".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "Stops, or `auto`.",
            "anyOf": [{ "type": "number", "minimum": -MOST, "maximum": MOST }, { "const": AUTO }]
        })
    }
}
