use super::Rgb;

/// One painted stroke: a polyline with round caps and joins.
#[derive(Debug, Clone, PartialEq)]
pub struct Stroke {
    /// Points in pixels of the view; one point is a dab.
    pub points: Vec<[f32; 2]>,
    /// Half the width in pixels.
    pub radius: f32,
    /// The part of the radius that it has at each point, in (0, 1]; all of it everywhere where there is none.
    pub pressure: Vec<f32>,
    /// 1: a hard edge; 0: opacity falls off linearly from the middle to the edge.
    pub hardness: f32,
    /// How strong the paint is in the middle of the stroke, in (0, 1].
    pub opacity: f32,
    /// Weight of its pixels in the solve, in (0, 1].
    pub weight: f32,
    /// Whether it takes paint away, of what is below it, instead of putting some on; its colour and weight say nothing then.
    pub erases: bool,
    /// The desired colour, linear: dimensionless for `tint`, radiance for `radiance`.
    pub color: Rgb,
}
