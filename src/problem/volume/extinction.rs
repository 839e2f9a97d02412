//! Extinction in log space.

use crate::scene::Rgb;

/// One pixel as a row of extinction, channel by channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LogRow {
    pub(super) depth: Rgb,
    pub(super) weight: Rgb,
    /// The wanted radiance in the unit of the depth: an error of such a part of it is an error of that part of the radiance.
    pub(super) shown: Rgb,
}

/// The optical depth that a pixel asks for, with L the wanted radiance, L_bg what is behind and L_m the medium's own.
///
/// With t = (L − L_m)/(L_bg − L_m) it is −ln t (Klehm 2015, eq. 7.13). Around a transmittance T that is known it is the tangent there,
/// −ln T + 1 − t/T: a step of Gauss–Newton on the radiance, which is the logarithm itself where T = t.
///
/// An error δ of L is an error δ / (T (L_bg − L_m)) of the depth, so that with the weight `weight` T² |L_bg − L_m|² / `scale`² the
/// least squares are again those of the radiance, to first order, in units of `scale`. Channels in which T is not positive have no
/// logarithm, and those whose background is as bright as the medium tell nothing: they get no weight. None where no channel is left.
///
/// For a grey medium all channels are replaced by their weighted mean.
pub(super) fn log_row(
    wanted: Rgb,
    behind: Rgb,
    medium: Rgb,
    weight: f32,
    scale: f64,
    is_grey: bool,
    around: Option<[f64; 3]>,
) -> Option<LogRow> {
    let mut row = LogRow { depth: [0.0; 3], weight: [0.0; 3], shown: [0.0; 3] };
    for c in 0..3 {
        let contrast = f64::from(behind[c]) - f64::from(medium[c]);
        let quotient = (f64::from(wanted[c]) - f64::from(medium[c])) / contrast;
        let at = around.map_or(quotient, |around| around[c]);
        // Not `<= 0`: neither a NaN nor what is below the resolution of f32 may pass.
        if !(contrast.abs() > 1e-6 * scale && at > 1e-7 && at.is_finite() && quotient.is_finite()) {
            continue;
        }
        row.depth[c] = (1.0 - quotient / at - at.ln()) as f32;
        row.weight[c] = (f64::from(weight) * (at * contrast / scale).powi(2)) as f32;
        row.shown[c] = (f64::from(wanted[c]) / (at * contrast)) as f32;
    }
    if row.weight.iter().all(|&weight| weight <= 0.0) {
        return None;
    }
    if is_grey {
        let sum: f32 = row.weight.iter().sum();
        let mean =
            |of: fn(f32) -> f32, values: Rgb| (0..3).map(|c| row.weight[c] / sum * of(values[c])).sum();
        let (depth, shown): (f32, f32) =
            (mean(|depth| depth, row.depth), mean(|shown| shown * shown, row.shown));
        return Some(LogRow { depth: [depth; 3], weight: [sum / 3.0; 3], shown: [shown.sqrt(); 3] });
    }
    Some(row)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_undoes_the_model() {
        let (behind, medium) = ([2.0, 1.0, 0.1], [0.5, 0.0, 0.4]);
        for tau in [0.0f32, 0.01, 0.5, 3.0, 8.0] {
            let wanted: Rgb = std::array::from_fn(|c| medium[c] + (behind[c] - medium[c]) * (-tau).exp());
            let row = log_row(wanted, behind, medium, 0.5, 1.0, false, None).unwrap();
            assert!(row.depth.iter().all(|&depth| (depth - tau).abs() <= 1e-3 * (1.0 + tau)), "{row:?}");
            let expected = 0.5 * ((-tau).exp() * 1.5).powi(2);
            assert!((row.weight[0] - expected).abs() <= 1e-3 * expected + 1e-9);
            let of_radiance = 0.5 * wanted[0].powi(2);
            let shown = row.weight[0] * row.shown[0].powi(2);
            assert!((shown - of_radiance).abs() <= 1e-4 * of_radiance, "{shown} of {of_radiance}");
        }
    }

    #[test]
    fn the_tangent_is_a_step_of_gauss_newton_on_the_radiance() {
        let (behind, medium, tau) = ([2.0f32, 1.0, 0.1], [0.5f32, 0.0, 0.4], [0.4f32, 1.5, 0.2]);
        let present: Rgb = std::array::from_fn(|c| medium[c] + (behind[c] - medium[c]) * (-tau[c]).exp());
        let around = tau.map(|tau| f64::from(-tau).exp());
        let wanted: Rgb = std::array::from_fn(|c| present[c] + 0.1 * (behind[c] - medium[c]));
        let row = log_row(wanted, behind, medium, 1.0, 1.0, false, Some(around)).unwrap();
        for c in 0..3 {
            // ∂L/∂τ = −(L_bg − L_m) T.
            let slope = -(behind[c] - medium[c]) * (-tau[c]).exp();
            let step = (wanted[c] - present[c]) / slope;
            assert!((row.depth[c] - tau[c] - step).abs() <= 1e-5, "{row:?}");
            assert!((row.weight[c] - slope * slope).abs() <= 1e-5);
        }
        let there = log_row(present, behind, medium, 1.0, 1.0, false, Some(around)).unwrap();
        let logarithm = log_row(present, behind, medium, 1.0, 1.0, false, None).unwrap();
        (0..3).for_each(|c| assert!((there.depth[c] - logarithm.depth[c]).abs() <= 1e-5));
    }

    #[test]
    fn channels_without_a_logarithm_are_left_out() {
        let row = log_row([0.5, 0.2, 0.9], [1.0, 1.0, 0.5], [0.0, 0.3, 0.5], 1.0, 1.0, false, None).unwrap();
        assert!(row.weight[0] > 0.0);
        assert_eq!(row.weight[1..], [0.0, 0.0], "darker than the medium; no contrast");
        assert_eq!(log_row([0.2; 3], [1.0; 3], [0.3; 3], 1.0, 1.0, true, None), None);
        assert_eq!(log_row([f32::NAN; 3], [1.0; 3], [0.0; 3], 1.0, 1.0, true, None), None);
        let grey = log_row([0.5, 0.2, 0.9], [1.0, 1.0, 0.5], [0.0, 0.3, 0.5], 1.0, 1.0, true, None).unwrap();
        assert_eq!(grey.depth, [row.depth[0]; 3]);
    }
}
