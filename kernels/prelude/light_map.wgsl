// THE traversal of a view ray through light map and shadow map; twin of src/march/light_map.rs. It calls visit(texel, weight) of
// the consumer that it is compiled into, for every texel once: weight ρ f ∫ σ e^{−σt} V v dt (Kol 2017, eq. 1).
// Lengths are measured from where the ray enters the light map, so that f32 has its digits where they are needed.

struct Transport {
    // 1 / metre
    sigma_t: vec4<f32>,
    light_size: vec2<i32>,
    shadow_size: vec2<i32>,
    // Texels of the shadow map a texel of the light map.
    shadow_from_light: vec2<f32>,
    // The number of levels above the texels of the shadow map.
    shadow_top: u32,
    // Steps a ray of the papers' march.
    steps: u32,
    // Of each level of the pyramid where it begins in `ranges`, and its width.
    levels: array<vec4<u32>, LEVELS>,
}

struct Ray {
    // Where it enters the light map, in texels of the light map, and texels a metre.
    entry: vec2<f32>,
    slope: vec2<f32>,
    // The same point in texels of the shadow map.
    shadow_entry: vec2<f32>,
    // Between which lengths it is over the shadow map.
    shadow_clip: vec2<f32>,
    // Depth along the light at the entry, in metres from where stored depths count, and its change a metre.
    depth: f32,
    depth_slope: f32,
    // Metres over the light map, and from the eye to the entry.
    length: f32,
    before: f32,
    // Scattering times transmittance from the eye to the entry, a channel.
    strength: vec4<f32>,
}

// Which rows are walked, and which elements are bound.
struct Pass {
    // Rows to walk; the first row of the bound y, and from one channel of y to the next.
    rows: u32,
    y_first: u32,
    y_stride: u32,
    // The first bound channel.
    channel: u32,
    // The first bound element of x, how many there are, and from one channel of x to the next.
    x_first: u32,
    x_len: u32,
    x_stride: u32,
    // Whether slabs of x have been here before.
    again: u32,
}

struct Piece {
    cell: vec2<i32>,
    start: vec2<f32>,
    change: vec2<f32>,
}

@group(0) @binding(0) var<uniform> parameters: Pass;
@group(1) @binding(2) var<uniform> transport: Transport;
@group(2) @binding(0) var<storage, read> rays: array<Ray>;

var<private> reached: vec2<i32>;

fn cell_at(origin: vec2<f32>, slope: vec2<f32>, t: f32) -> vec2<i32> {
    return clamp(vec2<i32>(origin + slope * t), vec2(0), transport.light_size + (EXTRA - 1));
}

fn piece_at(origin: vec2<f32>, slope: vec2<f32>, cell: vec2<i32>, t: f32, length: f32) -> Piece {
    return Piece(cell, origin + slope * t - vec2<f32>(cell), slope * length);
}

fn strength_at(ray: Ray, t: f32) -> Weight {
    return weight_of(ray.strength.xyz * exp(-transport.sigma_t.xyz * t));
}

// Visits the pieces of [a, b] cell by cell (Amanatides and Woo 1987); every crossing is computed from its own grid line.
fn integrate_stretch(ray: Ray, origin: vec2<f32>, inverse: vec2<f32>, a: f32, b: f32) {
    let ahead = ray.slope > vec2(0.0);
    let still = ray.slope == vec2(0.0);
    let last = transport.light_size + (EXTRA - 1);
    let sigma_t = weight_of(transport.sigma_t.xyz);
    let begin = cell_at(origin, ray.slope, a);
    // Whatever the rounding, no stretch begins behind the one before.
    var cell = select(min(begin, reached), max(begin, reached), ahead);
    var t = a;
    loop {
        let line = vec2<f32>(select(cell, cell + 1, ahead));
        let crossing = select((line - origin) * inverse, vec2(HUGE), still);
        let end = min(min(crossing.x, crossing.y), b);
        if end > t {
            let piece = piece_at(origin, ray.slope, cell, t, end - t);
            integrate(piece, sigma_t * (end - t), strength_at(ray, t));
            t = end;
            reached = cell;
        }
        if end >= b {
            break;
        }
        let onwards = select(vec2(-1), vec2(1), ahead);
        if crossing.x <= crossing.y {
            cell.x += onwards.x;
        } else {
            cell.y += onwards.y;
        }
        if any(cell < vec2(0)) || any(cell > last) {
            break;
        }
    }
}

// The papers' march: steps of equal length from the eye to where the ray ends or leaves the map, each worth its midpoint.
fn march_stretch(ray: Ray, origin: vec2<f32>, a: f32, b: f32) {
    let step = (ray.before + ray.length) / f32(transport.steps);
    let sigma_t = weight_of(transport.sigma_t.xyz);
    let first = u32(max(ceil((ray.before + a) / step - 0.5), 0.0));
    let end = min(u32(max(ceil((ray.before + b) / step - 0.5), 0.0)), transport.steps);
    for (var j = first; j < end; j++) {
        let t = (f32(j) + 0.5) * step - ray.before;
        let cell = cell_at(origin, ray.slope, t);
        sample(piece_at(origin, ray.slope, cell, t, 0.0), strength_at(ray, t) * sigma_t * step);
    }
}

fn walk(row: u32) {
    let ray = rays[row];
    if ray.length <= 0.0 {
        return;
    }
    let origin = ray.entry + SHIFT;
    let inverse = inverse_of(ray.slope);
    reached = cell_at(origin, ray.slope, 0.0);
    window_begin();
    lit_begin(ray);
    var stretch: vec2<f32>;
    while lit_next(ray, &stretch) {
        if MARCH {
            march_stretch(ray, origin, stretch.x, stretch.y);
        } else {
            integrate_stretch(ray, origin, inverse, stretch.x, stretch.y);
        }
    }
    window_finish();
}

// Place of a texel among the bound elements of x; not below `x_len` where it is not bound.
fn local_element(texel: vec2<i32>) -> u32 {
    return u32(texel.y * transport.light_size.x + texel.x) - parameters.x_first;
}
