// mine ← x + a (x − mine)
@group(0) @binding(2) var<storage, read> x: array<f32>;

fn change(k: u32, i: u32, plane: u32, channel: u32) {
    mine[i] = x[i] + params.a[channel] * (x[i] - mine[i]);
}
