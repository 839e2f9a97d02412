// One invocation is one lane; it takes every so-many-th element of its channel.

@group(0) @binding(0) var<uniform> params: VectorParams;
@group(0) @binding(1) var<storage, read_write> mine: array<f32>;

@compute @workgroup_size(LANES)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    for (var n = id.x; n < params.len; n += groups.x * LANES) {
        let k = params.first + n;
        change(k, id.y * params.stride + k, id.y, params.channel + id.y);
    }
}
