// Which rows are walked, and which elements are bound.
struct WalkParams {
    // Rows to walk; the first row of the bound y, and from one channel of y to the next.
    rows: u32,
    y_first: u32,
    y_stride: u32,
    // The first bound channel.
    channel: u32,
    // The number that the first bound element of x has among those that are walked (of a quantity of a volume; it wraps), how many
    // there are, and from one channel of x to the next.
    x_first: u32,
    x_len: u32,
    x_stride: u32,
    pad: u32,
}

@group(0) @binding(0) var<uniform> parameters: WalkParams;
