// y ← y + T x: one invocation walks one ray.
@group(0) @binding(1) var<storage, read_write> y: array<f32>;
@group(0) @binding(2) var<storage, read> x: array<f32>;

// Sums of a few dozen visits, and the sum of those: fewer roundings than one long sum.
var<private> part: vec3<f32>;
var<private> total: vec3<f32>;
var<private> visits: u32;

// The bound channels of an element, 0 for the others.
fn bound_of_x(e: u32) -> vec3<f32> {
    if CHANNELS == 3u {
        return vec3(x[e], x[parameters.x_stride + e], x[2u * parameters.x_stride + e]);
    }
    return vec3(x[e], 0.0, 0.0);
}

fn visit(cell: Cell, weight: Weight) {
    let e = local_element(cell);
    if e < parameters.x_len {
        part += weights_of(weight) * bound_of_x(e);
        visits++;
        if (visits & 31u) == 0u {
            total += part;
            part = vec3(0.0);
        }
    }
}

@compute @workgroup_size(RAYS)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= parameters.rows {
        return;
    }
    part = vec3(0.0);
    total = vec3(0.0);
    visits = 0u;
    walk(id.x);
    total += part;
    let row = parameters.y_first + id.x;
    y[row] += total.x;
    if CHANNELS == 3u {
        y[parameters.y_stride + row] += total.y;
        y[2u * parameters.y_stride + row] += total.z;
    }
}
