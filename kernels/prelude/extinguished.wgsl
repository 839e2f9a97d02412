// 1 − e^{−s}, whose digits are kept in thin media; twin of src/march/exponential.rs.
fn extinguished(s: f32) -> f32 {
    if s >= 0.5 {
        return 1.0 - exp(-s);
    }
    return series_0(s);
}
