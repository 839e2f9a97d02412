//! Polygons as triangles.

use glam::{DVec2, DVec3};

/// Corners of a polygon that is not convex. The time that such a one takes grows with their square.
pub(super) const MAX_CORNERS: usize = 1 << 14;

/// A polygon that is not convex has more corners than [`MAX_CORNERS`].
#[derive(Debug, PartialEq)]
pub(super) struct TooManyCorners;

/// Cuts a polygon into triangles, each three of its corners in their order; none where it has no area.
///
/// The outline may touch itself, as that of a wall does which runs to a window and back. A polygon that is
/// not plane is cut as it looks from along its mean normal, one that has none into a fan. Neighbouring
/// corners lie apart.
pub(super) fn triangles(corners: &[DVec3]) -> Result<Vec<[usize; 3]>, TooManyCorners> {
    let fan = (2..corners.len()).map(|last| [0, last - 1, last]);
    let Some(flat) = flat(corners) else {
        let has_area = |t: &[usize; 3]| {
            let [a, b, c] = t.map(|corner| corners[corner]);
            (b - a).cross(c - a) != DVec3::ZERO
        };
        return Ok(fan.filter(has_area).collect());
    };
    if is_convex(&flat) {
        return Ok(fan.collect());
    }
    if flat.len() > MAX_CORNERS {
        return Err(TooManyCorners);
    }
    Ok(Outline::new(&flat).ears())
}

/// The corners in a plane, counter-clockwise; none where the mean normal (Newell's) is zero.
///
/// One coordinate is left out and the others stay as they are, so that what is in line remains so.
fn flat(corners: &[DVec3]) -> Option<Vec<DVec2>> {
    let first = *corners.first()?;
    let apart = corners.iter().map(|&corner| corner - first);
    let ahead = apart.clone().cycle().skip(1);
    let normal: DVec3 = apart.clone().zip(ahead).map(|(a, b)| a.cross(b)).sum();
    if normal == DVec3::ZERO {
        return None;
    }
    let along = normal.abs().max_position();
    let (right, up) = ((along + 1) % 3, (along + 2) % 3);
    let (right, up) = if normal[along] > 0.0 { (right, up) } else { (up, right) };
    Some(apart.map(|corner| DVec2::new(corner[right], corner[up])).collect())
}

/// Twice the area of a triangle, positive where it turns left.
fn turn([a, b, c]: [DVec2; 3]) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Whether a fan from the first corner does it, without a triangle that has no area.
fn is_convex(flat: &[DVec2]) -> bool {
    let n = flat.len();
    let turns_left = |i: usize| turn([flat[i], flat[(i + 1) % n], flat[(i + 2) % n]]) >= 0.0;
    (2..n).all(|last| turn([flat[0], flat[last - 1], flat[last]]) > 0.0) && (0..n).all(turns_left)
}

/// What is left of a polygon while ears are cut off.
struct Outline<'a> {
    flat: &'a [DVec2],
    before: Vec<usize>,
    after: Vec<usize>,
    /// The corners that do not turn left, ordered by x. Others can only be in an ear together with one of
    /// these.
    reflex: Vec<usize>,
}

impl<'a> Outline<'a> {
    fn new(flat: &'a [DVec2]) -> Self {
        let n = flat.len();
        let before = (0..n).map(|corner| (corner + n - 1) % n).collect();
        let after = (0..n).map(|corner| (corner + 1) % n).collect();
        let mut outline = Self { flat, before, after, reflex: Vec::new() };
        outline.reflex = (0..n).filter(|&corner| outline.turn_at(corner) <= 0.0).collect();
        outline.reflex.sort_by(|&a, &b| flat[a].x.total_cmp(&flat[b].x));
        outline
    }

    fn triangle_at(&self, tip: usize) -> [usize; 3] {
        [self.before[tip], tip, self.after[tip]]
    }

    fn turn_at(&self, tip: usize) -> f64 {
        turn(self.triangle_at(tip).map(|corner| self.flat[corner]))
    }

    fn ears(mut self) -> Vec<[usize; 3]> {
        let mut left = self.flat.len();
        let mut triangles = Vec::with_capacity(left - 2);
        let mut is_ear: Vec<bool> = (0..left).map(|tip| self.is_ear(tip)).collect();
        let (mut tip, mut passed) = (1, 0);
        while left > 2 {
            if left > 3 && !is_ear[tip] && passed < left {
                (tip, passed) = (self.after[tip], passed + 1);
                continue;
            }
            if passed == left {
                tip = self.way_out(tip, left);
            }
            if self.turn_at(tip) > 0.0 {
                triangles.push(self.triangle_at(tip));
            }
            let [before, _, after] = self.triangle_at(tip);
            (self.after[before], self.before[after]) = (after, before);
            self.reflex.retain(|&corner| corner != tip);
            for corner in [before, after] {
                if self.turn_at(corner) > 0.0 {
                    self.reflex.retain(|&other| other != corner);
                }
            }
            for corner in [before, after] {
                is_ear[corner] = self.is_ear(corner);
            }
            // Not the next one, which would make a fan of slivers.
            (tip, left, passed) = (self.after[after], left - 1, 0);
        }
        triangles
    }

    /// The corner to cut off where none is an ear, as the outline crosses itself: one in line with its
    /// neighbours, or else one that turns left.
    fn way_out(&self, tip: usize, left: usize) -> usize {
        let round = || std::iter::successors(Some(tip), |&corner| Some(self.after[corner])).take(left);
        let found = round().find(|&corner| self.turn_at(corner) == 0.0);
        found.or_else(|| round().find(|&corner| self.turn_at(corner) > 0.0)).unwrap_or(tip)
    }

    /// Whether the triangle at a corner is of the polygon, and holds nothing of the outline.
    fn is_ear(&self, tip: usize) -> bool {
        let ear = self.triangle_at(tip).map(|corner| self.flat[corner]);
        if turn(ear) <= 0.0 {
            return false;
        }
        let x = ear.map(|corner| corner.x);
        let (least, most) = (x.into_iter().fold(x[0], f64::min), x.into_iter().fold(x[0], f64::max));
        let from = self.reflex.partition_point(|&corner| self.flat[corner].x < least);
        let near = self.reflex[from..].iter().take_while(|&&corner| self.flat[corner].x <= most);
        !near.copied().any(|corner| self.is_in(corner, ear))
    }

    /// Whether a corner lies in a triangle or on its edge, or at its tip with a side into it. Where the
    /// outline touches itself, two corners lie at one place.
    fn is_in(&self, corner: usize, [a, b, c]: [DVec2; 3]) -> bool {
        let place = self.flat[corner];
        if place == b {
            let sides = [self.before[corner], self.after[corner]].map(|end| self.flat[end]);
            return sides.into_iter().any(|end| turn([a, b, end]) > 0.0 && turn([b, c, end]) > 0.0);
        }
        let edges = [[a, b], [b, c], [c, a]];
        place != a && place != c && edges.into_iter().all(|[from, to]| turn([from, to, place]) >= 0.0)
    }
}
