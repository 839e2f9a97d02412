// mine ← the sums that stand in two words of fixed point
@group(0) @binding(2) var<storage, read> low: array<u32>;
@group(0) @binding(3) var<storage, read> high: array<u32>;
@group(0) @binding(4) var<storage, read> scales: array<f32>;

fn change(k: u32, i: u32, plane: u32, channel: u32) {
    mine[i] = float_from_fixed(vec2(low[i], high[i])) * scales[4u + channel];
}
