use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use super::{Rgb, mixed};
use crate::{Error, Result};

/// Directions nearer than this to being opposite have no one great circle through them, in radians.
const OPPOSITE: f64 = 1e-6;

/// A sun: parallel light, the same from infinity everywhere.
#[derive(Debug, Clone, PartialEq)]
pub struct DirectionalLight {
    /// Where the light goes (not where it comes from); of unit length.
    pub direction: DVec3,
    /// Radiance of the light before any gobo: the constant that a light map starts from.
    pub radiance: Rgb,
}

impl DirectionalLight {
    /// Errors: [`Error::Value`] for a zero or not finite direction, or a negative or not finite radiance.
    pub fn new(direction: DVec3, radiance: Rgb) -> Result<Self> {
        let unit = direction
            .try_normalize()
            .filter(|unit| unit.is_finite())
            .ok_or_else(|| Error::value("direction", direction, "a finite direction that is not zero"))?;
        if !radiance.iter().all(|&c| c.is_finite() && c >= 0.0) {
            return Err(Error::value("radiance", format!("{radiance:?}"), "finite and not negative"));
        }
        Ok(Self { direction: unit, radiance })
    }

    /// The light a `share` of the way to another: along the great circle, as far in the same time; its radiance is blended.
    ///
    /// Errors: [`Error::Value`] for one from the opposite side, to which many ways lead.
    pub fn between(&self, to: &Self, share: f64) -> Result<Self> {
        let radiance = mixed(&self.radiance, &to.radiance, share);
        let (a, b) = (self.direction, to.direction);
        let sine = a.cross(b).length();
        let angle = sine.atan2(a.dot(b));
        if PI - angle < OPPOSITE {
            let expected = "less than half a turn from that of the key before it; put a key between the two";
            return Err(Error::value("direction", b, expected));
        }
        let direction = match sine == 0.0 {
            true => a,
            false => (((1.0 - share) * angle).sin() * a + (share * angle).sin() * b).normalize(),
        };
        Ok(Self { direction, radiance })
    }

    /// The frame in which light maps and shadow maps of this light lie.
    pub fn frame(&self) -> LightFrame {
        LightFrame::along(self.direction)
    }
}

/// An orthonormal frame (u, v, w) along a directional light.
///
/// w goes where the light goes; looking along it, u is right and v is down, so that a map with its
/// row 0 at the least v is seen upright from the sun. Depth along w is the depth of shadow maps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightFrame {
    light_from_world: DMat3,
}

impl LightFrame {
    /// The frame along a unit `direction`. World +Y is up in it, or −Z where the light is vertical.
    pub fn along(direction: DVec3) -> Self {
        let up = if direction.y.abs() > 0.999 { DVec3::NEG_Z } else { DVec3::Y };
        let u = direction.cross(up).normalize();
        let v = direction.cross(u);
        Self { light_from_world: DMat3::from_cols(u, v, direction).transpose() }
    }

    /// (u, v, w) of a world-space point or direction, in metres.
    pub fn light_from_world(&self, vector: DVec3) -> DVec3 {
        self.light_from_world * vector
    }

    /// The world-space point or direction at (u, v, w).
    pub fn world_from_light(&self, vector: DVec3) -> DVec3 {
        self.light_from_world.transpose() * vector
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_is_right_handed_with_down_as_its_second_axis() {
        for direction in [DVec3::new(1.0, -2.0, 0.5), DVec3::NEG_Y, DVec3::Y, DVec3::X, DVec3::NEG_Z] {
            let frame = LightFrame::along(direction.normalize());
            let axis = |v: DVec3| frame.world_from_light(v);
            assert!((axis(DVec3::X).cross(axis(DVec3::Y)) - axis(DVec3::Z)).length() < 1e-12);
            assert!((axis(DVec3::Z) - direction.normalize()).length() < 1e-12);
            assert!(axis(DVec3::Y).y <= 1e-12, "v goes down for {direction}");
            let p = DVec3::new(0.3, -4.0, 2.0);
            assert!((frame.world_from_light(frame.light_from_world(p)) - p).length() < 1e-12);
        }
    }

    #[test]
    fn a_light_turns_along_the_great_circle_as_far_in_the_same_time() -> Result<()> {
        let [east, up] = [DVec3::X, DVec3::new(0.0, 3.0, 0.0)];
        let [from, to] =
            [DirectionalLight::new(east, [0.0, 1.0, 2.0])?, DirectionalLight::new(up, [4.0, 1.0, 0.0])?];
        for share in [0.0, 0.25, 0.5, 0.9, 1.0] {
            let light = from.between(&to, share)?;
            let (sine, cosine) = (share * 0.5 * PI).sin_cos();
            assert!((light.direction - DVec3::new(cosine, sine, 0.0)).length() < 1e-15, "{share}");
            let expected = [4.0 * share, 1.0, 2.0 - 2.0 * share];
            assert_eq!(light.radiance, expected.map(|value| value as f32));
        }
        let halfway = from.between(&to, 0.5)?.direction;
        assert!(
            (halfway - (0.75 * east + 0.25 * DVec3::Y).normalize()).length() > 0.1,
            "another way is noticed"
        );
        assert_eq!(from.between(&from, 0.3)?, from, "what does not move stays, to the bit");
        let opposite = DirectionalLight::new(-east, [1.0; 3])?;
        assert!(from.between(&opposite, 0.5).is_err());
        Ok(())
    }

    #[test]
    fn lights_without_direction_are_refused() {
        assert!(DirectionalLight::new(DVec3::ZERO, [1.0; 3]).is_err());
        assert!(DirectionalLight::new(DVec3::new(f64::NAN, 0.0, 1.0), [1.0; 3]).is_err());
        assert!(DirectionalLight::new(DVec3::X, [-1.0, 0.0, 0.0]).is_err());
    }
}
