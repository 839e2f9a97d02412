//! The frame of a chart: where values lie in it, and its lines and numbers.

use super::ticks::{AxisScale, Spacing};
use super::words::escaped;

pub(super) const TEXT: &str = "#83898f";
/// Told apart on white and on black; red, green and blue first, for the channels.
const COLORS: [&str; 7] = ["#d0605c", "#58a066", "#5a8fd6", "#c08a3e", "#9573c4", "#4aa3a3", "#b96a9b"];
/// How many there are until they begin again.
pub(super) const DISTINCT: usize = COLORS.len();

pub(super) fn color(index: usize) -> &'static str {
    COLORS[index % DISTINCT]
}

/// Two axes and what lies between them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axes {
    /// Left, top, right and bottom.
    pub(super) frame: [f64; 4],
    /// The part of a side that is left free at its ends, so that the outermost marks are whole.
    pub(super) inset: f64,
    x: AxisScale,
    y: AxisScale,
}

impl Axes {
    /// Over all of these points.
    pub(super) fn over(
        frame: [f64; 4],
        inset: f64,
        spacing: [Spacing; 2],
        points: impl Iterator<Item = [f64; 2]> + Clone,
    ) -> Self {
        let scale = |axis: usize| AxisScale::of(points.clone().map(|point| point[axis]), spacing[axis]);
        Self { frame, inset, x: scale(0), y: scale(1) }
    }

    pub(super) fn point(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.across(self.x.place(x)), self.up(self.y.place(y))]
    }

    fn across(&self, place: f64) -> f64 {
        let [left, _, right, _] = self.frame;
        left + self.inner(place) * (right - left)
    }

    fn up(&self, place: f64) -> f64 {
        let [_, top, _, bottom] = self.frame;
        bottom - self.inner(place) * (bottom - top)
    }

    fn inner(&self, place: f64) -> f64 {
        self.inset + (1.0 - 2.0 * self.inset) * place
    }

    /// Lines across with their numbers, about so many, and numbers along the foot.
    pub(super) fn svg(&self, lines_across: usize) -> String {
        let [left, _, right, bottom] = self.frame;
        let (mut lines, mut labels) = (String::new(), String::new());
        for (place, label) in self.y.ticks(lines_across) {
            let y = self.up(place);
            lines.push_str(&format!("M{left} {y:.1}H{right}"));
            labels.push_str(&format!(
                "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\n",
                left - 10.0,
                y + 4.0,
                escaped(&label)
            ));
        }
        for (place, label) in self.x.ticks(8) {
            let x = self.across(place);
            lines.push_str(&format!("M{x:.1} {bottom}v5"));
            labels.push_str(&format!(
                "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n",
                bottom + 19.0,
                escaped(&label)
            ));
        }
        format!(
            "<path d=\"{lines}M{left} {bottom}H{right}\" fill=\"none\" stroke=\"{TEXT}\" stroke-opacity=\"0.35\" \
             style=\"stroke:var(--chart-line,{TEXT})\"/>\n{labels}"
        )
    }
}
