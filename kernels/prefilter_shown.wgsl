// What rays show of prefiltered visibility: M products each (Klehm et al. 2014, eq. 9), whatever the scene.
@group(0) @binding(1) var<storage, read_write> y: array<f32>;
@group(0) @binding(2) var<storage, read> rays: array<PrefilterRay>;
@group(0) @binding(3) var<storage, read> sums: array<f32>;

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
    let far = ray.far[params.channel + channel];
    let lower = sums_of(ray.edge - 1u, channel);
    let upper = sums_of(ray.edge, channel);
    let angle = PI * ray.place;
    let turn = vec2(cos(2.0 * angle), sin(2.0 * angle));
    var wave = vec2(cos(angle), sin(angle));
    let last = 2u * params.harmonics;
    let mean = mix(sums[lower + last], sums[upper + last], far);
    var visible = 0.5 * mean;
    for (var k = 0u; k < params.harmonics; k++) {
        let sine = mix(sums[lower + 2u * k], sums[upper + 2u * k], far);
        let cosine = mix(sums[lower + 2u * k + 1u], sums[upper + 2u * k + 1u], far);
        visible += 2.0 / (PI * f32(2u * k + 1u)) * (wave.x * sine - wave.y * cosine);
        wave = vec2(wave.x * turn.x - wave.y * turn.y, wave.x * turn.y + wave.y * turn.x);
    }
    visible = max(min(visible, max(mean, 0.0)), min(mean, 0.0));
    y[channel * params.y_stride + ray.row] = ray.gain[params.channel + channel] * visible;
}
