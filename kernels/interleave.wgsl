// together[k] ← the channels of x[k], side by side
@group(0) @binding(0) var<uniform> params: VectorParams;
@group(0) @binding(1) var<storage, read_write> together: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> x: array<f32>;

@compute @workgroup_size(LANES)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    for (var k = id.x; k < params.len; k += groups.x * LANES) {
        together[k] = vec4(x[k], x[params.stride + k], x[2u * params.stride + k], 0.0);
    }
}
