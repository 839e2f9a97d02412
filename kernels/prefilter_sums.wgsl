// Means along the samples of a fan of light times sin(c_k z) and cos(c_k z), c_k = π (2k + 1), and of light alone: one lane each. They are
// weighted by transmittance along the reference ray.
@group(0) @binding(1) var<storage, read_write> sums: array<f32>;
@group(0) @binding(2) var<storage, read> fans: array<PrefilterFan>;
@group(0) @binding(3) var<storage, read> samples: array<PrefilterSample>;
@group(0) @binding(4) var<storage, read> x: array<f32>;

fn put(edge: u32, channel: u32, k: u32, means: vec2<f32>) {
    let at = sums_of(edge, channel) + 2u * k;
    sums[at] = means.x;
    if k < params.harmonics {
        sums[at + 1u] = means.y;
    }
}

@compute @workgroup_size(RAYS)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = lane_of(id, groups);
    let lanes = params.harmonics + 1u;
    if lane >= params.fans * params.channels * lanes {
        return;
    }
    let k = lane % lanes;
    let channel = lane / lanes % params.channels;
    let fan = fans[lane / lanes / params.channels];
    // Weights are ratios, so a rate that is next to none does for none.
    let rate = max(fan.rates[params.channel + channel], 1e-20);
    let first_x = channel * params.x_stride + params.first_sample + fan.first_sample;
    var sum = vec2(0.0);
    put(fan.first_edge, channel, k, sum);
    for (var j = 0u; j < fan.samples; j++) {
        let sample = samples[fan.first_sample + j];
        let part = exp(-rate * sample.begin) * extinguished(rate * sample.width) * x[first_x + j];
        if k < params.harmonics {
            let turns = (f32(k) + 0.5) * sample.place;
            let angle = 2.0 * PI * (turns - round(turns));
            sum += part * vec2(sin(angle), cos(angle));
        } else {
            sum.x += part;
        }
        put(fan.first_edge + j + 1u, channel, k, sum / extinguished(rate * (sample.begin + sample.width)));
    }
}
