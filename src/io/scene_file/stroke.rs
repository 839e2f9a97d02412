//! Painted strokes, and groups of them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::channels::Paint;
use super::flaw::{Built, Flaw, checked};
use crate::scene;

const MAX_POINTS: usize = 100_000;
const MAX_RADIUS: f64 = 4096.0;
const LEAST_PRESSURE: f64 = 0.05;

/// Farther away from the picture no point of a stroke can matter, and pixels are no longer told apart in f32.
const MAX_COORDINATE: f64 = 1e6;

/// Strokes that are hidden, or weigh less, together; on whichever views they are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Group {
    /// What its strokes call it.
    pub name: String,
    /// Whether its strokes are as if they were not there.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schemars(!skip_serializing_if)]
    pub hidden: bool,
    /// What the weight of each of its strokes is multiplied by, above 0 and at most 1.
    #[serde(default = "Stroke::default_weight", skip_serializing_if = "Stroke::is_default_weight")]
    #[schemars(!skip_serializing_if)]
    pub weight: f64,
}

impl Group {
    /// Whether groups can be: names that differ, and weights.
    ///
    /// Errors: what is wrong with them, in words.
    pub fn check(groups: &[Self]) -> Result<(), String> {
        check_groups(groups).map_err(in_words)
    }
}

fn in_words(flaw: Flaw) -> String {
    match flaw {
        Flaw::Document { path, problem } if path.is_empty() => problem,
        Flaw::Document { path, problem } => format!("{path}: {problem}"),
        Flaw::Machine(error) => error.to_string(),
    }
}

/// What is wrong with groups.
pub(super) fn check_groups(groups: &[Group]) -> Built<()> {
    for (index, group) in groups.iter().enumerate() {
        let place = |field: &str| format!("groups[{index}].{field}");
        if group.name.trim().is_empty() || group.name.chars().count() > 64 {
            return Err(Flaw::value(
                place("name"),
                format!("`{}`", group.name),
                "a name of 1 to 64 characters",
            ));
        }
        if let Some(first) = groups[..index].iter().position(|other| other.name == group.name) {
            let expected = format!("different from the name of groups[{first}]");
            return Err(Flaw::value(place("name"), format!("`{}`", group.name), &expected));
        }
        checked(&place("weight"), group.weight, "above 0 and at most 1", |w| w > 0.0 && w <= 1.0)?;
    }
    Ok(())
}

/// A painted stroke: a polyline with round caps and joins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// Points [x, y] in pixels, (0, 0) is the top left corner of the picture; one point is a dab.
    pub points: Vec<[f64; 2]>,
    /// Half the width in pixels, above 0 and at most 4096.
    pub radius: f64,
    /// How hard the pen was pressed at each point, from 0.05 to 1: the radius there is this part of `radius`. 1 everywhere when not given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub pressure: Vec<f64>,
    /// From 0 (the opacity falls off linearly from the middle to the edge) to 1 (a hard edge).
    #[serde(default = "Stroke::default_hardness", skip_serializing_if = "Stroke::is_default_hardness")]
    #[schemars(!skip_serializing_if)]
    pub hardness: f64,
    /// How strong the paint is in the middle of the stroke, above 0 and at most 1: at 0.25 it asks for a faint tint.
    #[serde(default = "Stroke::default_opacity", skip_serializing_if = "Stroke::is_default_opacity")]
    #[schemars(!skip_serializing_if)]
    pub opacity: f64,
    /// How much its pixels weigh in the solve, above 0 and at most 1, whatever their opacity; less on its soft edge.
    #[serde(default = "Stroke::default_weight", skip_serializing_if = "Stroke::is_default_weight")]
    #[schemars(!skip_serializing_if)]
    pub weight: f64,
    /// Whether it takes paint away from what is below it, layers included, instead of putting some on. Its colour and weight say nothing then.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schemars(!skip_serializing_if)]
    pub erase: bool,
    /// The name of its group, one of the `groups` of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// The desired colour: "#rrggbb" in sRGB, or [r, g, b] in linear Rec. 709.
    pub color: Paint,
}

impl Stroke {
    /// A stroke of the default hardness and opacity.
    pub fn new(points: Vec<[f64; 2]>, radius: f64, color: Paint) -> Self {
        Self {
            points,
            radius,
            hardness: Self::default_hardness(),
            opacity: Self::default_opacity(),
            weight: Self::default_weight(),
            pressure: Vec::new(),
            erase: false,
            group: None,
            color,
        }
    }

    /// The stroke on a picture of this size; none where its group is hidden.
    ///
    /// Errors: what is wrong with it, in words.
    pub fn on(&self, groups: &[Group], size: [usize; 2]) -> Result<Option<scene::Stroke>, String> {
        self.built_in(groups, size).map_err(in_words)
    }

    /// The stroke as its group has it, if that is not hidden.
    pub(super) fn built_in(&self, groups: &[Group], size: [usize; 2]) -> Built<Option<scene::Stroke>> {
        let built = self.build(size)?;
        let Some(name) = &self.group else { return Ok(Some(built)) };
        match groups.iter().find(|group| group.name == *name) {
            None => {
                let expected = "the name of one of the scene's `groups`";
                Err(Flaw::value("group", format!("`{name}`"), expected))
            }
            Some(group) if group.hidden => Ok(None),
            Some(group) => Ok(Some(scene::Stroke { weight: built.weight * group.weight as f32, ..built })),
        }
    }

    fn build(&self, size: [usize; 2]) -> Built<scene::Stroke> {
        let radius = checked("radius", self.radius, "above 0 and at most 4096 pixels", |r| {
            r > 0.0 && r <= MAX_RADIUS
        })?;
        let hardness =
            checked("hardness", self.hardness, "from 0 (soft) to 1 (hard)", |h| (0.0..=1.0).contains(&h))?;
        let opacity = checked("opacity", self.opacity, "above 0 and at most 1", |o| o > 0.0 && o <= 1.0)?;
        let weight = checked("weight", self.weight, "above 0 and at most 1", |w| w > 0.0 && w <= 1.0)?;
        self.check_points()?;
        let color = self.color.rgb("color")?;
        if !touches(&self.points, radius, size.map(|side| side as f64)) {
            let [width, height] = size;
            let problem =
                format!("the stroke lies outside the view, whose picture has {width} x {height} pixels");
            return Err(Flaw::new("", problem));
        }
        let points = self.points.iter().map(|point| point.map(|c| c as f32)).collect();
        Ok(scene::Stroke {
            points,
            pressure: self.pressure.iter().map(|&pressure| pressure as f32).collect(),
            radius: radius as f32,
            hardness: hardness as f32,
            opacity: opacity as f32,
            weight: weight as f32,
            erases: self.erase,
            color,
        })
    }

    fn check_points(&self) -> Built<()> {
        if self.points.is_empty() || self.points.len() > MAX_POINTS {
            return Err(Flaw::value(
                "points",
                format!("a list of {} points", self.points.len()),
                "a list of 1 to 100000 points",
            ));
        }
        if !self.pressure.is_empty() && self.pressure.len() != self.points.len() {
            let (got, points) = (self.pressure.len(), self.points.len());
            return Err(Flaw::value(
                "pressure",
                format!("a list of length {got}"),
                &format!("one for each of the {points} points"),
            ));
        }
        if let Some(index) = self.pressure.iter().position(|p| !(LEAST_PRESSURE..=1.0).contains(p)) {
            return Err(Flaw::value(
                format!("pressure[{index}]"),
                self.pressure[index].to_string(),
                "from 0.05 to 1",
            ));
        }
        let near = |c: f64| c.is_finite() && c.abs() <= MAX_COORDINATE;
        match self.points.iter().position(|point| !point.iter().all(|&c| near(c))) {
            None => Ok(()),
            Some(index) => Err(Flaw::value(
                format!("points[{index}]"),
                format!("{:?}", self.points[index]),
                "finite and within 1000000 pixels of the view",
            )),
        }
    }

    fn default_hardness() -> f64 {
        0.8
    }

    fn is_default_hardness(hardness: &f64) -> bool {
        *hardness == Self::default_hardness()
    }

    fn default_opacity() -> f64 {
        1.0
    }

    fn is_default_opacity(opacity: &f64) -> bool {
        *opacity == Self::default_opacity()
    }

    fn default_weight() -> f64 {
        1.0
    }

    fn is_default_weight(weight: &f64) -> bool {
        *weight == Self::default_weight()
    }
}

/// Whether any part of the stroke's area lies inside the picture.
fn touches(points: &[[f64; 2]], radius: f64, size: [f64; 2]) -> bool {
    let dab = points.first().map(|&point| [point, point]);
    let segments = points.windows(2).map(|pair| [pair[0], pair[1]]);
    dab.into_iter().chain(segments).any(|segment| distance_to_picture(segment, size) < radius)
}

/// The distance between a segment and the rectangle from (0, 0) to `size`.
fn distance_to_picture([a, b]: [[f64; 2]; 2], size: [f64; 2]) -> f64 {
    if crosses([a, b], size) {
        return 0.0;
    }
    let outside = |p: [f64; 2]| length([0, 1].map(|axis| p[axis] - p[axis].clamp(0.0, size[axis])));
    let corners = [[0.0, 0.0], [size[0], 0.0], [0.0, size[1]], size];
    let to_corners = corners.map(|corner| distance_to_segment(corner, [a, b]));
    to_corners.into_iter().fold(outside(a).min(outside(b)), f64::min)
}

/// Liang–Barsky clipping: whether some part of the segment is inside.
fn crosses([a, b]: [[f64; 2]; 2], size: [f64; 2]) -> bool {
    let mut inside = [0.0f64, 1.0];
    for axis in 0..2 {
        let step = b[axis] - a[axis];
        if step == 0.0 {
            if a[axis] < 0.0 || a[axis] > size[axis] {
                return false;
            }
            continue;
        }
        let (s, t) = (-a[axis] / step, (size[axis] - a[axis]) / step);
        inside = [inside[0].max(s.min(t)), inside[1].min(s.max(t))];
    }
    inside[0] <= inside[1]
}

fn distance_to_segment(p: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let (along, from) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let squared = along[0] * along[0] + along[1] * along[1];
    let dot = along[0] * from[0] + along[1] * from[1];
    let t = if squared > 0.0 { (dot / squared).clamp(0.0, 1.0) } else { 0.0 };
    length([from[0] - t * along[0], from[1] - t * along[1]])
}

fn length([x, y]: [f64; 2]) -> f64 {
    x.hypot(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [f64; 2] = [100.0, 50.0];

    #[test]
    fn a_stroke_touches_where_its_area_overlaps_the_picture() {
        assert!(touches(&[[50.0, 25.0]], 1.0, SIZE), "a dab inside");
        assert!(touches(&[[-3.0, 10.0]], 3.5, SIZE), "a dab beside the edge");
        assert!(!touches(&[[-3.0, 10.0]], 3.0, SIZE), "a dab that only meets the edge");
        assert!(touches(&[[-50.0, 25.0], [200.0, 25.0]], 0.1, SIZE), "both ends are outside");
        assert!(!touches(&[[-10.0, 5.0], [5.0, -10.0]], 3.5, SIZE), "passes the corner at 3.54");
        assert!(touches(&[[-10.0, 5.0], [5.0, -10.0]], 3.6, SIZE));
        assert!(!touches(&[[0.0, 60.0], [100.0, 70.0], [200.0, 25.0]], 5.0, SIZE));
    }

    #[test]
    fn the_distance_agrees_with_dense_sampling() {
        let points = [[-30.0, -20.0], [130.0, -7.0], [140.0, 80.0], [40.0, 53.0], [-5.0, 70.0], [20.0, 20.0]];
        for a in points {
            for b in points {
                let sampled = (0..=4000).map(|i| {
                    let t = f64::from(i) / 4000.0;
                    let p = [0, 1].map(|axis| a[axis] + t * (b[axis] - a[axis]));
                    length([0, 1].map(|axis| p[axis] - p[axis].clamp(0.0, SIZE[axis])))
                });
                let sampled = sampled.fold(f64::INFINITY, f64::min);
                let got = distance_to_picture([a, b], SIZE);
                assert!((got - sampled).abs() < 0.05, "{a:?} {b:?}: {got} and {sampled}");
            }
        }
    }

    #[test]
    fn strokes_without_sense_are_refused_at_their_fault() {
        let good = Stroke::new(vec![[1.0, 2.0]], 2.0, Paint::Hex([1, 2, 3]));
        assert!(good.build([10, 10]).is_ok());
        let bad = [
            ("radius", Stroke { radius: 0.0, ..good.clone() }),
            ("radius", Stroke { radius: 4097.0, ..good.clone() }),
            ("radius", Stroke { radius: f64::NAN, ..good.clone() }),
            ("hardness", Stroke { hardness: -0.1, ..good.clone() }),
            ("opacity", Stroke { opacity: 0.0, ..good.clone() }),
            ("opacity", Stroke { opacity: 1.1, ..good.clone() }),
            ("color", Stroke { color: Paint::Linear([0.0, -1.0, 0.0]), ..good.clone() }),
            ("points", Stroke { points: vec![], ..good.clone() }),
            ("points", Stroke { points: vec![[1.0; 2]; MAX_POINTS + 1], ..good.clone() }),
            ("points[1]", Stroke { points: vec![[1.0; 2], [1.0, f64::INFINITY]], ..good.clone() }),
            ("pressure", Stroke { pressure: vec![1.0, 0.5], ..good.clone() }),
            ("pressure[0]", Stroke { pressure: vec![0.01], ..good.clone() }),
            ("", Stroke { points: vec![[-2.0, -2.0]], ..good.clone() }),
        ];
        for (expected, stroke) in bad {
            let Err(Flaw::Document { path, .. }) = stroke.build([10, 10]) else {
                unreachable!("{expected} was accepted")
            };
            assert_eq!(path, expected);
        }
    }

    #[test]
    fn a_group_hides_its_strokes_and_weighs_them() {
        let group = |name: &str, hidden, weight| Group { name: name.to_owned(), hidden, weight };
        let groups = [group("warm", false, 0.5), group("cold", true, 1.0)];
        let stroke = |group: Option<&str>| Stroke {
            weight: 0.5,
            group: group.map(str::to_owned),
            ..Stroke::new(vec![[1.0, 2.0]], 2.0, Paint::Hex([1, 2, 3]))
        };
        let weight = |of| stroke(of).on(&groups, [10, 10]).map(|built| built.map(|built| built.weight));
        assert_eq!(weight(None), Ok(Some(0.5)));
        assert_eq!(weight(Some("warm")), Ok(Some(0.25)));
        assert_eq!(weight(Some("cold")), Ok(None));
        assert!(weight(Some("lukewarm")).unwrap_err().starts_with("group: "));
        assert!(check_groups(&groups).is_ok());
        for wrong in [group(" ", false, 1.0), group("warm", false, 1.0), group("new", false, 0.0)] {
            assert!(check_groups(&[groups[0].clone(), wrong]).is_err());
        }
    }
}
