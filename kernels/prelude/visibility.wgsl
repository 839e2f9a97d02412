// The lit stretches of a ray through the min-max pyramid of the shadow map, in order; twin of src/march/visibility.rs. Like that one
// it walks from node to node: down where a node is partly lit, up where the ray enters another parent.
// Everything is integers: ticks along the ray, and depths in parts of what the stored ones span. Stored depths and those of
// a ray are rounded once, by the host in f64.

@group(1) @binding(0) var<storage, read> depths: array<i32>;
// Least and largest depth of the nodes above the texels, level by level.
@group(1) @binding(1) var<storage, read> ranges: array<vec2<i32>>;

// Farther than any ray lives.
const NEVER: u32 = 0xffffffffu;
const BEFORE: i32 = 0;
const OVER: i32 = 1;
const BEYOND: i32 = 2;
const DONE: i32 = 3;

var<private> lit_t: u32;
// Before, over and beyond the shadow map, and done.
var<private> lit_phase: i32;
var<private> lit_cell: vec2<i32>;
var<private> lit_level: u32;
// Whether a stretch is under construction, and where it begins.
var<private> lit_open: bool;
var<private> lit_start: u32;

fn lit_begin(ray: LightMapRay) {
    lit_t = ray.shadow_clip.x;
    lit_phase = BEFORE;
    lit_cell = ray.shadow_cell;
    lit_level = transport.shadow_top;
    lit_open = false;
    lit_start = 0u;
}

// The upper word of a product.
fn multiply_high(a: u32, b: u32) -> u32 {
    let p = (a & 0xffffu) * (b & 0xffffu);
    let q = (a >> 16u) * (b & 0xffffu) + (p >> 16u);
    let r = (a & 0xffffu) * (b >> 16u) + (q & 0xffffu);
    return (a >> 16u) * (b >> 16u) + (q >> 16u) + (r >> 16u);
}

// Depth of the ray: what it is where that is among the stored ones, nearer or farther than all of them elsewhere.
fn depth_at(ray: LightMapRay, t: u32) -> i32 {
    if t < ray.depth_window.x || t > ray.depth_window.y {
        return select(FARTHEST, -FARTHEST, (t < ray.depth_window.x) == (ray.depth_step_high >= 0));
    }
    let dt = t - ray.depth_window.x;
    return ray.depth + ray.depth_step_high * i32(dt) + i32(multiply_high(ray.depth_step_low, dt));
}

// When the ray crosses a line of the shadow map, along one axis.
fn shadow_crossing(ray: LightMapRay, axis: u32, line: i32) -> u32 {
    let ahead = ray.slope[axis] > 0.0;
    // Lines that it crosses before.
    let n = u32(select(ray.shadow_cell[axis] - line, line - ray.shadow_cell[axis] - 1, ahead));
    if f32(n) * f32(ray.shadow_step_high[axis]) > f32(TICKS) {
        return NEVER;
    }
    let product = many_steps_low(ray.shadow_step_low[axis], n);
    let low = ray.shadow_first_low[axis] + product.x;
    let carry = select(0u, 1u, low < product.x);
    return ray.shadow_first_high[axis] + ray.shadow_step_high[axis] * n + product.y + carry;
}

// The same, and never for lines at the rim of the map: what is beyond belongs to the last texel until the map is left.
fn crossing_inside(ray: LightMapRay, axis: u32, line: i32) -> u32 {
    if line <= 0 || line >= transport.shadow_size[axis] || ray.slope[axis] == 0.0 {
        return NEVER;
    }
    return shadow_crossing(ray, axis, line);
}

fn range_of(level: u32, texel: vec2<i32>) -> vec2<i32> {
    if level == 0u {
        return vec2(depths[u32(texel.y * transport.shadow_size.x + texel.x)]);
    }
    let node = texel >> vec2(level);
    let row = transport.levels[level];
    return ranges[row.x + u32(node.y) * row.y + u32(node.x)];
}

// The texel along one axis that the ray is in at `t`, between `low` and `high`; it never goes back.
fn texel_at(ray: LightMapRay, axis: u32, t: u32, low: i32, high: i32) -> i32 {
    let first = ray.shadow_first_high[axis];
    var moved = 0;
    if t >= first {
        moved = 1 + i32(f32(t - first) / f32(max(ray.shadow_step_high[axis], 1u)));
    }
    let ahead = ray.slope[axis] > 0.0;
    var texel = clamp(ray.shadow_cell[axis] + select(-moved, moved, ahead), low, high);
    // The quotient is rounded: the crossings themselves decide.
    if ahead {
        if texel > low && crossing_inside(ray, axis, texel) > t {
            texel -= 1;
        } else if texel < high && crossing_inside(ray, axis, texel + 1) <= t {
            texel += 1;
        }
        return max(texel, lit_cell[axis]);
    }
    if texel < high && crossing_inside(ray, axis, texel + 1) > t {
        texel += 1;
    } else if texel > low && crossing_inside(ray, axis, texel) <= t {
        texel -= 1;
    }
    return min(texel, lit_cell[axis]);
}

fn open_at(t: u32) {
    if !lit_open {
        lit_open = true;
        lit_start = t;
    }
}

// Closes the stretch under construction; whether there is anything in it.
fn close_at(t: u32, stretch: ptr<function, vec2<u32>>) -> bool {
    let was_open = lit_open;
    lit_open = false;
    *stretch = vec2(lit_start, t);
    return was_open && t > lit_start;
}

// The next stretch, in ticks; false when there is none left.
fn lit_next(ray: LightMapRay, stretch: ptr<function, vec2<u32>>) -> bool {
    if lit_phase == BEFORE {
        // Beside the shadow map everything is lit.
        if ray.shadow_clip.x > 0u {
            open_at(0u);
        }
        lit_phase = OVER;
    }
    while lit_phase == OVER {
        if lit_t >= ray.shadow_clip.y {
            lit_phase = BEYOND;
            break;
        }
        let ahead = ray.slope > vec2(0.0);
        let low = (lit_cell >> vec2(lit_level)) << vec2(lit_level);
        let high = min(low + (1 << lit_level), transport.shadow_size);
        let line = select(low, high, ahead);
        let x = crossing_inside(ray, 0u, line.x);
        let y = crossing_inside(ray, 1u, line.y);
        let end = max(min(min(x, y), ray.shadow_clip.y), lit_t);
        let depth = vec2(depth_at(ray, lit_t), depth_at(ray, end));
        let range = range_of(lit_level, lit_cell);
        let is_lit = all(depth <= vec2(range.x));
        let is_dark = all(depth > vec2(range.y));
        if !is_lit && !is_dark && lit_level > 0u {
            lit_level -= 1u;
            continue;
        }
        let start = lit_t;
        lit_t = end;
        if end < ray.shadow_clip.y {
            // On to the next node.
            let before = lit_cell;
            if x <= y {
                lit_cell.y = texel_at(ray, 1u, end, low.y, high.y - 1);
                lit_cell.x = select(low.x - 1, high.x, ahead.x);
            } else {
                lit_cell.x = texel_at(ray, 0u, end, low.x, high.x - 1);
                lit_cell.y = select(low.y - 1, high.y, ahead.y);
            }
            let above = vec2(lit_level + 1u);
            if lit_level < transport.shadow_top && any((lit_cell >> above) != (before >> above)) {
                lit_level += 1u;
            }
        }
        if is_lit {
            open_at(start);
        } else if is_dark {
            if close_at(start, stretch) {
                return true;
            }
        } else {
            // From where the depth is known.
            let known = max(start, ray.depth_window.x);
            let ticks = abs(f32(range.x - depth_at(ray, known)) / ray.depth_slope);
            let cut = clamp(known + u32(min(ticks, f32(TICKS))), start, end);
            if depth.y > depth.x {
                open_at(start);
                if close_at(cut, stretch) {
                    return true;
                }
            } else {
                let closed = close_at(start, stretch);
                open_at(cut);
                if closed {
                    return true;
                }
            }
        }
    }
    if lit_phase == BEYOND {
        lit_phase = DONE;
        if ray.shadow_clip.y < TICKS {
            open_at(ray.shadow_clip.y);
        }
        return close_at(TICKS, stretch);
    }
    return false;
}
