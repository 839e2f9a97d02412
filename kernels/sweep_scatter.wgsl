// What arrives at samples in each term of their fan: the sweep of sweep_gather backwards. Rays add to all samples before their end, and
// samples ask when they switch off.
@group(0) @binding(1) var<storage, read_write> partials: array<f32>;
@group(0) @binding(2) var<storage, read_write> tree: array<f32>;
@group(0) @binding(3) var<storage, read> items: array<SweepItem>;
@group(0) @binding(4) var<storage, read> order: array<u32>;
@group(0) @binding(5) var<storage, read> rays: array<SweepRay>;
@group(0) @binding(6) var<storage, read> coefficients: array<f32>;
@group(0) @binding(7) var<storage, read> y: array<f32>;

// What a sample has been given by rays that end behind it.
fn arrived(item: SweepItem, sample: u32, channel: u32) -> f32 {
    var sum = 0.0;
    for (var node = sample + 1u; node <= item.samples; node += lowest_bit(node)) {
        sum += tree[number_at(item, node, channel)];
    }
    return sum;
}

@compute @workgroup_size(RAYS)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = lane_of(id, groups);
    if lane >= params.items * params.channels {
        return;
    }
    let item = items[lane / params.channels];
    let channel = lane % params.channels;
    for (var node = 0u; node <= item.samples; node++) {
        tree[number_at(item, node, channel)] = 0.0;
        // Samples that light no ray are asked for, too.
        partials[number_at(item, node, channel)] = 0.0;
    }
    var lit = item.lit;
    for (var number = item.rays; number > 0u; number--) {
        let ray = rays[item.first_ray + number - 1u];
        for (; lit > ray.lit; lit--) {
            let j = order[item.first_lit + lit - 1u];
            partials[number_at(item, j, channel)] = arrived(item, j, channel);
        }
        let shown = ray.scattering[params.channel + channel] * y[channel * params.y_stride + ray.row];
        let value = coefficients[ray.first_coefficient + item.term] * shown;
        for (var node = ray.whole; node > 0u; node -= lowest_bit(node)) {
            tree[number_at(item, node, channel)] += value;
        }
    }
    for (; lit > 0u; lit--) {
        let j = order[item.first_lit + lit - 1u];
        partials[number_at(item, j, channel)] = arrived(item, j, channel);
    }
}
