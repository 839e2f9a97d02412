//! Which directions of a surface are open: their share, their mean, and the cone that they are like.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat3, DVec3, Vec3};

use crate::scene::Weighting;

/// What stands on the way of light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    /// Nothing.
    Open,
    /// A surface.
    Hidden,
    /// That is not known.
    Unknown,
}

/// How open a surface is. Both are sums over directions and can be averaged with those of its neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Openness {
    /// The share of the directions that are open: AO.
    pub(super) share: f32,
    /// The share times how far the mean of the open directions is from that of all: AO (N − N of open ground).
    pub(super) bend: Vec3,
}

impl Openness {
    /// Of open ground.
    pub(super) const WHOLE: Self = Self { share: 1.0, bend: Vec3::ZERO };

    /// From directions around +Z, of which `way` says what is on it in world space.
    ///
    /// What is not known is left out (listing 3.1). The mean of all known directions is taken away from that of the open ones: what few directions have
    /// of their own is no bend.
    pub(super) fn of(directions: &[DVec3], normal: DVec3, way: impl Fn(DVec3) -> Way) -> Self {
        let frame = frame(normal);
        let (mut known, mut open) = ((0usize, DVec3::ZERO), (0usize, DVec3::ZERO));
        for &local in directions {
            let direction = frame * local;
            match way(direction) {
                Way::Unknown => continue,
                Way::Hidden => {}
                Way::Open => open = (open.0 + 1, open.1 + direction),
            }
            known = (known.0 + 1, known.1 + direction);
        }
        if known.0 == 0 {
            return Self::WHOLE;
        }
        let count = known.0 as f64;
        let share = open.0 as f64 / count;
        let bend = (open.1 - share * known.1) / count;
        Self { share: share as f32, bend: bend.as_vec3() }
    }

    /// The cone of directions that a surface with this normal is open to.
    pub(super) fn cone(&self, normal: DVec3, weighting: Weighting) -> BentCone {
        let share = f64::from(self.share);
        let bend = if share > 0.0 { self.bend.as_dvec3() / share } else { DVec3::ZERO };
        let mean = normal * open_length(weighting) + bend;
        let length = mean.length();
        BentCone {
            visibility: share,
            direction: if length > 0.0 { mean / length } else { normal },
            angle: cone_angle(length, weighting),
        }
    }
}

/// The open directions of a point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BentCone {
    /// Their share: AO.
    pub visibility: f64,
    /// Their mean, of unit length: the bent normal N.
    pub direction: DVec3,
    /// Half the opening angle of the cone around it, in radians: C.
    pub angle: f64,
}

/// |N| of open ground.
fn open_length(weighting: Weighting) -> f64 {
    match weighting {
        Weighting::Cosine => 2.0 / 3.0,
        Weighting::Uniform => 0.5,
    }
}

/// C from |N|, from π/2 of open ground down to 0 of one direction.
///
/// Law     cosine: directions of the cone that count their cosine with its axis have a mean of the same length, ⅔ (1 − c³) / (1 − c²) with c = cos C.
///         So light that is linear in the direction is the same from the cone as from the open directions.
/// Source  uniform: eq. 3.6
pub(super) fn cone_angle(length: f64, weighting: Weighting) -> f64 {
    let length = length.clamp(0.0, 1.0);
    match weighting {
        Weighting::Cosine => {
            // 2 c² − k c − k = 0.
            let k = (3.0 * length - 2.0).max(0.0);
            (0.25 * (k + (k * k + 8.0 * k).sqrt())).min(1.0).acos()
        }
        Weighting::Uniform => (1.0 - (2.0 * length - 1.0).max(0.0)) * FRAC_PI_2,
    }
}

/// World space from a space whose +Z is the normal (Duff et al. 2017).
pub(super) fn frame(n: DVec3) -> DMat3 {
    let sign = 1f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    let x = DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    DMat3::from_cols(x, DVec3::new(b, sign + n.y * n.y * a, -n.y), n)
}
