//! Curves as SVG: convergence of a solve, error against time, whatever goes down.
//!
//! The pictures have no background and text in mid-grey, so they stand on light and on dark pages; a page
//! can set `--chart-text` and `--chart-line` to do better. They carry no script and no font.

use super::axes::{Axes, TEXT, color};
use super::ticks::Spacing;
use super::words::escaped;
use crate::solve::Progress;
use crate::{Error, Result};

/// Width and height of one panel in the units of its viewBox.
const PANEL: [f64; 2] = [520.0, 300.0];
/// Left, top, right and bottom of what lies between the axes.
const FRAME: [f64; 4] = [64.0, 58.0, PANEL[0] - 14.0, PANEL[1] - 46.0];
const FONT: &str = "system-ui, sans-serif";
/// More points than this on one curve are thinned: they could not be told apart.
const MOST_POINTS: usize = 4096;
/// Curves of as few points show each.
const FEW_POINTS: usize = 8;

/// One axis of a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartAxis {
    /// What it measures, with its unit.
    pub label: String,
    /// How its values are laid out.
    pub spacing: Spacing,
}

/// One curve of a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Its name in the legend.
    pub label: String,
    /// Dashed instead of solid.
    pub dashed: bool,
    /// Points (x, y), from left to right.
    pub points: Vec<[f64; 2]>,
}

/// Curves over common axes. They are coloured in their order, red, green and blue first.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// What it shows.
    pub title: String,
    /// Across.
    pub x: ChartAxis,
    /// Upwards.
    pub y: ChartAxis,
    /// What is drawn.
    pub curves: Vec<Curve>,
}

/// One chart as an SVG document.
///
/// No curves, a single point and constant curves are fine.
///
/// Errors: [`Error::NonFinite`] for a coordinate that is a NaN or an infinity.
pub fn chart(chart: &Chart) -> Result<String> {
    document(std::slice::from_ref(chart))
}

/// The convergence of a solve as an SVG document: residual and normal residual, side by side, over the
/// iterations, one curve a colour channel.
///
/// Errors: [`Error::NonFinite`] for a residual that is a NaN or an infinity.
pub fn convergence(history: &[Progress]) -> Result<String> {
    document(&convergence_charts(history))
}

/// The two charts of [`convergence`].
pub(super) fn convergence_charts(history: &[Progress]) -> [Chart; 2] {
    let over_iterations = |title: &str, value: fn(&Progress) -> [f64; 3]| Chart {
        title: title.into(),
        x: ChartAxis { label: "iteration".into(), spacing: Spacing::Whole },
        y: ChartAxis { label: "relative to the start".into(), spacing: Spacing::Log },
        curves: ["red", "green", "blue"]
            .iter()
            .enumerate()
            .map(|(channel, name)| Curve {
                label: (*name).into(),
                dashed: false,
                points: history.iter().map(|step| [step.iteration as f64, value(step)[channel]]).collect(),
            })
            .collect(),
    };
    [
        over_iterations("Residual", |step| step.residual),
        over_iterations("Normal residual", |step| step.normal_residual),
    ]
}

fn document(charts: &[Chart]) -> Result<String> {
    let [width, height] = [PANEL[0] * charts.len() as f64, PANEL[1]];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" role=\"img\" aria-label=\"{}\" font-family=\"{FONT}\" font-size=\"12\">\n",
        escaped(&charts.iter().map(|chart| chart.title.as_str()).collect::<Vec<_>>().join(", "))
    );
    for (index, chart) in charts.iter().enumerate() {
        svg.push_str(&format!("<g transform=\"translate({} 0)\">\n", PANEL[0] * index as f64));
        svg.push_str(&panel(chart)?);
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    Ok(svg)
}

fn axes(chart: &Chart) -> Axes {
    let points = chart.curves.iter().flat_map(|curve| curve.points.iter().copied());
    Axes::over(FRAME, 0.0, [chart.x.spacing, chart.y.spacing], points)
}

fn panel(chart: &Chart) -> Result<String> {
    for curve in &chart.curves {
        if let Some(index) = curve.points.iter().position(|p| !(p[0].is_finite() && p[1].is_finite())) {
            let what = format!("the curve {} of the chart {}", curve.label, chart.title);
            return Err(Error::NonFinite { what, place: format!("point {index}") });
        }
    }
    let axes = axes(chart);
    let curves = chart.curves.iter().enumerate();
    let curves: String = curves.map(|(index, curve)| polyline(curve, color(index), &axes)).collect();
    Ok(format!(
        "<g fill=\"{TEXT}\" style=\"fill:var(--chart-text,{TEXT})\">\n{}{}</g>\n{curves}",
        titles(chart),
        axes.svg(6)
    ))
}

/// Title, axis labels and legend.
fn titles(chart: &Chart) -> String {
    let [left, _, right, _] = FRAME;
    let middle = 0.5 * (left + right);
    let mut text = format!(
        "<text x=\"{}\" y=\"18\" font-size=\"14\" font-weight=\"600\">{}</text>\n\
         <text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n\
         <text x=\"{}\" y=\"18\" text-anchor=\"end\">{}</text>\n",
        left,
        escaped(&chart.title),
        PANEL[1] - 8.0,
        escaped(&chart.x.label),
        right,
        escaped(&chart.y.label),
    );
    let mut x = left;
    for (index, curve) in chart.curves.iter().enumerate() {
        text.push_str(&format!(
            "<path d=\"M{x:.1} 37h18\" {}/><text x=\"{:.1}\" y=\"41\">{}</text>\n",
            stroke(curve, color(index)),
            x + 24.0,
            escaped(&curve.label)
        ));
        // The width of text is not known here; this is that of wide letters.
        x += 40.0 + 6.8 * curve.label.chars().count() as f64;
    }
    text
}

fn stroke(curve: &Curve, color: &str) -> String {
    let dashes = if curve.dashed { " stroke-dasharray=\"6 4\"" } else { "" };
    format!("fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" stroke-linejoin=\"round\"{dashes}")
}

/// The curve, with a dot at its last point, which is also all that one point alone shows; of a few points each has one.
fn polyline(curve: &Curve, color: &str, axes: &Axes) -> String {
    let Some(&last) = curve.points.last() else { return String::new() };
    let step = curve.points.len().div_ceil(MOST_POINTS).max(1);
    let thinned = curve.points[..curve.points.len() - 1].iter().step_by(step).chain([&last]);
    let points: Vec<[f64; 2]> = thinned.map(|&point| axes.point(point)).collect();
    let line: Vec<String> = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    let dots = if points.len() <= FEW_POINTS { &points[..] } else { &points[points.len() - 1..] };
    let dot = |[x, y]: &[f64; 2]| format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{color}\"/>\n");
    format!(
        "<polyline points=\"{}\" {}/>\n{}",
        line.join(" "),
        stroke(curve, color),
        dots.iter().map(dot).collect::<String>()
    )
}

#[cfg(test)]
mod tests {
    use super::super::example;
    use super::*;
    use proptest::prelude::*;

    /// Whether every tag is closed, in the right order, and every attribute is quoted.
    pub(in super::super) fn well_formed(xml: &str) -> bool {
        let mut open = Vec::new();
        let mut rest = xml;
        while let Some(start) = rest.find('<') {
            let Some(length) = rest[start..].find('>') else { return false };
            let tag = &rest[start + 1..start + length];
            rest = &rest[start + length + 1..];
            if tag.contains('<') || !tag.matches('"').count().is_multiple_of(2) {
                return false;
            }
            let name = tag.trim_start_matches('/').split([' ', '\n', '/']).next().unwrap_or_default();
            if tag.starts_with('/') {
                if open.pop() != Some(name) {
                    return false;
                }
            } else if !tag.ends_with('/') {
                open.push(name);
            }
        }
        open.is_empty() && !rest.contains('>')
    }

    #[test]
    fn the_well_formed_are_told_from_the_broken() {
        assert!(well_formed("<a b=\"1\"><c/>x</a>"));
        for broken in ["<a>", "<a></b>", "<a b=\"1></a>", "<a><b></a></b>", "a<", "<a></a>>"] {
            assert!(!well_formed(broken), "{broken}");
        }
    }

    #[test]
    fn three_channels_twice_with_a_legend() {
        let svg = convergence(&example().history).unwrap();
        assert!(well_formed(&svg));
        assert_eq!(svg.matches("<polyline").count(), 6);
        assert_eq!(svg.matches(">blue</text>").count(), 2);
        assert!(svg.contains(">Residual</text>") && svg.contains(">Normal residual</text>"));
    }

    #[test]
    fn a_curve_that_falls_is_drawn_downwards() {
        let points = vec![[0.0, 1.0], [5.0, 0.1], [10.0, 0.01]];
        let curve = Curve { label: "a".into(), dashed: false, points };
        let axis = |spacing| ChartAxis { label: String::new(), spacing };
        let chart = Chart {
            title: String::new(),
            x: axis(Spacing::Linear),
            y: axis(Spacing::Log),
            curves: vec![curve],
        };
        let axes = axes(&chart);
        let [a, b, c] = [0, 1, 2].map(|i| axes.point(chart.curves[0].points[i]));
        assert_eq!([a[0], a[1], c[0], c[1]], FRAME);
        // A straight line: the logarithm is the scale.
        assert!((b[0] - 0.5 * (a[0] + c[0])).abs() < 1e-9 && (b[1] - 0.5 * (a[1] + c[1])).abs() < 1e-9);
    }

    #[test]
    fn names_are_escaped_and_bad_numbers_are_refused() {
        let mut svg = Chart {
            title: "<script>".into(),
            x: ChartAxis { label: "\"".into(), spacing: Spacing::Log },
            y: ChartAxis { label: "&".into(), spacing: Spacing::Log },
            curves: vec![Curve { label: "<b>".into(), dashed: true, points: vec![[1.0, 1.0]] }],
        };
        let text = chart(&svg).unwrap();
        assert!(well_formed(&text) && !text.contains("<script") && text.contains("stroke-dasharray"));
        svg.curves[0].points.push([f64::NAN, 1.0]);
        assert!(matches!(chart(&svg), Err(Error::NonFinite { .. })));
        let step = Progress { residual: [f64::INFINITY; 3], ..Progress::default() };
        assert!(matches!(convergence(&[step]), Err(Error::NonFinite { .. })));
    }

    #[test]
    fn very_long_curves_are_thinned_but_keep_their_ends() {
        let history: Vec<Progress> =
            (0..100_000).map(|iteration| Progress { iteration, ..Progress::default() }).collect();
        let svg = convergence(&history).unwrap();
        assert!(svg.len() < 6 * 20 * (MOST_POINTS + 200));
        assert!(svg.contains(&format!("points=\"{:.1},", FRAME[0])));
        assert!(svg.contains(&format!(" {:.1},", FRAME[2])));
    }

    fn level() -> impl Strategy<Value = f64> {
        prop_oneof![
            Just(0.0),
            Just(1.0),
            Just(f64::MAX),
            Just(f64::MIN_POSITIVE),
            Just(5e-324),
            -1e3..1e3,
            any::<f64>().prop_filter("finite", |x| x.is_finite()),
        ]
    }

    proptest! {
        #[test]
        fn any_finite_history_can_be_drawn(
            steps in proptest::collection::vec((any::<usize>(), [level(), level(), level()]), 0..12),
            constant in level(),
        ) {
            let mut history = Vec::new();
            for (iteration, residual) in steps {
                history.push(Progress { iteration, residual, normal_residual: [constant; 3], ..Progress::default() });
            }
            let svg = convergence(&history).unwrap();
            prop_assert!(well_formed(&svg));
            prop_assert!(!svg.contains("NaN") && !svg.contains("inf"), "{}", svg);
        }
    }
}
