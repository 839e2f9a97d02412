// Sums in 64-bit fixed point: additions of integers, whose order does not matter.
// Range  |Σ w y| ≤ max|y| Σ_k (sum of row k) =: m, and a number stands for 2^e of itself with 2^e m ≤ 2^61, so that no sum, and no
//        partial sum in any order, leaves 63 bits and a sign; src/gpu/vectors/fixed_sums.rs has the proof.
@group(0) @binding(2) var<storage, read_write> low: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> high: array<atomic<u32>>;
// 2^e a channel, and 2^−e behind.
@group(0) @binding(4) var<storage, read> scales: array<f32>;

fn scale_of_near(plane: u32) -> f32 {
    return scales[parameters.channel + plane];
}

fn deposit(i: u32, value: f32, plane: u32) {
    deposit_words(i, fixed_from_float(value * scale_of_near(plane)), plane);
}

fn deposit_words(i: u32, words: vec2<u32>, plane: u32) {
    let before = atomicAdd(&low[i], words.x);
    let carry = select(0u, 1u, before + words.x < before);
    if words.y + carry != 0u {
        atomicAdd(&high[i], words.y + carry);
    }
}
