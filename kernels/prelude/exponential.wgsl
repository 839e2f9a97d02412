// Closed forms of ∫₀¹ s e^{−su} uᵏ du that keep their digits in thin and thick media; twin of src/march/exponential.rs.
// Error  relative 2e-6, held by a test against the twin in f64

// The mean of a cubic over what is extinguished over optical depth s, by two of its values: where in [0, 1] they are, and the weight of
// the first. From mean, variance and third cumulant of that distribution, each minus the derivative of the one before; twin of gauss_2.
fn gauss_2(s: f32) -> vec3<f32> {
    var mean: f32;
    var variance: f32;
    var third: f32;
    if s < 1.0 {
        let q = s * s;
        mean = 0.5 - s * (1.0 / 12.0 - q * (1.0 / 720.0 - q * (1.0 / 30240.0 - q * (1.0 / 1209600.0 - q / 47900160.0))));
        variance = 1.0 / 12.0 - q * (3.0 / 720.0 - q * (5.0 / 30240.0 - q * (7.0 / 1209600.0 - q * (9.0 / 47900160.0))));
        third = s * (6.0 / 720.0 - q * (20.0 / 30240.0 - q * (42.0 / 1209600.0 - q * (72.0 / 47900160.0))));
    } else {
        let left = exp(-s);
        let rest = left / (1.0 - left);
        let once = 1.0 / s;
        mean = once - rest;
        variance = once * once - rest * (1.0 + rest);
        third = 2.0 * once * once * once - rest * (1.0 + rest) * (1.0 + 2.0 * rest);
    }
    let spread = sqrt(variance);
    let skew = 0.5 * third / (variance * spread);
    let root = sqrt(1.0 + skew * skew);
    return vec3(mean + spread * (skew - root), mean + spread * (skew + root), 0.5 * (skew + root) / root);
}

// M₀, M₁, M₂: for small s M₂ as its series, the others by the recurrence s Mₖ = k Mₖ₋₁ − s e^{−s} run downwards.
fn moments(s: f32) -> vec3<f32> {
    if s >= 0.5 {
        let left = exp(-s);
        let m0 = 1.0 - left;
        let m1 = (m0 - s * left) / s;
        return vec3(m0, m1, (m1 + m1 - s * left) / s);
    }
    let m2 = series_2(s);
    let m0 = (s + 0.5 * s * s * (1.0 + m2)) / (1.0 + s + 0.5 * s * s);
    return vec3(m0, 0.5 * s * (m2 + 1.0 - m0), m2);
}
