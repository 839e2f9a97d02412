/// What is left out because no result depends on it. All of it, unless somebody wants to see what that is worth.
///
/// Rows that are kept and the far ends of rays have settings of their own: [`Strategy`](super::Strategy) and
/// [`transmittance_bound`](super::SolveSettings::transmittance_bound).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Skipping {
    /// Rays through pixels of which nothing is wanted; else they are rows without weight.
    pub pixels: bool,
    /// Unknowns that no row reaches; else methods carry them along.
    pub unknowns: bool,
    /// Texels of a shadow map, where a node of its pyramid is lit or shadowed as a whole.
    pub shadows: bool,
    /// Bricks of voxels that hold nothing.
    pub bricks: bool,
    /// Iterations of channels that have converged.
    pub channels: bool,
}

impl Default for Skipping {
    fn default() -> Self {
        Self { pixels: true, unknowns: true, shadows: true, bricks: true, channels: true }
    }
}
