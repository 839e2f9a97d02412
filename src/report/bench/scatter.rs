//! Points as SVG, cost across and error upwards, both by decades, with their Pareto front.

use super::super::axes::{Axes, DISTINCT, TEXT, color};
use super::super::ticks::Spacing;
use super::super::words::escaped;
use super::front;
use crate::{Error, Result};

const SIZE: [f64; 2] = [1100.0, 430.0];
/// Left, top, right and bottom of what lies between the axes; the legend stands to the right of it.
const FRAME: [f64; 4] = [74.0, 40.0, 880.0, 384.0];
/// A little room, so that the outermost marks are whole.
const INSET: f64 = 0.015;

/// One measured point.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// Cost and error.
    pub at: [f64; 2],
    /// What it is, said when pointed at.
    pub name: String,
    /// A word beside it; empty for none.
    pub label: String,
}

/// Points of one colour.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Its name in the legend.
    pub label: String,
    /// Whether a line joins them in their order.
    pub joined: bool,
    /// The points.
    pub marks: Vec<Mark>,
}

/// Points over cost and error.
#[derive(Debug, Clone, PartialEq)]
pub struct Scatter {
    /// What it shows.
    pub title: String,
    /// What the cost is, with its unit.
    pub x: String,
    /// What the error is.
    pub y: String,
    /// What is drawn.
    pub groups: Vec<Group>,
}

/// The points as an SVG document; a dashed line of steps is the front of those that none beats.
///
/// Errors: [`Error::NonFinite`] for a coordinate that is a NaN or an infinity.
pub fn scatter(scatter: &Scatter) -> Result<String> {
    let marks: Vec<&Mark> = scatter.groups.iter().flat_map(|group| &group.marks).collect();
    if let Some(mark) = marks.iter().find(|mark| !mark.at.iter().all(|value| value.is_finite())) {
        let what = format!("a point of the chart {}", scatter.title);
        return Err(Error::NonFinite { what, place: mark.name.clone() });
    }
    let points: Vec<[f64; 2]> = marks.iter().map(|mark| mark.at).collect();
    let axes = Axes::over(FRAME, INSET, [Spacing::Log; 2], points.iter().copied());
    let front: Vec<[f64; 2]> = front(&points).into_iter().map(|index| points[index]).collect();
    let groups = scatter.groups.iter().enumerate();
    let drawn: String = groups.map(|(index, group)| drawn_group(&axes, group, index)).collect();
    Ok(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\" \
         font-family=\"system-ui, sans-serif\" font-size=\"12\">\n<g fill=\"{TEXT}\" style=\"fill:var(--chart-text,{TEXT})\">\n{}{}{}</g>\n\
         {}{drawn}</svg>\n",
        SIZE[0],
        SIZE[1],
        escaped(&scatter.title),
        titles(scatter),
        axes.svg(8),
        legend(&scatter.groups),
        steps(&axes, &front),
    ))
}

fn titles(scatter: &Scatter) -> String {
    let [left, _, right, _] = FRAME;
    format!(
        "<text x=\"{left}\" y=\"20\" font-size=\"14\" font-weight=\"600\">{}</text>\n\
         <text x=\"{right}\" y=\"20\" text-anchor=\"end\">{} ↑</text>\n\
         <text x=\"{right}\" y=\"{}\" text-anchor=\"end\">{} →</text>\n",
        escaped(&scatter.title),
        escaped(&scatter.y),
        SIZE[1] - 8.0,
        escaped(&scatter.x),
    )
}

fn legend(groups: &[Group]) -> String {
    let x = FRAME[2] + 24.0;
    let mut text = format!(
        "<path d=\"M{x} {y}h16\" fill=\"none\" stroke=\"{TEXT}\" stroke-width=\"1.5\" stroke-dasharray=\"3 3\"/>\
         <text x=\"{}\" y=\"{}\">Pareto front</text>\n",
        x + 24.0,
        FRAME[1] + 8.0,
        y = FRAME[1] + 4.0,
    );
    for (index, group) in groups.iter().enumerate() {
        let y = FRAME[1] + 28.0 + 20.0 * index as f64;
        text.push_str(&format!(
            "<circle cx=\"{:.1}\" cy=\"{y:.1}\" {}/><text x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
            x + 8.0,
            paint(index),
            x + 24.0,
            y + 4.0,
            escaped(&group.label)
        ));
    }
    text
}

/// How the marks of a group look: where the colours begin again they are hollow.
fn paint(index: usize) -> String {
    let color = color(index);
    match index < DISTINCT {
        true => format!("r=\"4\" fill=\"{color}\""),
        false => format!("r=\"4\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\""),
    }
}

/// The front as steps: up to the next point, the one before is the best there is.
fn steps(axes: &Axes, front: &[[f64; 2]]) -> String {
    let mut path = String::new();
    for (index, &at) in front.iter().enumerate() {
        let [x, y] = axes.point(at);
        match index {
            0 => path.push_str(&format!("M{x:.1} {:.1}V{y:.1}", FRAME[1])),
            _ => path.push_str(&format!("H{x:.1}V{y:.1}")),
        }
    }
    if path.is_empty() {
        return path;
    }
    path.push_str(&format!("H{}", FRAME[2]));
    format!(
        "<path class=\"front\" d=\"{path}\" fill=\"none\" stroke=\"{TEXT}\" stroke-width=\"1.5\" \
         stroke-dasharray=\"3 3\"/>\n"
    )
}

fn drawn_group(axes: &Axes, group: &Group, index: usize) -> String {
    let places: Vec<[f64; 2]> = group.marks.iter().map(|mark| axes.point(mark.at)).collect();
    let mut text = String::new();
    if group.joined && places.len() > 1 {
        let points: Vec<String> = places.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let color = color(index);
        text.push_str(&format!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.5\" stroke-opacity=\"0.6\"/>\n",
            points.join(" ")
        ));
    }
    for (mark, [x, y]) in group.marks.iter().zip(places) {
        text.push_str(&format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" {}><title>{}</title></circle>\n",
            paint(index),
            escaped(&mark.name)
        ));
        if !mark.label.is_empty() {
            text.push_str(&format!(
                "<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"10\" fill=\"{TEXT}\" style=\"fill:var(--chart-text,{TEXT})\">{}</text>\n",
                x + 7.0,
                y - 5.0,
                escaped(&mark.label)
            ));
        }
    }
    text
}
#[cfg(test)]
mod tests {
    use super::*;

    fn with(points: &[[f64; 2]]) -> Scatter {
        let mark = |&at: &[f64; 2]| Mark { at, name: "<a>".into(), label: "16".into() };
        let group = |label: &str| Group {
            label: label.into(),
            joined: true,
            marks: points.iter().map(mark).collect(),
        };
        Scatter {
            title: "t".into(),
            x: "seconds".into(),
            y: "error".into(),
            groups: (0..9).map(|index| group(&index.to_string())).collect(),
        }
    }

    #[test]
    fn every_mark_and_one_front_are_drawn_and_names_are_escaped() {
        let svg = scatter(&with(&[[1.0, 1.0], [2.0, 0.0], [3.0, 5.0]])).unwrap();
        assert_eq!(svg.matches("<title>&lt;a&gt;</title>").count(), 27);
        assert_eq!(svg.matches("class=\"front\"").count(), 1);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert!(scatter(&with(&[])).is_ok());
    }

    #[test]
    fn what_is_no_number_is_named() {
        let error = scatter(&with(&[[1.0, f64::NAN]])).unwrap_err();
        assert!(matches!(error, Error::NonFinite { place, .. } if place == "<a>"));
    }
}
