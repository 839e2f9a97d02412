//! How rays are walked: what the kernels of the traversals are compiled for.

use super::fixed_point::Accumulation;
use crate::scene::{Basis, Quadrature};

/// What a traversal is compiled into.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Consumer {
    Gather,
    Scatter(Accumulation),
    Squares(Accumulation),
}

/// How a ray is walked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Walk {
    pub(super) bilinear: bool,
    pub(super) march: bool,
    pub(super) colored: bool,
    /// Channels at once: 1 or 3.
    pub(super) channels: u32,
    /// Whether deposits near the entry are summed up inside a workgroup first.
    pub(super) near: bool,
}

impl Walk {
    /// All channels at once, every deposit for itself.
    pub(super) fn new(basis: Basis, quadrature: Quadrature, colored: bool) -> Self {
        let march = matches!(quadrature, Quadrature::March { .. });
        Self { bilinear: basis == Basis::Bilinear, march, colored, channels: 3, near: false }
    }
}

/// How a ray is walked through a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct VolumeWalk {
    pub(super) extinction: bool,
    /// Whether what is emitted is multiplied by light.
    pub(super) lit: bool,
    /// Whether the unknown has another grid than the medium.
    pub(super) nested: bool,
    pub(super) trilinear: bool,
    pub(super) colored: bool,
    /// Channels at once: 1 or 3.
    pub(super) channels: u32,
}

impl VolumeWalk {
    /// Every way that a volume can ask for.
    pub(super) fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for bits in 0..16 {
            let [lit, nested, trilinear, colored] = [0, 1, 2, 3].map(|bit| bits >> bit & 1 == 1);
            for channels in [1, 3] {
                let walk = Self { extinction: false, lit, nested, trilinear, colored, channels };
                all.push(walk);
                if !lit && !nested {
                    all.push(Self { extinction: true, ..walk });
                }
            }
        }
        all
    }
}
