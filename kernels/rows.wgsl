// y[k] ← Σ_e w_ke x[e] over rows that are kept: gather over the rows of T, and the adjoint over those of its transpose.
// SHARERS lanes share a row, so that they read side by side.

struct RowsParams {
    // Rows of this slab; the first of them in the bound y, and from one channel of y to the next.
    rows: u32,
    y_first: u32,
    y_stride: u32,
    channel: u32,
    x_stride: u32,
    // Numbers of one channel's weights.
    nonzeros: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> params: RowsParams;
@group(0) @binding(1) var<storage, read_write> y: array<f32>;
@group(0) @binding(2) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> offsets: array<u32>;
@group(0) @binding(4) var<storage, read> elements: array<u32>;
@group(0) @binding(5) var<storage, read> weights: array<f32>;

var<workgroup> sums: array<vec3<f32>, LANES>;

// Of the bound channels; 0 for the others of colored weights. Never stored to by a channel's number: some compilers (FXC) cannot in
// a loop.
fn weights_at(k: u32) -> vec3<f32> {
    if COLORED {
        if CHANNELS == 3u {
            return vec3(weights[k], weights[params.nonzeros + k], weights[2u * params.nonzeros + k]);
        }
        return vec3(weights[params.channel * params.nonzeros + k], 0.0, 0.0);
    }
    return vec3(weights[k]);
}

fn color_of(e: u32) -> vec3<f32> {
    if CHANNELS == 3u {
        return vec3(x[e], x[params.x_stride + e], x[2u * params.x_stride + e]);
    }
    return vec3(x[e], 0.0, 0.0);
}

@compute @workgroup_size(LANES)
fn main(
    @builtin(local_invocation_id) lane: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let row = (group.y * groups.x + group.x) * (LANES / SHARERS) + lane.x / SHARERS;
    var total = vec3(0.0);
    if row < params.rows {
        let end = offsets[row + 1u];
        var k = offsets[row] + lane.x % SHARERS;
        // Sums of a few dozen terms, and the sum of those: fewer roundings than one long sum.
        while k < end {
            var part = vec3(0.0);
            for (var n = 0u; n < 32u && k < end; n++) {
                var w = weights_at(k);
                if SQUARED {
                    w = w * w;
                }
                part += w * color_of(elements[k]);
                k += SHARERS;
            }
            total += part;
        }
    }
    if SHARERS > 1u {
        sums[lane.x] = total;
        for (var half = SHARERS / 2u; half > 0u; half /= 2u) {
            workgroupBarrier();
            if lane.x % SHARERS < half {
                sums[lane.x] += sums[lane.x + half];
            }
        }
        total = sums[lane.x];
    }
    if row < params.rows && lane.x % SHARERS == 0u {
        for (var c = 0u; c < CHANNELS; c++) {
            y[c * params.y_stride + params.y_first + row] = total[c];
        }
    }
}
