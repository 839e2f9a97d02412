//! Numbers out of buffers: of any component type, normalized or not, sparse or not. Sizes are checked first,
//! and numbers are made one by one when they are asked for.
//!
//! The crate's own reader takes positions for f32 whatever their type is, and trusts lengths.

use gltf_json::Index;
use gltf_json::accessor::{Accessor, ComponentType};
use gltf_json::buffer::View;
use gltf_json::validation::Checked;

use super::file::GltfFile;
use crate::Result;

/// The elements of an accessor with `N` components each.
#[derive(Debug)]
pub(super) struct Elements<'a, const N: usize> {
    count: usize,
    /// None where all are zero.
    base: Option<Packed<'a>>,
    /// Which elements are others than those of the base, in increasing order, and what they are.
    replaced: Option<(Packed<'a>, Packed<'a>)>,
}

impl<'a, const N: usize> Elements<'a, N> {
    /// Errors: [`crate::Error::Format`] where anything lies outside of its buffer.
    pub(super) fn new(file: &'a GltfFile, index: Index<Accessor>) -> Result<Self> {
        let broken = |reason: &str| file.broken(format!("accessor {index} {reason}"));
        let accessor = file.get(index).ok_or_else(|| broken("is missing"))?;
        let (Checked::Valid(component), Checked::Valid(kind)) = (accessor.component_type, accessor.type_)
        else {
            return Err(broken("has an unknown type"));
        };
        if kind.multiplicity() != N {
            return Err(broken(&format!("has {} components where {N} are needed", kind.multiplicity())));
        }
        let number = |count: u64| usize::try_from(count).map_err(|_| broken("has too many elements"));
        let packed = |view, offset, count, layout| {
            Packed::new(file, view, offset, count, layout).map_err(|reason| broken(&reason))
        };
        let count = number(accessor.count.0)?;
        let layout = Layout { components: N, component: component.0, normalized: accessor.normalized };
        let base = match accessor.buffer_view {
            Some(view) => Some(packed(view, accessor.byte_offset.unwrap_or_default().0, count, layout)?),
            None => None,
        };
        let replaced = match &accessor.sparse {
            Some(sparse) if sparse.count.0 > 0 => {
                let Checked::Valid(component) = sparse.indices.component_type else {
                    return Err(broken("has an unknown type of indices"));
                };
                let (places, values) = (&sparse.indices, &sparse.values);
                let replaced = number(sparse.count.0)?;
                let plain = Layout { components: 1, component: component.0, normalized: false };
                let places = packed(places.buffer_view, places.byte_offset.0, replaced, plain)?;
                let increase = (1..replaced).all(|i| places.place(i - 1) < places.place(i));
                if !increase || places.place(replaced - 1) >= count {
                    return Err(broken("has sparse indices that do not increase or are out of range"));
                }
                Some((places, packed(values.buffer_view, values.byte_offset.0, replaced, layout)?))
            }
            _ => None,
        };
        Ok(Self { count, base, replaced })
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Whether the file has no numbers for it, which makes all of them zero.
    pub(super) fn is_empty_of_data(&self) -> bool {
        self.base.is_none() && self.replaced.is_none()
    }

    /// Integers are divided by their range where the accessor is normalized. Expects one of its elements.
    pub(super) fn at(&self, index: usize) -> [f64; N] {
        if let Some((places, values)) = &self.replaced
            && let Some(found) = places.find(index)
        {
            return values.element(found);
        }
        self.base.as_ref().map_or([0.0; N], |base| base.element(index))
    }
}

/// How an element lies in its bytes.
#[derive(Debug, Clone, Copy)]
struct Layout {
    components: usize,
    component: ComponentType,
    normalized: bool,
}

/// Elements at equal distances in a buffer view.
#[derive(Debug, Clone, Copy)]
struct Packed<'a> {
    bytes: &'a [u8],
    count: usize,
    stride: usize,
    layout: Layout,
}

impl<'a> Packed<'a> {
    /// Errors are reasons, to which the caller adds which accessor it is.
    fn new(
        file: &'a GltfFile,
        view: Index<View>,
        offset: u64,
        count: usize,
        layout: Layout,
    ) -> std::result::Result<Self, String> {
        let size = layout.components * layout.component.size();
        let stride = file.get(view).and_then(|view| view.byte_stride).map_or(0, |stride| stride.0);
        let stride = if stride == 0 { size } else { stride };
        if stride < size {
            return Err("has elements that overlap".into());
        }
        let bytes = file.view(view).map_err(|error| error.to_string())?;
        let Some(last) = count.checked_sub(1) else { return Ok(Self { bytes: &[], count, stride, layout }) };
        let start = usize::try_from(offset).ok();
        let length = stride.checked_mul(last).and_then(|length| length.checked_add(size));
        let bytes =
            start.zip(length).and_then(|(start, length)| bytes.get(start..start.checked_add(length)?));
        let bytes = bytes.ok_or("lies outside of its buffer view")?;
        Ok(Self { bytes, count, stride, layout })
    }

    fn element<const N: usize>(&self, index: usize) -> [f64; N] {
        let bytes = &self.bytes[index * self.stride..];
        let mut values = [0.0; N];
        for (value, bytes) in values.iter_mut().zip(bytes.chunks_exact(self.layout.component.size())) {
            *value = number(bytes, self.layout);
        }
        values
    }

    /// The element as the number of another one.
    fn place(&self, index: usize) -> usize {
        let [place] = self.element(index);
        place as usize
    }

    /// Which of these increasing numbers is `place`.
    fn find(&self, place: usize) -> Option<usize> {
        let mut range = 0..self.count;
        while !range.is_empty() {
            let middle = range.start + range.len() / 2;
            match self.place(middle).cmp(&place) {
                std::cmp::Ordering::Less => range.start = middle + 1,
                std::cmp::Ordering::Equal => return Some(middle),
                std::cmp::Ordering::Greater => range.end = middle,
            }
        }
        None
    }
}

/// From the bytes of one component; glTF 2.0, sec. 3.11 for what normalized means.
fn number(bytes: &[u8], layout: Layout) -> f64 {
    let (value, largest) = match (layout.component, bytes) {
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
    let is_integer = !matches!(layout.component, ComponentType::F32);
    if layout.normalized && is_integer { (value / largest).max(-1.0) } else { value }
}
