//! Extinction in log space.

use crate::scene::Rgb;

/// One pixel as a row of extinction: the optical depth and the weight of each channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LogRow {
    pub(super) depth: Rgb,
    pub(super) weight: Rgb,
}

/// −ln((L − L_m)/(L_bg − L_m)) a channel, with L the wanted radiance, L_bg what is behind and L_m the medium's own (Klehm 2015,
/// eq. 7.13), weighted by `weight` ((L − L_m)/(L_bg − L_m))² |L_bg − L_m|² / `scale`².
///
/// An error δ of L is an error δ / (L − L_m) of the logarithm, so that with this weight the least squares are again those of
/// the radiance, to first order, in units of `scale`. Channels in which the quotient is not positive have no logarithm, and
/// those whose background is as bright as the medium tell nothing: they get no weight. None where no channel is left.
///
/// For a grey medium all channels are replaced by their weighted mean.
pub(super) fn log_row(
    wanted: Rgb,
    behind: Rgb,
    medium: Rgb,
    weight: f32,
    scale: f64,
    is_grey: bool,
) -> Option<LogRow> {
    let mut row = LogRow { depth: [0.0; 3], weight: [0.0; 3] };
    for c in 0..3 {
        let contrast = f64::from(behind[c]) - f64::from(medium[c]);
        let quotient = (f64::from(wanted[c]) - f64::from(medium[c])) / contrast;
        // Not `<= 0`: neither a NaN nor what is below the resolution of f32 may pass.
        if !(contrast.abs() > 1e-6 * scale && quotient > 1e-7 && quotient.is_finite()) {
            continue;
        }
        row.depth[c] = -quotient.ln() as f32;
        row.weight[c] = (f64::from(weight) * (quotient * contrast / scale).powi(2)) as f32;
    }
    if row.weight.iter().all(|&weight| weight <= 0.0) {
        return None;
    }
    if is_grey {
        let sum: f32 = row.weight.iter().sum();
        let mean = (0..3).map(|c| row.weight[c] / sum * row.depth[c]).sum();
        return Some(LogRow { depth: [mean; 3], weight: [sum / 3.0; 3] });
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
            let row = log_row(wanted, behind, medium, 0.5, 1.0, false).unwrap();
            assert!(row.depth.iter().all(|&depth| (depth - tau).abs() <= 1e-3 * (1.0 + tau)), "{row:?}");
            let expected = 0.5 * ((-tau).exp() * 1.5).powi(2);
            assert!((row.weight[0] - expected).abs() <= 1e-3 * expected + 1e-9);
        }
    }

    #[test]
    fn channels_without_a_logarithm_are_left_out() {
        let row = log_row([0.5, 0.2, 0.9], [1.0, 1.0, 0.5], [0.0, 0.3, 0.5], 1.0, 1.0, false).unwrap();
        assert!(row.weight[0] > 0.0);
        assert_eq!(row.weight[1..], [0.0, 0.0], "darker than the medium; no contrast");
        assert_eq!(log_row([0.2; 3], [1.0; 3], [0.3; 3], 1.0, 1.0, true), None);
        assert_eq!(log_row([f32::NAN; 3], [1.0; 3], [0.0; 3], 1.0, 1.0, true), None);
        let grey = log_row([0.5, 0.2, 0.9], [1.0, 1.0, 0.5], [0.0, 0.3, 0.5], 1.0, 1.0, true).unwrap();
        assert_eq!(grey.depth, [row.depth[0]; 3]);
    }
}
