//! One quantity of a volume on the device.

use std::sync::Arc;

use rayon::prelude::*;

use super::bricks::{Pool, append_records, slots};
use super::light::{factors, largest, light};
use super::track::Cells;
use crate::gpu::Gpu;
use crate::gpu::layout::{Light, Track, Volume};
use crate::gpu::memory::Allocation;
use crate::gpu::pace::Paces;
use crate::gpu::walk::VolumeWalk;
use crate::march::{InScattering, Quantity, VolumeTraversal, VoxelElements};
use crate::scene::Interpolation;
use crate::{Error, Result};

/// What all parts of a volume share: the extinction, and where its bricks are.
#[derive(Debug)]
pub(super) struct Medium {
    slots: Vec<u32>,
    sigma: Arc<Allocation>,
}

impl Medium {
    /// Errors: [`Error::TooLarge`], [`Error::AdapterMemory`].
    pub(super) fn new(gpu: &Gpu, traversal: &VolumeTraversal) -> Result<Self> {
        let density = &traversal.transport().density;
        // Only lengths are asked for where every part is extinction.
        let is_used = traversal.parts().iter().any(|part| !matches!(part.quantity, Quantity::Extinction));
        let some = slots(density.cells());
        let keeps = |brick: usize| is_used && some[brick] == 0;
        let Pool { slots, values } = Pool::new(density.volume(), density.interpolation(), keeps);
        Ok(Self { slots, sigma: Arc::new(upload(gpu, "the medium", &values)?) })
    }
}

/// One quantity: its rows, its elements and what it is walked through.
#[derive(Debug)]
pub(super) struct WalkedPart {
    pub(super) walk: VolumeWalk,
    /// The number of its first element in vectors over all parts, and how many it has.
    pub(super) first: usize,
    pub(super) len: usize,
    /// Memory of the second group of bindings.
    pub(super) bricks: Allocation,
    pub(super) sigma: Arc<Allocation>,
    pub(super) lights: Allocation,
    pub(super) volume: Allocation,
    /// Tracks, slab by slab of the rows: the first row, and how many.
    pub(super) slabs: Vec<(usize, usize)>,
    pub(super) tracks: Vec<Allocation>,
    /// Σ_k Σ_i w_ki at most, and the same of the squared row sums.
    pub(super) row_sums: [f64; 2],
    pub(super) paces: Paces,
}

impl WalkedPart {
    /// Errors: [`Error::TooLarge`], [`Error::AdapterMemory`].
    pub(super) fn new(
        gpu: &Gpu,
        traversal: &VolumeTraversal,
        medium: &Medium,
        part: &VoxelElements,
        first: usize,
        colored: bool,
    ) -> Result<Self> {
        let shared = traversal.transport();
        let walk = VolumeWalk {
            extinction: matches!(part.quantity, Quantity::Extinction),
            lit: matches!(part.quantity, Quantity::Albedo(_)),
            nested: !matches!(part.quantity, Quantity::Extinction) && part.grid != *shared.density.grid(),
            trilinear: shared.basis == Interpolation::Trilinear,
            colored,
            channels: 3,
        };
        let walked =
            Cells::new(if walk.extinction { &part.grid } else { shared.density.grid() }, shared.basis);
        let (bricks, lights, volume) = tables(traversal, medium, part, &walked);
        let (slabs, tracks, row_sums) = tracks(gpu, traversal, part, &walked, walk.nested)?;
        Ok(Self {
            walk,
            first,
            len: part.voxels().len(),
            bricks: upload(gpu, "the bricks of a volume", &bricks)?,
            sigma: medium.sigma.clone(),
            lights: upload(gpu, "the light in a volume", &lights)?,
            volume: gpu.upload("the volume", &[volume])?,
            slabs,
            tracks,
            row_sums,
            paces: Paces::default(),
        })
    }

    /// Bytes of a row's tracks.
    pub(super) fn row_bytes(&self) -> usize {
        row_bytes(self.walk.nested)
    }
}

fn row_bytes(nested: bool) -> usize {
    size_of::<Track>() * if nested { 2 } else { 1 }
}

fn light_of(part: &VoxelElements) -> Option<&InScattering> {
    match &part.quantity {
        Quantity::Albedo(light) => Some(light),
        _ => None,
    }
}

/// Slots and records of bricks, values of the lights, and what says where they are.
fn tables(
    traversal: &VolumeTraversal,
    medium: &Medium,
    part: &VoxelElements,
    walked: &Cells,
) -> (Vec<u32>, Vec<f32>, Volume) {
    let shared = traversal.transport();
    let mut words = match part.quantity {
        Quantity::Extinction => slots(part.cells()),
        _ => medium.slots.clone(),
    };
    let elements = words.len() as u32;
    append_records(part.voxels(), &mut words);
    let (mut lit, mut values) = ([Light::default(); _], Vec::new());
    let fields = light_of(part).map_or(&[][..], InScattering::fields);
    for (lit, field) in lit.iter_mut().zip(fields) {
        let (found, pool) = light(field, &shared.density, words.len(), values.len());
        *lit = found;
        words.extend(pool.slots);
        values.extend(pool.values);
    }
    let m = walked.world_from_cells();
    let volume = Volume {
        metres: [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.as_vec3().extend(0.0).to_array()),
        cells: walked.size.map(|side| side as u32),
        slots: 0,
        size: part.grid.size().map(|side| side as u32),
        elements,
        transmittance_bound: shared.transmittance_bound as f32,
        channels: shared.density.volume().channels() as u32,
        lights: fields.len() as u32,
        pad: 0,
        light: lit,
    };
    (words, values, volume)
}

type Tracks = (Vec<(usize, usize)>, Vec<Allocation>, [f64; 2]);

/// The tracks of all rows, slab by slab, and bounds of what they sum up to.
fn tracks(
    gpu: &Gpu,
    traversal: &VolumeTraversal,
    part: &VoxelElements,
    walked: &Cells,
    nested: bool,
) -> Result<Tracks> {
    let rays = traversal.rays();
    let inner = Cells::new(&part.grid, traversal.transport().basis);
    let light = light_of(part);
    let radiance = light.map(largest).unwrap_or_default();
    let track = |row: usize| {
        let ray = rays.ray(row);
        let Some(stretch) = walked.stretch(&ray, rays.length(row)) else {
            return ([Track::default(); 2], 0.0);
        };
        let factors = light.map_or([0.0; _], |light| factors(light, &ray));
        let mut first = walked.track(&ray, stretch);
        for (word, factor) in [&mut first.first, &mut first.step_high, &mut first.step_low, &mut first.entry]
            .into_iter()
            .zip(factors)
        {
            word[3] = factor.to_bits();
        }
        let second = if nested { inner.track(&ray, stretch) } else { Track::default() };
        let sum = match part.quantity {
            Quantity::Emission | Quantity::InScattered(_) => 1.0,
            Quantity::Albedo(_) => factors.iter().zip(&radiance).map(|(f, l)| f64::from(*f) * l).sum(),
            Quantity::Extinction => stretch.metres(),
        };
        ([first, second], sum)
    };
    let at_once = gpu.rays_at_once(row_bytes(nested));
    let (mut slabs, mut memory, mut sums) = (Vec::new(), Vec::new(), [0.0; 2]);
    for first in (0..rays.len()).step_by(at_once) {
        let count = at_once.min(rays.len() - first);
        let rows: Vec<([Track; 2], f64)> = (first..first + count).into_par_iter().map(track).collect();
        for (_, sum) in &rows {
            sums = [sums[0] + sum, sums[1] + sum * sum];
        }
        let kept = if nested { 2 } else { 1 };
        let words: Vec<Track> = rows.iter().flat_map(|(tracks, _)| &tracks[..kept]).copied().collect();
        slabs.push((first, count));
        memory.push(gpu.upload("the rays", &words)?);
    }
    Ok((slabs, memory, sums))
}

/// What a kernel must see as a whole.
///
/// Errors: [`Error::TooLarge`], [`Error::AdapterMemory`].
fn upload<T: bytemuck::Pod>(gpu: &Gpu, what: &str, values: &[T]) -> Result<Allocation> {
    let bytes = size_of_val(values) as u64;
    if bytes > gpu.binding_limit() {
        return Err(Error::TooLarge {
            what: format!("{what} on the adapter"),
            needed: format!("{bytes} bytes"),
            limit: format!("{} bytes", gpu.binding_limit()),
            remedy: "lower the number of voxels, choose the strategy `assembled`, or compute on the processor",
        });
    }
    gpu.upload(what, values)
}
