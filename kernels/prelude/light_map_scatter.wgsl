// Depositing along a ray. All rays of a view meet around its eye, so with NEAR the texels near where a workgroup's rays enter
// the map are summed up inside the workgroup first, and reach the map once a workgroup instead of once a ray. Those sums are
// in fixed point, so that no loop waits for other lanes.

var<workgroup> corner: vec2<i32>;
// The bits of the largest |strength y| of the workgroup's rays.
var<workgroup> brightest: atomic<u32>;
var<workgroup> near_low: array<atomic<u32>, NEAR_NUMBERS>;
var<workgroup> near_high: array<atomic<u32>, NEAR_NUMBERS>;

// 2^e with 2^e RAYS max|strength y| < 2^60: a texel gets less than that from all rays of the workgroup, since a ray's weights
// sum up to its strength at most.
fn group_scale() -> f32 {
    let exponent = i32(atomicLoad(&brightest) >> 23u) - 127;
    return bitcast<f32>(u32(clamp(58 - RAYS_EXPONENT - exponent, -126, 126) + 127) << 23u);
}

fn deposit_near(k: u32, value: f32, plane: u32) {
    let words = fixed_from_float(value * scale_of_near(plane));
    let before = atomicAdd(&near_low[k], words.x);
    let carry = select(0u, 1u, before + words.x < before);
    if words.y + carry != 0u {
        atomicAdd(&near_high[k], words.y + carry);
    }
}

fn flush_near(i: u32, k: u32, plane: u32) {
    let words = vec2(atomicLoad(&near_low[k]), atomicLoad(&near_high[k]));
    if any(words != vec2(0u)) {
        deposit_words(i, words, plane);
    }
}

fn visit(texel: Cell, weight: Weight) {
    let e = local_element(texel);
    if e >= parameters.x_len {
        return;
    }
    let near = texel - corner;
    let value = carried(weights_of(weight), carrying);
    if NEAR > 0 && all(near >= vec2(0)) && all(near < vec2(NEAR)) {
        let k = u32(near.y * NEAR + near.x) * CHANNELS;
        deposit_near(k, value.x, 0u);
        if CHANNELS == 3u {
            deposit_near(k + 1u, value.y, 1u);
            deposit_near(k + 2u, value.z, 2u);
        }
    } else {
        deposit(e, value.x, 0u);
        if CHANNELS == 3u {
            deposit(parameters.x_stride + e, value.y, 1u);
            deposit(2u * parameters.x_stride + e, value.z, 2u);
        }
    }
}

@compute @workgroup_size(RAYS)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_id) lane: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    let is_ray = id.x < parameters.rows;
    if lane.x == 0u {
        corner = rays[min(group.x * RAYS + RAYS / 2u, parameters.rows - 1u)].entry_cell - NEAR / 2;
    }
    carrying = vec3(0.0);
    if is_ray {
        carrying = bound_of_y(id.x);
        if NEAR > 0 {
            let strength = rays[id.x].strength.xyz;
            let most = max(max(strength.x, strength.y), strength.z);
            let bright = abs(carried(vec3(most), carrying));
            atomicMax(&brightest, bitcast<u32>(max(max(bright.x, bright.y), bright.z)));
        }
    }
    workgroupBarrier();
    if is_ray {
        walk(id.x);
    }
    workgroupBarrier();
    for (var k = lane.x; k < u32(NEAR * NEAR); k += RAYS) {
        let texel = corner + vec2(i32(k) % max(NEAR, 1), i32(k) / max(NEAR, 1));
        let e = local_element(texel);
        if all(texel >= vec2(0)) && all(texel < transport.light_size) && e < parameters.x_len {
            for (var c = 0u; c < CHANNELS; c++) {
                flush_near(c * parameters.x_stride + e, k * CHANNELS + c, c);
            }
        }
    }
}
