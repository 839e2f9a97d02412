// mine ← min(max(mine, a), b): the projection onto the bounds
fn change(k: u32, i: u32, plane: u32, channel: u32) {
    mine[i] = min(max(mine[i], lower(channel)), upper(channel));
}
