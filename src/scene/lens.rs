//! Lenses of photographs: focal lengths in pixels, a principal point, and OpenCV's models of distortion.

use glam::{DMat2, DVec2, DVec3};

use crate::{Error, Result};

/// What undistorted directions are measured in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Projection {
    /// By the tangent of the angle to the axis, as a pinhole does.
    #[default]
    Perspective,
    /// By the angle to the axis in radians: a fisheye.
    Equidistant,
}

/// A lens as calibration finds it.
///
/// A direction first becomes a point u of a plane, x to the right and y downwards: |u| is the tangent of its angle to the axis, or
/// that angle in radians. With r = |u| the lens moves it to
///
/// ```text
/// x' = x (1 + k₁ r² + k₂ r⁴ + k₃ r⁶ + k₄ r⁸) + 2 p₁ x y + p₂ (r² + 2 x²)
/// y' = y (1 + k₁ r² + k₂ r⁴ + k₃ r⁶ + k₄ r⁸) + p₁ (r² + 2 y²) + 2 p₂ x y
/// ```
///
/// which appears at the pixel `principal_point` + `focal_length` · (x', y').
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// In pixels, along the width and along the height.
    pub focal_length: [f64; 2],
    /// Where the axis meets the picture, in pixels from its top left corner; the centre of the first pixel is (0.5, 0.5).
    pub principal_point: [f64; 2],
    /// What distances to the axis mean before distortion.
    pub projection: Projection,
    /// k₁ to k₄.
    pub radial: [f64; 4],
    /// p₁ and p₂.
    pub tangential: [f64; 2],
}

impl Lens {
    /// A lens without distortion.
    pub fn new(focal_length: [f64; 2], principal_point: [f64; 2]) -> Self {
        let projection = Projection::Perspective;
        Self { focal_length, principal_point, projection, radial: [0.0; 4], tangential: [0.0; 2] }
    }

    /// Whether straight lines appear straight.
    pub fn is_straight(&self) -> bool {
        self.projection == Projection::Perspective && self.is_undistorted()
    }

    fn is_undistorted(&self) -> bool {
        self.radial == [0.0; 4] && self.tangential == [0.0; 2]
    }

    /// The same lens before a picture whose sides are so many times as long.
    pub fn scaled(&self, [across, down]: [f64; 2]) -> Self {
        let by = |[x, y]: [f64; 2]| [x * across, y * down];
        Self { focal_length: by(self.focal_length), principal_point: by(self.principal_point), ..*self }
    }

    /// A lens a `share` of the way to another; none where the two project in different ways.
    pub(super) fn between(&self, to: &Self, share: f64) -> Option<Self> {
        fn blended<const N: usize>(from: [f64; N], to: [f64; N], share: f64) -> [f64; N] {
            std::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
        }
        (self.projection == to.projection).then(|| Self {
            focal_length: blended(self.focal_length, to.focal_length, share),
            principal_point: blended(self.principal_point, to.principal_point, share),
            projection: self.projection,
            radial: blended(self.radial, to.radial, share),
            tangential: blended(self.tangential, to.tangential, share),
        })
    }

    /// Where the lens moves a point of the plane to, and the derivative of that.
    fn distort(&self, u: DVec2) -> (DVec2, DMat2) {
        let [k1, k2, k3, k4] = self.radial;
        let [p1, p2] = self.tangential;
        let (DVec2 { x, y }, s) = (u, u.length_squared());
        let radial = 1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)));
        let slope = 2.0 * (k1 + s * (2.0 * k2 + s * (3.0 * k3 + s * 4.0 * k4)));
        let moved = u * radial
            + DVec2::new(
                2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
                p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
            );
        let mixed = x * y * slope + 2.0 * (p1 * x + p2 * y);
        let across = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x;
        let down = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
        (moved, DMat2::from_cols(DVec2::new(across, mixed), DVec2::new(mixed, down)))
    }

    /// The point that the lens moves to `target`, by Newton's method from `u`; none where it does not converge or comes to where
    /// the picture is folded over.
    fn undistort_from(&self, mut u: DVec2, target: DVec2) -> Option<DVec2> {
        for _ in 0..MOST_STEPS {
            let (moved, derivative) = self.distort(u);
            let miss = target - moved;
            // A determinant that is NaN is not positive either.
            let is_invertible = derivative.determinant() > 0.0;
            if !is_invertible {
                return None;
            }
            u += derivative.inverse() * miss;
            if miss.length() < CONVERGED {
                return Some(u);
            }
        }
        None
    }

    /// The same, found on the way from the axis, on which the derivative must be positive. The error is the last point that was
    /// reached.
    fn undistort_along(&self, target: DVec2) -> Result<DVec2, DVec2> {
        let mut u = DVec2::ZERO;
        for step in 1..=PIECES {
            let near = |next: &DVec2| next.distance(u) < 0.25 * (1.0 + u.length());
            let next = self.undistort_from(u, target * (f64::from(step) / f64::from(PIECES)));
            u = next.filter(near).ok_or(u)?;
        }
        Ok(u)
    }

    fn plane(&self, pixel: DVec2) -> DVec2 {
        (pixel - DVec2::from_array(self.principal_point)) / DVec2::from_array(self.focal_length)
    }
}

/// Steps of Newton's method at most.
const MOST_STEPS: usize = 24;
/// How near on the plane is there.
const CONVERGED: f64 = 1e-12;
/// Pieces of the way from the axis to a point of the picture.
const PIECES: u32 = 64;
/// Points along each side of a picture at which a lens is tried.
const TRIED: usize = 64;
/// Focal lengths and places of the axis at most, in pixels.
const FARTHEST: f64 = 1e7;

/// A lens before a picture over which it can be inverted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FittedLens {
    lens: Lens,
    /// The largest |u| of the picture.
    reach: f64,
    /// The most pixels a radian anywhere in the picture.
    magnification: f64,
}

impl FittedLens {
    /// Errors: [`Error::Value`] for lengths that are not above 0, numbers that are not finite, and a lens that is not invertible over
    /// a picture of `size`, with the first pixel of its rim that has no direction.
    pub(super) fn new(lens: Lens, size: [usize; 2]) -> Result<Self> {
        let Lens { focal_length, principal_point, .. } = lens;
        if !focal_length.iter().all(|&length| length > 0.0 && length <= FARTHEST) {
            let expected = "above 0 and at most 10000000 pixels";
            return Err(Error::value("focal_length", format!("{focal_length:?}"), expected));
        }
        if !principal_point.iter().all(|place| place.abs() <= FARTHEST) {
            let expected = "within 10000000 pixels of the picture";
            return Err(Error::value("principal_point", format!("{principal_point:?}"), expected));
        }
        let mut coefficients = lens.radial.iter().chain(&lens.tangential);
        if let Some(number) = coefficients.find(|number| !number.is_finite()) {
            return Err(Error::value("distortion", number, "finite numbers"));
        }
        let widest = match lens.projection {
            Projection::Perspective => f64::INFINITY,
            Projection::Equidistant => std::f64::consts::PI,
        };
        let mut fitted = Self { lens, reach: 0.0, magnification: 0.0 };
        // Ways from the axis to the rim pass all of the picture.
        for pixel in rim(size, 0.5) {
            let u = lens.undistort_along(lens.plane(pixel)).ok().filter(|u| u.length() < widest);
            let Some(u) = u else {
                let got = format!(
                    "a lens that shows no direction at pixel ({}, {})",
                    pixel.x.floor(),
                    pixel.y.floor()
                );
                let expected =
                    "one that shows every pixel a direction of its own: crop the pictures, or calibrate anew";
                return Err(Error::value("distortion", got, expected));
            };
            fitted.reach = fitted.reach.max(u.length());
        }
        // Half a pixel farther is no pixel's centre, and may have no direction.
        let outer = rim(size, 0.0).filter_map(|pixel| lens.undistort_along(lens.plane(pixel)).ok());
        let outer = outer.map(DVec2::length).filter(|&length| length < widest);
        fitted.reach = outer.fold(fitted.reach, f64::max) * (1.0 + 1e-9);
        fitted.magnification = fitted.most_pixels_a_radian(size);
        Ok(fitted)
    }

    pub(super) fn lens(&self) -> &Lens {
        &self.lens
    }

    pub(super) fn magnification(&self) -> f64 {
        self.magnification
    }

    /// The direction in the space of the camera, which looks along −z with +y up, that appears at a point of the picture, in pixels;
    /// of any length. Where the picture has ended and nothing appears any more, it is the last one on the way there.
    pub(super) fn direction(&self, pixel: DVec2) -> DVec3 {
        let target = self.lens.plane(pixel);
        let u = self.lens.undistort_from(target, target).filter(|u| u.length() <= self.reach);
        let u = u.unwrap_or_else(|| self.lens.undistort_along(target).unwrap_or_else(|last| last));
        match self.lens.projection {
            Projection::Perspective => DVec3::new(u.x, -u.y, -1.0),
            Projection::Equidistant => {
                let angle = u.length();
                let across = if angle > 0.0 { u * (angle.sin() / angle) } else { u };
                DVec3::new(across.x, -across.y, -angle.cos())
            }
        }
    }

    /// Where a point in the space of the camera appears, in pixels; none where that is farther from the axis than all of the picture.
    pub(super) fn pixel(&self, p: DVec3) -> Option<DVec2> {
        let across = DVec2::new(p.x, -p.y);
        let u = match self.lens.projection {
            Projection::Perspective if p.z >= 0.0 => return None,
            Projection::Perspective => across / -p.z,
            Projection::Equidistant => across.normalize_or_zero() * across.length().atan2(-p.z),
        };
        let (moved, _) = self.lens.distort(u);
        let [focal, centre] = [self.lens.focal_length, self.lens.principal_point].map(DVec2::from_array);
        (u.length() <= self.reach).then(|| centre + focal * moved)
    }

    fn most_pixels_a_radian(&self, size: [usize; 2]) -> f64 {
        const SAMPLES: usize = 16;
        let mut most = 0.0f64;
        for index in 0..(SAMPLES + 1) * (SAMPLES + 1) {
            let at = [index % (SAMPLES + 1), index / (SAMPLES + 1)];
            let at = [0, 1].map(|axis| 0.5 + (size[axis] - 1) as f64 * at[axis] as f64 / SAMPLES as f64);
            let towards = |x: f64, y: f64| self.direction(DVec2::new(at[0] + x, at[1] + y)).normalize();
            let across = towards(0.5, 0.0) - towards(-0.5, 0.0);
            let down = towards(0.0, 0.5) - towards(0.0, -0.5);
            // The smaller eigenvalue of the metric: how little a direction changes from a pixel to the next.
            let (a, b, c) = (across.length_squared(), across.dot(down), down.length_squared());
            let least = 0.5 * (a + c) - (0.25 * (a - c) * (a - c) + b * b).sqrt();
            most = most.max(if least > 0.0 { least.sqrt().recip() } else { f64::INFINITY });
        }
        // Between the samples it may be a little more.
        1.05 * most
    }
}

/// Points along the rim of a picture, so far inside it, in the order in which its pixels are read.
fn rim([width, height]: [usize; 2], inset: f64) -> impl Iterator<Item = DVec2> {
    let places = |side: usize| {
        let count = side.clamp(2, TRIED);
        let span = side as f64 - 2.0 * inset;
        let place = move |index: usize| (span * index as f64 / (count - 1) as f64).round().min(span) + inset;
        (0..count).map(place)
    };
    let (right, bottom) = (width as f64 - inset, height as f64 - inset);
    let row = move |y: f64| places(width).map(move |x| DVec2::new(x, y));
    let sides = places(height).flat_map(move |y| [DVec2::new(inset, y), DVec2::new(right, y)]);
    row(inset).chain(sides).chain(row(bottom))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn lens(projection: Projection, radial: [f64; 4], tangential: [f64; 2]) -> Lens {
        Lens { projection, radial, tangential, ..Lens::new([520.0, 500.0], [310.0, 250.0]) }
    }

    /// The formulas of OpenCV's manual, written out.
    fn opencv([x, y]: [f64; 2], [k1, k2, k3, k4]: [f64; 4], [p1, p2]: [f64; 2]) -> DVec2 {
        let r = x.hypot(y);
        let radial = 1.0 + k1 * r.powi(2) + k2 * r.powi(4) + k3 * r.powi(6) + k4 * r.powi(8);
        DVec2::new(
            x * radial + 2.0 * p1 * x * y + p2 * (r * r + 2.0 * x * x),
            y * radial + p1 * (r * r + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }

    #[test]
    fn points_appear_where_opencv_puts_them() {
        let (radial, tangential) = ([-0.21, 0.07, 0.01, -0.002], [0.003, -0.002]);
        let bent = lens(Projection::Perspective, radial, tangential);
        let fitted = FittedLens::new(bent, [640, 480]).unwrap();
        for [x, y] in [[0.0, 0.0], [0.3, -0.2], [-0.45, 0.4], [0.1, 0.35]] {
            let at = opencv([x, y], radial, tangential);
            let expected = DVec2::new(310.0 + 520.0 * at.x, 250.0 + 500.0 * at.y);
            let seen = fitted.pixel(2.5 * DVec3::new(x, -y, -1.0)).unwrap();
            assert!(seen.distance(expected) < 1e-9, "{seen} {expected}");
        }
        assert_eq!(fitted.pixel(DVec3::new(0.1, 0.1, 1.0)), None, "behind the camera");
        assert_eq!(fitted.pixel(DVec3::new(9.0, 0.1, -1.0)), None, "where the polynomial means nothing");
    }

    #[test]
    fn the_derivative_is_that_of_the_distortion() {
        let bent = lens(Projection::Perspective, [-0.2, 0.05, 0.02, 0.01], [0.02, -0.03]);
        for u in [DVec2::new(0.3, 0.4), DVec2::new(-0.7, 0.2)] {
            let (_, derivative) = bent.distort(u);
            for (axis, column) in [(DVec2::X, derivative.x_axis), (DVec2::Y, derivative.y_axis)] {
                let slope = (bent.distort(u + 1e-6 * axis).0 - bent.distort(u - 1e-6 * axis).0) / 2e-6;
                assert!(slope.distance(column) < 1e-8, "{slope} {column}");
            }
        }
    }

    #[test]
    fn an_equidistant_lens_shows_an_angle_of_the_distance_over_the_focal_length() {
        let fisheye = Lens { projection: Projection::Equidistant, ..Lens::new([100.0; 2], [200.0, 150.0]) };
        let fitted = FittedLens::new(fisheye, [400, 300]).unwrap();
        for (x, y) in [(200.0, 150.0), (260.0, 150.0), (20.5, 0.5), (200.0, 299.0)] {
            let angle = fitted.direction(DVec2::new(x, y)).angle_between(DVec3::NEG_Z);
            let expected = (x - 200.0).hypot(y - 150.0) / 100.0;
            assert!((angle - expected).abs() < 1e-12, "{angle} {expected}");
        }
        // It sees what is beside and behind it.
        assert!(fitted.direction(DVec2::new(0.5, 0.5)).z > 0.0);
        let seen = fitted.pixel(DVec3::new(3.0, 0.0, 0.0)).unwrap();
        assert!(seen.distance(DVec2::new(200.0 + 100.0 * std::f64::consts::FRAC_PI_2, 150.0)) < 1e-9);
    }

    #[test]
    fn lenses_that_fold_the_picture_over_are_refused_with_a_pixel() {
        // r − 0.4 r³ turns around at r = 0.91, where it is 0.61; the corner is at 0.77.
        let folded = lens(Projection::Perspective, [-0.4, 0.0, 0.0, 0.0], [0.0; 2]);
        let refused = FittedLens::new(folded, [640, 480]).unwrap_err().to_string();
        assert!(refused.contains("distortion") && refused.contains("pixel (0, 0)"), "{refused}");
        // Its right half is seen.
        let cropped = Lens { principal_point: [50.0, 100.0], ..folded };
        assert!(FittedLens::new(cropped, [200, 200]).is_ok());
        let wide = Lens { projection: Projection::Equidistant, ..Lens::new([100.0; 2], [320.0, 240.0]) };
        let refused = FittedLens::new(wide, [640, 480]).unwrap_err().to_string();
        assert!(refused.contains("pixel (0, 0)"), "{refused}");
        let bad = [
            Lens { focal_length: [0.0, 1.0], ..folded },
            Lens { focal_length: [1.0, f64::NAN], ..folded },
            Lens { principal_point: [f64::INFINITY, 0.0], ..folded },
            Lens { radial: [0.0, f64::NAN, 0.0, 0.0], ..folded },
            Lens { radial: [1e300, -1e300, 1e300, 0.0], ..folded },
        ];
        assert!(bad.into_iter().all(|lens| FittedLens::new(lens, [640, 480]).is_err()));
    }

    #[test]
    fn the_magnification_is_that_of_a_pinhole() {
        let fitted = FittedLens::new(Lens::new([300.0; 2], [200.0, 150.0]), [400, 300]).unwrap();
        let rim = 300.0 * (1.0 + (199.5f64.powi(2) + 149.5f64.powi(2)) / 300.0f64.powi(2));
        let ratio = fitted.magnification() / rim;
        assert!((1.04..1.06).contains(&ratio), "{ratio}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

        #[test]
        fn what_is_undistorted_is_distorted_back(
            radial in [-0.3_f64..0.3, -0.1_f64..0.1, -0.03_f64..0.03, -0.01_f64..0.01],
            tangential in prop::array::uniform2(-0.01_f64..0.01),
            is_fisheye in any::<bool>(),
            at in prop::array::uniform2(0.0_f64..1.0),
        ) {
            let projection = if is_fisheye { Projection::Equidistant } else { Projection::Perspective };
            let tangential = if is_fisheye { [0.0; 2] } else { tangential };
            if let Ok(fitted) = FittedLens::new(lens(projection, radial, tangential), [640, 480]) {
                let pixel = DVec2::new(0.5 + at[0] * 639.0, 0.5 + at[1] * 479.0);
                let direction = fitted.direction(pixel);
                let seen = fitted.pixel(7.0 * direction).unwrap();
                // A thousandth of a millionth of a pixel: 1e-12 on the plane.
                prop_assert!(seen.distance(pixel) < 520.0 * 1e-12, "{seen} {pixel}");
                let lens = fitted.lens();
                let u = lens.undistort_along(lens.plane(pixel)).unwrap();
                let again = lens.undistort_from(lens.plane(pixel), lens.plane(pixel)).unwrap_or(u);
                prop_assert!(u.distance(again) < 1e-12, "{u} {again}");
                let back = lens.undistort_from(0.99 * u, lens.distort(u).0).unwrap_or(DVec2::NAN);
                prop_assert!(back.distance(u) < 1e-12, "{back} {u}");
            }
        }
    }
}
