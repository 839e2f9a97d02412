use crate::{Error, Result};

/// A homogeneous medium that fills all space.
#[derive(Debug, Clone, PartialEq)]
pub struct Medium {
    /// Extinction coefficient σ_t a channel, in 1/metre.
    pub sigma_t: [f64; 3],
    /// Single-scattering albedo ρ a channel, in [0, 1].
    pub albedo: [f64; 3],
    /// Mean cosine g of the Henyey–Greenstein phase function, inside (−1, 1); positive scatters forwards.
    pub g: f64,
}

impl Medium {
    /// Errors: [`Error::Value`] for an extinction that is not positive and finite, an albedo outside [0, 1] or `g`
    /// outside (−1, 1).
    pub fn new(sigma_t: [f64; 3], albedo: [f64; 3], g: f64) -> Result<Self> {
        if !sigma_t.iter().all(|&s| s.is_finite() && s > 0.0) {
            return Err(Error::value("sigma_t", format!("{sigma_t:?}"), "positive and finite (1/metre)"));
        }
        if !albedo.iter().all(|&a| (0.0..=1.0).contains(&a)) {
            return Err(Error::value("albedo", format!("{albedo:?}"), "between 0 and 1"));
        }
        if !(g > -1.0 && g < 1.0) {
            return Err(Error::value("g", g, "inside (-1, 1)"));
        }
        Ok(Self { sigma_t, albedo, g })
    }

    /// Whether one number stands for all three channels.
    pub fn is_grey(&self) -> bool {
        let equal = |v: [f64; 3]| v[0] == v[1] && v[1] == v[2];
        equal(self.sigma_t) && equal(self.albedo)
    }

    /// Its phase function f(θ), in 1/steradian; see [`henyey_greenstein`].
    pub fn phase(&self, cosine: f64) -> f64 {
        henyey_greenstein(self.g, cosine)
    }

    /// Transmittance e^{−σ_t t} a channel over `t` metres.
    pub fn transmittance(&self, t: f64) -> [f64; 3] {
        self.sigma_t.map(|s| (-s * t).exp())
    }

    /// The distance in metres after which the clearest channel's transmittance is `bound`.
    pub fn reach(&self, bound: f64) -> f64 {
        -bound.ln() / self.sigma_t[0].min(self.sigma_t[1]).min(self.sigma_t[2])
    }
}

/// Henyey–Greenstein phase function f(θ) with mean cosine `g`, in 1/steradian.
///
/// `cosine` is between the direction in which light travels before and after the scattering.
/// Source: Henyey and Greenstein 1941, eq. 2; Klehm 2015, eq. 2.6.
pub fn henyey_greenstein(g: f64, cosine: f64) -> f64 {
    let denominator = (1.0 + g * g - 2.0 * g * cosine).max(0.0);
    (1.0 - g * g) / (4.0 * std::f64::consts::PI * denominator * denominator.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phase_function_integrates_to_one_over_the_sphere() -> Result<()> {
        for g in [-0.8, 0.0, 0.3, 0.8] {
            let medium = Medium::new([1.0; 3], [1.0; 3], g)?;
            let n = 200_000;
            let mean: f64 =
                (0..n).map(|i| medium.phase(-1.0 + 2.0 * (i as f64 + 0.5) / n as f64)).sum::<f64>()
                    / n as f64;
            assert!((mean * 4.0 * std::f64::consts::PI - 1.0).abs() < 1e-6, "g = {g}");
        }
        Ok(())
    }

    #[test]
    fn impossible_media_are_refused() {
        assert!(Medium::new([0.0; 3], [0.5; 3], 0.0).is_err());
        assert!(Medium::new([f64::INFINITY; 3], [0.5; 3], 0.0).is_err());
        assert!(Medium::new([1.0; 3], [1.5, 0.0, 0.0], 0.0).is_err());
        assert!(Medium::new([1.0; 3], [0.5; 3], 1.0).is_err());
        assert!(Medium::new([1.0; 3], [0.5; 3], f64::NAN).is_err());
    }
}
