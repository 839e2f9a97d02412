use std::sync::Arc;

use glam::DVec3;

use super::{Quadrature, Volume};

/// How irregular the air is: what it scatters along a view ray is multiplied by the mean of `I (α N(x, f) + 1 − α)` along it (Kol 2017, sec. 4.3).
#[derive(Debug, Clone, PartialEq)]
pub struct Heterogeneity {
    /// N.
    pub noise: AirNoise,
    /// What is painted in the air.
    pub blends: Blends,
    /// The box of the blend volumes, its least and its largest corner, in metres; where none is given it holds what the views see.
    pub bounds: Option<[DVec3; 2]>,
    /// Voxels of the blend volumes along the longest side of the box.
    pub voxels: usize,
    /// How the mean is taken: exactly, cell by cell; or in the middles of so many equal steps at most, of fewer where steps would be shorter
    /// than a voxel.
    pub quadrature: Quadrature,
    /// Pixels from one ray that is asked to the next, along both axes of a picture; 1 asks each.
    pub upsample: usize,
    /// Voxels along the longest side of the one volume that noise and blend volumes are baked into; none where they stay apart.
    pub bake: Option<usize>,
}

/// Tileable noise in a cube that is repeated in all directions: octaves of Perlin's noise, about 1 on the mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AirNoise {
    /// The side of the cube in metres; none where it is fitted to the box of the blend volumes.
    pub size: Option<f64>,
    /// Cells of the first octave along a side.
    pub cells: u32,
    /// How many octaves, each of twice the frequency of the one before.
    pub octaves: u32,
    /// The factor from one octave to the next.
    pub persistence: f64,
    /// Other numbers give other noise.
    pub seed: u32,
    /// Voxels along a side: a power of two.
    pub voxels: usize,
    /// How far the cube is moved, in metres: wind.
    pub offset: DVec3,
}

/// The three blend volumes.
#[derive(Debug, Clone, PartialEq)]
pub struct Blends {
    /// α: how much of the noise there is, from 0 to 1.
    pub amount: BlendVolume,
    /// f: the level of detail at which the noise is looked up; each level has half the voxels of the one before.
    pub frequency: BlendVolume,
    /// I: how much light the air scatters.
    pub intensity: BlendVolume,
}

/// Values in the air: the same everywhere but where something else is stored or painted.
#[derive(Debug, Clone, PartialEq)]
pub struct BlendVolume {
    /// What is everywhere.
    pub base: f64,
    /// What is in its place inside of the box of a volume.
    pub stored: Option<Arc<Volume>>,
    /// What is painted over that, one stroke after the other.
    pub strokes: Vec<AirStroke>,
}

/// A stroke on a plane in the air, of a brush that is an ellipsoid.
#[derive(Debug, Clone, PartialEq)]
pub struct AirStroke {
    /// The path of its middle, in world space.
    pub path: Vec<DVec3>,
    /// The normal of the plane; of unit length.
    pub normal: DVec3,
    /// Half axes of the brush across and along the normal, in metres.
    pub radii: [f64; 2],
    /// What is painted; none takes away what has been painted before.
    pub value: Option<f64>,
    /// How far values go towards it in the middle, from 0 to 1.
    pub opacity: f64,
    /// The part of the radius in which the opacity is whole; it falls to 0 at the rim.
    pub hardness: f64,
}

impl AirStroke {
    /// How far values go towards its own at a point, from 0 to 1: whole up to the hardness, a smooth cubic from there to the rim.
    pub fn opacity_at(&self, point: DVec3) -> f64 {
        let nearest = self.distance(point);
        if nearest >= 1.0 {
            return 0.0;
        }
        let soft = 1.0 - self.hardness;
        let u = if nearest > self.hardness { (1.0 - nearest) / soft } else { 1.0 };
        self.opacity * u * u * (3.0 - 2.0 * u)
    }

    /// Distance from the path in radii of the brush.
    fn distance(&self, point: DVec3) -> f64 {
        // In this space the brush is the unit ball.
        let scaled = |v: DVec3| {
            let along = v.dot(self.normal);
            (v - self.normal * along) / self.radii[0] + self.normal * (along / self.radii[1])
        };
        let from_segment = |from: DVec3, to: DVec3| {
            let (along, towards) = (scaled(to - from), scaled(point - from));
            let share = towards.dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
            (towards - along * share.clamp(0.0, 1.0)).length_squared()
        };
        let segments = self.path.windows(2).map(|ends| from_segment(ends[0], ends[1]));
        let nearest = segments.fold(f64::INFINITY, f64::min);
        let single = if let [only] = self.path[..] { scaled(point - only).length_squared() } else { nearest };
        single.sqrt()
    }

    /// The box around all that it can change: its least and its largest corner.
    pub fn bounds(&self) -> [DVec3; 2] {
        let [across, along] = self.radii;
        // Of an ellipsoid of revolution: √(across² (1 − n²) + along² n²) on each axis.
        let n = self.normal * self.normal;
        let reach = (across * across * (DVec3::ONE - n).max(DVec3::ZERO) + along * along * n).map(f64::sqrt);
        let around = |pick: fn(DVec3, DVec3) -> DVec3, start: f64| {
            self.path.iter().fold(DVec3::splat(start), |bound, &point| pick(bound, point))
        };
        [around(DVec3::min, f64::INFINITY) - reach, around(DVec3::max, f64::NEG_INFINITY) + reach]
    }
}

impl Heterogeneity {
    /// In a few words.
    pub fn in_words(&self) -> String {
        let painted: Vec<String> = [
            ("amount", &self.blends.amount),
            ("frequency", &self.blends.frequency),
            ("intensity", &self.blends.intensity),
        ]
        .into_iter()
        .filter(|(_, blend)| blend.stored.is_some() || !blend.strokes.is_empty())
        .map(|(name, blend)| match blend.strokes.len() {
            0 => format!("{name} from a file"),
            count => format!("{count} strokes in {name}"),
        })
        .collect();
        let average = match self.quadrature {
            Quadrature::March { steps } => format!("{steps} steps"),
            Quadrature::Exact => "exact".to_owned(),
        };
        let painted = if painted.is_empty() { String::new() } else { format!(", {}", painted.join(", ")) };
        format!("heterogeneous air ({} octaves of noise, {average}{painted})", self.noise.octaves)
    }

    /// The same a `share` of the way to another, where they differ in how far the noise has moved alone.
    pub(super) fn moved_to(&self, to: &Self, share: f64) -> Option<Self> {
        let offset = self.noise.offset.lerp(to.noise.offset, share);
        let moved = |it: &Self| Self { noise: AirNoise { offset, ..it.noise }, ..it.clone() };
        let here = moved(self);
        (here == moved(to)).then_some(here)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stroke() -> AirStroke {
        AirStroke {
            path: vec![DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0)],
            normal: DVec3::Z,
            radii: [1.0, 0.5],
            value: Some(1.0),
            opacity: 0.8,
            hardness: 0.5,
        }
    }

    #[test]
    fn a_brush_is_an_ellipsoid_with_a_soft_rim() {
        let stroke = stroke();
        for (point, opacity) in [
            (DVec3::new(2.0, 0.0, 0.0), 0.8),
            (DVec3::new(2.0, 0.5, 0.0), 0.8),
            (DVec3::new(2.0, 0.75, 0.0), 0.4),
            (DVec3::new(2.0, 0.0, 0.375), 0.4),
            (DVec3::new(4.75, 0.0, 0.0), 0.4),
            (DVec3::new(2.0, 1.0, 0.0), 0.0),
            (DVec3::new(2.0, 0.0, 0.51), 0.0),
            (DVec3::new(5.1, 0.0, 0.0), 0.0),
        ] {
            assert!((stroke.opacity_at(point) - opacity).abs() < 1e-12, "{point}");
        }
        let dab = AirStroke { path: vec![DVec3::ZERO], hardness: 1.0, ..stroke };
        assert_eq!([dab.opacity_at(DVec3::X * 0.99), dab.opacity_at(DVec3::X * 1.01)], [0.8, 0.0]);
    }

    #[test]
    fn the_box_of_a_stroke_holds_all_that_it_changes_and_little_more() {
        let normal = DVec3::new(1.0, 2.0, -2.0) / 3.0;
        let stroke = AirStroke { normal, radii: [1.0, 0.3], ..stroke() };
        let [low, high] = stroke.bounds();
        let mut reached = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let side = 60;
        for k in 0..side * side * side {
            let share = DVec3::new((k % side) as f64, (k / side % side) as f64, (k / side / side) as f64);
            let point = low - 0.2 + (high - low + 0.4) * share / (side - 1) as f64;
            if stroke.opacity_at(point) > 0.0 {
                assert!(point.cmpge(low).all() && point.cmple(high).all());
                reached = [reached[0].min(point), reached[1].max(point)];
            }
        }
        assert!((reached[0] - low).max_element() < 0.2 && (high - reached[1]).max_element() < 0.2);
    }
}
