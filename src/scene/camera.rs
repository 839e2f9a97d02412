use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};

use super::lens::{FittedLens, Lens};
use crate::{Error, Result};

/// A half-line in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts, in metres.
    pub origin: DVec3,
    /// Where it goes; of unit length.
    pub direction: DVec3,
}

impl Ray {
    /// The point at distance `t` metres.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }
}

/// Which side of the picture the field of view is measured along.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FovAxis {
    /// The width.
    X,
    /// The height, as in glTF.
    #[default]
    Y,
}

/// A camera; looks along −Z of its own space, +Y up.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    world_from_camera: DAffine3,
    camera_from_world: DAffine3,
    size: [usize; 2],
    optics: Optics,
}

/// What makes the picture of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Optics {
    /// A hole before the middle of a picture of square pixels, by half the width and half the height of the image plane at
    /// distance 1.
    Pinhole(DVec2),
    Lens(FittedLens),
}

impl Camera {
    /// The largest picture, in pixels a side.
    pub const MAX_SIZE: usize = 16384;

    /// A camera at `world_from_camera` (scale is ignored) with field of view `fov` in degrees
    /// along `fov_axis` and a picture of `size` pixels, width first.
    ///
    /// Errors: [`Error::Value`] when the transform is singular, `fov` is not inside (0, 180) or a side is
    /// not in 1..=16384.
    pub fn new(world_from_camera: DAffine3, fov: f64, fov_axis: FovAxis, size: [usize; 2]) -> Result<Self> {
        if !(fov > 0.0 && fov < 180.0) {
            return Err(Error::value("fov", fov, "between 0 and 180 degrees"));
        }
        check_size(size)?;
        let world_from_camera = without_scale(world_from_camera)?;
        let (width, height) = (size[0] as f64, size[1] as f64);
        let tangent = (0.5 * fov.to_radians()).tan();
        let half_extent = match fov_axis {
            FovAxis::X => DVec2::new(tangent, tangent * height / width),
            FovAxis::Y => DVec2::new(tangent * width / height, tangent),
        };
        Ok(Self::at(world_from_camera, size, Optics::Pinhole(half_extent)))
    }

    /// A camera at `world_from_camera` (scale is ignored) with a lens before a picture of `size` pixels, width first.
    ///
    /// Errors: [`Error::Value`] when the transform is singular, a side is not in 1..=16384, a number of the lens is not finite or
    /// out of range, or the lens shows a pixel no direction of its own.
    pub fn with_lens(world_from_camera: DAffine3, lens: Lens, size: [usize; 2]) -> Result<Self> {
        check_size(size)?;
        let world_from_camera = without_scale(world_from_camera)?;
        let fitted = FittedLens::new(lens, size)?;
        let half = 0.5 * DVec2::new(size[0] as f64, size[1] as f64);
        let [across, down] = lens.focal_length;
        let is_pinhole = lens.is_straight() && across == down && lens.principal_point == half.to_array();
        let optics = if is_pinhole { Optics::Pinhole(half / across) } else { Optics::Lens(fitted) };
        Ok(Self::at(world_from_camera, size, optics))
    }

    fn at(world_from_camera: DAffine3, size: [usize; 2], optics: Optics) -> Self {
        Self { world_from_camera, camera_from_world: world_from_camera.inverse(), size, optics }
    }

    /// The same camera moved in the world, with a picture of another size.
    ///
    /// Errors: [`Error::Value`] for a size that is not allowed, or a singular move.
    pub fn moved(&self, world_from_world: DAffine3, size: [usize; 2]) -> Result<Self> {
        let world_from_camera = world_from_world * self.world_from_camera;
        match &self.optics {
            Optics::Pinhole(half_extent) => {
                let fov = 2.0 * half_extent.y.atan().to_degrees();
                Self::new(world_from_camera, fov, FovAxis::Y, size)
            }
            Optics::Lens(fitted) => {
                let scale = [0, 1].map(|axis| size[axis] as f64 / self.size[axis] as f64);
                Self::with_lens(world_from_camera, fitted.lens().scaled(scale), size)
            }
        }
    }

    /// The camera a `share` of the way to another: along a straight line, turned about one axis, its field of view (or all numbers of its
    /// lens) blended.
    ///
    /// Errors: [`Error::Value`] for a picture of another size and a lens of another projection; those of [`Self::with_lens`].
    pub fn between(&self, to: &Self, share: f64) -> Result<Self> {
        if self == to {
            return Ok(self.clone());
        }
        if self.size != to.size {
            return Err(Error::value("size", format!("{:?}", to.size), "that of the key before it"));
        }
        let [from, onto] = [self, to].map(|camera| camera.world_from_camera);
        let [a, b] = [from, onto].map(|transform| DQuat::from_mat3(&transform.matrix3));
        let world_from_camera = DAffine3 {
            matrix3: DMat3::from_quat(a.slerp(b, share)),
            translation: from.translation.lerp(onto.translation, share),
        };
        if let [Optics::Pinhole(a), Optics::Pinhole(b)] = [self.optics, to.optics] {
            let [a, b] = [a, b].map(|half_extent| 2.0 * half_extent.y.atan().to_degrees());
            return Self::new(world_from_camera, a + share * (b - a), FovAxis::Y, self.size);
        }
        let lens = self.lens().between(&to.lens(), share);
        let lens = lens.ok_or_else(|| {
            let expected = "a lens of the same kind as at the key before it: both fisheyes, or none of them";
            Error::value("lens", "a lens of another projection", expected)
        });
        Self::with_lens(world_from_camera, lens?, self.size)
    }

    /// Its lens; of a pinhole the one that shows the same.
    fn lens(&self) -> Lens {
        match &self.optics {
            Optics::Lens(fitted) => *fitted.lens(),
            Optics::Pinhole(half_extent) => {
                let half = self.size.map(|side| 0.5 * side as f64);
                Lens::new([half[1] / half_extent.y; 2], half)
            }
        }
    }

    /// Width and height of the picture in pixels.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The eye, in world space.
    pub fn position(&self) -> DVec3 {
        self.world_from_camera.translation
    }

    /// The direction straight ahead, in world space.
    pub fn ahead(&self) -> DVec3 {
        self.world_from_camera.transform_vector3(DVec3::NEG_Z)
    }

    /// The view ray through the point (x, y) of the picture, in pixels.
    pub fn ray(&self, x: f64, y: f64) -> Ray {
        let towards = match &self.optics {
            Optics::Pinhole(half_extent) => {
                let ndc =
                    DVec2::new(2.0 * x / self.size[0] as f64 - 1.0, 1.0 - 2.0 * y / self.size[1] as f64);
                (ndc * *half_extent).extend(-1.0)
            }
            Optics::Lens(fitted) => fitted.direction(DVec2::new(x, y)),
        };
        Ray {
            origin: self.position(),
            direction: self.world_from_camera.transform_vector3(towards).normalize(),
        }
    }

    /// The view ray through the centre of a pixel.
    pub fn pixel_ray(&self, x: usize, y: usize) -> Ray {
        self.ray(x as f64 + 0.5, y as f64 + 0.5)
    }

    /// The angle between the ray through a pixel and that through its next neighbour, in radians: the smaller one of both directions.
    pub fn pixel_angle(&self, x: usize, y: usize) -> f64 {
        let at = self.pixel_ray(x, y).direction;
        let to = |x: usize, y: usize| (self.pixel_ray(x, y).direction - at).length();
        to(x + 1, y).min(to(x, y + 1))
    }

    /// A world-space point in homogeneous coordinates of the picture: x and y from −1 to 1, y upwards, and z = `near` w⁻¹ from 0
    /// far away to 1 at `near` metres, each times w. None where the lens bends straight lines, which no such coordinates can.
    pub fn clip_from_world(&self, point: DVec3, near: f64) -> Option<[f64; 4]> {
        let p = self.camera_from_world.transform_point3(point);
        match &self.optics {
            Optics::Pinhole(half_extent) => Some([p.x / half_extent.x, p.y / half_extent.y, near, -p.z]),
            Optics::Lens(fitted) if fitted.lens().is_straight() => {
                let Lens { focal_length, principal_point, .. } = fitted.lens();
                let [x, y] = [p.x, -p.y];
                let pixel = [
                    x * focal_length[0] - p.z * principal_point[0],
                    y * focal_length[1] - p.z * principal_point[1],
                ];
                let [across, down] = [0, 1].map(|axis| 2.0 * pixel[axis] / self.size[axis] as f64 + p.z);
                Some([across, -down, near, -p.z])
            }
            Optics::Lens(_) => None,
        }
    }

    /// The most pixels of the picture that something spans whose angular size has this tangent: towards the rim things appear
    /// larger.
    pub fn pixels_across(&self, tangent: f64) -> f64 {
        match &self.optics {
            Optics::Pinhole(half_extent) => {
                let side = |axis: usize| 0.5 * self.size[axis] as f64 / half_extent[axis];
                let rim = 1.0 + half_extent.length_squared();
                tangent * side(0).max(side(1)) * rim
            }
            Optics::Lens(fitted) => tangent * fitted.magnification(),
        }
    }

    /// Where a world-space point appears in the picture, in pixels; none when it is not before the camera, or farther from the axis of
    /// its lens than all of the picture.
    pub fn project(&self, point: DVec3) -> Option<DVec2> {
        let p = self.camera_from_world.transform_point3(point);
        let half_extent = match &self.optics {
            Optics::Pinhole(half_extent) => *half_extent,
            Optics::Lens(fitted) => return fitted.pixel(p),
        };
        if p.z >= 0.0 {
            return None;
        }
        let ndc = DVec2::new(p.x, p.y) / -p.z / half_extent;
        Some(DVec2::new((ndc.x + 1.0) * 0.5 * self.size[0] as f64, (1.0 - ndc.y) * 0.5 * self.size[1] as f64))
    }
}

fn check_size(size: [usize; 2]) -> Result<()> {
    if size.iter().any(|&side| side == 0 || side > Camera::MAX_SIZE) {
        return Err(Error::value("size", format!("{size:?}"), "two whole numbers from 1 to 16384"));
    }
    Ok(())
}

/// The transform of a camera at `origin` that looks at `target` with `up` upwards in its picture.
///
/// Errors: [`Error::Value`] when the two points coincide or `up` is parallel to the view.
pub fn look_at(origin: DVec3, target: DVec3, up: DVec3) -> Result<DAffine3> {
    let forward = (target - origin).try_normalize();
    let right = forward.and_then(|forward| forward.cross(up).try_normalize());
    let (Some(forward), Some(right)) = (forward, right) else {
        let got = format!("origin {origin}, target {target}, up {up}");
        return Err(Error::value(
            "look_at",
            got,
            "two different points and an up that is not along the view",
        ));
    };
    let rotation = DMat3::from_cols(right, right.cross(forward), -forward);
    Ok(DAffine3 { matrix3: rotation, translation: origin })
}

/// The rigid part of a transform: its rotation and translation.
fn without_scale(transform: DAffine3) -> Result<DAffine3> {
    let m = transform.matrix3;
    let determinant = m.determinant();
    let volume = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    if !(transform.is_finite() && determinant.abs() > 1e-9 * volume && volume > 0.0) {
        return Err(Error::value("to_world", "a singular transform", "invertible, with finite numbers"));
    }
    let x = m.x_axis.normalize();
    let y = (m.y_axis - x * x.dot(m.y_axis)).normalize();
    let z = x.cross(y) * determinant.signum();
    Ok(DAffine3 { matrix3: DMat3::from_cols(x, y, z), translation: transform.translation })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Projection;

    #[test]
    fn a_ray_through_a_pixel_projects_back_onto_it() -> Result<()> {
        let eye = look_at(DVec3::new(3.0, 2.0, 5.0), DVec3::ZERO, DVec3::Y)?;
        let camera = Camera::new(eye, 50.0, FovAxis::X, [640, 360])?;
        for (x, y) in [(0.0, 0.0), (320.0, 180.0), (17.5, 300.25)] {
            let seen = camera.project(camera.ray(x, y).at(7.0)).unwrap_or_default();
            assert!((seen - DVec2::new(x, y)).length() < 1e-9);
        }
        assert!(camera.project(camera.ray(1.0, 1.0).at(-1.0)).is_none());
        Ok(())
    }

    fn bent() -> Lens {
        Lens {
            radial: [-0.12, 0.03, 0.0, 0.0],
            tangential: [0.002, -0.001],
            ..Lens::new([500.0, 480.0], [300.0, 200.0])
        }
    }

    #[test]
    fn a_ray_through_any_lens_projects_back_onto_its_pixel() -> Result<()> {
        let eye = look_at(DVec3::new(3.0, 2.0, 5.0), DVec3::ZERO, DVec3::Y)?;
        let fisheye = Lens { projection: Projection::Equidistant, tangential: [0.0; 2], ..bent() };
        for lens in [bent(), fisheye, Lens::new([500.0, 480.0], [300.0, 200.0])] {
            let camera = Camera::with_lens(eye, lens, [640, 360])?;
            for (x, y) in [(0.5, 0.5), (300.0, 200.0), (17.5, 300.25), (639.5, 359.5)] {
                let seen = camera.project(camera.ray(x, y).at(7.0)).unwrap_or_default();
                assert!((seen - DVec2::new(x, y)).length() < 1e-9, "{seen}");
            }
        }
        Ok(())
    }

    #[test]
    fn a_lens_before_the_middle_of_square_pixels_is_a_pinhole() -> Result<()> {
        let camera =
            Camera::with_lens(DAffine3::IDENTITY, Lens::new([500.0; 2], [320.0, 240.0]), [640, 480])?;
        let pinhole =
            Camera::new(DAffine3::IDENTITY, 2.0 * 0.48f64.atan().to_degrees(), FovAxis::Y, [640, 480])?;
        assert!(matches!(camera.optics, Optics::Pinhole(_)));
        let apart = camera.pixel_ray(3, 5).direction - pinhole.pixel_ray(3, 5).direction;
        assert!(apart.length() < 1e-14);
        // A pixel to the side it is the same picture, moved.
        let aside = Camera::with_lens(DAffine3::IDENTITY, Lens::new([500.0; 2], [321.0, 238.0]), [640, 480])?;
        let apart = camera.pixel_ray(3, 5).direction - aside.pixel_ray(4, 3).direction;
        assert!(apart.length() < 1e-14 && matches!(aside.optics, Optics::Lens(_)));
        Ok(())
    }

    #[test]
    fn a_smaller_picture_of_a_lens_shows_the_same() -> Result<()> {
        let camera = Camera::with_lens(DAffine3::IDENTITY, bent(), [640, 360])?;
        let small = camera.moved(DAffine3::IDENTITY, [160, 90])?;
        for (x, y) in [(4.0, 4.0), (320.0, 180.0), (600.0, 40.0)] {
            let [whole, small] = [camera.ray(x, y), small.ray(0.25 * x, 0.25 * y)];
            assert!((whole.direction - small.direction).length() < 1e-12);
        }
        Ok(())
    }

    #[test]
    fn homogeneous_coordinates_are_those_of_the_pixels_where_lines_are_straight() -> Result<()> {
        let eye = look_at(DVec3::new(3.0, 2.0, 5.0), DVec3::ZERO, DVec3::Y)?;
        let straight = Camera::with_lens(eye, Lens::new([500.0, 480.0], [300.0, 200.0]), [640, 360])?;
        for camera in [straight, Camera::new(eye, 50.0, FovAxis::X, [640, 360])?] {
            let point = DVec3::new(0.3, -0.2, 0.1);
            let [x, y, _, w] = camera.clip_from_world(point, 0.1).unwrap_or_default();
            let pixel = DVec2::new((x / w + 1.0) * 320.0, (1.0 - y / w) * 180.0);
            assert!((pixel - camera.project(point).unwrap_or_default()).length() < 1e-9, "{pixel}");
        }
        let camera = Camera::with_lens(eye, bent(), [640, 360])?;
        assert_eq!(camera.clip_from_world(DVec3::ZERO, 0.1), None);
        Ok(())
    }

    #[test]
    fn a_camera_moves_straight_and_turns_about_one_axis() -> Result<()> {
        let eye = |origin: DVec3, angle: f64| DAffine3 {
            matrix3: DMat3::from_rotation_y(angle),
            translation: origin,
        };
        let (a, b) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(5.0, 2.0, -1.0));
        let from = Camera::new(eye(a, 0.2), 40.0, FovAxis::Y, [64, 48])?;
        let to = Camera::new(eye(b, 1.4), 60.0, FovAxis::Y, [64, 48])?;
        let quarter = from.between(&to, 0.25)?;
        let expected = Camera::new(eye(DVec3::new(2.0, 2.0, 2.0), 0.5), 45.0, FovAxis::Y, [64, 48])?;
        let apart = |one: &Camera, other: &Camera| {
            let [one, other] = [one, other].map(|camera| camera.pixel_ray(3, 5));
            (one.direction - other.direction).length() + one.origin.distance(other.origin)
        };
        assert!(apart(&quarter, &expected) < 1e-14, "{}", apart(&quarter, &expected));
        assert!(apart(&from.between(&to, 0.26)?, &expected) > 1e-3);
        assert_eq!(from.between(&from, 0.3)?, from, "what does not move stays, to the bit");
        // A pinhole becomes a lens by its focal length.
        let bent = Camera::with_lens(eye(a, 0.2), bent(), [64, 48])?;
        let middle = from.between(&bent, 0.5)?.lens();
        assert!((middle.focal_length[0] - 0.5 * (24.0 / 20f64.to_radians().tan() + 500.0)).abs() < 1e-9);
        assert_eq!(middle.radial[0], -0.06);
        let fisheye = Lens { projection: Projection::Equidistant, ..Lens::new([60.0; 2], [32.0, 24.0]) };
        assert!(from.between(&Camera::with_lens(eye(a, 0.2), fisheye, [64, 48])?, 0.5).is_err());
        let large = Camera::new(eye(a, 0.2), 40.0, FovAxis::Y, [128, 96])?;
        assert!(from.between(&large, 0.5).is_err());
        Ok(())
    }

    #[test]
    fn scale_is_ignored_and_singular_transforms_are_refused() -> Result<()> {
        let scaled = DAffine3::from_scale(DVec3::new(2.0, 3.0, 4.0));
        let camera = Camera::new(scaled, 60.0, FovAxis::Y, [4, 4])?;
        assert!((camera.ray(2.0, 2.0).direction + DVec3::Z).length() < 1e-12);
        assert!(Camera::new(DAffine3::from_scale(DVec3::ZERO), 60.0, FovAxis::Y, [4, 4]).is_err());
        assert!(Camera::new(DAffine3::IDENTITY, f64::NAN, FovAxis::Y, [4, 4]).is_err());
        assert!(Camera::new(DAffine3::IDENTITY, 60.0, FovAxis::Y, [0, 4]).is_err());
        Ok(())
    }
}
