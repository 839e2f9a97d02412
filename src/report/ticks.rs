//! Where an axis has its lines, and how far along it a value lies.

use super::words;

/// More decades than this below the largest value are not drawn: that far down there is only rounding.
const DECADES: f64 = 18.0;

/// How the values of an axis are laid out along it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Spacing {
    /// Evenly.
    #[default]
    Linear,
    /// Evenly, with lines at whole numbers only.
    Whole,
    /// By decades; what is not positive lies at the foot.
    Log,
}

/// The scale of one axis: the range of values shown, linear or in decades.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AxisScale {
    /// The ends, as logarithms of base ten on a logarithmic axis.
    low: f64,
    high: f64,
    spacing: Spacing,
}

impl AxisScale {
    /// The scale that shows all `values`, which are finite. It is never empty. On a logarithmic one values
    /// that are not positive lie at its low end.
    pub(super) fn of(values: impl Iterator<Item = f64>, spacing: Spacing) -> Self {
        let shown = values.map(|v| bounded(v, spacing)).filter(|v| v.is_finite());
        let (low, high) =
            shown.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let nothing = low > high;
        match spacing {
            Spacing::Log if nothing => Self { low: -1.0, high: 0.0, spacing },
            Spacing::Log => Self::decades(low, high),
            _ if nothing => Self { low: 0.0, high: 1.0, spacing },
            _ => Self::linear(low, high, spacing),
        }
    }

    /// From decade to decade; a curve that hardly moves gets only as much as it needs, not less than a third
    /// of a decade, so that rounding does not look like a mountain range.
    fn decades(low: f64, high: f64) -> Self {
        let low = low.max(high - DECADES);
        let (low, high) = if high - low > 0.9 {
            ((low + 1e-3).floor(), (high - 1e-3).ceil().min(308.0))
        } else {
            let middle = 0.5 * (low + high);
            let half = (0.55 * (high - low)).max(0.16);
            (middle - half, middle + half)
        };
        Self { low, high, spacing: Spacing::Log }
    }

    fn linear(low: f64, high: f64, spacing: Spacing) -> Self {
        let room = 1e-9 * low.abs().max(high.abs()).max(1e-3);
        if high - low > room {
            Self { low, high, spacing }
        } else {
            Self { low, high: low + low.abs().max(1.0), spacing }
        }
    }

    /// How far along the axis a value lies, in [0, 1].
    pub(super) fn place(&self, value: f64) -> f64 {
        let value = bounded(value, self.spacing).max(self.low);
        ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }

    /// Places in [0, 1] and labels of about `wanted` lines.
    pub(super) fn ticks(&self, wanted: usize) -> Vec<(f64, String)> {
        let values = match self.spacing {
            Spacing::Log => self.log_values(wanted),
            Spacing::Linear => linear_values(self.low, self.high, wanted, 0.0),
            Spacing::Whole => linear_values(self.low, self.high, wanted, 1.0),
        };
        values.into_iter().map(|value| (self.place(value), words::number(value))).collect()
    }

    fn log_values(&self, wanted: usize) -> Vec<f64> {
        let (low, high) = (self.low - 1e-9, self.high + 1e-9);
        let first = low.ceil() as i32;
        let last = high.floor() as i32;
        if last - first >= 1 {
            let step = ((last - first) as usize).div_ceil(wanted.max(1)).max(1);
            // From the top down, so that the start of the curves always has its line.
            return (first..=last).rev().step_by(step).map(|decade| 10f64.powi(decade)).collect();
        }
        linear_values(10f64.powf(self.low), 10f64.powf(self.high), wanted.min(4), 0.0)
    }
}

/// A value as its axis has it; large enough ones are cut so that differences of two cannot overflow.
fn bounded(value: f64, spacing: Spacing) -> f64 {
    if spacing != Spacing::Log {
        value.clamp(-1e300, 1e300)
    } else if value > 0.0 {
        value.log10()
    } else {
        f64::NEG_INFINITY
    }
}

/// Multiples of 1, 2 or 5 times a power of ten between `low` and `high`, not closer than `least`.
fn linear_values(low: f64, high: f64, wanted: usize, least: f64) -> Vec<f64> {
    let rough = ((high - low) / wanted.max(1) as f64).max(least);
    if !(rough.is_finite() && rough > 0.0) {
        return Vec::new();
    }
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|&s| s >= rough * 0.999);
    let Some(step) = step.filter(|&step| step > 0.0) else { return Vec::new() };
    let first = (low / step - 1e-6).ceil();
    (0..=2 * wanted).map(|i| (first + i as f64) * step).take_while(|&v| v <= high + 1e-6 * step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_a_logarithmic_axis_are_decades_and_zero_is_at_its_foot() {
        let scale = AxisScale::of([1.0, 0.003, 0.0].into_iter(), Spacing::Log);
        assert_eq!(scale.place(1.0), 1.0);
        assert_eq!(scale.place(0.001), 0.0);
        assert_eq!(scale.place(0.0), 0.0);
        assert!((scale.place(0.1) - 2.0 / 3.0).abs() < 1e-12);
        let labels: Vec<_> = scale.ticks(6).into_iter().map(|(_, label)| label).collect();
        assert_eq!(labels, ["1", "0.1", "0.01", "0.001"]);
    }

    #[test]
    fn ticks_are_round_few_and_inside() {
        let labels = |scale: AxisScale| {
            scale.ticks(6).into_iter().map(|(_, label)| label).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(labels(AxisScale::of([0.0, 32.0].into_iter(), Spacing::Linear)), "0 10 20 30");
        assert_eq!(labels(AxisScale::of([0.0, 1.2].into_iter(), Spacing::Linear)), "0 0.2 0.4 0.6 0.8 1 1.2");
        assert_eq!(labels(AxisScale::of([0.0, 2.0].into_iter(), Spacing::Whole)), "0 1 2");
        assert_eq!(labels(AxisScale::of([0.0].into_iter(), Spacing::Whole)), "0 1");
        for spacing in [Spacing::Linear, Spacing::Whole, Spacing::Log] {
            for values in
                [vec![], vec![0.0], vec![1e-320, 1e308], vec![-1e308, 1e308], vec![1.0, 1.0 + 1e-16]]
            {
                let ticks = AxisScale::of(values.iter().copied(), spacing).ticks(6);
                assert!(ticks.len() <= 13 && !ticks.is_empty(), "{values:?} {spacing:?} {ticks:?}");
                assert!(ticks.iter().all(|(place, _)| (0.0..=1.0).contains(place)));
            }
        }
    }
}
