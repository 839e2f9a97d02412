//! Values that are written as one number or as three, and painted colours.

use std::borrow::Cow;
use std::fmt;

use glam::DVec3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error as _, IgnoredAny, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::scene::Rgb;

use super::flaw::{Built, Flaw};

/// A value a colour channel: one number for all of them, or `[r, g, b]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Channels {
    /// The same in every channel.
    Grey(f64),
    /// Red, green and blue.
    Rgb([f64; 3]),
}

impl Channels {
    /// The three channels.
    pub fn wide(self) -> [f64; 3] {
        match self {
            Self::Grey(value) => [value; 3],
            Self::Rgb(rgb) => rgb,
        }
    }

    /// One number where the three are the same.
    pub(super) fn simplest(self) -> Self {
        match self.wide() {
            [r, g, b] if r == g && g == b => Self::Grey(r),
            rgb => Self::Rgb(rgb),
        }
    }

    /// The three channels as radiance or reflectance; a flaw when one is below 0, above `limit` or beyond f32.
    pub(super) fn rgb(self, path: &str, limit: f32) -> Built<Rgb> {
        let rgb = self.wide().map(|value| value as f32);
        if rgb.iter().all(|&c| c.is_finite() && 0.0 <= c && c <= limit) {
            return Ok(rgb);
        }
        let bound =
            if limit < f32::MAX { format!("from 0 to {limit}") } else { "finite and not negative".into() };
        Err(Flaw::value(path, self, &bound))
    }
}

impl fmt::Display for Channels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Grey(value) => write!(f, "{value}"),
            Self::Rgb(rgb) => write!(f, "{rgb:?}"),
        }
    }
}

/// A factor of length: one number for all axes, or `[x, y, z]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// The same along every axis.
    Uniform(f64),
    /// Along x, y and z.
    Axes([f64; 3]),
}

impl Scale {
    /// The three factors.
    pub fn axes(self) -> DVec3 {
        match self {
            Self::Uniform(factor) => DVec3::splat(factor),
            Self::Axes(factors) => DVec3::from_array(factors),
        }
    }
}

/// A painted colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Paint {
    /// sRGB with 8 bits a channel, written `"#rrggbb"` or `"#rgb"`.
    Hex([u8; 3]),
    /// Linear Rec. 709, written `[r, g, b]`.
    Linear([f64; 3]),
}

impl Paint {
    /// The colour, linear.
    pub(super) fn rgb(self, path: &str) -> Built<Rgb> {
        match self {
            Self::Hex(bytes) => Ok(bytes.map(|byte| linear_from_srgb(f64::from(byte) / 255.0) as f32)),
            Self::Linear(rgb) => Channels::Rgb(rgb).rgb(path, f32::MAX),
        }
    }

    fn from_hex(text: &str) -> Option<Self> {
        let digits = text.strip_prefix('#').filter(|digits| digits.bytes().all(|b| b.is_ascii_hexdigit()))?;
        let number = u32::from_str_radix(digits, 16).ok()?;
        let [_, r, g, b] = match digits.len() {
            // Each digit stands for two.
            3 => (0x11 * (number >> 8 << 16 | (number >> 4 & 0xF) << 8 | number & 0xF)).to_be_bytes(),
            6 => number.to_be_bytes(),
            _ => return None,
        };
        Some(Self::Hex([r, g, b]))
    }
}

/// IEC 61966-2-1.
fn linear_from_srgb(value: f64) -> f64 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// Reads a number, or an array of three.
struct OneOrThree {
    expecting: &'static str,
    /// Whether one number will do.
    one: bool,
}

enum Numbers {
    One(f64),
    Three([f64; 3]),
}

const CHANNELS: OneOrThree = OneOrThree { expecting: "a number or [r, g, b]", one: true };
const SCALE: OneOrThree = OneOrThree { expecting: "a number or [x, y, z]", one: true };
const LINEAR: OneOrThree = OneOrThree { expecting: PAINT_EXPECTED, one: false };
const PAINT_EXPECTED: &str = "an sRGB colour \"#rrggbb\" or \"#rgb\", or linear [r, g, b]";

impl OneOrThree {
    fn number<E: serde::de::Error>(&self, value: f64) -> Result<Numbers, E> {
        if self.one { Ok(Numbers::One(value)) } else { Err(E::invalid_type(Unexpected::Float(value), self)) }
    }
}

impl<'de> Visitor<'de> for OneOrThree {
    type Value = Numbers;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expecting)
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<Numbers, E> {
        self.number(value)
    }

    fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<Numbers, E> {
        self.number(value as f64)
    }

    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<Numbers, E> {
        self.number(value as f64)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Numbers, A::Error> {
        let mut numbers = [0.0; 3];
        for (length, number) in numbers.iter_mut().enumerate() {
            *number = sequence.next_element()?.ok_or_else(|| A::Error::invalid_length(length, &self))?;
        }
        let mut length = numbers.len();
        while sequence.next_element::<IgnoredAny>()?.is_some() {
            length += 1;
        }
        if length > 3 { Err(A::Error::invalid_length(length, &self)) } else { Ok(Numbers::Three(numbers)) }
    }
}

impl<'de> Deserialize<'de> for Channels {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(match deserializer.deserialize_any(CHANNELS)? {
            Numbers::One(value) => Self::Grey(value),
            Numbers::Three(rgb) => Self::Rgb(rgb),
        })
    }
}

impl<'de> Deserialize<'de> for Scale {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(match deserializer.deserialize_any(SCALE)? {
            Numbers::One(factor) => Self::Uniform(factor),
            Numbers::Three(factors) => Self::Axes(factors),
        })
    }
}

struct PaintVisitor;

impl<'de> Visitor<'de> for PaintVisitor {
    type Value = Paint;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(PAINT_EXPECTED)
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Paint, E> {
        Paint::from_hex(text).ok_or_else(|| E::invalid_value(Unexpected::Str(text), &self))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, sequence: A) -> Result<Paint, A::Error> {
        match LINEAR.visit_seq(sequence)? {
            Numbers::Three(rgb) => Ok(Paint::Linear(rgb)),
            Numbers::One(value) => Err(A::Error::invalid_type(Unexpected::Float(value), &self)),
        }
    }
}

impl<'de> Deserialize<'de> for Paint {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(PaintVisitor)
    }
}

impl Serialize for Channels {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Grey(value) => value.serialize(serializer),
            Self::Rgb(rgb) => rgb.serialize(serializer),
        }
    }
}

impl Serialize for Scale {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Uniform(factor) => factor.serialize(serializer),
            Self::Axes(factors) => factors.serialize(serializer),
        }
    }
}

impl Serialize for Paint {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Hex([r, g, b]) => serializer.collect_str(&format_args!("#{r:02x}{g:02x}{b:02x}")),
            Self::Linear(rgb) => rgb.serialize(serializer),
        }
    }
}

fn three_numbers() -> serde_json::Value {
    serde_json::json!({ "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3 })
}

impl JsonSchema for Channels {
    fn schema_name() -> Cow<'static, str> {
        "Channels".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A value a colour channel: one number for all of them, or [r, g, b].",
            "anyOf": [{ "type": "number" }, three_numbers()]
        })
    }
}

impl JsonSchema for Scale {
    fn schema_name() -> Cow<'static, str> {
        "Scale".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A factor of length: one number for all axes, or [x, y, z].",
            "anyOf": [{ "type": "number" }, three_numbers()]
        })
    }
}

impl JsonSchema for Paint {
    fn schema_name() -> Cow<'static, str> {
        "Paint".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A painted colour: \"#rrggbb\" in sRGB, or [r, g, b] in linear Rec. 709.",
            "anyOf": [{ "type": "string", "pattern": "^#([0-9A-Fa-f]{3}){1,2}$" }, three_numbers()]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, String> {
        serde_json::from_str(text).map_err(|error| error.to_string())
    }

    #[test]
    fn one_number_or_three_and_nothing_else() {
        assert_eq!(read("2"), Ok(Channels::Grey(2.0)));
        assert_eq!(read("[1, 2.5, -3]"), Ok(Channels::Rgb([1.0, 2.5, -3.0])));
        for bad in ["[1, 2]", "[1, 2, 3, 4]", "[]", "\"red\"", "{}", "null", "true", "[1, \"2\", 3]"] {
            assert!(read::<Channels>(bad).is_err(), "{bad}");
            assert!(read::<Scale>(bad).is_err(), "{bad}");
        }
        assert!(
            read::<Channels>("[1, 2, 3, 4]").unwrap_err().contains("invalid length 4, expected a number or")
        );
    }

    #[test]
    fn hex_is_srgb_and_numbers_are_linear() {
        assert_eq!(read("\"#Ff8000\""), Ok(Paint::Hex([255, 128, 0])));
        assert_eq!(read("\"#fA0\""), Ok(Paint::Hex([255, 170, 0])));
        let [r, g, b] = Paint::Hex([255, 128, 0]).rgb("color").unwrap();
        assert!((r, b) == (1.0, 0.0) && (g - 0.215_860_5).abs() < 1e-6, "{g}");
        assert_eq!(Paint::Linear([4.0, 0.5, 0.0]).rgb("color").unwrap(), [4.0, 0.5, 0.0]);
        for bad in [
            "\"ff8000\"",
            "\"#ff80\"",
            "\"#ff\"",
            "\"#+ff\"",
            "\"#ff80000\"",
            "\"#gg0000\"",
            "\"#ääa\"",
            "0.5",
            "[1, 2]",
            "null",
        ] {
            assert!(read::<Paint>(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn radiance_is_finite_and_not_negative_also_as_f32() {
        for bad in [-1.0, f64::NAN, f64::INFINITY, 1e39] {
            assert!(Channels::Grey(bad).rgb("ambient", f32::MAX).is_err(), "{bad}");
            assert!(Paint::Linear([0.0, bad, 0.0]).rgb("color").is_err(), "{bad}");
        }
        assert!(Channels::Grey(1.5).rgb("albedo", 1.0).is_err());
    }
}
