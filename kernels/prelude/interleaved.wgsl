// x with the channels of an element side by side: one access where planes take three.
@group(0) @binding(2) var<storage, read> x: array<vec4<f32>>;

fn color_of(e: u32) -> vec3<f32> {
    return x[e].xyz;
}
