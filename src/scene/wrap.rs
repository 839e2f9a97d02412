/// How texture coordinates beyond [0, 1] are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// Repeat the texture.
    #[default]
    Repeat,
    /// Repeat it, mirrored every other time.
    Mirror,
    /// Use its edge.
    Clamp,
}

/// The two pixels around a texture coordinate, and how far it is from the first towards the second.
pub(super) fn neighbours(coordinate: f64, size: usize, wrap: Wrap) -> ([usize; 2], f64) {
    // A whole number of periods is taken off first, so that no coordinate is too large for an integer.
    let period = match wrap {
        Wrap::Repeat => 1.0,
        Wrap::Mirror => 2.0,
        Wrap::Clamp => f64::INFINITY,
    };
    let within = if period.is_finite() { coordinate.rem_euclid(period) } else { coordinate.clamp(-1.0, 2.0) };
    let at = within * size as f64 - 0.5;
    let first = at.floor();
    let fraction = if at.is_finite() { at - first } else { 0.0 };
    let first = first as i64;
    ([first, first.saturating_add(1)].map(|pixel| wrapped(pixel, size as i64, wrap) as usize), fraction)
}

fn wrapped(pixel: i64, size: i64, wrap: Wrap) -> i64 {
    match wrap {
        Wrap::Repeat => pixel.rem_euclid(size.max(1)),
        Wrap::Mirror => {
            let pixel = pixel.rem_euclid(size.max(1).saturating_mul(2));
            if pixel < size { pixel } else { 2 * size - 1 - pixel }
        }
        Wrap::Clamp => pixel.clamp(0, (size - 1).max(0)),
    }
}
