// 2^e and 2^−e a channel for sums in fixed point, from the pieces of max|y| in `largest`; NaN where y is not finite.
// One workgroup of three lanes, one a channel.

struct FixedScaleParams {
    // Where the pieces of each channel begin, how many they are, and the sum of all rows' weights, rounded up.
    begin: vec4<u32>,
    pieces: vec4<u32>,
    row_sums: vec4<f32>,
}

@group(0) @binding(0) var<uniform> params: FixedScaleParams;
@group(0) @binding(1) var<storage, read_write> scales: array<f32>;
@group(0) @binding(2) var<storage, read> largest: array<f32>;

@compute @workgroup_size(3)
fn main(@builtin(local_invocation_id) lane: vec3<u32>) {
    let c = lane.x;
    var bits = 0u;
    for (var k = 0u; k < params.pieces[c]; k++) {
        bits = max(bits, bitcast<u32>(largest[params.begin[c] + k]));
    }
    // max|y| < 2^(y + 1), row sums < 2^(w + 1)
    let y = i32(bits >> 23u) - 127;
    let w = i32(bitcast<u32>(params.row_sums[c]) >> 23u) - 127;
    let e = clamp(59 - y - w, -126, 126);
    var scale = bitcast<f32>(u32(e + 127) << 23u);
    var inverse = bitcast<f32>(u32(127 - e) << 23u);
    if bits >= 0x7f800000u || params.row_sums[c] > HUGE {
        scale = 0.0;
        inverse = bitcast<f32>(0x7fc00000u | (bits & 1u));
    }
    scales[c] = scale;
    scales[4u + c] = inverse;
}
