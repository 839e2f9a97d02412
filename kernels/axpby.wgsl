// mine ← a x + b mine; where b is 0 it forgets what it was, NaN included.
@group(0) @binding(2) var<storage, read> x: array<f32>;

fn change(k: u32, i: u32, plane: u32, channel: u32) {
    let a = params.a[channel];
    let b = params.b[channel];
    if b == 0.0 {
        mine[i] = a * x[i];
    } else {
        mine[i] = a * x[i] + b * mine[i];
    }
}
