// Sums in 64-bit fixed point, two words each: additions of integers, whose order does not matter.
// Range  |Σ w y| ≤ max|y| Σ_k (sum of row k) =: m, and a number stands for 2^e of itself with 2^e m ≤ 2^61, so that no sum, and no
//        partial sum in any order, leaves 63 bits and a sign; src/gpu/fixed_point.rs has the proof.
@group(0) @binding(2) var<storage, read_write> low: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> high: array<atomic<u32>>;
// 2^e a channel, and 2^−e behind.
@group(0) @binding(4) var<storage, read> scales: array<f32>;

var<workgroup> near_low: array<atomic<u32>, NEAR_NUMBERS>;
var<workgroup> near_high: array<atomic<u32>, NEAR_NUMBERS>;

// The nearest integer in two words, low and high, of two's complement.
fn fixed_from_float(value: f32) -> vec2<u32> {
    let magnitude = round(abs(value));
    let above = floor(magnitude * WORD_INVERSE);
    let words = vec2(u32(magnitude - above * WORD), u32(above));
    if value >= 0.0 {
        return words;
    }
    let flipped = ~words.x + 1u;
    return vec2(flipped, ~words.y + select(0u, 1u, flipped == 0u));
}

fn deposit(i: u32, value: f32, plane: u32) {
    deposit_words(i, fixed_from_float(value * scales[parameters.channel + plane]));
}

fn deposit_words(i: u32, words: vec2<u32>) {
    let before = atomicAdd(&low[i], words.x);
    let carry = select(0u, 1u, before + words.x < before);
    if words.y + carry != 0u {
        atomicAdd(&high[i], words.y + carry);
    }
}

fn deposit_near(k: u32, value: f32, plane: u32) {
    let words = fixed_from_float(value * scales[parameters.channel + plane]);
    let before = atomicAdd(&near_low[k], words.x);
    let carry = select(0u, 1u, before + words.x < before);
    if words.y + carry != 0u {
        atomicAdd(&near_high[k], words.y + carry);
    }
}

fn flush_near(i: u32, k: u32) {
    let words = vec2(atomicLoad(&near_low[k]), atomicLoad(&near_high[k]));
    if any(words != vec2(0u)) {
        deposit_words(i, words);
    }
}
