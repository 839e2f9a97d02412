// The lit stretches of a ray through the min-max pyramid of the shadow map, in order; twin of src/march/visibility.rs, whose
// recursion is here a walk from node to node: down where a node is partly lit, up where the ray enters another parent.

@group(1) @binding(0) var<storage, read> depths: array<f32>;
// Least and largest depth of the nodes above the texels, level by level.
@group(1) @binding(1) var<storage, read> ranges: array<vec2<f32>>;

var<private> lit_t: f32;
var<private> lit_phase: i32;
var<private> lit_cell: vec2<i32>;
var<private> lit_level: u32;
// Where the stretch under construction begins; less than 0 when there is none.
var<private> lit_open: f32;
var<private> lit_origin: vec2<f32>;
var<private> lit_slope: vec2<f32>;
var<private> lit_inverse: vec2<f32>;

// One over a slope, and 0 for none.
fn inverse_of(slope: vec2<f32>) -> vec2<f32> {
    return select(1.0 / slope, vec2(0.0), slope == vec2(0.0));
}

fn lit_begin(ray: Ray) {
    lit_t = 0.0;
    lit_phase = 0;
    lit_open = -1.0;
    lit_level = transport.shadow_top;
    lit_origin = ray.shadow_entry;
    lit_slope = ray.slope * transport.shadow_from_light;
    lit_inverse = inverse_of(lit_slope);
}

fn range_of(level: u32, cell: vec2<i32>) -> vec2<f32> {
    if level == 0u {
        return vec2(depths[u32(cell.y * transport.shadow_size.x + cell.x)]);
    }
    let node = cell >> vec2(level);
    let row = transport.levels[level];
    return ranges[row.x + u32(node.y) * row.y + u32(node.x)];
}

// Closes the stretch under construction at `end`; whether there was one.
fn lit_close(end: f32, stretch: ptr<function, vec2<f32>>) -> bool {
    if lit_open < 0.0 {
        return false;
    }
    *stretch = vec2(lit_open, end);
    lit_open = -1.0;
    return end > (*stretch).x;
}

fn lit_open_at(t: f32) {
    if lit_open < 0.0 {
        lit_open = t;
    }
}

// The next stretch; false when there is none left.
fn lit_next(ray: Ray, stretch: ptr<function, vec2<f32>>) -> bool {
    if lit_phase == 0 {
        // Before the shadow map everything is lit.
        if ray.shadow_clip.x > 0.0 {
            lit_open_at(0.0);
        }
        lit_t = ray.shadow_clip.x;
        let at = vec2<i32>(floor(lit_origin + lit_slope * lit_t));
        lit_cell = clamp(at, vec2(0), transport.shadow_size - 1);
        lit_phase = 1;
    }
    while lit_phase == 1 {
        if lit_t >= ray.shadow_clip.y {
            lit_phase = 2;
            break;
        }
        let ahead = lit_slope > vec2(0.0);
        let node = lit_cell >> vec2(lit_level);
        let low = node << vec2(lit_level);
        let high = min(low + (1 << lit_level), transport.shadow_size);
        let line = select(low, high, ahead);
        let at_rim = (line <= vec2(0)) | (line >= transport.shadow_size) | (lit_slope == vec2(0.0));
        let crossing = select((vec2<f32>(line) - lit_origin) * lit_inverse, vec2(HUGE), at_rim);
        let end = max(min(min(crossing.x, crossing.y), ray.shadow_clip.y), lit_t);
        let depth = ray.depth + ray.depth_slope * vec2(lit_t, end);
        let range = range_of(lit_level, lit_cell);
        let is_lit = all(depth <= vec2(range.x));
        let is_dark = all(depth > vec2(range.y));
        if !is_lit && !is_dark && lit_level > 0u {
            lit_level -= 1u;
            continue;
        }
        let start = lit_t;
        // On to the next node.
        let before = lit_cell;
        lit_t = end;
        if end < ray.shadow_clip.y {
            let near = clamp(vec2<i32>(floor(lit_origin + lit_slope * end)), low, high - 1);
            lit_cell = select(min(near, lit_cell), max(near, lit_cell), ahead);
            if crossing.x <= crossing.y {
                lit_cell.x = select(low.x - 1, high.x, ahead.x);
            } else {
                lit_cell.y = select(low.y - 1, high.y, ahead.y);
            }
            let above = vec2(lit_level + 1u);
            if lit_level < transport.shadow_top && any((lit_cell >> above) != (before >> above)) {
                lit_level += 1u;
            }
        }
        if is_lit {
            lit_open_at(start);
        } else if is_dark {
            if lit_close(start, stretch) {
                return true;
            }
        } else {
            let cut = clamp((range.x - ray.depth) / ray.depth_slope, start, end);
            if depth.y > depth.x {
                lit_open_at(start);
                if lit_close(cut, stretch) {
                    return true;
                }
            } else {
                let closed = lit_close(start, stretch);
                lit_open_at(cut);
                if closed {
                    return true;
                }
            }
        }
    }
    if lit_phase == 2 {
        lit_phase = 3;
        if ray.shadow_clip.y < ray.length {
            lit_open_at(ray.shadow_clip.y);
        }
        return lit_close(ray.length, stretch);
    }
    return false;
}
