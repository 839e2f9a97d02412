// What a ray carries back to the elements that it meets.
var<private> carrying: vec3<f32>;

// The bound channels of a row, 0 for the others.
fn bound_of_y(row: u32) -> vec3<f32> {
    let i = parameters.y_first + row;
    if CHANNELS == 3u {
        return vec3(y[i], y[parameters.y_stride + i], y[2u * parameters.y_stride + i]);
    }
    return vec3(y[i], 0.0, 0.0);
}
