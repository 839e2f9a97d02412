// mine[k] ← mine[k] + x[into[k]] − x[out_of[k]]: one axis of the gradient's adjoint
@group(0) @binding(2) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> into: array<u32>;
@group(0) @binding(4) var<storage, read> out_of: array<u32>;

fn change(k: u32, i: u32, plane: u32, channel: u32) {
    mine[i] = mine[i] + (picked(into[k], plane) - picked(out_of[k], plane));
}
