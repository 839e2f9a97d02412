//! Extrema along the lines through an epipole.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::morphology::{Extremum, Room};
use crate::scene::{Grid, Radius};

/// The lines of a shadow map through an epipole, texel by texel.
///
/// With s = (z − z_l) / |t − l| a view ray has one slope from the eye on, so eq. 3 of Kol et al. 2017,
/// `z'_t = min(z_t, |t − l| / |s − l| (z_s − z_l) + z_l)`, is a running minimum of slopes.
///
/// Texels that see the epipole along u rather than along v lie on lines to the middles of texels of the last column on their side, others to
/// those of the last row; a line has one texel in each column, and misses the line through a texel's centre by half a texel at
/// most. So every texel is on one line of its own, and each kernel is a part of it: a line is filtered in three comparisons a texel, whatever
/// the kernel's length.
pub(super) struct Lines<'g> {
    grid: &'g Grid,
    /// In texels.
    epipole: DVec2,
    /// Of the eye, as depths of the map are.
    depth: f64,
    radius: Radius,
}

/// A quarter of the map, seen from the epipole: the longer axis, and towards which side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Fan {
    /// 0 where columns are passed one by one.
    axis: usize,
    is_upward: bool,
}

/// A place of a line.
#[derive(Debug, Clone, Copy)]
struct Place {
    texel: usize,
    /// Metres from the epipole.
    distance: f64,
    /// Whether the line is the texel's own.
    is_own: bool,
}

impl<'g> Lines<'g> {
    /// `eye` is in the light's frame, its depth as those of the map.
    pub(super) fn new(grid: &'g Grid, eye: DVec3, radius: Radius) -> Self {
        Self { grid, epipole: grid.grid_from_light(eye.truncate()), depth: eye.z, radius }
    }

    /// Each depth becomes that of the least slope towards the eye, or of the largest away from it.
    pub(super) fn filter(&self, depths: &mut [f32], of: Extremum) {
        let found: Vec<AtomicU32> = depths.iter().map(|depth| AtomicU32::new(depth.to_bits())).collect();
        let lines: Vec<(Fan, isize)> = Fan::ALL.into_iter().flat_map(|fan| self.of_fan(fan)).collect();
        let depths_now = &*depths;
        lines.into_par_iter().for_each_init(
            || (Vec::new(), Vec::new(), Room::default()),
            |(places, slopes, room), line| {
                places.clear();
                places.extend(self.places(line));
                slopes.clear();
                slopes.extend(places.iter().map(|place| self.slope(place, depths_now)));
                let reach = self.reach(line);
                let window = if of == Extremum::Least { [reach, 0] } else { [0, reach] };
                room.slide(slopes, window, of.nothing(), |a: f64, b| of.of(a, b));
                for (place, &slope) in places.iter().zip(&*slopes).filter(|(place, _)| place.is_own) {
                    // Its own depth keeps its bits.
                    if slope != self.slope(place, depths_now) {
                        let depth = (self.depth + slope * place.distance) as f32;
                        found[place.texel].store(depth.to_bits(), Ordering::Relaxed);
                    }
                }
            },
        );
        depths
            .par_iter_mut()
            .zip(found)
            .for_each(|(depth, found)| *depth = f32::from_bits(found.into_inner()));
    }

    fn slope(&self, place: &Place, depths: &[f32]) -> f64 {
        (f64::from(depths[place.texel]) - self.depth) / place.distance
    }

    /// The lines of a quarter, by the texel of the last column that they lead to; that may lie beside the map.
    fn of_fan(&self, fan: Fan) -> impl Iterator<Item = (Fan, isize)> + use<> {
        let [along, across] = fan.axes();
        let size = self.grid.size.map(|side| side as f64);
        let (length, from) = (self.length(fan), self.epipole[across]);
        let first = if fan.is_upward { 0.5 } else { size[along] - 0.5 };
        let nearest = ((first - self.epipole[along]) * fan.sign()).max(0.5);
        // From the epipole on: where the sides of the map lie, and where the steepest lines to them lead.
        let [low, high] = [-from, size[across] - from];
        let low = if low < 0.0 { low * length / nearest } else { low };
        let high = if high > 0.0 { high * length / nearest } else { high };
        let lines = match length > 0.5 {
            true => {
                (from + low.max(-length) - 1.0).floor() as isize
                    ..(from + high.min(length) + 1.0).ceil() as isize
            }
            false => 0..0,
        };
        lines.map(move |line| (fan, line))
    }

    /// How many texels of the axis there are from the epipole to the middle of the last ones.
    fn length(&self, fan: Fan) -> f64 {
        let [along, _] = fan.axes();
        let last = if fan.is_upward { self.grid.size[along] as f64 - 0.5 } else { 0.5 };
        (last - self.epipole[along]) * fan.sign()
    }

    /// How far a line goes across for each texel that it goes along.
    fn steepness(&self, (fan, line): (Fan, isize)) -> f64 {
        (line as f64 + 0.5 - self.epipole[fan.axes()[1]]) / self.length(fan)
    }

    /// Steps of a line within the radius.
    fn reach(&self, line: (Fan, isize)) -> usize {
        let [along, across] = line.0.axes();
        let mut step = DVec2::ZERO;
        (step[along], step[across]) = (1.0, self.steepness(line));
        let steps = match self.radius {
            Radius::Texels(radius) => radius / step.length(),
            Radius::Metres(radius) => radius / (step / self.grid.density()).length(),
        };
        (steps + 1e-9) as usize
    }

    /// The texels of a line on the map, away from the epipole, from half a texel beside it on.
    fn places(&self, line: (Fan, isize)) -> impl Iterator<Item = Place> + '_ {
        let (fan, number) = line;
        let ([along, across], steepness) = (fan.axes(), self.steepness(line));
        let count = self.grid.size[along];
        let columns = (0..count).map(move |k| if fan.is_upward { k } else { count - 1 - k });
        columns.filter_map(move |column| {
            let off = (column as f64 + 0.5 - self.epipole[along]) * fan.sign();
            let row = (self.epipole[across] + off * steepness).floor();
            if off <= 0.5 || row < 0.0 || row >= self.grid.size[across] as f64 {
                return None;
            }
            let mut texel = [0; 2];
            (texel[along], texel[across]) = (column, row as usize);
            let centre = DVec2::new(texel[0] as f64 + 0.5, texel[1] as f64 + 0.5) - self.epipole;
            Some(Place {
                texel: texel[1] * self.grid.size[0] + texel[0],
                distance: (centre / self.grid.density()).length(),
                is_own: self.own(centre) == (fan, number),
            })
        })
    }

    /// The line of a texel, given its centre from the epipole on.
    fn own(&self, centre: DVec2) -> (Fan, isize) {
        let fan = Fan::of(centre);
        let [along, across] = fan.axes();
        let end = self.epipole[across] + centre[across] / (centre[along] * fan.sign()) * self.length(fan);
        (fan, end.floor() as isize)
    }
}

impl Fan {
    const ALL: [Self; 4] = [
        Self { axis: 0, is_upward: true },
        Self { axis: 0, is_upward: false },
        Self { axis: 1, is_upward: true },
        Self { axis: 1, is_upward: false },
    ];

    fn of(from_epipole: DVec2) -> Self {
        let axis = usize::from(from_epipole.y.abs() > from_epipole.x.abs());
        Self { axis, is_upward: from_epipole[axis] >= 0.0 }
    }

    /// The axis along which texels are passed one by one, and the other.
    fn axes(self) -> [usize; 2] {
        [self.axis, 1 - self.axis]
    }

    fn sign(self) -> f64 {
        if self.is_upward { 1.0 } else { -1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Extent;

    fn grid(size: [usize; 2]) -> Grid {
        let max = DVec2::new(size[0] as f64 * 0.1, size[1] as f64 * 0.13) + 1.0;
        Grid::new(Extent { min: DVec2::ONE, max }, size).unwrap()
    }

    fn depths(grid: &Grid) -> Vec<f32> {
        let value = |k: usize| match k * 7919 % 101 {
            0..6 => f32::INFINITY,
            value => 2.0 + value as f32 * 0.01,
        };
        (0..grid.len()).map(value).collect()
    }

    /// By definition, texel by texel: samples on the texel's line, column by column, and eq. 3 for each of them.
    fn by_hand(grid: &Grid, eye: DVec3, radius: f64, depths: &[f32], of: Extremum) -> Vec<f32> {
        let [width, height] = grid.size;
        let eye_at = grid.grid_from_light(eye.truncate());
        let metric = |texel: DVec2| ((texel - eye_at) / grid.density()).length();
        let one = |k: usize| {
            let t = DVec2::new((k % width) as f64 + 0.5, (k / width) as f64 + 0.5);
            let axis = usize::from((t - eye_at).y.abs() > (t - eye_at).x.abs());
            let off = (t - eye_at)[axis];
            if off.abs() <= 0.5 {
                return depths[k];
            }
            // The line leads to the middle of the last texel on that side.
            let last = if off > 0.0 { grid.size[axis] as f64 - 0.5 } else { 0.5 } - eye_at[axis];
            let end = (eye_at[1 - axis] + (t - eye_at)[1 - axis] / off * last).floor() + 0.5;
            let steepness = (end - eye_at[1 - axis]) / last;
            let reach = radius / (1.0 + steepness * steepness).sqrt();
            let towards = if of == Extremum::Least { -off.signum() } else { off.signum() };
            let (mut z, mut steps) = (f64::from(depths[k]), 0.0);
            loop {
                steps += 1.0;
                let along = off + towards * steps;
                let across = eye_at[1 - axis] + along * steepness;
                let mut s = DVec2::ZERO;
                (s[axis], s[1 - axis]) = (eye_at[axis] + along, across.floor() + 0.5);
                let texel = s.floor();
                let is_there = texel.cmpge(DVec2::ZERO).all()
                    && texel.cmplt(DVec2::new(width as f64, height as f64)).all();
                if steps > reach + 1e-9 || along * off.signum() <= 0.5 || !is_there {
                    return z as f32;
                }
                let z_s = f64::from(depths[texel.y as usize * width + texel.x as usize]);
                z = of.of(z, metric(t) / metric(s) * (z_s - eye.z) + eye.z);
            }
        };
        (0..grid.len()).map(one).collect()
    }

    #[test]
    fn lines_through_the_epipole_are_equation_3() {
        let grid = grid([37, 29]);
        let all = depths(&grid);
        // In the map, on its rim, beside it and far away; before what casts shadows, and behind some of it.
        let eyes = [
            (17.3, 11.8, 0.5),
            (0.5, 3.1, 2.4),
            (-8.0, 40.0, 0.0),
            (60.0, 12.0, 1.0),
            (900.0, -2000.0, -3.0),
        ];
        for (x, y, z) in eyes {
            let eye = DVec2::new(x, y) / grid.density() + grid.extent.min;
            for radius in [0.0, 1.0, 6.4, 500.0] {
                for of in [Extremum::Least, Extremum::Largest] {
                    let lines = Lines::new(&grid, eye.extend(z), Radius::Texels(radius));
                    let mut found = all.clone();
                    lines.filter(&mut found, of);
                    let expected = by_hand(&grid, eye.extend(z), radius, &all, of);
                    for (texel, (found, expected)) in found.iter().zip(&expected).enumerate() {
                        let is_close = found == expected || (found - expected).abs() <= 1e-5 * expected.abs();
                        assert!(is_close, "({x}, {y}), {radius}, {of:?}, {texel}: {found}, not {expected}");
                    }
                }
            }
        }
    }

    #[test]
    fn every_texel_has_a_line_of_its_own_and_only_one() {
        for (size, x, y) in [([20, 31], 7.2, 30.9), ([33, 8], -3.0, -100.0), ([16, 16], 8.0, 8.0)] {
            let grid = grid(size);
            let eye = DVec2::new(x, y) / grid.density() + grid.extent.min;
            let lines = Lines::new(&grid, eye.extend(0.0), Radius::Texels(3.0));
            let mut owners = vec![0; grid.len()];
            for line in Fan::ALL.into_iter().flat_map(|fan| lines.of_fan(fan)) {
                lines.places(line).filter(|place| place.is_own).for_each(|place| owners[place.texel] += 1);
            }
            for (texel, owners) in owners.into_iter().enumerate() {
                let centre = DVec2::new((texel % size[0]) as f64 + 0.5, (texel / size[0]) as f64 + 0.5);
                let is_beside = (centre - DVec2::new(x, y)).abs().max_element() <= 0.5 + 1e-9;
                assert!(owners == 1 || is_beside && owners == 0, "{size:?}, {centre}: {owners}");
            }
        }
    }
}
