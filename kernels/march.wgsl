// What rays show of a light map in equal steps, each worth its middle: one invocation marches one ray.

struct MarchParams {
    // Extinction of the bound channels, in 1/metre.
    sigma_t: vec4<f32>,
    shadow_size: vec2<u32>,
    light_size: vec2<u32>,
    rays: u32,
    // The row of the first ray.
    first_row: u32,
    steps: u32,
    bilinear: u32,
    // The first channel that is bound, how many are, and numbers from one to the next.
    channel: u32,
    channels: u32,
    x_stride: u32,
    y_stride: u32,
}

// Where a ray begins and what a step adds: in texels of the shadow map and of the light map, and in depth.
struct MarchRay {
    scattering: vec3<f32>,
    // Metres of a step.
    step: f32,
    shadow_at: vec2<f32>,
    shadow_step: vec2<f32>,
    light_at: vec2<f32>,
    light_step: vec2<f32>,
    depth: f32,
    depth_step: f32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> params: MarchParams;
@group(0) @binding(1) var<storage, read_write> y: array<f32>;
@group(0) @binding(2) var<storage, read> rays: array<MarchRay>;
@group(0) @binding(3) var<storage, read> depths: array<f32>;
@group(0) @binding(4) var<storage, read> x: array<f32>;

fn is_inside(at: vec2<f32>, size: vec2<u32>) -> bool {
    return all(at >= vec2(0.0)) && all(at < vec2<f32>(size));
}

fn is_lit(at: vec2<f32>, depth: f32) -> bool {
    if !is_inside(at, params.shadow_size) {
        return true;
    }
    let cell = vec2<u32>(at);
    return depth <= depths[cell.y * params.shadow_size.x + cell.x];
}

// The bound channels of an element, 0 for the others.
fn element(e: u32) -> vec3<f32> {
    if params.channels == 3u {
        return vec3(x[e], x[params.x_stride + e], x[2u * params.x_stride + e]);
    }
    return vec3(x[e], 0.0, 0.0);
}

fn texel(i: u32, j: u32) -> vec3<f32> {
    let last = params.light_size - vec2(1u);
    return element(min(j, last.y) * params.light_size.x + min(i, last.x));
}

// Behind the texels stands the light beside them.
fn light(at: vec2<f32>) -> vec3<f32> {
    if !is_inside(at, params.light_size) {
        return element(params.light_size.x * params.light_size.y);
    }
    if params.bilinear == 0u {
        return texel(u32(at.x), u32(at.y));
    }
    let place = clamp(at - vec2(0.5), vec2(0.0), vec2<f32>(params.light_size - vec2(1u)));
    let cell = vec2<u32>(place);
    let part = fract(place);
    let above = mix(texel(cell.x, cell.y), texel(cell.x + 1u, cell.y), part.x);
    let below = mix(texel(cell.x, cell.y + 1u), texel(cell.x + 1u, cell.y + 1u), part.x);
    return mix(above, below, part.y);
}

@compute @workgroup_size(RAYS)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = lane_of(id, groups);
    if lane >= params.rays {
        return;
    }
    let ray = rays[lane];
    let rates = params.sigma_t.xyz * ray.step;
    let lost = vec3(extinguished(rates.x), extinguished(rates.y), extinguished(rates.z));
    var total = vec3(0.0);
    for (var j = 0u; j < params.steps; j++) {
        let t = f32(j) + 0.5;
        if is_lit(ray.shadow_at + t * ray.shadow_step, ray.depth + t * ray.depth_step) {
            total += exp(-rates * f32(j)) * light(ray.light_at + t * ray.light_step);
        }
    }
    total *= lost;
    let row = params.first_row + lane;
    if params.channels == 3u {
        y[row] = ray.scattering.x * total.x;
        y[params.y_stride + row] = ray.scattering.y * total.y;
        y[2u * params.y_stride + row] = ray.scattering.z * total.z;
    } else {
        y[row] = ray.scattering[params.channel] * total.x;
    }
}
