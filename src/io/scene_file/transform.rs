//! Where something stands: `to_world`.

use glam::{DAffine3, DMat4, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scene;

use super::channels::Scale;
use super::flaw::{At, Built, Flaw};

/// Where something stands in the world. Either `matrix`, or `look_at`, or any of `scale`, `rotate` and
/// `translate`, which are applied in this order.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Transform {
    /// Four rows of four numbers, applied to column vectors; the last row is 0, 0, 0, 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matrix: Option<[[f64; 4]; 4]>,
    /// Stands at one point and looks at another along its −Z axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub look_at: Option<LookAt>,
    /// A shift in metres, applied last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub translate: Option<[f64; 3]>,
    /// A rotation around the origin, applied after `scale`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate: Option<Rotate>,
    /// A factor for all axes or one an axis, applied first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<Scale>,
}

/// Stands at `origin` and looks at `target` along −Z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LookAt {
    /// Where it stands, in metres.
    pub origin: [f64; 3],
    /// What it looks at, in metres.
    pub target: [f64; 3],
    /// What is up.
    #[serde(default = "LookAt::default_up", skip_serializing_if = "LookAt::is_default_up")]
    #[schemars(!skip_serializing_if)]
    pub up: [f64; 3],
}

/// A right-handed rotation around an axis through the origin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rotate {
    /// The axis, of any length.
    pub axis: [f64; 3],
    /// The angle in degrees.
    pub angle: f64,
}

impl Transform {
    /// A transform that stands at `origin` and looks at `target`, +Y up.
    pub fn looking(origin: [f64; 3], target: [f64; 3]) -> Self {
        Self { look_at: Some(LookAt { origin, target, up: LookAt::default_up() }), ..Self::default() }
    }

    pub(super) fn build(&self) -> Built<DAffine3> {
        let parts = self.translate.is_some() || self.rotate.is_some() || self.scale.is_some();
        match (&self.matrix, &self.look_at, parts) {
            (Some(rows), None, false) => from_rows(rows).at("matrix"),
            (None, Some(look_at), false) => look_at.build(),
            (None, None, _) => self.build_parts(),
            _ => Err(Flaw::new(
                "",
                "these do not go together; give either `matrix`, or `look_at`, or any of `scale`, `rotate` and \
                 `translate`",
            )),
        }
    }

    fn build_parts(&self) -> Built<DAffine3> {
        let scale = self.scale.map_or(DVec3::ONE, Scale::axes);
        let scale = invertible(DAffine3::from_scale(scale)).at("scale")?;
        let rotate = self.rotate.as_ref().map_or(Ok(DAffine3::IDENTITY), Rotate::build).at("rotate")?;
        let shift = DVec3::from_array(self.translate.unwrap_or_default());
        let translate = invertible(DAffine3::from_translation(shift)).at("translate")?;
        Ok(translate * rotate * scale)
    }
}

impl LookAt {
    fn build(&self) -> Built<DAffine3> {
        let [origin, target, up] = [self.origin, self.target, self.up].map(DVec3::from_array);
        // Lengths beyond this overflow when squared, which look_at would take for a zero.
        for (path, vector) in [("origin", origin), ("target", target), ("up", up)] {
            if !(vector.is_finite() && vector.abs().max_element() <= FARTHEST) {
                return Err(Flaw::value(path, vector, "finite and within 1e9 metres")).at("look_at");
            }
        }
        Ok(scene::look_at(origin, target, up)?)
    }

    fn default_up() -> [f64; 3] {
        [0.0, 1.0, 0.0]
    }

    fn is_default_up(up: &[f64; 3]) -> bool {
        *up == Self::default_up()
    }
}

/// Coordinates in metres that the single-precision parts of a renderer can still tell apart.
pub(super) const FARTHEST: f64 = 1e9;

impl Rotate {
    fn build(&self) -> Built<DAffine3> {
        let axis = DVec3::from_array(self.axis);
        let unit = axis.try_normalize().filter(|unit| unit.is_finite());
        let unit = unit.ok_or_else(|| Flaw::value("axis", axis, "a finite direction that is not zero"))?;
        super::flaw::checked("angle", self.angle, "a finite number of degrees", |_| true)?;
        Ok(DAffine3::from_axis_angle(unit, self.angle.to_radians()))
    }
}

fn from_rows(rows: &[[f64; 4]; 4]) -> Built<DAffine3> {
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err(Flaw::value("[3]", format!("{:?}", rows[3]), "[0, 0, 0, 1]"));
    }
    invertible(DAffine3::from_mat4(DMat4::from_cols_array_2d(rows).transpose()))
}

/// The transform when it has an inverse, judged relative to the lengths of its columns.
fn invertible(transform: DAffine3) -> Built<DAffine3> {
    let m = transform.matrix3;
    let volume = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    let near = transform.translation.abs().max_element() <= FARTHEST;
    if transform.is_finite() && near && volume.is_normal() && m.determinant().abs() > 1e-9 * volume {
        return Ok(transform);
    }
    Err(Flaw::value("", "a singular or boundless transform", "invertible and within 1e9 metres"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: DVec3, b: [f64; 3]) -> bool {
        (a - DVec3::from_array(b)).length() < 1e-12
    }

    #[test]
    fn scale_comes_before_rotation_and_rotation_before_translation() {
        let transform = Transform {
            scale: Some(Scale::Axes([2.0, 3.0, 4.0])),
            rotate: Some(Rotate { axis: [0.0, 0.0, 5.0], angle: 90.0 }),
            translate: Some([10.0, 0.0, 0.0]),
            ..Transform::default()
        };
        let world_from_local = transform.build().unwrap();
        assert!(close(world_from_local.transform_point3(DVec3::X), [10.0, 2.0, 0.0]));
        assert!(close(world_from_local.transform_point3(DVec3::Y), [7.0, 0.0, 0.0]));
    }

    #[test]
    fn a_matrix_is_written_in_rows() {
        let rows = [[0.0, -1.0, 0.0, 5.0], [1.0, 0.0, 0.0, 6.0], [0.0, 0.0, 1.0, 7.0], [0.0, 0.0, 0.0, 1.0]];
        let world = Transform { matrix: Some(rows), ..Transform::default() }.build().unwrap();
        assert!(close(world.transform_point3(DVec3::X), [5.0, 7.0, 7.0]));
    }

    #[test]
    fn a_looker_sees_its_target_before_it() {
        let world = Transform::looking([1.0, 2.0, 3.0], [1.0, 2.0, -4.0]).build().unwrap();
        assert!(close(world.transform_vector3(-DVec3::Z), [0.0, 0.0, -1.0]));
        assert!(close(world.transform_point3(DVec3::ZERO), [1.0, 2.0, 3.0]));
    }

    #[test]
    fn transforms_without_inverse_and_contradictions_are_refused() {
        let scaled = |scale| Transform { scale: Some(scale), ..Transform::default() };
        let bad = [
            scaled(Scale::Uniform(0.0)),
            scaled(Scale::Axes([1.0, 0.0, 1.0])),
            scaled(Scale::Uniform(1e200)),
            scaled(Scale::Uniform(f64::NAN)),
            Transform { matrix: Some([[0.0; 4]; 4]), ..Transform::default() },
            Transform { translate: Some([1e300, 0.0, 0.0]), ..Transform::default() },
            Transform { rotate: Some(Rotate { axis: [0.0; 3], angle: 1.0 }), ..Transform::default() },
            Transform::looking([1.0; 3], [1.0; 3]),
            Transform::looking([1e300, 0.0, 0.0], [1.0; 3]),
            Transform { scale: Some(Scale::Uniform(1.0)), ..Transform::looking([0.0; 3], [1.0; 3]) },
        ];
        for transform in bad {
            assert!(transform.build().is_err(), "{transform:?}");
        }
        assert_eq!(Transform::default().build().unwrap(), DAffine3::IDENTITY);
    }
}
