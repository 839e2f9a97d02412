//! Where a light map lies, in a file beside it.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::problem::Maps;
use crate::scene::Extent;
use crate::{Error, Result, io};

/// Bytes of a placement at most.
const LONGEST: u64 = 1 << 16;

/// Where a light map lies in the world; written beside it, for other programs and for `render`.
///
/// The point (i, j) of the picture, in texels from its top left corner, is lit along `w` through
/// `u · (min[0] + i · width) + v · (min[1] + j · height)` with texels of `(max − min) / size` metres.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Placement {
    size: [usize; 2],
    min: [f64; 2],
    max: [f64; 2],
    u: [f64; 3],
    v: [f64; 3],
    w: [f64; 3],
}

impl Placement {
    pub(super) fn of(maps: &Maps) -> Self {
        let axis = |axis: DVec3| maps.frame.world_from_light(axis).to_array();
        let extent = maps.light_map.extent;
        Self {
            size: maps.light_map.size,
            min: extent.min.to_array(),
            max: extent.max.to_array(),
            u: axis(DVec3::X),
            v: axis(DVec3::Y),
            w: axis(DVec3::Z),
        }
    }

    pub(super) fn to_json(&self) -> Result<String> {
        io::to_json(self)
    }

    /// The extent that is written beside a light map; none where nothing is.
    ///
    /// Errors: [`Error::File`] when it is there and cannot be read, [`Error::Format`] when it says nothing usable.
    pub(super) fn beside(light_map: &Path) -> Result<Option<Extent>> {
        let path = light_map.with_extension("placement.json");
        let mut text = String::new();
        let read = File::open(&path).and_then(|file| file.take(LONGEST).read_to_string(&mut text));
        match read {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(source) => return Err(Error::File { action: "read", path, source }),
            Ok(_) => {}
        }
        let unusable =
            |reason: String| Error::Format { path: path.clone(), format: "light map placement", reason };
        let placement: Self = serde_json::from_str(&text).map_err(|error| unusable(error.to_string()))?;
        let extent = Extent { min: DVec2::from_array(placement.min), max: DVec2::from_array(placement.max) };
        if !extent.has_area() {
            return Err(unusable("min must be below max".to_owned()));
        }
        Ok(Some(extent))
    }
}
