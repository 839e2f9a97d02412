// Depositing along a ray. All rays of a view meet around its eye, so the texels near where a workgroup's rays enter the map are
// summed up inside the workgroup first, and reach the map once a workgroup instead of once a ray.

var<private> carrying: vec3<f32>;
var<workgroup> corner: vec2<i32>;

fn visit(texel: vec2<i32>, weight: Weight) {
    let e = local_element(texel);
    if e >= parameters.x_len {
        return;
    }
    let near = texel - corner;
    let is_near = all(near >= vec2(0)) && all(near < vec2(NEAR));
    for (var c = 0u; c < CHANNELS; c++) {
        let value = carried(weight, parameters.channel + c, carrying[c]);
        if is_near {
            deposit_near(u32(near.y * NEAR + near.x) * CHANNELS + c, value, c);
        } else {
            deposit(c * parameters.x_stride + e, value, c);
        }
    }
}

@compute @workgroup_size(RAYS)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_id) lane: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    if lane.x == 0u {
        let ray = rays[min(group.x * RAYS + RAYS / 2u, parameters.rows - 1u)];
        corner = vec2<i32>(floor(ray.entry)) - NEAR / 2;
    }
    workgroupBarrier();
    if id.x < parameters.rows {
        for (var c = 0u; c < CHANNELS; c++) {
            carrying[c] = y[c * parameters.y_stride + parameters.y_first + id.x];
        }
        walk(id.x);
    }
    workgroupBarrier();
    for (var k = lane.x; k < u32(NEAR * NEAR); k += RAYS) {
        let texel = corner + vec2(i32(k) % NEAR, i32(k) / NEAR);
        let e = local_element(texel);
        if all(texel >= vec2(0)) && all(texel < transport.light_size) && e < parameters.x_len {
            for (var c = 0u; c < CHANNELS; c++) {
                flush_near(c * parameters.x_stride + e, k * CHANNELS + c);
            }
        }
    }
}
