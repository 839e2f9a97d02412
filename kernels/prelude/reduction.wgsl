// One workgroup of the first two axes reduces PIECE elements of a channel pairwise: sixteen a lane, then the lanes. The host adds the pieces in f64.
// Error  (13 roundings) 2⁻²⁴ Σ|terms| at most: log₂ PIECE additions and one product

@group(0) @binding(0) var<uniform> params: VectorParams;
@group(0) @binding(1) var<storage, read_write> results: array<f32>;

var<workgroup> lanes: array<f32, LANES>;

fn term_or_none(n: u32, plane: u32) -> f32 {
    if n < params.len {
        let k = params.first + n;
        return term(k, plane * params.stride + k, params.channel + plane);
    }
    return NONE;
}

@compute @workgroup_size(LANES)
fn main(
    @builtin(local_invocation_id) lane: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let piece = group.y * groups.x + group.x;
    let pieces = (params.len + PIECE - 1u) / PIECE;
    if piece >= pieces {
        return;
    }
    let first = piece * PIECE + lane.x;
    var fours: array<f32, 4>;
    for (var q = 0u; q < 4u; q++) {
        let n = first + 4u * q * LANES;
        fours[q] = together(
            together(term_or_none(n, group.z), term_or_none(n + LANES, group.z)),
            together(term_or_none(n + 2u * LANES, group.z), term_or_none(n + 3u * LANES, group.z)),
        );
    }
    lanes[lane.x] = together(together(fours[0], fours[1]), together(fours[2], fours[3]));
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane.x < half {
            lanes[lane.x] = together(lanes[lane.x], lanes[lane.x + half]);
        }
    }
    if lane.x == 0u {
        results[params.results + group.z * pieces + piece] = lanes[0];
    }
}
