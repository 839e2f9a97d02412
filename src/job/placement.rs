//! Where a light map lies, in a file beside it.

use std::io::ErrorKind;
use std::path::Path;

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::problem::Maps;
use crate::scene::{Extent, LightFrame};
use crate::{Error, Result, io};

/// What such a file is called.
const FORMAT: &str = "light map placement";

/// How far apart axes of one and the same light may be: their numbers are written whole, and other programs may have rounded them to f32.
const SAME_AXIS: f64 = 1e-5;

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

    /// The extent that is written beside a light map of so many texels under a light; none where nothing is.
    ///
    /// Errors: [`Error::File`] when it is there and cannot be read, [`Error::Format`] when it says nothing usable, or is of a light map of
    /// another size or of a light from elsewhere.
    pub(super) fn beside(light_map: &Path, size: [usize; 2], frame: &LightFrame) -> Result<Option<Extent>> {
        let path = light_map.with_extension("placement.json");
        let text = match io::input::text(&path, LONGEST, FORMAT) {
            Err(Error::File { source, .. }) if source.kind() == ErrorKind::NotFound => return Ok(None),
            read => read?,
        };
        let unusable = |reason: String| Error::Format { path: path.clone(), format: FORMAT, reason };
        let placement: Self = serde_json::from_str(&text).map_err(|error| unusable(error.to_string()))?;
        let extent = Extent { min: DVec2::from_array(placement.min), max: DVec2::from_array(placement.max) };
        if !extent.has_area() {
            return Err(unusable("min must be below max".to_owned()));
        }
        if placement.size != size {
            let [[w, h], [width, height]] = [placement.size, size];
            let reason = format!("it is of {w} × {h} texels, and the light map has {width} × {height}");
            return Err(unusable(reason));
        }
        let axes = [placement.u, placement.v, placement.w].map(DVec3::from_array);
        let own = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| frame.world_from_light(axis));
        if !axes.iter().zip(own).all(|(axis, own)| axis.distance(own) < SAME_AXIS) {
            let reason = "its axes are those of a light from another direction than the scene's; \
                          solve for this light, or render the scene that the light map was found for";
            return Err(unusable(reason.to_owned()));
        }
        Ok(Some(extent))
    }
}
