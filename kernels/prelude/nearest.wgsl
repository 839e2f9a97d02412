// Constant in each texel; twin of Nearest in src/march/basis.rs. Each texel is visited once, when the ray has left it.
const EXTRA: i32 = 0;

var<private> window_cell: vec2<i32>;
var<private> window: Weight;

fn window_begin() {
    window_cell = vec2(-1, -1);
    window = Weight(0.0);
}

fn window_add(cell: vec2<i32>, weight: Weight) {
    if any(cell != window_cell) {
        window_finish();
        window_cell = cell;
        window = weight;
    } else {
        window += weight;
    }
}

fn integrate(piece: Piece, s: Weight, strength: Weight) {
    window_add(piece.cell, strength * all_extinguished(s));
}

fn sample(piece: Piece, strength: Weight) {
    window_add(piece.cell, strength);
}

fn window_finish() {
    if is_positive(window) {
        visit(window_cell, window);
    }
}
