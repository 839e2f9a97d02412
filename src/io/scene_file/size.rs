//! Amounts of memory as a person writes them.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Visitor;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::{Error, Result};

const EXPECTED: &str = "a number of bytes such as 1000000, \"512 MB\" or \"4GiB\"";

/// Units by their name in lower case. As with GNU tools, a single letter is a power of 1024.
const UNITS: [(&str, u64); 14] = [
    ("", 1),
    ("b", 1),
    ("k", 1 << 10),
    ("kb", 1000),
    ("kib", 1 << 10),
    ("m", 1 << 20),
    ("mb", 1_000_000),
    ("mib", 1 << 20),
    ("g", 1 << 30),
    ("gb", 1_000_000_000),
    ("gib", 1 << 30),
    ("t", 1 << 40),
    ("tb", 1_000_000_000_000),
    ("tib", 1 << 40),
];

/// Bytes in `4GiB`, `512 MB`, `1.5g` or `1000000`; case and spaces around the unit do not matter.
///
/// Errors: [`Error::Value`] for anything else, for zero and for more than 2⁶⁴ − 1.
pub fn parse_size(text: &str) -> Result<u64> {
    let bytes = |text: &str| {
        let text = text.trim();
        let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
        let (number, unit) = text.split_at(digits);
        let unit = unit.trim_start().to_ascii_lowercase();
        let (_, factor) = UNITS.iter().find(|(name, _)| *name == unit)?;
        match number.parse::<u64>() {
            Ok(whole) => whole.checked_mul(*factor),
            Err(_) => {
                let product = number.parse::<f64>().ok()? * *factor as f64;
                // 2⁶⁴ itself rounds to u64::MAX when cast, so it is refused as a float.
                (product < u64::MAX as f64).then_some(product as u64)
            }
        }
    };
    bytes(text).filter(|&bytes| bytes > 0).ok_or_else(|| {
        let short: String = text.chars().take(40).collect();
        Error::value("size", format!("`{}`", short.escape_debug()), EXPECTED)
    })
}

/// An amount of memory in bytes, written as in `"4GiB"` or as a plain number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemorySize(pub u64);

impl fmt::Display for MemorySize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let units = [("TiB", 1u64 << 40), ("GiB", 1 << 30), ("MiB", 1 << 20), ("KiB", 1 << 10)];
        match units.iter().find(|(_, factor)| self.0 > 0 && self.0.is_multiple_of(*factor)) {
            Some((unit, factor)) => write!(f, "{}{unit}", self.0 / factor),
            None => write!(f, "{}", self.0),
        }
    }
}

impl Serialize for MemorySize {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for MemorySize {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(SizeVisitor)
    }
}

struct SizeVisitor;

impl Visitor<'_> for SizeVisitor {
    type Value = MemorySize;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(EXPECTED)
    }

    fn visit_u64<E: serde::de::Error>(self, bytes: u64) -> Result<MemorySize, E> {
        if bytes == 0 {
            return Err(E::invalid_value(serde::de::Unexpected::Unsigned(0), &self));
        }
        Ok(MemorySize(bytes))
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<MemorySize, E> {
        let invalid = |_| E::invalid_value(serde::de::Unexpected::Str(text), &self);
        parse_size(text).map(MemorySize).map_err(invalid)
    }
}

impl JsonSchema for MemorySize {
    fn schema_name() -> Cow<'static, str> {
        "MemorySize".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "An amount of memory: a number of bytes, or text such as \"4GiB\" or \"512 MB\".",
            "anyOf": [
                { "type": "integer", "minimum": 1 },
                { "type": "string", "pattern": "^\\s*[0-9]*\\.?[0-9]+\\s*([kKmMgGtT]?[iI]?[bB]?)\\s*$" }
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_with_their_units() {
        let table = [
            ("1000000", 1_000_000),
            ("4GiB", 4 << 30),
            ("512 MB", 512_000_000),
            (" 1.5g ", 3 << 29),
            ("2k", 2048),
            ("1 b", 1),
            ("18446744073709551615", u64::MAX),
        ];
        for (text, bytes) in table {
            assert_eq!(parse_size(text).unwrap(), bytes, "{text}");
        }
    }

    #[test]
    fn what_is_not_a_size_is_refused() {
        for text in [
            "",
            "0",
            "GiB",
            "-1",
            "4 cats",
            "1e9",
            "nan",
            "1.2.3",
            ".",
            "99999999999TiB",
            "99999999.9TiB",
            "4iB",
        ] {
            assert!(parse_size(text).is_err(), "{text}");
        }
    }

    #[test]
    fn sizes_are_written_as_they_are_read() {
        for bytes in [1, 1000, 1024, 4 << 30, (4 << 30) + 1, 1 << 63, u64::MAX] {
            assert_eq!(parse_size(&MemorySize(bytes).to_string()).unwrap(), bytes);
        }
    }
}
