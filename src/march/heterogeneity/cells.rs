//! The pieces of a ray between the planes of several lattices.

use glam::DVec3;

/// A lattice of planes across the axes, as a ray meets them: one at each whole number.
#[derive(Debug, Clone, Copy)]
pub(super) struct Planes {
    origin: DVec3,
    slope: DVec3,
    /// The last plane on each axis, the first being 0; none where they go on for ever.
    last: Option<DVec3>,
}

/// The next plane of one axis.
struct Crossing {
    at: f64,
    plane: f64,
    step: f64,
    origin: f64,
    slope: f64,
    last: f64,
}

impl Planes {
    /// Those of a ray that begins at `origin` and moves by `slope` a metre, in cells.
    pub(super) fn new(origin: DVec3, slope: DVec3, last: Option<DVec3>) -> Self {
        Self { origin, slope, last }
    }

    /// The first planes behind the beginning of the ray.
    fn first(&self) -> impl Iterator<Item = Crossing> + '_ {
        (0..3).filter(|&axis| self.slope[axis] != 0.0).map(|axis| {
            let (origin, slope) = (self.origin[axis], self.slope[axis]);
            let last = self.last.map_or(f64::INFINITY, |last| last[axis]);
            let first = self.last.map_or(f64::NEG_INFINITY, |_| 0.0);
            let plane = match slope > 0.0 {
                true => (origin.floor() + 1.0).max(first),
                false => (origin.ceil() - 1.0).min(last),
            };
            let end = if slope > 0.0 { last } else { first };
            let mut crossing = Crossing { at: 0.0, plane, step: slope.signum(), origin, slope, last: end };
            crossing.place();
            crossing
        })
    }
}

impl Crossing {
    fn place(&mut self) {
        let is_beyond = (self.plane - self.last) * self.step > 0.0;
        self.at = if is_beyond { f64::INFINITY } else { (self.plane - self.origin) / self.slope };
    }

    fn next(&mut self) {
        self.plane += self.step;
        self.place();
    }
}

/// Visits the pieces of [0, length] between all planes, in order. Each crossing is computed from its own plane.
pub(super) fn pieces(lattices: &[Planes], length: f64, mut visit: impl FnMut(f64, f64)) {
    let mut crossings: Vec<Crossing> = lattices.iter().flat_map(Planes::first).collect();
    let mut from = 0.0;
    loop {
        let next = crossings.iter_mut().min_by(|a, b| a.at.total_cmp(&b.at));
        let to = next.as_ref().map_or(f64::INFINITY, |crossing| crossing.at).min(length);
        if to > from {
            visit(from, to);
            from = to;
        }
        match next {
            Some(crossing) if to < length => crossing.next(),
            _ => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_end_at_every_plane() {
        let endless = Planes::new(DVec3::new(0.25, 0.5, 0.0), DVec3::new(1.0, -0.5, 0.0), None);
        let few =
            Planes::new(DVec3::new(-1.5, 0.0, 9.0), DVec3::new(2.0, 0.0, -1.0), Some(DVec3::splat(2.0)));
        let mut ends = Vec::new();
        let mut reached = 0.0;
        pieces(&[endless, few], 8.0, |from, to| {
            assert_eq!(from, reached);
            reached = to;
            ends.push(to);
        });
        let expected = [0.75, 1.0, 1.25, 1.75, 2.75, 3.0, 3.75, 4.75, 5.0, 5.75, 6.75, 7.0, 7.75, 8.0];
        assert_eq!(ends, expected);
    }
}
