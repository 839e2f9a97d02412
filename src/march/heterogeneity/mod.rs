//! Heterogeneous air as a factor of scattered light: the mean of `h = I (α N(x, f) + 1 − α)` along view rays (Kol 2017, section 4.3).
//!
//! N is noise of mean 1, twice that of the paper, so that the picture is as bright with it as without it. The three others are the
//! blend volumes; their values are linear between the middles of voxels, and go over to what is everywhere over one voxel at the rim.

mod blends;
mod cells;
mod noise;

use glam::DVec3;
use rayon::prelude::*;

pub use blends::AirGrid;
use blends::{Ringed, Values};
use cells::{Planes, pieces};
pub use noise::NoiseVolume;

use crate::Result;
use crate::scene::{Heterogeneity, Quadrature, Ray, Samples, Volume};

/// The largest factor of an intensity.
pub const MOST_INTENSITY: f64 = 1000.0;

/// h everywhere in the air.
#[derive(Debug, Clone, PartialEq)]
pub struct HeterogeneityField {
    noise: NoiseVolume,
    grid: AirGrid,
    ringed: Ringed,
    amount: Values,
    frequency: Values,
    intensity: Values,
    baked: Option<Baked>,
    quadrature: Quadrature,
    /// The least and the largest level of detail anywhere.
    levels: [f64; 2],
}

/// h inside of the box, linear between the middles of its voxels and constant beyond the outermost ones.
#[derive(Debug, Clone, PartialEq)]
struct Baked {
    grid: AirGrid,
    volume: Volume,
}

impl Baked {
    /// The planes between the middles of its voxels, and those of its box, along a ray.
    fn planes(&self, ray: &Ray) -> [Planes; 2] {
        let [low, _] = self.grid.bounds();
        let cells = (ray.origin - low) / self.grid.voxel();
        let size = DVec3::from_array(self.grid.size().map(|side| side as f64));
        let slope = ray.direction / self.grid.voxel();
        [
            Planes::new(cells - 0.5, slope, Some(size - 1.0)),
            Planes::new(cells / size, slope / size, Some(DVec3::ONE)),
        ]
    }
}

impl HeterogeneityField {
    /// Over a box, given by its least and its largest corner, with noise in cubes of `size` metres.
    ///
    /// Errors: [`crate::Error::Value`] naming a stroke that reaches nothing, or a box without volume.
    pub fn new(air: &Heterogeneity, bounds: [DVec3; 2], size: f64) -> Result<Self> {
        let noise = NoiseVolume::new(&air.noise, size);
        let grid = AirGrid::over(bounds, air.voxels)?;
        let values = |name: &str, blend, most: f64| {
            Values::new(blend, &grid, [0.0, most]).map_err(|error| error.inside(name))
        };
        let frequency = values("frequency", &air.blends.frequency, noise.last_level() as f64)?;
        let mut field = Self {
            levels: frequency.range(),
            amount: values("amount", &air.blends.amount, 1.0)?,
            frequency,
            intensity: values("intensity", &air.blends.intensity, MOST_INTENSITY)?,
            noise,
            grid,
            ringed: Ringed::new(grid),
            baked: None,
            quadrature: air.quadrature,
        };
        if let Some(voxels) = air.bake {
            let grid = AirGrid::over(bounds, voxels)?;
            let values =
                (0..grid.len()).into_par_iter().map(|index| field.unbaked(grid.middle(index)) as f32);
            let volume = Volume::new(grid.voxels()?, 1, Samples::F32(values.collect()))?;
            field.baked = Some(Baked { grid, volume });
        }
        Ok(field)
    }

    /// h at a point.
    pub fn at(&self, point: DVec3) -> f64 {
        match &self.baked {
            Some(baked) if baked.grid.contains(point) => {
                let place = baked.volume.grid().grid_from_world().transform_point3(point);
                f64::from(baked.volume.interpolated(place.to_array())[0])
            }
            _ => self.unbaked(point),
        }
    }

    fn unbaked(&self, point: DVec3) -> f64 {
        let is_painted = [&self.intensity, &self.amount, &self.frequency].map(Values::is_painted);
        let place = is_painted.contains(&true).then(|| self.ringed.place(point));
        let intensity = self.intensity.at(place.as_ref());
        if intensity == 0.0 {
            return 0.0;
        }
        let amount = self.amount.at(place.as_ref());
        if amount == 0.0 {
            return intensity;
        }
        let noise = self.noise.at(point, self.frequency.at(place.as_ref()));
        intensity * (amount * noise + 1.0 - amount)
    }

    /// The mean of h along a ray, up to so many metres.
    ///
    /// Error: none but rounding (1e-6) of [`Quadrature::Exact`]; of steps that of their midpoints (docs/looks.md has it measured).
    pub fn mean(&self, ray: &Ray, length: f64) -> f64 {
        if length <= 0.0 {
            return self.at(ray.origin);
        }
        match self.quadrature {
            Quadrature::Exact => self.exact(ray, length) / length,
            Quadrature::March { steps: most } => {
                let count = (length / self.finest()).ceil().clamp(1.0, f64::from(most));
                let step = length / count;
                let value = |k: u32| self.at(ray.at(step * (f64::from(k) + 0.5)));
                (0..count as u32).map(value).sum::<f64>() / count
            }
        }
    }

    /// The side of the smallest voxel that h depends on, in metres.
    fn finest(&self) -> f64 {
        if let Some(baked) = &self.baked {
            return baked.grid.voxel();
        }
        let noise = self.noise.voxel(self.levels[0] as usize);
        let is_painted = [&self.amount, &self.frequency, &self.intensity].map(Values::is_painted);
        if is_painted.contains(&true) { noise.min(self.grid.voxel()) } else { noise }
    }

    /// ∫ h along a ray: in cells h is a polynomial, and as many nodes of Gauss are taken as make it exact.
    fn exact(&self, ray: &Ray, length: f64) -> f64 {
        let Some(baked) = &self.baked else { return self.exact_where(ray, length, &[], &|_, _| true) };
        let is_inside = |from: f64, to: f64| baked.grid.contains(ray.at(0.5 * (from + to)));
        let [cells, rim] = baked.planes(ray);
        let (rule, mut sum) = (gauss(2), 0.0);
        pieces(&[cells, rim], length, |from, to| {
            if is_inside(from, to) {
                sum += self.over(ray, &rule, [from, to]);
            }
        });
        let is_all = [0.0, length].into_iter().all(|end| baked.grid.contains(ray.at(end)));
        if is_all {
            sum
        } else {
            sum + self.exact_where(ray, length, &[rim], &|from, to| !is_inside(from, to))
        }
    }

    /// The same of what is not baked, over the pieces that are asked for. Where the level of detail passes a whole number in a cell, it is cut
    /// there.
    fn exact_where(
        &self,
        ray: &Ray,
        length: f64,
        rims: &[Planes],
        is_asked_for: &dyn Fn(f64, f64) -> bool,
    ) -> f64 {
        let levels = self.levels[0] as usize..=self.levels[1].ceil() as usize;
        let mut lattices: Vec<Planes> = levels.map(|level| self.noise.planes(level, ray)).collect();
        lattices.extend(rims);
        let is_painted = |values: &Values| u32::from(values.is_painted());
        let painted = is_painted(&self.amount) + is_painted(&self.intensity);
        // Three for each trilinear factor; the level of detail is one more, of the noise.
        let degree = 3 * (1 + painted + is_painted(&self.frequency));
        if degree > 3 {
            lattices.push(self.ringed.planes(ray));
        }
        let (rule, mut sum) = (gauss(degree / 2 + 1), 0.0);
        pieces(&lattices, length, |from, to| {
            if !is_asked_for(from, to) {
                return;
            }
            let mut start = from;
            if self.frequency.is_painted() {
                let level = |t: f64| self.frequency.at(Some(&self.ringed.place(ray.at(t))));
                for cut in whole_numbers(level, from, to) {
                    sum += self.over(ray, &rule, [start, cut]);
                    start = cut;
                }
            }
            sum += self.over(ray, &rule, [start, to]);
        });
        sum
    }

    /// ∫ h along a piece of a ray by a rule on [0, 1].
    fn over(&self, ray: &Ray, rule: &[[f64; 2]], [from, to]: [f64; 2]) -> f64 {
        let value = |[node, weight]: &[f64; 2]| weight * self.at(ray.at(from + node * (to - from)));
        rule.iter().map(value).sum::<f64>() * (to - from)
    }

    /// The side of the cube of noise, in metres.
    pub fn noise_size(&self) -> f64 {
        self.noise.voxel(self.noise.last_level())
    }

    /// The box of the blend volumes, in voxels.
    pub fn grid(&self) -> &AirGrid {
        &self.grid
    }

    /// Whether something is painted in the air, or all is baked.
    pub fn is_painted(&self) -> bool {
        self.baked.is_some()
            || [&self.amount, &self.frequency, &self.intensity].map(Values::is_painted).contains(&true)
    }

    /// The blend volumes by their names, and the one that they are baked into.
    ///
    /// Errors: those of [`Volume::new`].
    pub fn volumes(&self) -> Result<Vec<(&'static str, Volume)>> {
        let blends =
            [("amount", &self.amount), ("frequency", &self.frequency), ("intensity", &self.intensity)];
        let blends = blends.into_iter().map(|(name, values)| Ok((name, values.volume(&self.grid)?)));
        let baked = self.baked.iter().map(|baked| Ok(("baked", baked.volume.clone())));
        blends.chain(baked).collect()
    }

    /// Bytes of its volumes.
    pub fn bytes(&self) -> usize {
        let blends = [&self.amount, &self.frequency, &self.intensity].map(Values::bytes);
        let baked = self.baked.as_ref().map_or(0, |baked| baked.volume.samples().bytes());
        self.noise.bytes() + blends.iter().sum::<usize>() + baked
    }
}

/// Where a cubic function passes whole numbers between two places, in order.
fn whole_numbers(function: impl Fn(f64) -> f64, from: f64, to: f64) -> Vec<f64> {
    let u = |share: f64| from + share * (to - from);
    // Through four points; of rising powers of the share.
    let [a, b, c, d] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(|share| function(u(share)));
    let [p1, p2, p3] = [
        -5.5 * a + 9.0 * b - 4.5 * c + d,
        9.0 * a - 22.5 * b + 18.0 * c - 4.5 * d,
        -4.5 * a + 13.5 * b - 13.5 * c + 4.5 * d,
    ];
    let cubic = |share: f64| a + share * (p1 + share * (p2 + share * p3));
    let mut ends = vec![0.0, 1.0];
    let turn = p2 * p2 - 3.0 * p1 * p3;
    if turn > 0.0 {
        // Both turning points; one of them is far away where it is nearly a parabola.
        let q = -(p2 + turn.sqrt().copysign(p2));
        ends.extend([q / (3.0 * p3), p1 / q].into_iter().filter(|share| *share > 0.0 && *share < 1.0));
    }
    ends.sort_by(f64::total_cmp);
    let mut found = Vec::new();
    for ends in ends.windows(2) {
        let [low, high] = [cubic(ends[0]), cubic(ends[1])];
        let (first, last) = (low.min(high).floor() as i64 + 1, low.max(high).ceil() as i64 - 1);
        let mut numbers: Vec<i64> = (first..=last).collect();
        if low > high {
            numbers.reverse();
        }
        for number in numbers {
            let (mut below, mut above) = if low < high { (ends[0], ends[1]) } else { (ends[1], ends[0]) };
            for _ in 0..60 {
                let middle = 0.5 * (below + above);
                *(if cubic(middle) < number as f64 { &mut below } else { &mut above }) = middle;
            }
            found.push(u(0.5 * (below + above)));
        }
    }
    found
}

/// Nodes and weights of Gauss and Legendre on [0, 1], exact for polynomials of degree 2n − 1: roots of Pₙ by Newton's method.
fn gauss(count: u32) -> Vec<[f64; 2]> {
    let n = f64::from(count);
    let rule = |k: u32| {
        let mut x = (std::f64::consts::PI * (f64::from(k) + 0.75) / (n + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            let (mut before, mut value) = (1.0, x);
            for j in 1..count {
                let j = f64::from(j);
                (before, value) = (value, ((2.0 * j + 1.0) * x * value - j * before) / (j + 1.0));
            }
            slope = n * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        [0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope)]
    };
    (0..count).map(rule).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::scene::{AirNoise, AirStroke, BlendVolume, Blends, VoxelGrid};

    const BOUNDS: [DVec3; 2] = [DVec3::new(-4.0, -3.0, -5.0), DVec3::new(4.0, 3.0, 5.0)];
    const SIZE: f64 = 3.7;

    fn blend(base: f64) -> BlendVolume {
        BlendVolume { base, stored: None, strokes: Vec::new() }
    }

    fn plain() -> Heterogeneity {
        let noise = AirNoise {
            size: None,
            cells: 3,
            octaves: 3,
            persistence: 0.6,
            seed: 2,
            voxels: 32,
            offset: DVec3::new(0.3, -0.1, 0.7),
        };
        Heterogeneity {
            noise,
            blends: Blends { amount: blend(1.0), frequency: blend(0.0), intensity: blend(1.0) },
            bounds: None,
            voxels: 16,
            quadrature: Quadrature::Exact,
            upsample: 1,
            bake: None,
        }
    }

    fn stroke(path: &[DVec3], value: f64, hardness: f64) -> AirStroke {
        let normal = DVec3::new(0.6, 0.0, 0.8);
        AirStroke {
            path: path.to_vec(),
            normal,
            radii: [2.0, 1.5],
            value: Some(value),
            opacity: 0.9,
            hardness,
        }
    }

    /// All three volumes are painted, so that every factor is a polynomial.
    fn painted() -> Heterogeneity {
        let mut air = plain();
        air.blends.amount.strokes = vec![stroke(&[DVec3::ZERO, DVec3::new(2.0, 1.0, 0.0)], 0.2, 0.0)];
        air.blends.frequency.strokes = vec![stroke(&[DVec3::new(-1.0, 0.0, 1.0)], 4.3, 0.3)];
        air.blends.intensity.strokes = vec![
            stroke(&[DVec3::new(1.0, -1.0, -2.0)], 3.0, 0.5),
            stroke(&[DVec3::new(3.0, -1.0, -2.0)], 0.0, 0.5),
        ];
        air
    }

    fn field(air: &Heterogeneity) -> HeterogeneityField {
        HeterogeneityField::new(air, BOUNDS, SIZE).unwrap()
    }

    fn rays() -> Vec<(Ray, f64)> {
        let ray = |origin: [f64; 3], to: [f64; 3]| {
            let (origin, to) = (DVec3::from_array(origin), DVec3::from_array(to));
            (Ray { origin, direction: (to - origin).normalize() }, origin.distance(to))
        };
        vec![
            ray([-6.0, -2.0, -3.0], [5.0, 2.5, 4.0]),
            ray([0.0, 0.0, -8.0], [0.0, 0.0, 6.0]),
            ray([3.9, -2.0, 4.0], [-2.0, 1.0, -6.0]),
            ray([1.0, -1.0, -2.0], [1.3, -0.8, -1.7]),
        ]
    }

    /// The sum of octaves, levels and blends is done here by other code than that of the field, from its own voxels.
    #[test]
    fn a_value_is_that_of_the_equation() {
        let air = painted();
        let field = field(&air);
        let volumes = field.volumes().unwrap();
        for (k, point) in (0..200).map(|k| (k, f64::from(k))).map(|(k, t)| {
            (k, DVec3::new(3.0 * (1.3 * t).sin(), 2.0 * (0.7 * t).cos(), 4.0 * (2.1 * t).sin()))
        }) {
            let [amount, level, intensity] = [0, 1, 2].map(|which| {
                let place = volumes[which].1.grid().grid_from_world().transform_point3(point);
                f64::from(volumes[which].1.interpolated(place.to_array())[0])
            });
            let [fine, coarse] =
                [level.floor(), level.floor() + 1.0].map(|level| field.noise.at(point, level));
            let noise = fine + level.fract() * (coarse - fine);
            let expected = intensity * (amount * noise + 1.0 - amount);
            assert!((field.at(point) - expected).abs() < 2e-5, "{k}: {} and {expected}", field.at(point));
        }
    }

    #[test]
    fn exact_means_are_those_of_a_million_midpoints() {
        let mut baked = painted();
        baked.bake = Some(20);
        for (name, air) in [("plain", plain()), ("painted", painted()), ("baked", baked)] {
            let field = field(&air);
            for (ray, length) in rays() {
                let count = 1_000_000;
                let value = |k: i32| field.at(ray.at(length * (f64::from(k) + 0.5) / f64::from(count)));
                let mean = (0..count).map(value).sum::<f64>() / f64::from(count);
                let exact = field.mean(&ray, length);
                assert!((exact - mean).abs() < 1e-6 * mean.max(1.0), "{name}: {exact} and {mean}");
                // Fewer nodes than the degree asks for are seen.
                let coarse =
                    HeterogeneityField { quadrature: Quadrature::March { steps: 20 }, ..field.clone() };
                assert!((coarse.mean(&ray, length) - mean).abs() > 1e-6, "{name}");
            }
        }
    }

    #[test]
    fn steps_come_closer_as_they_get_shorter_and_are_no_shorter_than_voxels() {
        let air = painted();
        let exact = field(&air);
        let error = |steps: u32| {
            let field = HeterogeneityField { quadrature: Quadrature::March { steps }, ..exact.clone() };
            let all =
                rays().into_iter().map(|(ray, length)| field.mean(&ray, length) - exact.mean(&ray, length));
            all.map(|apart| apart * apart).sum::<f64>().sqrt()
        };
        let errors = [4, 16, 64, 100_000].map(error);
        assert!(errors.is_sorted_by(|a, b| a > b) || errors[2] == errors[3], "{errors:?}");
        assert!(errors[3] < 0.02, "{errors:?}");
    }

    #[test]
    fn noise_that_is_not_there_changes_nothing() {
        let mut air = painted();
        air.blends = Blends { amount: blend(0.0), frequency: blend(0.0), intensity: blend(1.7) };
        for quadrature in [Quadrature::Exact, Quadrature::March { steps: 7 }] {
            let field = field(&Heterogeneity { quadrature, ..air.clone() });
            for (ray, length) in rays() {
                assert!((field.mean(&ray, length) - 1.7).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn an_eraser_brings_back_what_is_everywhere_and_a_file_stays_inside_its_box() {
        let mut air = plain();
        air.blends.amount = blend(0.0);
        let whole = |value| AirStroke { hardness: 1.0, opacity: 1.0, ..stroke(&[DVec3::ZERO], value, 1.0) };
        air.blends.intensity.strokes = vec![whole(3.0)];
        assert!((field(&air).at(DVec3::ZERO) - 3.0).abs() < 1e-6);
        air.blends.intensity.strokes.push(AirStroke { value: None, ..whole(0.0) });
        assert!((field(&air).at(DVec3::ZERO) - 1.0).abs() < 1e-6);
        let grid = VoxelGrid::over_cube([2; 3], glam::DAffine3::from_scale(DVec3::splat(2.0))).unwrap();
        air.blends.intensity.stored = Some(Arc::new(Volume::constant(grid, [0.25; 3]).unwrap()));
        air.blends.intensity.strokes.clear();
        let field = field(&air);
        assert_eq!([field.at(DVec3::ONE), field.at(-DVec3::ONE)], [0.25, 1.0]);
    }

    #[test]
    fn strokes_that_reach_nothing_are_named() {
        let mut air = plain();
        air.blends.amount.strokes =
            vec![stroke(&[DVec3::ZERO], 0.5, 0.5), stroke(&[DVec3::splat(30.0)], 0.5, 0.5)];
        let error = HeterogeneityField::new(&air, BOUNDS, SIZE).unwrap_err().to_string();
        assert!(error.contains("amount.strokes[1]") && error.contains("voxel"), "{error}");
        let thin = AirStroke { radii: [0.01; 2], ..stroke(&[DVec3::splat(0.1)], 0.5, 0.5) };
        air.blends.amount.strokes = vec![thin];
        assert!(HeterogeneityField::new(&air, BOUNDS, SIZE).is_err());
    }

    #[test]
    fn whole_numbers_of_a_cubic_are_found_in_order() {
        let cubic = |t: f64| 2.0 * t * t * t - 3.0 * t + 0.4;
        let found = whole_numbers(cubic, -1.6, 1.7);
        assert!(found.is_sorted() && found.len() > 5, "{found:?}");
        assert!(found.iter().all(|&t| (cubic(t) - cubic(t).round()).abs() < 1e-9));
        let crossings = (0..330_000)
            .filter(|&k| {
                let t = |k: i32| -1.6 + 1e-5 * f64::from(k);
                cubic(t(k)).floor() != cubic(t(k + 1)).floor()
            })
            .count();
        assert_eq!(found.len(), crossings);
    }

    #[test]
    fn rules_of_gauss_are_exact() {
        for count in 1..9 {
            let rule = gauss(count);
            for degree in 0..2 * count as i32 {
                let sum: f64 = rule.iter().map(|[node, weight]| weight * node.powi(degree)).sum();
                assert!((sum - 1.0 / f64::from(degree + 1)).abs() < 1e-14, "{count}, {degree}");
            }
        }
    }
}
