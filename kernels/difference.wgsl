// mine[k] ← x[heads[k]] − x[tails[k]]: the gradient on a lattice
@group(0) @binding(2) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> heads: array<u32>;
@group(0) @binding(4) var<storage, read> tails: array<u32>;

fn change(k: u32, i: u32, plane: u32, channel: u32) {
    mine[i] = so_far(i) + (picked(heads[k], plane) - picked(tails[k], plane));
}
