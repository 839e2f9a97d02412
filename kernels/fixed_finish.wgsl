// mine ← the sums that stand in two words of fixed point
@group(0) @binding(2) var<storage, read> low: array<u32>;
@group(0) @binding(3) var<storage, read> high: array<u32>;
@group(0) @binding(4) var<storage, read> scales: array<f32>;

fn change(k: u32, i: u32, plane: u32, channel: u32) {
    var words = vec2(low[i], high[i]);
    let is_negative = (words.y >> 31u) != 0u;
    if is_negative {
        words = vec2(~words.x + 1u, ~words.y + select(0u, 1u, words.x == 0u));
    }
    let magnitude = f32(words.y) * WORD + f32(words.x);
    mine[i] = select(magnitude, -magnitude, is_negative) * scales[4u + channel];
}
