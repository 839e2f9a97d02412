// Bilinear between texel centres, constant beyond the outermost ones; twin of Bilinear in src/march/basis.rs.
// Cell (i, j) lies between texels i − 1 and i, j − 1 and j. Each texel is visited once, when the ray has left it.
const EXTRA: i32 = 1;

var<private> window_cell: vec2<i32>;
// Weights of the texels at (low, low), (high, low), (low, high), (high, high).
var<private> taps: array<Weight, 4>;

fn window_begin() {
    window_cell = vec2(0, 0);
    taps = array<Weight, 4>();
}

fn window_leave(offset: vec2<i32>, weight: Weight) {
    // A weight is zero where its texel would be outside; rounding can make a vanishing one negative.
    if is_positive(weight) {
        visit(window_cell + offset, weight);
    }
}

fn window_finish() {
    window_leave(vec2(-1, -1), taps[0]);
    window_leave(vec2(0, -1), taps[1]);
    window_leave(vec2(-1, 0), taps[2]);
    window_leave(vec2(0, 0), taps[3]);
}

// Moves the window over the cell, visits the texels that it leaves and keeps the others.
fn window_move(to: vec2<i32>) {
    let moved = to - window_cell;
    if all(moved == vec2(0)) {
        return;
    }
    if moved.y == 0 && moved.x == 1 {
        window_leave(vec2(-1, -1), taps[0]);
        window_leave(vec2(-1, 0), taps[2]);
        taps = array<Weight, 4>(taps[1], Weight(0.0), taps[3], Weight(0.0));
    } else if moved.y == 0 && moved.x == -1 {
        window_leave(vec2(0, -1), taps[1]);
        window_leave(vec2(0, 0), taps[3]);
        taps = array<Weight, 4>(Weight(0.0), taps[0], Weight(0.0), taps[2]);
    } else if moved.x == 0 && moved.y == 1 {
        window_leave(vec2(-1, -1), taps[0]);
        window_leave(vec2(0, -1), taps[1]);
        taps = array<Weight, 4>(taps[2], taps[3], Weight(0.0), Weight(0.0));
    } else if moved.x == 0 && moved.y == -1 {
        window_leave(vec2(-1, 0), taps[2]);
        window_leave(vec2(0, 0), taps[3]);
        taps = array<Weight, 4>(Weight(0.0), Weight(0.0), taps[0], taps[1]);
    } else {
        window_jump(moved);
    }
    window_cell = to;
}

// The same for any other move, as after a stretch in shadow.
fn window_jump(moved: vec2<i32>) {
    let taps_then = taps;
    taps = array<Weight, 4>();
    window_shift(vec2(0, 0), moved, taps_then[0]);
    window_shift(vec2(1, 0), moved, taps_then[1]);
    window_shift(vec2(0, 1), moved, taps_then[2]);
    window_shift(vec2(1, 1), moved, taps_then[3]);
}

fn window_shift(place: vec2<i32>, moved: vec2<i32>, weight: Weight) {
    // By numbers that are constant: an array that is looked up otherwise is in no register.
    let to = place - moved;
    if all(to == vec2(0, 0)) {
        taps[0] = weight;
    } else if all(to == vec2(1, 0)) {
        taps[1] = weight;
    } else if all(to == vec2(0, 1)) {
        taps[2] = weight;
    } else if all(to == vec2(1, 1)) {
        taps[3] = weight;
    } else {
        window_leave(place - 1, weight);
    }
}

// Fraction towards the high texel at the start of the piece, and its change.
fn fraction(piece: Piece, axis: i32) -> vec2<f32> {
    if piece.cell[axis] == 0 {
        return vec2(1.0, 0.0);
    }
    if piece.cell[axis] == transport.light_size[axis] {
        return vec2(0.0, 0.0);
    }
    return vec2(clamp(piece.start[axis], 0.0, 1.0), piece.change[axis]);
}

fn integrate(piece: Piece, s: Weight, strength: Weight) {
    window_move(piece.cell);
    let x = fraction(piece, 0);
    let y = fraction(piece, 1);
    let m = all_moments(s);
    let along_x = x.x * m.m0 + x.y * m.m1;
    let along_y = y.x * m.m0 + y.y * m.m1;
    let along_both = x.x * y.x * m.m0 + (x.x * y.y + x.y * y.x) * m.m1 + x.y * y.y * m.m2;
    // Grouped so that it is exactly zero where either texel lies outside.
    taps[0] += strength * ((m.m0 - along_x) - (along_y - along_both));
    taps[1] += strength * (along_x - along_both);
    taps[2] += strength * (along_y - along_both);
    taps[3] += strength * along_both;
}

fn sample(piece: Piece, strength: Weight) {
    window_move(piece.cell);
    let x = fraction(piece, 0).x;
    let y = fraction(piece, 1).x;
    taps[0] += strength * ((1.0 - x) * (1.0 - y));
    taps[1] += strength * (x * (1.0 - y));
    taps[2] += strength * ((1.0 - x) * y);
    taps[3] += strength * (x * y);
}
