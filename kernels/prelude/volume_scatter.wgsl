// Depositing along a ray, each voxel for itself: unlike the texels around an eye no voxel is met by all rays of a view, unless the
// eye is in it.


// Nothing is summed up inside a workgroup.
fn group_scale() -> f32 {
    return 1.0;
}

fn visit(voxel: Cell, weight: Weight) {
    let e = local_element(voxel);
    if e >= parameters.x_len {
        return;
    }
    let value = carried(weights_of(weight), carrying);
    deposit(e, value.x, 0u);
    if CHANNELS == 3u {
        deposit(parameters.x_stride + e, value.y, 1u);
        deposit(2u * parameters.x_stride + e, value.z, 2u);
    }
}

@compute @workgroup_size(RAYS)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= parameters.rows {
        return;
    }
    carrying = bound_of_y(id.x);
    walk(id.x);
}
