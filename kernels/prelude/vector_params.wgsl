// A vector is three planes, one a channel, `stride` numbers apart; a binding holds one plane, a slab of one, or all three.

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
    // The element from which on the second pair of bounds holds.
    then: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
    // Two scalars a channel: factors, or l and u.
    a: vec4<f32>,
    b: vec4<f32>,
    then_a: vec4<f32>,
    then_b: vec4<f32>,
}

// l of element k
fn lower(k: u32, channel: u32) -> f32 {
    return select(params.a[channel], params.then_a[channel], k >= params.then);
}

// u of element k
fn upper(k: u32, channel: u32) -> f32 {
    return select(params.b[channel], params.then_b[channel], k >= params.then);
}
