use glam::DVec3;

use crate::scene::{LightFrame, Medium, Ray};

/// A view ray in the frame of the light, up to the first surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewRay {
    /// The eye, (u, v, w) in metres.
    pub origin: DVec3,
    /// Direction in the frame of the light; of unit length.
    pub direction: DVec3,
    /// Distance to the first solid surface in metres; infinite where there is none.
    pub length: f64,
    /// Scattering factor ρ f(θ) a channel, constant along the ray because the light is parallel.
    pub scattering: [f64; 3],
}

impl ViewRay {
    /// The ray in the frame of a light whose light travels along the frame's third axis. `length` is in metres up to
    /// the first surface, infinite where there is none.
    pub fn new(ray: &Ray, length: f64, frame: &LightFrame, medium: &Medium) -> Self {
        let direction = frame.light_from_world(ray.direction);
        // Light that travels along +w leaves towards the eye, against the view ray.
        let phase = medium.phase(-direction.z);
        Self {
            origin: frame.light_from_world(ray.origin),
            direction,
            length,
            scattering: medium.albedo.map(|albedo| albedo * phase),
        }
    }
}
