// Element `e` of a bound slab of the other vector, 0 where it lies elsewhere or nowhere.
fn picked(e: u32, plane: u32) -> f32 {
    let local = e - params.other_first;
    if e != NOWHERE && local < params.other_len {
        return x[plane * params.other_stride + local];
    }
    return 0.0;
}

// What the slabs before have left in mine.
fn so_far(i: u32) -> f32 {
    if params.again != 0u {
        return mine[i];
    }
    return 0.0;
}
