// y[place] ← Σ_e w_ke x[e] over rows that are kept: gather over the rows of T, and the adjoint over those of its transpose. A row that is
// cut into pieces is the sum of those, and they go into `pieces`.
// Lanes of a workgroup share its rows, as many a row as those are long, so that they read side by side.

struct RowsParams {
    // Numbers of one channel's weights.
    nonzeros: u32,
    channel: u32,
    // From one channel to the next.
    x_stride: u32,
    y_stride: u32,
    pieces_stride: u32,
    // Places from here on are those of pieces.
    places: u32,
    // Workgroups that have rows.
    groups: u32,
    pad: u32,
}

// Rows of a workgroup: the first, one behind the last, and lanes a row, a power of two.
struct RowsGroup {
    first: u32,
    end: u32,
    sharers: u32,
    pad: u32,
}

@group(0) @binding(0) var<uniform> params: RowsParams;
@group(0) @binding(1) var<storage, read_write> y: array<f32>;
@group(0) @binding(3) var<storage, read_write> pieces: array<f32>;
@group(0) @binding(4) var<storage, read> groups: array<RowsGroup>;
// Where a row begins, and its place; one row more than there are says where the last ends.
@group(0) @binding(5) var<storage, read> rows: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read> elements: array<u32>;
@group(0) @binding(7) var<storage, read> weights: array<f32>;

var<workgroup> sums: array<vec3<f32>, LANES>;

// Of the bound channels; 0 for the others of colored weights. Never stored to by a channel's number: some compilers (FXC) cannot in
// a loop.
fn weights_at(k: u32) -> vec3<f32> {
    if COLORED {
        if CHANNELS == 3u {
            return vec3(weights[k], weights[params.nonzeros + k], weights[2u * params.nonzeros + k]);
        }
        return vec3(weights[params.channel * params.nonzeros + k], 0.0, 0.0);
    }
    return vec3(weights[k]);
}

fn put(place: u32, total: vec3<f32>) {
    if place < params.places {
        y[place] = total.x;
        if CHANNELS == 3u {
            y[params.y_stride + place] = total.y;
            y[2u * params.y_stride + place] = total.z;
        }
    } else {
        let piece = place - params.places;
        pieces[piece] = total.x;
        if CHANNELS == 3u {
            pieces[params.pieces_stride + piece] = total.y;
            pieces[2u * params.pieces_stride + piece] = total.z;
        }
    }
}

@compute @workgroup_size(LANES)
fn main(
    @builtin(local_invocation_id) lane: vec3<u32>,
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
) {
    let number = id.y * count.x + id.x;
    if number >= params.groups {
        return;
    }
    let group = groups[number];
    let mine = lane.x % group.sharers;
    let row = group.first + lane.x / group.sharers;
    var total = vec3(0.0);
    if row < group.end {
        let end = rows[row + 1u].x;
        // A few terms a lane, and the sums of those pair by pair: fewer roundings than one long sum.
        for (var k = rows[row].x + mine; k < end; k += group.sharers) {
            var w = weights_at(k);
            if SQUARED {
                w = w * w;
            }
            total += w * color_of(elements[k]);
        }
    }
    sums[lane.x] = total;
    for (var half = SHARERS / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if half < group.sharers && mine < half {
            sums[lane.x] += sums[lane.x + half];
        }
    }
    if row < group.end && mine == 0u {
        put(rows[row].y, sums[lane.x]);
    }
}
