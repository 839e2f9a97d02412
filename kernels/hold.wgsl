// mine ← 0 where x is at a bound and going down the gradient would leave the box
@group(0) @binding(2) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> gradient: array<f32>;

fn change(k: u32, i: u32, plane: u32, channel: u32) {
    if is_held(x[i], gradient[i], lower(channel), upper(channel)) {
        mine[i] = 0.0;
    }
}
