//! Numbers out of buffers: bounded, of any component type, normalized or not, sparse or not.
//!
//! The crate's own reader takes positions for f32 whatever their type is, and trusts lengths.

use gltf_json::Index;
use gltf_json::accessor::{Accessor, ComponentType};
use gltf_json::buffer::View;
use gltf_json::validation::Checked;

use super::file::GltfFile;
use crate::{Error, Result};

/// Accessors without a buffer view are zeros; no file can vouch for their number.
const MAX_ZEROS: usize = 1 << 24;

/// The elements of an accessor with `N` components each.
///
/// Integers are divided by their range where the accessor is normalized. Errors: [`Error::Format`] where anything
/// lies outside of its buffer, [`Error::TooLarge`].
pub(super) fn read<const N: usize>(file: &GltfFile, index: Index<Accessor>) -> Result<Vec<[f64; N]>> {
    let broken = |reason: &str| file.broken(format!("accessor {index} {reason}"));
    let accessor = file.get(index).ok_or_else(|| broken("is missing"))?;
    let (Checked::Valid(component), Checked::Valid(kind)) = (accessor.component_type, accessor.type_) else {
        return Err(broken("has an unknown type"));
    };
    if kind.multiplicity() != N {
        return Err(broken(&format!("has {} components where {N} are needed", kind.multiplicity())));
    }
    let count = usize::try_from(accessor.count.0).map_err(|_| broken("has too many elements"))?;
    let format = ComponentFormat { component: component.0, normalized: accessor.normalized };
    let mut elements = match accessor.buffer_view {
        Some(view) => {
            let offset = accessor.byte_offset.unwrap_or_default().0;
            elements(file, view, offset, count, format).map_err(|reason| broken(&reason))?
        }
        None if count > MAX_ZEROS => {
            return Err(Error::TooLarge {
                what: format!("accessor {index} of {}", file.path.display()),
                needed: format!("{count} zeros"),
                limit: MAX_ZEROS.to_string(),
                remedy: "export the mesh without empty accessors",
            });
        }
        None => vec![[0.0; N]; count],
    };
    if let Some(sparse) = &accessor.sparse {
        let count = usize::try_from(sparse.count.0).map_err(|_| broken("has too many elements"))?;
        let Checked::Valid(component) = sparse.indices.component_type else {
            return Err(broken("has an unknown type of indices"));
        };
        let at = &sparse.indices;
        let plain = ComponentFormat { component: component.0, normalized: false };
        let places: Vec<[f64; 1]> = self::elements(file, at.buffer_view, at.byte_offset.0, count, plain)
            .map_err(|reason| broken(&reason))?;
        let values = &sparse.values;
        let values = self::elements(file, values.buffer_view, values.byte_offset.0, count, format)
            .map_err(|reason| broken(&reason))?;
        for ([place], value) in places.into_iter().zip(values) {
            let element = elements.get_mut(place as usize);
            *element.ok_or_else(|| broken("has a sparse index that is out of range"))? = value;
        }
    }
    Ok(elements)
}

#[derive(Clone, Copy)]
struct ComponentFormat {
    component: ComponentType,
    normalized: bool,
}

/// Errors are reasons, to which the caller adds which accessor it is.
fn elements<const N: usize>(
    file: &GltfFile,
    view: Index<View>,
    offset: u64,
    count: usize,
    format: ComponentFormat,
) -> std::result::Result<Vec<[f64; N]>, String> {
    if count == 0 {
        return Ok(Vec::new());
    }
    let bytes = file.view(view).map_err(|error| error.to_string())?;
    let width = format.component.size();
    let stride = file.get(view).and_then(|view| view.byte_stride).map_or(0, |stride| stride.0);
    let stride = if stride == 0 { N * width } else { stride };
    if stride < N * width {
        return Err("has elements that overlap".into());
    }
    let start = usize::try_from(offset).ok();
    let length = stride.checked_mul(count - 1).and_then(|length| length.checked_add(N * width));
    let bytes = start.zip(length).and_then(|(start, length)| bytes.get(start..start.checked_add(length)?));
    let bytes = bytes.ok_or("lies outside of its buffer view")?;
    let element = |bytes: &[u8]| {
        let mut values = [0.0; N];
        for (value, bytes) in values.iter_mut().zip(bytes.chunks_exact(width)) {
            *value = number(bytes, format);
        }
        values
    };
    Ok(bytes.chunks(stride).map(element).collect())
}

/// From the bytes of one component; glTF 2.0, sec. 3.11 for what normalized means.
fn number(bytes: &[u8], format: ComponentFormat) -> f64 {
    let (value, largest) = match (format.component, bytes) {
        (ComponentType::I8, &[a]) => (f64::from(a as i8), f64::from(i8::MAX)),
        (ComponentType::U8, &[a]) => (f64::from(a), f64::from(u8::MAX)),
        (ComponentType::I16, &[a, b]) => (f64::from(i16::from_le_bytes([a, b])), f64::from(i16::MAX)),
        (ComponentType::U16, &[a, b]) => (f64::from(u16::from_le_bytes([a, b])), f64::from(u16::MAX)),
        (ComponentType::U32, &[a, b, c, d]) => {
            (f64::from(u32::from_le_bytes([a, b, c, d])), f64::from(u32::MAX))
        }
        (ComponentType::F32, &[a, b, c, d]) => (f64::from(f32::from_le_bytes([a, b, c, d])), 1.0),
        _ => (f64::NAN, 1.0),
    };
    let is_integer = !matches!(format.component, ComponentType::F32);
    if format.normalized && is_integer { (value / largest).max(-1.0) } else { value }
}
