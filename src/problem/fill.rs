//! Texels that no painted ray reaches, filled from their neighbours for hand-off.

use std::sync::Arc;

use super::LightMapProblem;
use crate::Result;
use crate::operator::{CpuVector, Gradient, Indexed, LinearOperator, Neighbours, Restricted, Vector};
use crate::scene::Rgb;
use crate::solve::{Beginning, Cgls, Control, LeastSquares, Limits, Method, drive};

/// How far the diffusion is computed; beyond this nobody sees a difference.
const LIMITS: (usize, f64) = (2000, 1e-4);

/// The same texels, with those outside `reached` replaced by the solution of the heat equation at rest around the reached
/// ones: the least sum of squared differences between neighbours.
pub(super) fn fill(problem: &LightMapProblem, reached: &[u32], texels: Vec<Rgb>) -> Result<Vec<Rgb>> {
    let size = problem.maps.light_map.size;
    let mut is_reached = vec![false; texels.len()];
    reached.iter().for_each(|&texel| is_reached[texel as usize] = true);
    let all: Vec<u32> = (0..texels.len() as u32).collect();
    let empty: Arc<[u32]> = all.iter().copied().filter(|&texel| !is_reached[texel as usize]).collect();
    if empty.is_empty() {
        return Ok(texels);
    }
    let begun = nearest_mean(&texels, &is_reached, size);
    let texels = CpuVector(texels);
    let gradient = Gradient::new(Arc::new(Neighbours::new(&size, &all)?), &texels)?;
    // min ‖G (E y + x)‖² over the empty texels y, x being zero there.
    let mut known = texels.clone();
    let mut rhs = gradient.range();
    empty.iter().for_each(|&texel| known.0[texel as usize] = [0.0; 3]);
    gradient.apply(&known, &mut rhs)?;
    rhs.scale([-1.0; 3]);
    let operator = Restricted::new(&gradient, empty.clone())?;
    let mut start = operator.domain();
    start.pick(&CpuVector(begun), &empty);
    let mut method = Cgls::new(&operator);
    let least_squares = LeastSquares::new(&operator, &rhs);
    let limits = Limits::new(LIMITS.0, LIMITS.1);
    drive(&mut method, &least_squares, Beginning::At(&start), &limits, |_, _| Ok(Control::Continue))?;
    let mut filled = known.0;
    empty.iter().zip(&method.solution().0).for_each(|(&texel, &value)| filled[texel as usize] = value);
    Ok(filled)
}

/// For every texel the mean of the reached ones in the smallest of ever larger blocks that has any: where the diffusion
/// begins, so that it need not travel far.
fn nearest_mean(texels: &[Rgb], is_reached: &[bool], size: [usize; 2]) -> Vec<Rgb> {
    let sums = texels.iter().zip(is_reached).map(
        |(&[r, g, b], &known)| {
            if known { [r, g, b, 1.0] } else { [0.0; 4] }
        },
    );
    let level = (size, sums.collect::<Vec<[f32; 4]>>());
    let mut levels = vec![level];
    while let Some(([width, height], sums)) = levels.last().filter(|(size, _)| *size != [1, 1]) {
        let half = [width.div_ceil(2), height.div_ceil(2)];
        let mut halved = vec![[0.0; 4]; half[0] * half[1]];
        for (index, sum) in sums.iter().enumerate() {
            let parent = &mut halved[(index / width / 2) * half[0] + index % width / 2];
            (0..4).for_each(|k| parent[k] += sum[k]);
        }
        levels.push((half, halved));
    }
    (0..texels.len())
        .map(|index| {
            let (mut i, mut j) = (index % size[0], index / size[0]);
            for (size, sums) in &levels {
                let [r, g, b, count] = sums[j * size[0] + i];
                if count > 0.0 {
                    return [r / count, g / count, b / count];
                }
                (i, j) = (i / 2, j / 2);
            }
            texels[index]
        })
        .collect()
}
