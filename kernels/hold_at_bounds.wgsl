// mine ← 0 where x is at a bound
@group(0) @binding(2) var<storage, read> x: array<f32>;

fn change(k: u32, i: u32, plane: u32, channel: u32) {
    if x[i] <= lower(channel) || x[i] >= upper(channel) {
        mine[i] = 0.0;
    }
}
