// Numbers of 64 bits in two words, low and high, of two's complement: their sums are the same in any order.

fn fixed_from_float(value: f32) -> vec2<u32> {
    let magnitude = round(abs(value));
    let above = floor(magnitude * WORD_INVERSE);
    let words = vec2(u32(magnitude - above * WORD), u32(above));
    return select(words, negated(words), value < 0.0);
}

fn float_from_fixed(words: vec2<u32>) -> f32 {
    let is_negative = (words.y >> 31u) != 0u;
    let magnitude = select(words, negated(words), is_negative);
    let value = f32(magnitude.y) * WORD + f32(magnitude.x);
    return select(value, -value, is_negative);
}

fn negated(words: vec2<u32>) -> vec2<u32> {
    return vec2(~words.x + 1u, ~words.y + select(0u, 1u, words.x == 0u));
}
