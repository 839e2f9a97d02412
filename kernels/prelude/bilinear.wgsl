// Bilinear between texel centres, constant beyond the outermost ones; twin of Bilinear in src/march/basis.rs.
// Cell (i, j) lies between texels i − 1 and i, j − 1 and j. Each texel is visited once, when the ray has left it.
const SHIFT: f32 = 0.5;
const EXTRA: i32 = 1;

var<private> window_cell: vec2<i32>;
// Weights of the texels at (low, low), (high, low), (low, high), (high, high).
var<private> taps: array<Weight, 4>;

fn window_begin() {
    window_cell = vec2(0, 0);
    taps = array<Weight, 4>();
}

fn window_leave(tap: i32) {
    // A weight is zero where its texel would be outside; rounding can make a vanishing one negative.
    if is_positive(taps[tap]) {
        visit(window_cell + vec2((tap & 1) - 1, (tap >> 1) - 1), taps[tap]);
    }
}

fn window_move(cell: vec2<i32>) {
    if all(cell == window_cell) {
        return;
    }
    let moved = cell - window_cell;
    var kept = array<Weight, 4>();
    for (var tap = 0; tap < 4; tap++) {
        let to = vec2(tap & 1, tap >> 1) - moved;
        if all(to >= vec2(0, 0)) && all(to < vec2(2, 2)) {
            kept[to.y * 2 + to.x] = taps[tap];
        } else {
            window_leave(tap);
        }
    }
    taps = kept;
    window_cell = cell;
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

fn window_finish() {
    for (var tap = 0; tap < 4; tap++) {
        window_leave(tap);
    }
}
