// ‖gradient‖² without what only the bounds hold back
@group(0) @binding(2) var<storage, read> gradient: array<f32>;
@group(0) @binding(3) var<storage, read> x: array<f32>;

const NONE: f32 = 0.0;

fn together(a: f32, b: f32) -> f32 {
    return a + b;
}

fn term(k: u32, i: u32, channel: u32) -> f32 {
    if is_held(x[i], gradient[i], lower(channel), upper(channel)) {
        return 0.0;
    }
    return gradient[i] * gradient[i];
}
