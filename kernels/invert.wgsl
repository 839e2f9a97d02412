// mine ← 1 / mine, 0 where it is 0
fn change(k: u32, i: u32, plane: u32, channel: u32) {
    if mine[i] != 0.0 {
        mine[i] = 1.0 / mine[i];
    }
}
