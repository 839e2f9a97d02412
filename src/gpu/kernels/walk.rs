//! How rays are walked: what the kernels of the traversals are compiled for.

use crate::scene::{Basis, Quadrature};

/// How rays are walked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(in crate::gpu) enum Walk {
    LightMap(LightMapWalk),
    Volume(VolumeWalk),
}

/// How a ray is walked over a light map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(in crate::gpu) struct LightMapWalk {
    pub(super) bilinear: bool,
    pub(super) march: bool,
    pub(super) colored: bool,
    /// Channels at once: 1 or 3.
    pub(super) channels: u32,
    /// Whether deposits near the entry are summed up inside a workgroup first.
    pub(super) near: bool,
}

/// How a ray is walked through a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(in crate::gpu) struct VolumeWalk {
    pub(in crate::gpu) extinction: bool,
    /// Whether what is emitted is multiplied by light.
    pub(in crate::gpu) lit: bool,
    /// Whether the unknown has another grid than the medium.
    pub(in crate::gpu) nested: bool,
    pub(in crate::gpu) trilinear: bool,
    pub(in crate::gpu) colored: bool,
    /// Channels at once: 1 or 3.
    pub(in crate::gpu) channels: u32,
}

impl LightMapWalk {
    /// All channels at once, every deposit for itself.
    pub(in crate::gpu) fn new(basis: Basis, quadrature: Quadrature, colored: bool) -> Self {
        let march = matches!(quadrature, Quadrature::March { .. });
        Self { bilinear: basis == Basis::Bilinear, march, colored, channels: 3, near: false }
    }
}

impl Walk {
    /// The same over so many channels at once. With `near` deposits near the entry of a light map are summed up inside a workgroup
    /// first.
    pub(in crate::gpu) fn over(self, channels: u32, near: bool) -> Self {
        match self {
            Self::LightMap(walk) => Self::LightMap(LightMapWalk { channels, near, ..walk }),
            Self::Volume(walk) => Self::Volume(VolumeWalk { channels, ..walk }),
        }
    }

    /// Whether deposits near the entry are summed up inside a workgroup first.
    pub(super) fn sums_near(self) -> bool {
        matches!(self, Self::LightMap(LightMapWalk { near: true, .. }))
    }

    /// Every way that a problem can ask for.
    pub(super) fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for bits in 0..16 {
            let flags = [0, 1, 2, 3].map(|bit| bits >> bit & 1 == 1);
            for channels in [1, 3] {
                let [bilinear, march, colored, near] = flags;
                all.push(Self::LightMap(LightMapWalk { bilinear, march, colored, channels, near }));
                let [lit, nested, trilinear, colored] = flags;
                let walk = VolumeWalk { extinction: false, lit, nested, trilinear, colored, channels };
                all.push(Self::Volume(walk));
                if !lit && !nested {
                    all.push(Self::Volume(VolumeWalk { extinction: true, ..walk }));
                }
            }
        }
        all
    }
}
