// THE traversal of a view ray through light map and shadow map; twin of src/march/light_map.rs. It calls visit(texel, weight) of
// the consumer that it is compiled into, for every texel once: weight ρ f ∫ σ e^{−σt} V v dt (Kol 2017, eq. 1).
//
// Lengths are measured from where the ray enters the light map, and counted in ticks: its length over the map is TICKS of
// them. Crossings of grid lines are ticks in 32.32 fixed point, made by the host in f64 and added up exactly, so that the
// shortest piece far out keeps its digits, where f32 would have left three of them.

struct LightMapUniform {
    // 1 / metre
    sigma_t: vec4<f32>,
    light_size: vec2<i32>,
    shadow_size: vec2<i32>,
    // The number of levels above the texels of the shadow map.
    shadow_top: u32,
    // Steps a ray of the papers' march.
    steps: u32,
    pad: vec2<u32>,
    // Of each level of the pyramid where it begins in `ranges`, and its width.
    levels: array<vec4<u32>, LEVELS>,
}

struct LightMapRay {
    // Scattering times transmittance from the eye to the entry, a channel.
    strength: vec4<f32>,
    // The cell of the basis where it enters the light map, and where inside it.
    entry_cell: vec2<i32>,
    entry_fraction: vec2<f32>,
    // When it crosses the first line along each axis, in ticks and 2⁻³² of a tick, and how long it takes to the next.
    first_high: vec2<u32>,
    first_low: vec2<u32>,
    step_high: vec2<u32>,
    step_low: vec2<u32>,
    // Texels a metre.
    slope: vec2<f32>,
    // Between which ticks it is over the shadow map; the texel where that begins, and the lines that it crosses from there on.
    shadow_clip: vec2<u32>,
    shadow_cell: vec2<i32>,
    shadow_first_high: vec2<u32>,
    shadow_first_low: vec2<u32>,
    shadow_step_high: vec2<u32>,
    shadow_step_low: vec2<u32>,
    // Between which ticks its depth is among the stored ones; the depth where that begins, and its change a tick.
    depth_window: vec2<u32>,
    depth: i32,
    depth_step_high: i32,
    depth_step_low: u32,
    depth_slope: f32,
    // Metres over the light map, and from the eye to the entry.
    length: f32,
    before: f32,
    pad: vec2<f32>,
}

// What the unknown has at an element.
alias Cell = vec2<i32>;

struct Piece {
    cell: vec2<i32>,
    start: vec2<f32>,
    change: vec2<f32>,
}

@group(1) @binding(2) var<uniform> transport: LightMapUniform;
@group(2) @binding(0) var<storage, read> rays: array<LightMapRay>;

// Where the walk is: the cell; when each axis crosses its next line; since when it has been in the cell, and where it was
// inside it then.
var<private> cell: vec2<i32>;
var<private> next_high: vec2<u32>;
var<private> next_low: vec2<u32>;
var<private> since: vec2<u32>;
var<private> fraction_then: vec2<f32>;
var<private> metres_a_tick: f32;

fn walk_begin(ray: LightMapRay) {
    cell = ray.entry_cell;
    next_high = ray.first_high;
    next_low = ray.first_low;
    since = vec2(0u);
    fraction_then = ray.entry_fraction;
    metres_a_tick = ray.length / f32(TICKS);
}

// Crosses the next line of one axis.
fn cross(ray: LightMapRay, axis: vec2<bool>) {
    let ahead = ray.slope > vec2(0.0);
    let low = next_low + select(vec2(0u), ray.step_low, axis);
    let carry = select(vec2(0u), vec2(1u), low < next_low);
    since = select(since, next_high, axis);
    fraction_then = select(fraction_then, select(vec2(1.0), vec2(0.0), ahead), axis);
    next_high += select(vec2(0u), ray.step_high, axis) + carry;
    next_low = low;
    cell += select(vec2(0), select(vec2(-1), vec2(1), ahead), axis);
}

// 2⁻³² step_low n and its carry to whole ticks, for n < 2¹⁶.
fn many_steps_low(low: u32, n: u32) -> vec2<u32> {
    let p = (low & 0xffffu) * n;
    let q = (low >> 16u) * n;
    let sum = p + (q << 16u);
    return vec2(sum, (q >> 16u) + select(0u, 1u, sum < p));
}

// Crosses all lines of an axis up to tick `t`: most of them at once, the last ones by one.
fn catch_up(ray: LightMapRay, axis: u32, t: u32) {
    if next_high[axis] <= t {
        let steps = f32(t - next_high[axis]) / f32(max(ray.step_high[axis], 1u));
        let n = u32(clamp(steps - 1.0, 0.0, 65535.0));
        let product = many_steps_low(ray.step_low[axis], n);
        let low = next_low[axis] + product.x;
        let carry = select(0u, 1u, low < product.x);
        let mine = vec2(axis == 0u, axis == 1u);
        next_low = select(next_low, vec2(low), mine);
        next_high += select(vec2(0u), vec2(ray.step_high[axis] * n + product.y + carry), mine);
        cell += select(vec2(0), vec2(select(-i32(n), i32(n), ray.slope[axis] > 0.0)), mine);
        while next_high[axis] <= t {
            cross(ray, mine);
        }
    }
}

fn catch_up_both(ray: LightMapRay, t: u32) {
    catch_up(ray, 0u, t);
    catch_up(ray, 1u, t);
}

fn is_inside() -> bool {
    return all(cell >= vec2(0)) && all(cell < transport.light_size + EXTRA);
}

// From tick `t` on, for so many metres.
fn piece_at(ray: LightMapRay, t: u32, length: f32) -> Piece {
    let moved = ray.slope * (vec2<f32>(vec2(t) - since) * metres_a_tick);
    return Piece(cell, fraction_then + moved, ray.slope * length);
}

fn tick_of(ray: LightMapRay, t: f32) -> u32 {
    return min(u32(max(t / metres_a_tick, 0.0)), TICKS);
}

fn strength_at(ray: LightMapRay, t: f32) -> Weight {
    return weight_of(ray.strength.xyz * exp(-transport.sigma_t.xyz * t));
}

// Visits the pieces of [a, b] cell by cell (Amanatides and Woo 1987).
fn integrate_stretch(ray: LightMapRay, a: u32, b: u32) {
    let sigma_t = weight_of(transport.sigma_t.xyz);
    catch_up_both(ray, a);
    var t = a;
    while t < b && is_inside() {
        let end = min(min(next_high.x, next_high.y), b);
        if end > t {
            let length = f32(end - t) * metres_a_tick;
            integrate(piece_at(ray, t, length), sigma_t * length, strength_at(ray, f32(t) * metres_a_tick));
            t = end;
        }
        if end < b {
            let x_first = next_high.x <= next_high.y;
            cross(ray, vec2(x_first, !x_first));
        }
    }
}

// The papers' march: steps of equal length from the eye to where the ray ends or leaves the map, each worth its midpoint.
fn march_stretch(ray: LightMapRay, a: f32, b: f32) {
    let step = (ray.before + ray.length) / f32(transport.steps);
    let sigma_t = weight_of(transport.sigma_t.xyz);
    let first = u32(max(ceil((ray.before + a) / step - 0.5), 0.0));
    let end = min(u32(max(ceil((ray.before + b) / step - 0.5), 0.0)), transport.steps);
    for (var j = first; j < end; j++) {
        let t = (f32(j) + 0.5) * step - ray.before;
        let tick = tick_of(ray, t);
        catch_up_both(ray, tick);
        if is_inside() {
            sample(piece_at(ray, tick, 0.0), strength_at(ray, t) * sigma_t * step);
        }
    }
}

fn walk(row: u32) {
    let ray = rays[row];
    if ray.length <= 0.0 {
        return;
    }
    walk_begin(ray);
    window_begin();
    lit_begin(ray);
    var stretch: vec2<u32>;
    while lit_next(ray, &stretch) {
        if MARCH {
            march_stretch(ray, f32(stretch.x) * metres_a_tick, f32(stretch.y) * metres_a_tick);
        } else {
            integrate_stretch(ray, stretch.x, stretch.y);
        }
    }
    window_finish();
}

// Place of a texel among the bound elements of x; not below `x_len` where it is not bound.
fn local_element(texel: vec2<i32>) -> u32 {
    return u32(texel.y * transport.light_size.x + texel.x) - parameters.x_first;
}
