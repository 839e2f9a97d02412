//! Where a surface is, by its alpha.

use std::sync::Arc;

use crate::scene::{AlphaMask, Wrap};

/// The alpha of a texture below which a surface is not there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cutoff(f32);

impl Cutoff {
    /// Of a picture that says no more than where a surface is.
    pub(super) const HALF: f32 = 0.5;

    /// The surface is there where the texture's alpha times `factor` is at least `cutoff`.
    pub(super) fn new(cutoff: f32, factor: f32) -> Self {
        Self(cutoff / factor)
    }

    /// Whether it leaves nothing, whatever the texture says.
    pub(super) fn leaves_nothing(self) -> bool {
        self.0 > 1.0
    }

    /// The alpha itself.
    pub(super) fn value(self) -> f32 {
        self.0
    }

    /// Tells cut-offs apart.
    pub(super) fn bits(self) -> u32 {
        self.0.to_bits()
    }

    /// Whether a surface with this alpha is there.
    pub(super) fn keeps(self, alpha: u8) -> bool {
        f32::from(alpha) >= self.0 * 255.0
    }

    /// The mask of a texture, row by row from the top left; none where all of the surface is there, as most
    /// textures have no hole.
    pub(super) fn mask(
        self,
        size: [usize; 2],
        alpha: impl Iterator<Item = u8> + Clone,
        wrap: [Wrap; 2],
    ) -> Option<Arc<AlphaMask>> {
        let has_holes = alpha.clone().any(|alpha| !self.keeps(alpha));
        has_holes.then(|| Arc::new(AlphaMask { size, alpha: alpha.collect(), cutoff: self.0, wrap }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_raises_what_the_texture_must_have() {
        let half = Cutoff::new(Cutoff::HALF, 1.0);
        assert!(half.keeps(128) && !half.keeps(127) && !half.leaves_nothing());
        let faint = Cutoff::new(Cutoff::HALF, 0.625);
        assert!(faint.keeps(204) && !faint.keeps(203) && !faint.leaves_nothing());
        assert!(Cutoff::new(Cutoff::HALF, 0.49).leaves_nothing());
        assert!(Cutoff::new(Cutoff::HALF, 0.0).leaves_nothing());
    }

    #[test]
    fn a_texture_without_holes_is_no_mask() {
        let mask = |alpha: &[u8]| Cutoff::new(0.5, 1.0).mask([2, 1], alpha.iter().copied(), [Wrap::Clamp; 2]);
        assert_eq!(mask(&[255, 128]), None);
        assert_eq!(mask(&[255, 127]).unwrap().alpha, [255, 127]);
    }
}
