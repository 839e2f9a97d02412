// mine ← a
fn change(k: u32, i: u32, plane: u32, channel: u32) {
    mine[i] = params.a[channel];
}
