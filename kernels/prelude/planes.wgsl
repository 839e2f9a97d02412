// x as vectors lie in memory: each channel is a plane.
@group(0) @binding(2) var<storage, read> x: array<f32>;

// Of the bound channels; 0 for the others.
fn color_of(e: u32) -> vec3<f32> {
    if CHANNELS == 3u {
        return vec3(x[e], x[params.x_stride + e], x[2u * params.x_stride + e]);
    }
    return vec3(x[e], 0.0, 0.0);
}
