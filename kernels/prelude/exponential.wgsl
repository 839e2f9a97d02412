// Closed forms of ∫₀¹ s e^{−su} uᵏ du that keep their digits in thin and thick media; twin of src/march/exponential.rs.
// Error  relative 2e-6, held by a test against the twin in f64

// 1 − e^{−s}
fn extinguished(s: f32) -> f32 {
    if s >= 0.5 {
        return 1.0 - exp(-s);
    }
    return series_0(s);
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
