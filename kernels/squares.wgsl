// x ← x + diag(Tᵀ diag(y) T): the same with the square of every weight.
@group(0) @binding(1) var<storage, read> y: array<f32>;

fn carried(weight: vec3<f32>, y: vec3<f32>) -> vec3<f32> {
    return weight * weight * y;
}
