use std::f64::consts::FRAC_PI_2;

use glam::DVec3;

use super::openness::{Openness, Way, cone_angle};
use super::pattern::hemisphere;
use crate::scene::Weighting;

/// The mean of the open directions at the foot of a wall that hides one half of them.
#[test]
fn the_foot_of_a_wall_is_open_to_a_quarter_of_the_sphere() {
    for normal in [DVec3::Y, DVec3::new(0.36, 0.48, -0.8), -DVec3::Z] {
        let free = normal.any_orthonormal_vector();
        let way = |towards: DVec3| if towards.dot(free) > 0.0 { Way::Open } else { Way::Hidden };
        // Uniform: ∫ ω / ∫ 1 = (1/2, 1/2). By cosine: ∫ ω cos θ / ∫ cos θ = (4 / 3π, 2/3) along (free, normal).
        for (weighting, along) in [
            (Weighting::Uniform, [0.5, 0.5]),
            (Weighting::Cosine, [4.0 / (3.0 * std::f64::consts::PI), 2.0 / 3.0]),
        ] {
            let open = Openness::of(&hemisphere(20_000, weighting, [0.1, 0.5]), normal, way);
            let cone = open.cone(normal, weighting);
            assert!((cone.visibility - 0.5).abs() < 1e-3, "{}", cone.visibility);
            let mean = free * along[0] + normal * along[1];
            assert!(cone.direction.dot(mean.normalize()) > 1.0 - 1e-6, "{weighting:?}");
            assert!((cone.angle - cone_angle(mean.length(), weighting)).abs() < 2e-3);
            // Neither the normal nor another mean.
            assert!(cone.direction.dot(normal) < 0.9);
        }
    }
}

#[test]
fn open_ground_has_a_whole_cone_around_its_normal() {
    for weighting in [Weighting::Uniform, Weighting::Cosine] {
        for samples in [1, 3, 8] {
            let normal = DVec3::new(0.6, 0.0, 0.8);
            let open = Openness::of(&hemisphere(samples, weighting, [0.3, 0.7]), normal, |_| Way::Open);
            let cone = open.cone(normal, weighting);
            assert_eq!(cone.visibility, 1.0);
            assert!((cone.direction - normal).length() < 1e-12, "few directions bend nothing");
            assert!((cone.angle - FRAC_PI_2).abs() < 1e-7, "{weighting:?}");
        }
    }
}

/// Directions in a cone around the normal: the cone is found again, where they count their cosines.
#[test]
fn the_cone_of_directions_in_a_cone_is_that_cone() {
    for degrees in [10.0f64, 30.0, 60.0, 85.0] {
        let rim = degrees.to_radians().cos();
        let way = |towards: DVec3| if towards.z > rim { Way::Open } else { Way::Hidden };
        let open = Openness::of(&hemisphere(100_000, Weighting::Cosine, [0.0, 0.5]), DVec3::Z, way);
        let cone = open.cone(DVec3::Z, Weighting::Cosine);
        assert!((cone.angle.to_degrees() - degrees).abs() < 0.1, "{degrees}: {}", cone.angle.to_degrees());
        assert!((cone.visibility - (1.0 - rim * rim)).abs() < 1e-3);
    }
    // The paper's: from |N| = 1/2 to 1.
    assert_eq!(
        [0.5, 0.75, 1.0].map(|length| cone_angle(length, Weighting::Uniform)),
        [1.0, 0.5, 0.0].map(|it| it * FRAC_PI_2)
    );
}
