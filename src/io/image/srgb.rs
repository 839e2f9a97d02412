/// The sRGB value (IEC 61966-2-1) of a linear one; 0 and 1 stay where they are, values beyond are not clamped.
pub fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The linear value of an sRGB one (IEC 61966-2-1); inverse of [`srgb_from_linear`].
pub fn linear_from_srgb(srgb: f32) -> f32 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

/// Whether white, red, green and blue lie where Rec. 709 has them, as x and y.
pub(super) fn is_rec_709(primaries: [[f64; 2]; 4]) -> bool {
    const REC_709: [[f64; 2]; 4] = [[0.3127, 0.329], [0.64, 0.33], [0.3, 0.6], [0.15, 0.06]];
    let both = primaries.as_flattened().iter().zip(REC_709.as_flattened());
    both.into_iter().all(|(given, expected)| (given - expected).abs() < 5e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transfer_function_has_the_values_of_the_standard() {
        for (linear, srgb) in [(0.0, 0.0), (1.0, 1.0), (0.5, 0.735_357), (0.18, 0.461_356), (0.002, 0.025_84)]
        {
            assert!((srgb_from_linear(linear) - srgb).abs() < 1e-5, "{linear}");
            assert!((linear_from_srgb(srgb) - linear).abs() < 1e-5, "{srgb}");
        }
    }

    #[test]
    fn every_code_of_eight_and_sixteen_bits_comes_back() {
        for (top, step) in [(255_u32, 1), (65535, 7)] {
            for code in (0..=top).step_by(step) {
                let linear = linear_from_srgb(code as f32 / top as f32);
                assert_eq!((srgb_from_linear(linear) * top as f32).round() as u32, code, "of {top}");
            }
        }
    }

    #[test]
    fn only_the_primaries_of_rec_709_are_rec_709() {
        let rounded = [[0.3127, 0.329], [0.639, 0.331], [0.3, 0.6], [0.15, 0.06]];
        assert!(is_rec_709(rounded));
        for place in 0..8 {
            let mut other = rounded;
            other.as_flattened_mut()[place] += 0.01;
            assert!(!is_rec_709(other), "{place}");
        }
        assert!(!is_rec_709([[f64::NAN; 2]; 4]));
    }
}
