//! Where the light comes through that painted pixels scatter.

use glam::DVec2;
use rayon::prelude::*;

use super::Constraint;
use crate::march::{ViewRay, lit_stretches};
use crate::scene::{Extent, LightFrame, Scene};
use crate::visibility::ShadowMap;

/// The share of the sampled light that may come from outside the light map. Beyond the last sampled places there is up to half of a 32nd
/// more, so that it is 95 % at least that comes through the map.
const OUTSIDE: f64 = 0.02;
/// Rays that are looked at; so many of all painted pixels.
const RAYS: usize = 4096;
/// Lit places along a ray, each of which scatters as much as the others.
const PLACES: usize = 32;
/// What is cut off a side at once, as a share of all light.
const CUT: f64 = 0.0025;
/// A rectangle's sides are multiples of the power of two that is at most this share of their length.
const SNAP: f64 = 1.0 / 16.0;

/// Points on the plane of a light through which light comes that painted pixels scatter.
pub(super) struct Scattered(Vec<Point>);

#[derive(Clone, Copy)]
struct Point {
    place: DVec2,
    /// Its shares of the light of all pixels: as bright as they are, and as if all were as bright.
    shares: [f64; 2],
}

impl Scattered {
    /// Of painted pixels, the lengths of whose rays are in metres up to the first surface. Nothing where all of them lie in shadow.
    pub(super) fn new(
        scene: &Scene,
        (frame, shadow_map): (&LightFrame, &ShadowMap),
        constraints: &[Constraint],
        lengths: &[f64],
    ) -> Self {
        let painted: Vec<usize> =
            (0..constraints.len()).filter(|&row| constraints[row].is_painted()).collect();
        let stride = painted.len().div_ceil(RAYS).max(1);
        // The clearest channel sees farthest.
        let sigma = scene.medium.sigma_t.iter().copied().fold(f64::INFINITY, f64::min);
        let along = |&row: &usize| {
            let (pixel, length) = (&constraints[row], lengths[row]);
            let ray = scene.views[pixel.view].camera.pixel_ray(pixel.x, pixel.y);
            let ray = ViewRay::new(&ray, length, frame, &scene.medium);
            let end = length.min(scene.medium.reach(scene.solve.transmittance_bound));
            let stretches = lit_stretches(&ray, shadow_map, end);
            let of = |[from, to]: [f64; 2]| (-sigma * from).exp() * -(sigma * (from - to)).exp_m1();
            let all: f64 = stretches.iter().copied().map(of).sum();
            let weight = f64::from(pixel.weight) / PLACES as f64;
            let shares = [weight * ray.scattering.iter().sum::<f64>() * all, weight];
            let mut points = Vec::with_capacity(PLACES);
            // So much light comes from nearer to the eye than the stretch.
            let mut before = 0.0;
            for stretch in stretches {
                let here = of(stretch);
                while (points.len() as f64 + 0.5) * all < (before + here) * PLACES as f64
                    && points.len() < PLACES
                {
                    let within = (points.len() as f64 + 0.5) / PLACES as f64 * all - before;
                    let distance = -((-sigma * stretch[0]).exp() - within).ln() / sigma;
                    let distance = distance.clamp(stretch[0], stretch[1]);
                    points.push(Point { place: (ray.origin + distance * ray.direction).truncate(), shares });
                }
                before += here;
            }
            points
        };
        let picked: Vec<usize> = painted.into_iter().step_by(stride).collect();
        let mut points: Vec<Point> = picked.par_iter().flat_map_iter(along).collect();
        for which in 0..2 {
            let all: f64 = points.iter().map(|point| point.shares[which]).sum();
            points.iter_mut().for_each(|point| point.shares[which] /= all);
        }
        Self(points)
    }

    /// The smallest rectangle that holds 95 % of the light, of all pixels as they are and as if they were equally bright, with its corners
    /// moved outwards to round numbers: so another stroke moves it only where it must. None where there is no light.
    ///
    /// It is found side by side: as long as so much light may go, the side goes a little inwards on which that takes away most area for
    /// the light.
    pub(super) fn extent(&self) -> Option<Extent> {
        let mut inside = self.0.clone();
        let mut outside = [0.0; 2];
        loop {
            let extent = inside.iter().fold(Extent::NOTHING, |extent, point| extent.include(point.place));
            let cuts = (0..4).filter_map(|side| Cut::of(&inside, extent, side));
            let best = cuts.max_by(|a, b| a.gain.total_cmp(&b.gain));
            let goes = |cut: &Cut| (0..2).all(|k| outside[k] + cut.shares[k] <= OUTSIDE);
            let Some(cut) = best.filter(goes) else {
                return extent.min.is_finite().then(|| snapped(extent));
            };
            outside = [0, 1].map(|k| outside[k] + cut.shares[k]);
            inside.retain(|point| cut.keeps(point.place));
        }
    }
}

/// What moving one side of a rectangle inwards takes away.
struct Cut {
    axis: usize,
    /// Whether the lower side moves.
    is_lower: bool,
    at: f64,
    shares: [f64; 2],
    /// Area, as a share of the rectangle, for the light.
    gain: f64,
}

impl Cut {
    /// None where a side cannot move.
    fn of(points: &[Point], extent: Extent, side: usize) -> Option<Self> {
        let (axis, is_lower) = (side / 2, side.is_multiple_of(2));
        let [min, max] = [extent.min[axis], extent.max[axis]];
        if max <= min {
            return None;
        }
        // How far from the side that moves, as a share of the rectangle.
        let depth = |point: &Point| {
            let from = if is_lower { point.place[axis] - min } else { max - point.place[axis] };
            from / (max - min)
        };
        const STEPS: usize = 256;
        let mut strips = [[0.0; 2]; STEPS];
        for point in points {
            let strip = &mut strips[((depth(point) * STEPS as f64) as usize).min(STEPS - 1)];
            (0..2).for_each(|k| strip[k] += point.shares[k]);
        }
        let (mut shares, mut steps) = ([0.0f64; 2], 0);
        while shares[0].max(shares[1]) < CUT {
            shares = [0, 1].map(|k| shares[k] + strips[steps][k]);
            steps += 1;
            if steps == STEPS {
                return None;
            }
        }
        // What is empty behind it goes, too.
        steps += strips[steps..].iter().take_while(|strip| **strip == [0.0; 2]).count();
        let part = steps as f64 / STEPS as f64;
        let at = if is_lower { min + part * (max - min) } else { max - part * (max - min) };
        Some(Self { axis, is_lower, at, shares, gain: part / shares[0].max(shares[1]) })
    }

    fn keeps(&self, place: DVec2) -> bool {
        if self.is_lower { place[self.axis] >= self.at } else { place[self.axis] <= self.at }
    }
}

/// With its sides moved outwards to multiples of a power of two; a point becomes a square that can be drawn.
fn snapped(extent: Extent) -> Extent {
    let sides = (extent.max - extent.min).max(DVec2::splat(1e-6));
    let step = DVec2::from_array([sides.x, sides.y].map(|side| (SNAP * side).log2().floor().exp2()));
    let (min, max) = ((extent.min / step).floor() * step, (extent.max / step).ceil() * step);
    Extent { min, max: max.max(min + step) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(points: impl IntoIterator<Item = (f64, f64, f64)>) -> Scattered {
        let point = |(u, v, share)| Point { place: DVec2::new(u, v), shares: [share; 2] };
        Scattered(points.into_iter().map(point).collect())
    }

    /// Light in a square of 10 by 10, and this share of it far away.
    fn with_far_light(far: f64) -> Extent {
        let near = (0..900).map(|i| ((i % 30) as f64 / 3.0, (i / 30) as f64 / 3.0, (1.0 - far) / 900.0));
        let outside = (0..100).map(|i| (1e3 + i as f64, -2e3, far / 100.0));
        of(near.chain(outside)).extent().unwrap()
    }

    #[test]
    fn what_is_far_away_and_faint_is_left_out_and_what_is_not_is_not() {
        let extent = with_far_light(0.015);
        assert!(extent.min.cmpge(DVec2::splat(-1.0)).all() && extent.max.cmple(DVec2::splat(11.0)).all());
        assert!(with_far_light(0.1).max.x > 1000.0, "a tenth of the light may not be lost");
    }

    #[test]
    fn little_more_light_moves_nothing() {
        let grid = |count: usize| {
            of((0..count * count).map(|i| {
                let [u, v] = [i % count, i / count].map(|k| 7.3 * (k as f64 + 0.5) / count as f64);
                (u, v, 1.0 / (count * count) as f64)
            }))
        };
        assert_eq!(grid(64).extent(), grid(70).extent());
        let Some(Extent { min, max }) = grid(64).extent() else { unreachable!() };
        let step = 0.25;
        assert_eq!((min / step).fract(), DVec2::ZERO);
        assert_eq!((max / step).fract(), DVec2::ZERO);
    }

    #[test]
    fn darkness_has_no_extent_and_a_point_has_one() {
        assert_eq!(of([]).extent(), None);
        assert!(of([(3.0, 4.0, 1.0)]).extent().unwrap().has_area());
    }
}
