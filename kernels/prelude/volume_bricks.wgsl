// Volumes on the device, brick by brick: those that hold nothing have no memory.

// Light from somewhere, cached at the centres of voxels.
struct LightUniform {
    // Its cells from the medium's: `high` in whole 2⁻¹⁰, so that what it makes of whole cells is exact in f32, and what that
    // leaves. Columns.
    high: array<vec4<f32>, 3>,
    low: array<vec4<f32>, 3>,
    at_high: vec3<f32>,
    // Where the slots of its bricks begin in `bricks`, and its values in `lights`.
    slots: u32,
    at_low: vec3<f32>,
    first: u32,
    // Voxels a side.
    size: vec3<u32>,
    channels: u32,
}

struct VolumeUniform {
    // Metres of a cell along each axis that is walked.
    metres: array<vec4<f32>, 3>,
    // Cells that are walked, and where the slots of their bricks begin in `bricks`.
    cells: vec3<u32>,
    slots: u32,
    // Voxels of the unknown, and where the places of their bricks' records begin in `bricks`.
    size: vec3<u32>,
    elements: u32,
    transmittance_bound: f32,
    // Of the extinction.
    channels: u32,
    lights: u32,
    pad: u32,
    light: array<LightUniform, LIGHTS>,
}

// Slots of bricks of cells; places of the records of bricks with elements; and those records: the number of the first element, how
// many are in the slices before (two a word), and a bit a voxel, two words a slice.
@group(1) @binding(0) var<storage, read> bricks: array<u32>;
// σ_t, brick by brick.
@group(1) @binding(1) var<storage, read> sigma: array<f32>;
// Radiance, light by light and brick by brick.
@group(1) @binding(2) var<storage, read> lights: array<f32>;
@group(1) @binding(3) var<uniform> volume: VolumeUniform;

fn brick_of(cell: vec3<u32>, cells: vec3<u32>) -> u32 {
    let across = (cells + 7u) >> vec3(3u);
    let brick = cell >> vec3(3u);
    return (brick.z * across.y + brick.y) * across.x + brick.x;
}

// Place of a value among those of a brick with so many a side.
fn inside_brick(cell: vec3<u32>, side: u32) -> u32 {
    let at = cell & vec3(7u);
    return (at.z * side + at.y) * side + at.x;
}

fn sigma_at(i: u32) -> Weight {
    if COLORED && volume.channels == 3u {
        return weight_of(vec3(sigma[3u * i], sigma[3u * i + 1u], sigma[3u * i + 2u]));
    }
    return weight_of(vec3(sigma[i * volume.channels]));
}

// The number of an element among those that are bound; NOWHERE, or not below `x_len`, where it is not.
fn local_element(voxel: vec3<i32>) -> u32 {
    let at = vec3<u32>(voxel);
    let record = bricks[volume.elements + brick_of(at, volume.size)];
    if record == NOWHERE {
        return NOWHERE;
    }
    let slice = at.z & 7u;
    let row = at.y & 7u;
    let half = record + 5u + 2u * slice;
    let word = bricks[half + (row >> 2u)];
    let bit = ((row & 3u) << 3u) | (at.x & 7u);
    if ((word >> bit) & 1u) == 0u {
        return NOWHERE;
    }
    let before = (bricks[record + 1u + (slice >> 1u)] >> ((slice & 1u) << 4u)) & 0xffffu;
    let lower = select(0u, countOneBits(bricks[half]), row >= 4u);
    let number = bricks[record] + before + lower + countOneBits(word & ((1u << bit) - 1u));
    return number - parameters.x_first;
}

// What the lights are times towards the eye; the medium's cell, where in it the piece begins, and how far it goes.
var<private> factors: vec4<f32>;
var<private> lit_cell: vec3<f32>;
var<private> lit_start: vec3<f32>;
var<private> lit_change: vec3<f32>;

fn light_value(begin: u32, channels: u32, i: u32) -> vec3<f32> {
    if COLORED && channels == 3u {
        return vec3(lights[begin + 3u * i], lights[begin + 3u * i + 1u], lights[begin + 3u * i + 2u]);
    }
    return vec3(lights[begin + channels * i]);
}

// A piece in the cells of a light: from which whole cell on, where it begins, and how far it goes.
struct LightLine {
    whole: vec3<f32>,
    start: vec3<f32>,
    change: vec3<f32>,
}

fn light_line(k: u32) -> LightLine {
    let light = &volume.light[k];
    let h = array<vec3<f32>, 3>((*light).high[0].xyz, (*light).high[1].xyz, (*light).high[2].xyz);
    let l = array<vec3<f32>, 3>((*light).low[0].xyz, (*light).low[1].xyz, (*light).low[2].xyz);
    let all = array<vec3<f32>, 3>(h[0] + l[0], h[1] + l[1], h[2] + l[2]);
    let high = h[0] * lit_cell.x + h[1] * lit_cell.y + h[2] * lit_cell.z + (*light).at_high;
    let low = l[0] * lit_cell.x + l[1] * lit_cell.y + l[2] * lit_cell.z + (*light).at_low;
    let within = all[0] * lit_start.x + all[1] * lit_start.y + all[2] * lit_start.z;
    let change = all[0] * lit_change.x + all[1] * lit_change.y + all[2] * lit_change.z;
    return LightLine(floor(high), (high - floor(high)) + (low + within), change);
}

// Radiance of a light at u of the piece; trilinear between centres and constant beyond the outermost ones.
fn radiance(k: u32, u: f32) -> vec3<f32> {
    let light = &volume.light[k];
    let line = light_line(k);
    let rest = line.start + line.change * u;
    let whole = line.whole + floor(rest);
    let last = vec3<f32>((*light).size);
    let is_outside = (whole < vec3(1.0)) | (whole >= last);
    let part = select(rest - floor(rest), vec3(0.0), is_outside);
    let at = vec3<u32>(clamp(whole, vec3(1.0), last));
    let slot = bricks[(*light).slots + brick_of(at, (*light).size + 1u)];
    if slot == NOWHERE {
        return vec3(0.0);
    }
    let i = slot * 729u + inside_brick(at, 9u);
    let first = (*light).first;
    let channels = (*light).channels;
    let x0 = mix(light_value(first, channels, i), light_value(first, channels, i + 1u), part.x);
    let x1 = mix(light_value(first, channels, i + 9u), light_value(first, channels, i + 10u), part.x);
    let x2 = mix(light_value(first, channels, i + 81u), light_value(first, channels, i + 82u), part.x);
    let x3 = mix(light_value(first, channels, i + 90u), light_value(first, channels, i + 91u), part.x);
    return mix(mix(x0, x1, part.y), mix(x2, x3, part.y), part.z);
}

// What is scattered towards the eye at u of the piece.
fn light_at(u: f32) -> Weight {
    return weight_of(scattered_at(u));
}

fn scattered_at(u: f32) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = 0u; k < volume.lights; k++) {
        sum += factors[k] * radiance(k, u);
    }
    return sum;
}

// Its mean over what is extinguished in [begin, end] of the piece, whose optical depth is `tau`; exact where it is a cubic.
fn mean_scattered(tau: Weight, begin: f32, end: f32) -> Weight {
    let depths = channels_of(tau);
    let mean = mean_by(gauss_2(depths.x), begin, end);
    if depths.y == depths.x && depths.z == depths.x {
        return weight_of(mean);
    }
    return weight_of(vec3(mean.x, mean_by(gauss_2(depths.y), begin, end).y, mean_by(gauss_2(depths.z), begin, end).z));
}

fn mean_by(rule: vec3<f32>, begin: f32, end: f32) -> vec3<f32> {
    return mix(scattered_at(mix(begin, end, rule.y)), scattered_at(mix(begin, end, rule.x)), rule.z);
}

// Parts of a piece at most.
const CUTS: u32 = 64u;
// What is cut off is longer than this.
const SHORTEST: f32 = 1e-6;

// Where in (begin, end] the light is a cubic no longer: the first plane through the centres of its voxels.
fn next_cut(begin: f32, end: f32) -> f32 {
    var next = end;
    for (var k = 0u; k < volume.lights; k++) {
        let line = light_line(k);
        let at = line.start + line.change * begin;
        let ahead = select(ceil(at) - 1.0, floor(at) + 1.0, line.change > vec3(0.0));
        let moves = line.change != vec3(0.0);
        let across = 1.0 / select(vec3(1.0), line.change, moves);
        // The plane that it stands on is not ahead, whatever the rounding.
        let u = (ahead - line.start) * across;
        let beyond = select(u, u + abs(across), u <= vec3(begin + SHORTEST));
        let cuts = select(vec3(end), beyond, moves & (beyond < vec3(end - SHORTEST)));
        next = min(next, min(min(cuts.x, cuts.y), cuts.z));
    }
    return next;
}
