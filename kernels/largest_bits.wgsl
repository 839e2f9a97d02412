// max |y|, by the bits of the numbers: an infinity is larger than all numbers, and a NaN larger still
@group(0) @binding(2) var<storage, read> y: array<f32>;

const NONE: f32 = 0.0;

fn together(a: f32, b: f32) -> f32 {
    return bitcast<f32>(max(bitcast<u32>(a), bitcast<u32>(b)));
}

fn term(k: u32, i: u32, channel: u32) -> f32 {
    return bitcast<f32>(bitcast<u32>(y[i]) & 0x7fffffffu);
}
