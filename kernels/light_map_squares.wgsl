// x ← x + diag(Tᵀ diag(y) T): the same with the square of every weight.
@group(0) @binding(1) var<storage, read> y: array<f32>;

fn carried(weight: Weight, channel: u32, y: f32) -> f32 {
    let w = channel_of(weight, channel);
    return w * w * y;
}
