// What rays show, all terms together.
@group(0) @binding(1) var<storage, read_write> y: array<f32>;
@group(0) @binding(2) var<storage, read> rays: array<SweepRay>;
@group(0) @binding(3) var<storage, read> coefficients: array<f32>;
@group(0) @binding(4) var<storage, read> partials: array<f32>;

@compute @workgroup_size(RAYS)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = lane_of(id, groups);
    if lane >= params.rays * params.channels {
        return;
    }
    let ray = rays[lane / params.channels];
    let channel = lane % params.channels;
    var sum = 0.0;
    for (var m = 0u; m < ray.terms; m++) {
        let k = ray.first_coefficient + m;
        sum += coefficients[k] * partials[k * params.channels + channel];
    }
    y[channel * params.y_stride + ray.row] = ray.scattering[params.channel + channel] * sum;
}
