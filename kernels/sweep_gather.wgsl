// What rays show of each term of their fan: κ is swept downwards, samples switch on in a tree of partial sums (Fenwick 1994), and rays
// ask for the sum of those before their end.
@group(0) @binding(1) var<storage, read_write> partials: array<f32>;
@group(0) @binding(2) var<storage, read_write> tree: array<f32>;
@group(0) @binding(3) var<storage, read> items: array<SweepItem>;
@group(0) @binding(4) var<storage, read> samples: array<SweepSample>;
@group(0) @binding(5) var<storage, read> order: array<u32>;
@group(0) @binding(6) var<storage, read> rays: array<SweepRay>;
@group(0) @binding(7) var<storage, read> x: array<f32>;

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
    }
    let first_x = channel * params.x_stride + params.first_sample + item.first_sample;
    var next = 0u;
    for (var number = 0u; number < item.rays; number++) {
        let lit = rays[item.first_ray + number].lit;
        for (; next < lit; next++) {
            let j = order[item.first_lit + next];
            let value = weight_of(item, samples[item.first_sample + j], channel) * x[first_x + j];
            for (var node = j + 1u; node <= item.samples; node += lowest_bit(node)) {
                tree[number_at(item, node, channel)] += value;
            }
        }
        var sum = 0.0;
        for (var node = rays[item.first_ray + number].whole; node > 0u; node -= lowest_bit(node)) {
            sum += tree[number_at(item, node, channel)];
        }
        partials[number_of_ray(item, number, channel)] = sum;
    }
}
