// The largest α with l ≤ x + α step ≤ u
@group(0) @binding(2) var<storage, read> step: array<f32>;
@group(0) @binding(3) var<storage, read> x: array<f32>;

const NONE: f32 = HUGE;

fn together(a: f32, b: f32) -> f32 {
    return min(a, b);
}

fn term(k: u32, i: u32, channel: u32) -> f32 {
    if step[i] < 0.0 && lower(channel) > -HUGE {
        return max((lower(channel) - x[i]) / step[i], 0.0);
    }
    if step[i] > 0.0 && upper(channel) < HUGE {
        return max((upper(channel) - x[i]) / step[i], 0.0);
    }
    return HUGE;
}
