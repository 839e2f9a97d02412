// The metric of dense tiles; twin of src/cpu/tiles.rs. One workgroup takes one tile, one lane one unknown of it.
// OPERATION chooses: 0 stretch v ← M v; 1 shrink v ← S⁻¹ v by a symmetric sweep of Gauss and Seidel; 2 descend, the same from
// a separable step within bounds.

struct TilesParams {
    tiles: u32,
    stride: u32,
    channel: u32,
    // Of the bounds.
    parts: u32,
    // 1 / norm
    shorter: vec4<f32>,
}

// l and u of the elements from `begin` to where the next part begins.
struct BoundsPart {
    lower: vec4<f32>,
    upper: vec4<f32>,
    begin: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> params: TilesParams;
@group(0) @binding(1) var<storage, read_write> v: array<f32>;
@group(0) @binding(2) var<storage, read> y: array<f32>;
// Of each tile: where its matrix begins, its members begin, how many they are.
@group(0) @binding(3) var<storage, read> tiles: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> members: array<u32>;
@group(0) @binding(5) var<storage, read> matrices: array<f32>;
// The parts of the bounds; the first begins at 0. Members of a tile may belong to different ones.
@group(0) @binding(6) var<storage, read> parts: array<BoundsPart>;

var<workgroup> exchange: array<vec3<f32>, TILE>;
var<workgroup> change: array<vec3<f32>, 2>;
// The lower triangle, row after row.
var<workgroup> held: array<f32, HELD_NUMBERS>;

// Below, 0 stands for channels that are not bound. Vectors are never stored to by a channel's number: some compilers (FXC) cannot in a
// loop.
fn colors(i: u32) -> vec3<f32> {
    if CHANNELS == 3u {
        return vec3(v[i], v[params.stride + i], v[2u * params.stride + i]);
    }
    return vec3(v[i], 0.0, 0.0);
}

fn aims(i: u32) -> vec3<f32> {
    if CHANNELS == 3u {
        return vec3(y[i], y[params.stride + i], y[2u * params.stride + i]);
    }
    return vec3(y[i], 0.0, 0.0);
}

fn bound_of(all: vec4<f32>) -> vec3<f32> {
    if CHANNELS == 3u {
        return all.xyz;
    }
    return vec3(all[params.channel], 0.0, 0.0);
}

// Entry (row, column) of a tile; matrices are symmetric, so lanes read along a row side by side.
fn entry(tile: vec4<u32>, k: u32, lane: u32) -> vec3<f32> {
    if HELD {
        let row = max(k, lane);
        return vec3(held[row * (row + 1u) / 2u + min(k, lane)]);
    }
    let i = tile.x + k * tile.z + lane;
    if COLORED {
        if CHANNELS == 3u {
            return vec3(matrices[3u * i], matrices[3u * i + 1u], matrices[3u * i + 2u]);
        }
        return vec3(matrices[3u * i + params.channel], 0.0, 0.0);
    }
    return vec3(matrices[i]);
}

// The part of the bounds that element i belongs to, by halving.
fn part_of(i: u32) -> u32 {
    var part = 0u;
    for (var beyond = params.parts; beyond - part > 1u;) {
        let middle = (part + beyond) / 2u;
        if parts[middle].begin <= i {
            part = middle;
        } else {
            beyond = middle;
        }
    }
    return part;
}

fn reciprocal(w: vec3<f32>) -> vec3<f32> {
    return select(1.0 / w, vec3(0.0), w <= vec3(0.0));
}

@compute @workgroup_size(TILE)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = local.x;
    let number = group.y * groups.x + group.x;
    if number >= params.tiles {
        return;
    }
    let tile = tiles[number];
    let side = tile.z;
    let is_member = lane < side;
    let i = members[tile.y + min(lane, side - 1u)];
    var g = vec3(0.0);
    if is_member {
        g = colors(i);
    }
    if HELD {
        for (var k = lane; k < side; k++) {
            held[k * (k + 1u) / 2u + lane] = matrices[tile.x + k * side + lane];
        }
        workgroupBarrier();
    }
    var d = vec3(0.0);
    // (M d)_lane
    var slope = vec3(0.0);

    if OPERATION == 0 {
        exchange[lane] = g;
        workgroupBarrier();
        if is_member {
            for (var k = 0u; k < side; k++) {
                slope += entry(tile, k, lane) * exchange[k];
            }
        }
        g = slope;
    } else {
        var least = vec3(-HUGE);
        var most = vec3(HUGE);
        var lower = vec3(0.0);
        var upper = vec3(0.0);
        var at = vec3(0.0);
        if OPERATION == 1 {
            // For −v the least is at M⁻¹ v.
            g = -g;
        } else {
            g *= bound_of(params.shorter);
            at = aims(i);
            let part = part_of(i);
            lower = bound_of(parts[part].lower);
            upper = bound_of(parts[part].upper);
            least = lower - at;
            most = upper - at;
            var sum = vec3(0.0);
            if is_member {
                for (var k = 0u; k < side; k++) {
                    sum += entry(tile, k, lane);
                }
            }
            d = min(max(-g * reciprocal(sum), least), most);
            if !is_member {
                d = vec3(0.0);
            }
            exchange[lane] = d;
            workgroupBarrier();
            if is_member {
                for (var k = 0u; k < side; k++) {
                    slope += entry(tile, k, lane) * exchange[k];
                }
            }
        }
        var inverse = vec3(0.0);
        if is_member {
            inverse = reciprocal(entry(tile, lane, lane));
        }
        for (var n = 0u; n < 2u * side; n++) {
            let k = select(2u * side - 1u - n, n, n < side);
            if lane == k {
                let moved = min(max(d - (g + slope) * inverse, least), most);
                change[n & 1u] = moved - d;
                d = moved;
            }
            workgroupBarrier();
            if is_member {
                slope += entry(tile, k, lane) * change[n & 1u];
            }
        }
        g = d;
        if OPERATION == 2 {
            // A bound is met to the last digit.
            g = clamp(at + d, lower, upper);
        }
    }
    if is_member {
        v[i] = g.x;
        if CHANNELS == 3u {
            v[params.stride + i] = g.y;
            v[2u * params.stride + i] = g.z;
        }
    }
}
