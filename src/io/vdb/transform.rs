use std::io::{Read, Seek};

use glam::{DAffine3, DVec3};

use super::byte_reader::ByteReader;
use crate::Result;

/// The world from the index space. A linear map is stored as what it is made of; scales are followed by numbers that
/// follow from them.
///
/// Errors: [`Error::Format`](crate::Error::Format) for a map that is not linear.
pub(super) fn read<R: Read + Seek>(source: &mut ByteReader<R>) -> Result<DAffine3> {
    let kind = source.text()?;
    match kind.as_str() {
        "AffineMap" | "UnitaryMap" => affine(source),
        "ScaleMap" | "UniformScaleMap" => {
            let scale = vector(source)?;
            source.skip(OF_SCALE)?;
            Ok(DAffine3::from_scale(scale))
        }
        "ScaleTranslateMap" | "UniformScaleTranslateMap" => {
            let translation = vector(source)?;
            let scale = vector(source)?;
            source.skip(OF_SCALE)?;
            Ok(DAffine3 { translation, ..DAffine3::from_scale(scale) })
        }
        "TranslationMap" => Ok(DAffine3::from_translation(vector(source)?)),
        "NonlinearFrustumMap" => Err(source.broken(
            "its voxels lie in the frustum of a camera (NonlinearFrustumMap); resample it to a linear transform",
        )),
        _ => Err(source.broken(format!("its transform is of an unknown kind, `{kind}`"))),
    }
}

/// Voxel size, inverse, its square and its half.
const OF_SCALE: u64 = 4 * 24;

fn vector<R: Read + Seek>(source: &mut ByteReader<R>) -> Result<DVec3> {
    Ok(DVec3::from_array(source.f64s()?))
}

/// A 4 × 4 matrix for row vectors: each row is where an axis goes, the last one where the origin goes.
fn affine<R: Read + Seek>(source: &mut ByteReader<R>) -> Result<DAffine3> {
    let m: [f64; 16] = source.f64s()?;
    let [x, y, z, origin] = [0, 4, 8, 12].map(|row| DVec3::new(m[row], m[row + 1], m[row + 2]));
    let affine = [m[3], m[7], m[11], m[15] - 1.0].iter().all(|rest| rest.abs() < 1e-9);
    if !affine {
        return Err(source.broken("its transform has a perspective"));
    }
    Ok(DAffine3::from_cols(x, y, z, origin))
}

/// The stored form of `world_from_index`, which [`read`] undoes. It is scales where there is nothing else, because programs may ask for
/// them.
pub(super) fn bytes(world_from_index: &DAffine3) -> Vec<u8> {
    let m = world_from_index.matrix3;
    let origin = world_from_index.translation;
    let scale = DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z);
    if DAffine3::from_scale(scale).matrix3 != m {
        let row = |axis: DVec3, last| [axis.x, axis.y, axis.z, last];
        let rows = [row(m.x_axis, 0.0), row(m.y_axis, 0.0), row(m.z_axis, 0.0), row(origin, 1.0)];
        return named("AffineMap", rows.as_flattened());
    }
    let uniform = scale.x == scale.y && scale.y == scale.z;
    let inverse = scale.recip();
    let vectors =
        [origin, scale, scale.abs(), inverse, inverse * inverse, inverse / 2.0].map(|v| v.to_array());
    named(if uniform { "UniformScaleTranslateMap" } else { "ScaleTranslateMap" }, vectors.as_flattened())
}

fn named(kind: &str, numbers: &[f64]) -> Vec<u8> {
    let mut bytes = super::header::text(kind);
    bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    bytes
}
