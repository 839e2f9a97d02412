//! Texels that nothing is known of, filled from their neighbours for hand-off.

use std::sync::Arc;

use super::cells::{Cells, numbered};
use super::diffusion::{Known, at_rest, nearest_mean};
use crate::Result;
use crate::operator::{CpuVector, Gradient, LinearOperator, Neighbours, Weighted};
use crate::scene::Rgb;
use crate::solve::Limits;

/// How far the diffusion is computed; beyond this nobody sees a difference.
const LIMITS: (usize, f64) = (2000, 1e-3);

/// The same texels of a light map, with those outside `known` replaced by what diffuses into them from the known ones: the heat equation at
/// rest, on [`Cells`] that are the larger the farther they lie from what is known.
///
/// Shapes  size: columns and rows; known: increasing; texels: row by row
/// Law     no channel leaves the range that the known texels span
pub(super) fn fill(size: [usize; 2], known: &[u32], mut texels: Vec<Rgb>) -> Result<Vec<Rgb>> {
    if known.is_empty() || known.len() == texels.len() {
        return Ok(texels);
    }
    let mut is_known = vec![false; texels.len()];
    known.iter().for_each(|&texel| is_known[texel as usize] = true);
    let everywhere: Vec<u32> = (0..texels.len() as u32).collect();
    let cells = Cells::new(size, is_known.into(), &everywhere);
    let empty: Vec<u32> = cells.each().map(|(texel, _)| texel).collect();
    let colors: Vec<Rgb> = known.iter().map(|&texel| texels[texel as usize]).collect();
    let start = nearest_mean(&size, &Known { places: known, colors: &colors }, &empty);

    let mut columns = [known, &empty].concat();
    columns.sort_unstable();
    let pairs = cells.pairs();
    let roots = CpuVector(cells.weights(&pairs).map(|weight| [weight.sqrt(); 3]).collect());
    let numbers = pairs.map(|pairs| numbered(&pairs, &columns, texels.len()));
    let mut values = CpuVector::<f32>(columns.iter().map(|&texel| texels[texel as usize]).collect());
    let unknown: Arc<[u32]> =
        (0..).zip(&columns).filter(|(_, texel)| empty.binary_search(texel).is_ok()).map(|(k, _)| k).collect();
    unknown.iter().for_each(|&k| values.0[k as usize] = [0.0; 3]);
    let gradient = Gradient::new(Arc::new(Neighbours::of_pairs(columns.len(), &numbers)), &values)?;
    debug_assert_eq!(gradient.range().0.len(), roots.0.len());
    let gradient = Weighted::new(gradient, roots)?;
    let limits = Limits::new(LIMITS.0, LIMITS.1);
    let (found, _) = at_rest(&gradient, &values, unknown, &CpuVector(start), &limits)?;

    empty.iter().zip(found.0).for_each(|(&texel, color)| texels[texel as usize] = color);
    cells.spread(&mut texels, [0.0; 3], 0.0);
    let least = |of: fn(f32, f32) -> f32, from: f32| -> Rgb {
        colors.iter().fold([from; 3], |so_far, color| std::array::from_fn(|c| of(so_far[c], color[c])))
    };
    let (low, high) = (least(f32::min, f32::INFINITY), least(f32::max, f32::NEG_INFINITY));
    texels.iter_mut().for_each(|texel| *texel = std::array::from_fn(|c| texel[c].clamp(low[c], high[c])));
    Ok(texels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::diffusion::diffuse;

    const SIZE: [usize; 2] = [90, 64];

    #[test]
    fn it_is_near_the_heat_equation_at_rest_and_stays_between_what_is_known() {
        let is_known = |k: usize| {
            let (x, y) = ((k % SIZE[0]) as f64, (k / SIZE[0]) as f64);
            (x - 20.0).hypot(y - 20.0) < 6.0 || (60.0..63.0).contains(&x) && y > 30.0
        };
        let colored = |k: usize| if k % SIZE[0] < 40 { [0.1, 0.8, 0.3] } else { [0.9, 0.2, 0.3] };
        let all = 0..SIZE[0] * SIZE[1];
        let known: Vec<u32> = all.clone().filter(|&k| is_known(k)).map(|k| k as u32).collect();
        let empty: Vec<u32> = all.clone().filter(|&k| !is_known(k)).map(|k| k as u32).collect();
        let texels: Vec<Rgb> = all.map(|k| if is_known(k) { colored(k) } else { [7.0; 3] }).collect();
        let filled = fill(SIZE, &known, texels.clone()).unwrap();
        let colors: Vec<Rgb> = known.iter().map(|&k| texels[k as usize]).collect();
        let places = Known { places: &known, colors: &colors };
        let exact = diffuse::<f64>(&SIZE, &places, &empty, &Limits::new(5000, 1e-9)).unwrap();
        let off = empty.iter().zip(&exact.colors).flat_map(|(&k, color)| {
            let filled = filled[k as usize];
            (0..3).map(move |c| (filled[c] - color[c]).abs())
        });
        let worst = off.fold(0.0, f32::max);
        assert!(worst < 0.03, "{worst}");
        assert!(known.iter().all(|&k| filled[k as usize] == texels[k as usize]), "what is known stays");
        assert!(filled.iter().all(|texel| (0.1..=0.9).contains(&texel[0]) && (texel[2] - 0.3).abs() < 1e-6));
    }
}
