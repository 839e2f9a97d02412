// x ← x + Tᵀ y: one invocation walks one ray and deposits what it carries.
@group(0) @binding(1) var<storage, read> y: array<f32>;

fn carried(weight: vec3<f32>, y: vec3<f32>) -> vec3<f32> {
    return weight * y;
}
