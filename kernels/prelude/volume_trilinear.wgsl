// Medium and unknown trilinear between voxel centres, constant beyond the outermost ones; twin of Trilinear in
// src/march/volume/window.rs and of Density::cubic and nodes beside it. Cell (i, j, k) lies between voxels i − 1 and i, and so on. Each
// voxel is visited once, when the ray has left it.
const EXTRA: u32 = 1u;
// Optical depth beyond which nothing of a piece arrives that f32 could add.
const DARK: f32 = 40.0;

// Optical depth over a piece of a ray inside one cell, a polynomial of u in [0, 1] along it: trilinear is cubic along a line.
struct Depth {
    a: Weight,
    b: Weight,
    c: Weight,
    d: Weight,
}

// A polynomial of u of degree 2.
struct Quadratic {
    a: Weight,
    b: Weight,
    c: Weight,
}

var<private> window_cell: vec3<i32>;
// Weights of the eight voxels around: x in the lowest bit of the place, then y, then z.
var<private> taps: array<Weight, 8>;

// Between four neighbours along x and y, from where the piece begins and how far it goes. Differences first, so that nothing cancels
// where the four are nearly equal.
fn between(i: u32, start: vec2<f32>, change: vec2<f32>) -> Quadratic {
    let a = sigma_at(i);
    let b = sigma_at(i + 9u);
    let along_a = sigma_at(i + 1u) - a;
    let along_b = sigma_at(i + 10u) - b;
    let low = a + start.x * along_a;
    let across = b + start.x * along_b - low;
    let turn = along_b - along_a;
    return Quadratic(
        low + start.y * across,
        change.x * (along_a + start.y * turn) + change.y * across,
        change.x * change.y * turn,
    );
}

fn depth_over(slot: u32, cell: vec3<u32>, start: vec3<f32>, change: vec3<f32>, metres: f32) -> Depth {
    let i = slot * 729u + inside_brick(cell, 9u);
    let p = between(i, start.xy, change.xy);
    let q = between(i + 81u, start.xy, change.xy);
    let a = q.a - p.a;
    let b = q.b - p.b;
    let c = q.c - p.c;
    return Depth(
        (p.a + start.z * a) * metres,
        (p.b + start.z * b + change.z * a) * (metres / 2.0),
        (p.c + start.z * c + change.z * b) * (metres / 3.0),
        change.z * c * (metres / 4.0),
    );
}

fn depth_at(depth: Depth, u: f32) -> Weight {
    return u * (depth.a + u * (depth.b + u * (depth.c + u * depth.d)));
}

fn depth_slope(depth: Depth, u: f32) -> Weight {
    return depth.a + u * (2.0 * depth.b + u * (3.0 * depth.c + u * (4.0 * depth.d)));
}

fn is_empty(depth: Depth) -> bool {
    return !is_positive(abs(depth.a) + abs(depth.b) + abs(depth.c) + abs(depth.d));
}

fn window_begin() {
    window_cell = vec3(0);
    taps = array<Weight, 8>();
}

fn window_leave(offset: vec3<i32>, weight: Weight) {
    // A weight is zero where its voxel would be outside.
    if is_positive(weight) {
        visit(window_cell + offset, weight);
    }
}

// Moves the window over the cell by one axis at a time, visits the voxels that it leaves and keeps the others. A longer way is two
// steps along z, which leave all eight.
fn window_move(to: vec3<i32>) {
    while any(window_cell != to) {
        let moved = to - window_cell;
        let is_far = any(abs(moved) > vec3(1));
        let none = Weight(0.0);
        var u = vec3(0);
        var v = vec3(0);
        var step = vec3(0);
        var leaving: array<Weight, 4>;
        if is_far || moved.z != 0 {
            let ahead = is_far || moved.z > 0;
            let low = array<Weight, 4>(taps[0], taps[1], taps[2], taps[3]);
            let high = array<Weight, 4>(taps[4], taps[5], taps[6], taps[7]);
            u.x = 1;
            v.y = 1;
            step.z = select(-1, 1, ahead);
            if ahead {
                leaving = low;
                taps = array<Weight, 8>(high[0], high[1], high[2], high[3], none, none, none, none);
            } else {
                leaving = high;
                taps = array<Weight, 8>(none, none, none, none, low[0], low[1], low[2], low[3]);
            }
        } else if moved.y != 0 {
            let low = array<Weight, 4>(taps[0], taps[1], taps[4], taps[5]);
            let high = array<Weight, 4>(taps[2], taps[3], taps[6], taps[7]);
            u.x = 1;
            v.z = 1;
            step.y = moved.y;
            if moved.y > 0 {
                leaving = low;
                taps = array<Weight, 8>(high[0], high[1], none, none, high[2], high[3], none, none);
            } else {
                leaving = high;
                taps = array<Weight, 8>(none, none, low[0], low[1], none, none, low[2], low[3]);
            }
        } else {
            let low = array<Weight, 4>(taps[0], taps[2], taps[4], taps[6]);
            let high = array<Weight, 4>(taps[1], taps[3], taps[5], taps[7]);
            u.y = 1;
            v.z = 1;
            step.x = moved.x;
            if moved.x > 0 {
                leaving = low;
                taps = array<Weight, 8>(high[0], none, high[1], none, high[2], none, high[3], none);
            } else {
                leaving = high;
                taps = array<Weight, 8>(none, low[0], none, low[1], none, low[2], none, low[3]);
            }
        }
        // Of the voxels −1 and 0 along the axis those behind are left.
        let corner = u + v + max(step, vec3(0));
        window_leave(-corner, leaving[0]);
        window_leave(u - corner, leaving[1]);
        window_leave(v - corner, leaving[2]);
        window_leave(u + v - corner, leaving[3]);
        // After the second step of a long way nothing is left to keep.
        let is_clear = is_far && !any_tap();
        window_cell = select(window_cell + step, to, is_clear);
    }
}

fn any_tap() -> bool {
    return is_positive(taps[0]) || is_positive(taps[1]) || is_positive(taps[2]) || is_positive(taps[3]);
}

fn window_finish() {
    window_move(window_cell + vec3(0, 0, 2));
}

// Fraction towards the higher voxel at u; exactly 1 or 0 in the outermost cells, where only the inner voxel counts.
fn fractions(cell: vec3<i32>, at: vec3<f32>) -> vec3<f32> {
    let inner = select(clamp(at, vec3(0.0), vec3(1.0)), vec3(0.0), cell == vec3<i32>(volume.size));
    return select(inner, vec3(1.0), cell == vec3(0));
}

fn window_add(fraction: vec3<f32>, weight: Weight) {
    let f = fraction;
    let e = vec3(1.0) - fraction;
    taps[0] += weight * (e.x * e.y * e.z);
    taps[1] += weight * (f.x * e.y * e.z);
    taps[2] += weight * (e.x * f.y * e.z);
    taps[3] += weight * (f.x * f.y * e.z);
    taps[4] += weight * (e.x * e.y * f.z);
    taps[5] += weight * (f.x * e.y * f.z);
    taps[6] += weight * (e.x * f.y * f.z);
    taps[7] += weight * (f.x * f.y * f.z);
}

// Adds what is extinguished around u of the piece, `at` in the unknown's cell, of a panel's share `weight`.
fn node(
    depth: Depth,
    before: Weight,
    u: f32,
    weight: Weight,
    cell: vec3<i32>,
    at: vec3<f32>,
) {
    let gone = max(depth_slope(depth, u), Weight(0.0)) * exp(before - depth_at(depth, u));
    var share = weight * gone;
    if LIT {
        share *= light_at(u);
    }
    window_add(fractions(cell, at), share);
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
    window_move(cell);
    var begin = part.x;
    for (var cut = 1u; cut <= CUTS && begin < part.y; cut++) {
        var end = part.y;
        if LIT && cut < CUTS {
            end = next_cut(begin, part.y);
        }
        let share = (vec2(begin, end) - part.x) / (part.y - part.x);
        let left = strength * exp(depth_at(depth, part.x) - depth_at(depth, begin));
        integrate_smooth(depth, vec2(begin, end), left, cell, start + change * share.x, change * (share.y - share.x));
        begin = end;
    }
}

// The same where light has no kink: four nodes of Gauss and Legendre for every half of optical depth.
fn integrate_smooth(
    depth: Depth,
    part: vec2<f32>,
    strength: Weight,
    cell: vec3<i32>,
    start: vec3<f32>,
    change: vec3<f32>,
) {
    let before = depth_at(depth, part.x);
    // By the steepest part, for panels are equal in length.
    let slope = max(depth_slope(depth, part.x), depth_slope(depth, part.y));
    let steepest = max(slope, depth_slope(depth, 0.5 * (part.x + part.y))) * (part.y - part.x);
    let most = max(largest(depth_at(depth, part.y) - before), largest(steepest));
    let panels = clamp(ceil(most / PANEL), 1.0, MOST_PANELS);
    let across = 1.0 / panels;
    let width = (part.y - part.x) * across;
    let weight = strength * width;
    for (var panel = 0.0; panel < panels; panel += 1.0) {
        let begin = part.x + panel * width;
        if smallest(depth_at(depth, begin) - before) > DARK {
            break;
        }
        let at = start + change * (panel * across);
        let on = change * across;
        node(depth, before, begin + NODE_0 * width, NODE_WEIGHT_0 * weight, cell, at + NODE_0 * on);
        node(depth, before, begin + NODE_1 * width, NODE_WEIGHT_1 * weight, cell, at + NODE_1 * on);
        node(depth, before, begin + NODE_2 * width, NODE_WEIGHT_2 * weight, cell, at + NODE_2 * on);
        node(depth, before, begin + NODE_3 * width, NODE_WEIGHT_3 * weight, cell, at + NODE_3 * on);
    }
}

// Two nodes, exact for cubics.
fn integrate_length(metres: f32, cell: vec3<i32>, start: vec3<f32>, change: vec3<f32>) {
    window_move(cell);
    let weight = Weight(0.5 * metres);
    window_add(fractions(cell, start + HALF_NODE_0 * change), weight);
    window_add(fractions(cell, start + HALF_NODE_1 * change), weight);
}
