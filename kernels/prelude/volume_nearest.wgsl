// Medium and unknown constant in each voxel; twin of Nearest in src/march/volume/window.rs. Each voxel is visited once, when the ray
// has left it.
const EXTRA: u32 = 0u;

// Optical depth over a piece of a ray inside one cell.
struct Depth {
    whole: Weight,
}

var<private> window_cell: vec3<i32>;
var<private> window: Weight;

fn depth_over(slot: u32, cell: vec3<u32>, start: vec3<f32>, change: vec3<f32>, metres: f32) -> Depth {
    return Depth(sigma_at(slot * 512u + inside_brick(cell, 8u)) * metres);
}

fn depth_at(depth: Depth, u: f32) -> Weight {
    return depth.whole * u;
}

fn is_empty(depth: Depth) -> bool {
    return !is_positive(depth.whole);
}

fn window_begin() {
    window_cell = vec3(-1);
    window = Weight(0.0);
}

fn window_finish() {
    if is_positive(window) {
        visit(window_cell, window);
    }
}

fn window_add(cell: vec3<i32>, weight: Weight) {
    if any(cell != window_cell) {
        window_finish();
        window_cell = cell;
        window = weight;
    } else {
        window += weight;
    }
}

// [from, to] of a piece with some optical depth, in one cell of the unknown.
fn integrate(
    depth: Depth,
    part: vec2<f32>,
    strength: Weight,
    cell: vec3<i32>,
    start: vec3<f32>,
    change: vec3<f32>,
) {
    if !LIT {
        window_add(cell, strength * all_extinguished(depth.whole * (part.y - part.x)));
        return;
    }
    var weight = Weight(0.0);
    var left = strength;
    var begin = part.x;
    for (var cut = 1u; cut <= CUTS && begin < part.y; cut++) {
        let end = select(next_cut(begin, part.y), part.y, cut == CUTS);
        let tau = depth.whole * (end - begin);
        weight += left * all_extinguished(tau) * mean_scattered(tau, begin, end);
        left *= exp(-tau);
        begin = end;
    }
    window_add(cell, weight);
}

fn integrate_length(metres: f32, cell: vec3<i32>, start: vec3<f32>, change: vec3<f32>) {
    window_add(cell, Weight(metres));
}
