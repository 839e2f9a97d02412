//! Weights of regularizers: a number, or the rule that chooses one.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Visitor;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::scene;

use super::flaw::{Built, checked};

/// A weight, relative to the mean squared column norm of the transport, or how it is chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weight(scene::RegularizationWeight);

const GCV: &str = "gcv";
const L_CURVE: &str = "l-curve";

impl Weight {
    /// The weight; a flaw at `path` when it is negative.
    pub(super) fn build(self, path: &str) -> Built<scene::RegularizationWeight> {
        if let scene::RegularizationWeight::Relative(weight) = self.0 {
            checked(path, weight, "finite and not negative", |weight| weight >= 0.0)?;
        }
        Ok(self.0)
    }

    /// Whether it is to be chosen.
    pub(super) fn is_open(self) -> bool {
        !matches!(self.0, scene::RegularizationWeight::Relative(_))
    }
}

impl From<f64> for Weight {
    fn from(weight: f64) -> Self {
        Self(scene::RegularizationWeight::Relative(weight))
    }
}

impl From<scene::RegularizationWeight> for Weight {
    fn from(weight: scene::RegularizationWeight) -> Self {
        Self(weight)
    }
}

impl Serialize for Weight {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            scene::RegularizationWeight::Relative(weight) => weight.serialize(serializer),
            scene::RegularizationWeight::Gcv => GCV.serialize(serializer),
            scene::RegularizationWeight::LCurve => L_CURVE.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Weight {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WeightVisitor)
    }
}

struct WeightVisitor;

impl Visitor<'_> for WeightVisitor {
    type Value = Weight;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, \"gcv\" or \"l-curve\"")
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<Weight, E> {
        Ok(Weight(scene::RegularizationWeight::Relative(value)))
    }

    fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<Weight, E> {
        self.visit_f64(value as f64)
    }

    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<Weight, E> {
        self.visit_f64(value as f64)
    }

    fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Weight, E> {
        match name {
            GCV => Ok(Weight(scene::RegularizationWeight::Gcv)),
            L_CURVE => Ok(Weight(scene::RegularizationWeight::LCurve)),
            other => Err(E::unknown_variant(other, &[GCV, L_CURVE])),
        }
    }
}

impl JsonSchema for Weight {
    fn schema_name() -> Cow<'static, str> {
        "Weight".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A weight relative to the mean squared column norm of the transport, or the rule that chooses it: generalized cross-validation or the corner of the L-curve.",
            "anyOf": [{ "type": "number", "minimum": 0 }, { "enum": [GCV, L_CURVE] }]
        })
    }
}
