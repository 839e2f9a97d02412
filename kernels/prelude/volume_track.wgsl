// A ray through the cells of one grid, in integers; twin of CellRay in src/march/volume/cells.rs.
//
// TICKS of them are the part of the ray that is inside the grid that it is walked through. Crossings of grid planes are made by
// the host in f64, and added up exactly as ticks in 32.32 fixed point, so that the shortest piece far out keeps its digits.

struct Track {
    // Where four more words are needed they stand behind: of the first track of a row the bits of what its lights are times as
    // they go towards the eye, of the second between which ticks (first, step_high) the ray is over its grid.
    // When it crosses the first plane along each axis, in ticks.
    first: vec4<u32>,
    // How long it takes to the next one, in ticks and 2⁻³² of a tick; the uppermost bit says backwards. Where that is TICKS the
    // low word has the bits of the speed instead, in cells a tick: there is no next plane. A row that misses has zeros.
    step_high: vec4<u32>,
    step_low: vec4<u32>,
    // Where it begins, in 2^−PLACE_BITS of a cell.
    entry: vec4<u32>,
}

struct Walker {
    cell: vec3<i32>,
    // When each axis crosses its next plane, and how long it takes from one to the next.
    next_high: vec3<u32>,
    next_low: vec3<u32>,
    step_high: vec3<u32>,
    step_low: vec3<u32>,
    onwards: vec3<i32>,
    // Cells a tick.
    slope: vec3<f32>,
    // Since when it has been in the cell, along each axis, and where it was inside it then.
    since: vec3<u32>,
    fraction_then: vec3<f32>,
}

struct Planes {
    high: vec3<u32>,
    low: vec3<u32>,
}

fn walker_of(track: Track, begin: u32) -> Walker {
    let onwards = select(vec3(1), vec3(-1), (track.step_high.xyz >> vec3(31u)) != vec3(0u));
    let high = track.step_high.xyz & vec3(0x7fffffffu);
    let is_slow = high == vec3(TICKS);
    let step = vec3<f32>(high) + vec3<f32>(track.step_low.xyz) * WORD_INVERSE;
    let speed = select(1.0 / step, bitcast<vec3<f32>>(track.step_low.xyz), is_slow);
    let inside = track.entry.xyz & vec3((1u << PLACE_BITS) - 1u);
    var w: Walker;
    w.cell = vec3<i32>(track.entry.xyz >> vec3(PLACE_BITS));
    w.next_high = track.first.xyz;
    // The host rounds down; this makes it half a tick at most.
    w.next_low = vec3(0x80000000u);
    w.step_high = high;
    w.step_low = select(track.step_low.xyz, vec3(0u), is_slow);
    w.onwards = onwards;
    w.slope = speed * vec3<f32>(onwards);
    w.since = vec3(begin);
    w.fraction_then = vec3<f32>(inside) / f32(1u << PLACE_BITS);
    return w;
}

// Where it is inside its cell at tick `t`.
fn fraction_at(w: ptr<private, Walker>, t: u32) -> vec3<f32> {
    let moved = (*w).slope * vec3<f32>(vec3(t) - (*w).since);
    return clamp((*w).fraction_then + moved, vec3(0.0), vec3(1.0));
}

fn next_plane(w: ptr<private, Walker>) -> u32 {
    return min(min((*w).next_high.x, (*w).next_high.y), (*w).next_high.z);
}

// The plane that is n ≤ 7 behind the next one. A step of which n reach beyond TICKS is cut so that no sum leaves 32 bits.
fn plane_after(w: ptr<private, Walker>, n: vec3<u32>) -> Planes {
    let most = select(select(vec3(TICKS), vec3(TICKS / 2u), n >= vec3(2u)), vec3(TICKS / 4u), n >= vec3(4u));
    let p = ((*w).step_low & vec3(0xffffu)) * n;
    let q = ((*w).step_low >> vec3(16u)) * n;
    let low = p + (q << vec3(16u));
    let high = min((*w).step_high, most) * n + (q >> vec3(16u)) + select(vec3(0u), vec3(1u), low < p);
    let sum = (*w).next_low + low;
    return Planes((*w).next_high + high + select(vec3(0u), vec3(1u), sum < low), sum);
}

// Crosses n planes at once along each axis; `last` is when the last of them is crossed.
fn cross_many(w: ptr<private, Walker>, n: vec3<u32>, last: vec3<u32>) {
    let crosses = n > vec3(0u);
    let next = plane_after(w, n);
    (*w).since = select((*w).since, last, crosses);
    (*w).fraction_then =
        select((*w).fraction_then, select(vec3(1.0), vec3(0.0), (*w).onwards > vec3(0)), crosses);
    (*w).next_high = next.high;
    (*w).next_low = next.low;
    (*w).cell += (*w).onwards * vec3<i32>(n);
}

// Crosses the plane that comes next.
fn cross_next(w: ptr<private, Walker>) {
    let next = (*w).next_high;
    let x_first = next.x <= next.y && next.x <= next.z;
    let y_first = !x_first && next.y <= next.z;
    let axis = vec3(x_first, y_first, !(x_first || y_first));
    cross_many(w, select(vec3(0u), vec3(1u), axis), next);
}

// Crosses k planes along every axis that has as many left and is over the last of them at tick `t`.
fn cross_if(w: ptr<private, Walker>, k: u32, left: vec3<u32>, t: u32) -> vec3<u32> {
    let last = plane_after(w, vec3(k - 1u)).high;
    let n = select(vec3(0u), vec3(k), (left >= vec3(k)) & (last <= vec3(t)));
    cross_many(w, n, last);
    return left - n;
}

// Goes to where it leaves its brick, and says when. Nothing here loops: the up to seven planes of an axis come by 4, 2 and 1.
fn pass_brick(w: ptr<private, Walker>) -> u32 {
    let inside = vec3<u32>((*w).cell) & vec3(7u);
    var left = select(inside, vec3(7u) - inside, (*w).onwards > vec3(0));
    let out = plane_after(w, left).high;
    let t = min(min(out.x, out.y), out.z);
    left = cross_if(w, 4u, left, t);
    left = cross_if(w, 2u, left, t);
    left = cross_if(w, 1u, left, t);
    // The next plane of one axis is now the brick's own.
    cross_next(w);
    return t;
}
