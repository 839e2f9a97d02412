// Which triangle each pixel sees first: a depth pass that keeps numbers of triangles instead of depths. The host then meets
// that triangle with the pixel's own ray in f64, so that no distance is rounded to what a rasterizer interpolates.

struct Corner {
    @location(0) clip: vec4<f32>,
    // From 1; 0 is the sky.
    @location(1) triangle: u32,
}

struct Seen {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) triangle: u32,
}

@vertex
fn corner(corner: Corner) -> Seen {
    return Seen(corner.clip, corner.triangle);
}

@fragment
fn seen(seen: Seen) -> @location(0) u32 {
    return seen.triangle;
}
