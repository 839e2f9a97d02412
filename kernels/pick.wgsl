// mine[k] ← x[index[k]], 0 where the index is nowhere
@group(0) @binding(2) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> index: array<u32>;

fn change(k: u32, i: u32, plane: u32, channel: u32) {
    mine[i] = so_far(i) + picked(index[k], plane);
}
