// THE traversal of a straight view ray through a volume; twin of VolumeTraversal in src/march/volume/mod.rs. It calls visit(voxel,
// weight) of the consumer that it is compiled into, for every voxel once: weight ∫ T_r σ_t v dt for emission, times L_scat for albedo
// (Klehm 2015, eq. 7.4 and 7.6), and ∫ v dt for extinction (eq. 7.13).
//
// EXTINCTION walks the bricks of the unknown that have elements. Else those of the medium are walked, and NESTED in each piece the
// unknown's own grid.

// What the unknown has at an element.
alias Cell = vec3<i32>;

// One track a row, NESTED two.
@group(2) @binding(0) var<storage, read> tracks: array<Track>;

var<private> walker: Walker;
// NESTED through the unknown's cells, and between which ticks it is over them.
var<private> inner: Walker;
var<private> inner_clip: vec2<u32>;
var<private> metres_a_tick: f32;

fn is_inside(cell: vec3<i32>, cells: vec3<u32>) -> bool {
    // What is before the first cell is beyond the last one without a sign.
    return all(vec3<u32>(cell) < cells);
}

fn integrate_nested(depth: Depth, a: u32, b: u32, strength: Weight) {
    let begin = max(a, inner_clip.x);
    let last = min(b, inner_clip.y);
    if begin >= last {
        return;
    }
    while next_plane(&inner) <= begin {
        cross_next(&inner);
    }
    let part = 1.0 / f32(b - a);
    var t = begin;
    while t < last && is_inside(inner.cell, volume.size + EXTRA) {
        let end = min(next_plane(&inner), last);
        if end > t {
            let within = vec2(f32(t - a), f32(end - a)) * part;
            let entering = strength * exp(-depth_at(depth, within.x));
            integrate(depth, within, entering, inner.cell, fraction_at(&inner, t), inner.slope * f32(end - t));
            t = end;
        }
        if end < last {
            cross_next(&inner);
        }
    }
}

// Integrates the piece from tick a to b, and says how much of the strength is left.
fn pass_piece(slot: u32, a: u32, b: u32, strength: Weight) -> Weight {
    let start = fraction_at(&walker, a);
    let ticks = f32(b - a);
    let change = walker.slope * ticks;
    if EXTINCTION {
        integrate_length(ticks * metres_a_tick, walker.cell, start, change);
        return strength;
    }
    let depth = depth_over(slot, vec3<u32>(walker.cell), start, change, ticks * metres_a_tick);
    if is_empty(depth) {
        return strength;
    }
    if LIT {
        lit_cell = vec3<f32>(walker.cell);
        lit_start = start;
        lit_change = change;
    }
    if NESTED {
        integrate_nested(depth, a, b, strength);
    } else {
        integrate(depth, vec2(0.0, 1.0), strength, walker.cell, start, change);
    }
    return strength - strength * all_extinguished(depth_at(depth, 1.0));
}

fn walk_begin(row: u32) -> bool {
    let track = tracks[select(row, 2u * row, NESTED)];
    walker = walker_of(track, 0u);
    let slope = walker.slope;
    metres_a_tick = length(
        volume.metres[0].xyz * slope.x + volume.metres[1].xyz * slope.y + volume.metres[2].xyz * slope.z
    );
    if LIT {
        let words = vec4(track.first.w, track.step_high.w, track.step_low.w, track.entry.w);
        factors = bitcast<vec4<f32>>(words);
    }
    if NESTED {
        let second = tracks[2u * row + 1u];
        inner_clip = vec2(second.first.w, second.step_high.w);
        inner = walker_of(second, inner_clip.x);
    }
    return track.step_high.x != 0u;
}

// Cell by cell in bricks that are not empty (Amanatides and Woo 1987), to the end of the ray or of the light.
fn walk(row: u32) {
    if !walk_begin(row) {
        return;
    }
    window_begin();
    var strength = Weight(1.0);
    var t = 0u;
    while t < TICKS
        && is_inside(walker.cell, volume.cells)
        && is_positive(strength - Weight(volume.transmittance_bound)) {
        let slot = bricks[volume.slots + brick_of(vec3<u32>(walker.cell), volume.cells)];
        if slot == NOWHERE {
            t = pass_brick(&walker);
            continue;
        }
        let end = min(next_plane(&walker), TICKS);
        if end > t {
            strength = pass_piece(slot, t, end, strength);
            t = end;
        }
        if end < TICKS {
            cross_next(&walker);
        }
    }
    window_finish();
}
