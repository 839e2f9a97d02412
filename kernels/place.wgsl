// mine[index[k]] ← x[k], of a mine that is zero; here k runs over x, and `other` is mine
@group(0) @binding(2) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> index: array<u32>;

fn change(k: u32, i: u32, plane: u32, channel: u32) {
    let e = index[k];
    let local = e - params.other_first;
    if e != NOWHERE && local < params.other_len {
        mine[plane * params.other_stride + local] = x[i];
    }
}
