use glam::DVec2;

/// One straight piece of a stroke, in pixels; of length zero for a dab.
pub(super) struct Segment {
    pub(super) from: DVec2,
    pub(super) to: DVec2,
    inverse_squared_length: f64,
    /// The part of its radius that the stroke has at both ends, in between by the place.
    pressures: [f64; 2],
    /// The most that its distance changes a pixel: one over the least pressure.
    pub(super) steepest: f64,
}

impl Segment {
    pub(super) fn new([from, to]: [DVec2; 2], pressures: [f64; 2]) -> Self {
        let squared = from.distance_squared(to);
        Self {
            from,
            to,
            inverse_squared_length: if squared > 0.0 { squared.recip() } else { 0.0 },
            pressures,
            steepest: pressures[0].min(pressures[1]).recip(),
        }
    }

    /// The distance of the nearest place, where distances count more the less the pen was pressed there: the least over t of
    /// |p − q(t)| / π(t). A place is covered where that is less than the radius, as by a disc of radius π(t) r at every q(t).
    pub(super) fn squared_distance(&self, point: DVec2) -> f64 {
        let (along, behind) = (self.to - self.from, point - self.from);
        let [first, last] = self.pressures;
        if first == last {
            let t = (behind.dot(along) * self.inverse_squared_length).clamp(0.0, 1.0);
            return behind.distance_squared(along * t) / (first * first);
        }
        let at = |t: f64| behind.distance_squared(along * t) / (first + (last - first) * t).powi(2);
        // Where the derivative of the quotient is 0. It falls and rises again, so ends are nearest where that is not inside.
        let (slope, forward) = (last - first, behind.dot(along));
        let inside = (first * forward + slope * behind.length_squared())
            / (first * along.length_squared() + slope * forward);
        let ends = at(0.0).min(at(1.0));
        if inside > 0.0 && inside < 1.0 { ends.min(at(inside)) } else { ends }
    }
}
