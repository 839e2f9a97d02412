// mine ← mine ∘ min(x − l, u − x), unchanged where there is no bound
@group(0) @binding(2) var<storage, read> x: array<f32>;

fn change(k: u32, i: u32, plane: u32, channel: u32) {
    var room = HUGE;
    if lower(channel) > -HUGE {
        room = x[i] - lower(channel);
    }
    if upper(channel) < HUGE {
        room = min(room, upper(channel) - x[i]);
    }
    if room < HUGE {
        mine[i] = mine[i] * room;
    }
}
