// What arrives at samples, all terms together.
@group(0) @binding(1) var<storage, read_write> x: array<f32>;
@group(0) @binding(2) var<storage, read> items: array<SweepItem>;
@group(0) @binding(3) var<storage, read> samples: array<SweepSample>;
@group(0) @binding(4) var<storage, read> partials: array<f32>;

@compute @workgroup_size(RAYS)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = lane_of(id, groups);
    if lane >= params.samples * params.channels {
        return;
    }
    let number = lane / params.channels;
    let channel = lane % params.channels;
    let sample = samples[number];
    let terms = items[sample.item].terms;
    var sum = 0.0;
    for (var m = 0u; m < terms; m++) {
        let item = items[sample.item + m];
        let at = number_at(item, number - item.first_sample, channel);
        sum += weight_of(item, sample, channel) * partials[at];
    }
    x[channel * params.x_stride + params.first_sample + number] = sum;
}
