//! One quantity of a volume on the device.

use std::sync::Arc;

use super::bricks::{Pool, append_records, slots};
use super::light::{factors, largest, light};
use super::track::Cells;
use crate::Result;
use crate::gpu::device::{Allocation, Gpu};
use crate::gpu::kernels::layout::{LightUniform, Track, VolumeUniform};
use crate::gpu::kernels::{VolumeWalk, Walk};
use crate::gpu::operators::rays::Rays;
use crate::gpu::operators::walked::WalkedPart;
use crate::march::{InScattering, Quantity, VolumeTraversal, VoxelElements};
use crate::operator::RowOrder;
use crate::scene::Interpolation;

/// What all parts of a volume share: the extinction, and where its bricks are.
#[derive(Debug)]
pub(super) struct MediumBricks {
    slots: Vec<u32>,
    sigma: Arc<Allocation>,
}

impl MediumBricks {
    /// Errors: [`crate::Error::TooLarge`], [`crate::Error::AdapterMemory`].
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

/// One quantity: its rows, its elements from `first` on, and what it is walked through.
///
/// Errors: [`crate::Error::TooLarge`], [`crate::Error::AdapterMemory`].
pub(super) fn walked_part(
    gpu: &Gpu,
    (traversal, order): (&VolumeTraversal, &RowOrder),
    medium: &MediumBricks,
    part: &VoxelElements,
    first: usize,
    colored: bool,
) -> Result<WalkedPart> {
    let shared = traversal.transport();
    let walk = VolumeWalk {
        extinction: matches!(part.quantity, Quantity::Extinction),
        lit: matches!(part.quantity, Quantity::Albedo(_)),
        nested: !matches!(part.quantity, Quantity::Extinction) && part.grid != *shared.density.grid(),
        trilinear: shared.basis == Interpolation::Trilinear,
        colored,
        channels: 3,
    };
    let walked = Cells::new(if walk.extinction { &part.grid } else { shared.density.grid() }, shared.basis);
    let (bricks, lights, volume) = tables(traversal, medium, part, &walked);
    let rays = rays(gpu, (traversal, order), part, &walked, walk.nested)?;
    let passed = vec![
        Arc::new(upload(gpu, "the bricks of a volume", &bricks)?),
        medium.sigma.clone(),
        Arc::new(upload(gpu, "the light in a volume", &lights)?),
        Arc::new(gpu.upload("the volume", &[volume])?),
    ];
    Ok(WalkedPart::new(Walk::Volume(walk), first..first + part.voxels().len(), passed, rays))
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
    medium: &MediumBricks,
    part: &VoxelElements,
    walked: &Cells,
) -> (Vec<u32>, Vec<f32>, VolumeUniform) {
    let shared = traversal.transport();
    let mut words = match part.quantity {
        Quantity::Extinction => slots(part.cells()),
        _ => medium.slots.clone(),
    };
    let elements = words.len() as u32;
    append_records(part.voxels(), &mut words);
    let (mut lit, mut values) = ([LightUniform::default(); _], Vec::new());
    let fields = light_of(part).map_or(&[][..], InScattering::fields);
    for (lit, field) in lit.iter_mut().zip(fields) {
        let (found, pool) = light(field, &shared.density, words.len(), values.len());
        *lit = found;
        words.extend(pool.slots);
        values.extend(pool.values);
    }
    let m = walked.world_from_cells();
    let volume = VolumeUniform {
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

/// The tracks of all rows: one through the cells that are walked, and with `nested` one through those of the unknown.
fn rays(
    gpu: &Gpu,
    (traversal, order): (&VolumeTraversal, &RowOrder),
    part: &VoxelElements,
    walked: &Cells,
    nested: bool,
) -> Result<Rays> {
    let rays = traversal.rays();
    let inner = Cells::new(&part.grid, traversal.transport().basis);
    let light = light_of(part);
    let radiance = light.map(largest).unwrap_or_default();
    let track = |position: usize| {
        let row = order.row(position);
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
    match nested {
        true => Rays::new(gpu, rays.len(), track),
        false => Rays::new(gpu, rays.len(), |position| {
            let ([first, _], sum) = track(position);
            ([first], sum)
        }),
    }
}

/// What a kernel must see as a whole.
///
/// Errors: [`crate::Error::TooLarge`], [`crate::Error::AdapterMemory`].
fn upload<T: bytemuck::Pod>(gpu: &Gpu, what: &str, values: &[T]) -> Result<Allocation> {
    gpu.expect_visible(
        format!("{what} on the adapter"),
        size_of_val(values) as u64,
        "lower the number of voxels, choose the strategy `assembled`, or compute on the processor",
    )?;
    gpu.upload(what, values)
}
