// mine ← min(max(y + c (mine ∘ x), a), b): a step from y in a diagonal metric, projected onto the bounds
@group(0) @binding(2) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> y: array<f32>;

fn change(k: u32, i: u32, plane: u32, channel: u32) {
    mine[i] = min(max(y[i] + params.c[channel] * (mine[i] * x[i]), lower(channel)), upper(channel));
}
