// One invocation is one lane; it takes every so-many-th element of its channel. A vector is three planes, `stride`
// numbers apart; a binding holds one plane, a slab of one, or all three.

struct VectorParams {
    // Numbers a channel of `mine`, and from one channel to the next.
    len: u32,
    stride: u32,
    // The first channel that is bound.
    channel: u32,
    // Elements of the other vector that are bound, and from one channel to the next.
    other_first: u32,
    other_len: u32,
    other_stride: u32,
    // Whether slabs of the other vector have been here before.
    again: u32,
    // Where a reduction writes.
    results: u32,
    a: vec4<f32>,
    b: vec4<f32>,
}

@group(0) @binding(0) var<uniform> params: VectorParams;
@group(0) @binding(1) var<storage, read_write> mine: array<f32>;

@compute @workgroup_size(LANES)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    for (var k = id.x; k < params.len; k += groups.x * LANES) {
        change(k, id.y * params.stride + k, id.y, params.channel + id.y);
    }
}
