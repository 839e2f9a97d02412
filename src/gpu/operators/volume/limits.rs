//! What the kernels cannot walk, refused before they are given it.

use crate::gpu::device::Gpu;
use crate::gpu::kernels::Accumulation;
use crate::gpu::kernels::layout::LIGHTS;
use crate::gpu::operators::rounds;
use crate::march::{Quantity, VolumeTraversal, VoxelElements};
use crate::scene::{Interpolation, Quadrature};
use crate::{Error, Result};

/// Optical depth after which the kernels have left a piece, or a ray, for certain.
const DARK: f64 = 64.0;
const REMEDY: &str = "choose the strategy `assembled`, which keeps the rows, or compute on the processor";

/// Errors: [`Error::Unsupported`] for what there is no kernel for, [`Error::TooLarge`] for rays whose loops would not end by themselves.
pub(super) fn check(gpu: &Gpu, traversal: &VolumeTraversal, accumulation: Accumulation) -> Result<()> {
    let shared = traversal.transport();
    let lights = traversal.parts().iter().map(lights).max().unwrap_or(0);
    let scatters = |part: &VoxelElements| matches!(part.quantity, Quantity::InScattered(_));
    let problem = if traversal.parts().iter().any(scatters) {
        "walks volumes in a light that is known, and it is looked for".to_owned()
    } else if shared.refraction.is_some() {
        "walks straight rays only, and these are bent".to_owned()
    } else if shared.quadrature != Quadrature::Exact {
        "takes the integrals of volumes exactly, and a march was asked for".to_owned()
    } else if lights > LIGHTS {
        format!("walks volumes in {LIGHTS} lights at most, and these are {lights}")
    } else if shared.basis != shared.density.interpolation() {
        "interpolates an unknown as it does the medium, and they differ".to_owned()
    } else if !shared.density.cells().passes_over_bricks() {
        "always passes over empty bricks, and was asked to enter them".to_owned()
    } else {
        let needed = |part: &VoxelElements| rounds_of_a_ray(traversal, part, accumulation);
        return rounds::check(
            gpu,
            || traversal.parts().iter().map(needed).max().unwrap_or(0),
            "lower the number of voxels, choose the strategy `assembled`, or compute on the processor",
        );
    };
    Err(Error::Unsupported { adapter: gpu.record().name.clone(), problem, remedy: REMEDY })
}

fn lights(part: &VoxelElements) -> usize {
    match &part.quantity {
        Quantity::Albedo(light) => light.fields().len(),
        _ => 0,
    }
}

/// Rounds of the loops of one ray at most.
fn rounds_of_a_ray(traversal: &VolumeTraversal, part: &VoxelElements, accumulation: Accumulation) -> usize {
    let shared = traversal.transport();
    let across = |size: [usize; 3]| size.iter().map(|side| side + 2).sum::<usize>();
    let is_extinction = matches!(part.quantity, Quantity::Extinction);
    let is_nested = !is_extinction && part.grid != *shared.density.grid();
    let walked = across(if is_extinction { part.grid.size() } else { shared.density.grid().size() });
    let inner = if is_nested { across(part.grid.size()) } else { 0 };
    let pieces = walked + inner;
    let trilinear = shared.basis == Interpolation::Trilinear;
    // A voxel is left once; sums by compare-and-swap wait for others.
    let leaves = if trilinear { 4 * pieces + 8 } else { pieces };
    let waits = if accumulation == Accumulation::Swap { 3 * 16 * leaves } else { 0 };
    let moves = if trilinear { 2 * pieces } else { 0 };
    let panels = if trilinear && !is_extinction { pieces + panels(traversal) } else { 0 };
    let nodes = if trilinear { 4 * panels } else { pieces };
    walked + 2 * inner + moves + panels + lights(part) * nodes + waits
}

/// Panels of half an optical depth along a ray at most, beyond one a piece: as many as it has in the densest channel until the clearest
/// one is dark.
fn panels(traversal: &VolumeTraversal) -> usize {
    let density = &traversal.transport().density;
    let volume = density.volume();
    let corners = density.grid().corners();
    let diagonal = (0..4).map(|k| corners[7 - k].distance(corners[k])).fold(0.0, f64::max);
    let whole = f64::from(volume.range()[1]) * diagonal;
    let ratio = (0..density.grid().len()).map(|index| {
        let [r, g, b] = volume.color(index).map(f64::from);
        let most = r.max(g).max(b);
        if most > 0.0 { most / r.min(g).min(b) } else { 1.0 }
    });
    let ratio = if density.is_grey() { 1.0 } else { ratio.fold(1.0, f64::max) };
    (2.0 * whole.min(2.0 * DARK * ratio)) as usize
}
