// A vector is three planes, one a channel, `stride` numbers apart; a binding holds one plane, a slab of one, or all three.

struct VectorParams {
    // Elements of what is bound that are worked on: how many, and numbers from one channel to the next.
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
    // The first element that is worked on.
    first: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
    // Two scalars a channel: factors, or l and u.
    a: vec4<f32>,
    b: vec4<f32>,
    // A factor a channel beside l and u.
    c: vec4<f32>,
}

// l
fn lower(channel: u32) -> f32 {
    return params.a[channel];
}

// u
fn upper(channel: u32) -> f32 {
    return params.b[channel];
}
