// x ← x + Tᵀ y: one invocation walks one ray and deposits what it carries.
@group(0) @binding(1) var<storage, read> y: array<f32>;

fn carried(weight: Weight, channel: u32, y: f32) -> f32 {
    return channel_of(weight, channel) * y;
}
