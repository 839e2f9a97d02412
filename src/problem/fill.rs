//! Texels that no painted ray reaches, filled from their neighbours for hand-off.

use super::diffusion::{Known, diffuse};
use crate::Result;
use crate::scene::Rgb;
use crate::solve::Limits;

/// How far the diffusion is computed; beyond this nobody sees a difference.
const LIMITS: (usize, f64) = (2000, 1e-4);

/// The same texels of a light map, with those outside `reached` replaced by what diffuses into them from the reached ones.
///
/// Shapes  size: columns and rows; reached: increasing; texels: row by row
pub(super) fn fill(size: &[usize; 2], reached: &[u32], mut texels: Vec<Rgb>) -> Result<Vec<Rgb>> {
    let mut is_reached = vec![false; texels.len()];
    reached.iter().for_each(|&texel| is_reached[texel as usize] = true);
    let empty: Vec<u32> = (0..texels.len() as u32).filter(|&texel| !is_reached[texel as usize]).collect();
    let colors: Vec<Rgb> = reached.iter().map(|&texel| texels[texel as usize]).collect();
    let known = Known { places: reached, colors: &colors };
    let limits = Limits::new(LIMITS.0, LIMITS.1);
    let diffused = diffuse::<f32>(size, &known, &empty, &limits)?;
    empty.iter().zip(diffused.colors).for_each(|(&texel, color)| texels[texel as usize] = color);
    Ok(texels)
}
