// Sweeps over slices: one lane for each term and channel of a fan, so lanes side by side meet the same places of the same tree.

struct SweepParams {
    // Terms of all fans, rays and samples that are worked on.
    items: u32,
    rays: u32,
    samples: u32,
    // The first of these samples among those of x̂.
    first_sample: u32,
    // The first channel that is bound, how many are, and numbers from one to the next.
    channel: u32,
    channels: u32,
    x_stride: u32,
    y_stride: u32,
}

// A term of a fan: which part of all samples and rays is its fan's.
struct SweepItem {
    // Extinction a metre of ξ, a channel.
    rates: vec3<f32>,
    term: u32,
    terms: u32,
    samples: u32,
    first_sample: u32,
    // Samples that light any ray.
    lit: u32,
    first_lit: u32,
    rays: u32,
    first_ray: u32,
    // Where the a_m of its rays begin.
    first_coefficient: u32,
    // Where the nodes of its tree begin.
    first_node: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

struct SweepRay {
    scattering: vec3<f32>,
    row: u32,
    // Samples of the fan that the ray passes as a whole, and those by falling c that light it.
    whole: u32,
    lit: u32,
    terms: u32,
    first_coefficient: u32,
}

struct SweepSample {
    // ξ where it begins, and its width.
    begin: f32,
    width: f32,
    // The first term of its fan.
    item: u32,
}

@group(0) @binding(0) var<uniform> params: SweepParams;

// Where a lane's number of a node, or of a sample, stands.
fn number_at(item: SweepItem, place: u32, channel: u32) -> u32 {
    return (item.first_node + place * item.terms + item.term) * params.channels + channel;
}

// Where a lane's number of a ray stands.
fn number_of_ray(item: SweepItem, ray: u32, channel: u32) -> u32 {
    return (item.first_coefficient + ray * item.terms + item.term) * params.channels + channel;
}

fn lowest_bit(node: u32) -> u32 {
    return node & (~node + 1u);
}

// e^{−σ q_m a} − e^{−σ q_m b} between the edges of a sample.
fn weight_of(item: SweepItem, sample: SweepSample, channel: u32) -> f32 {
    let rate = item.rates[params.channel + channel];
    return exp(-rate * sample.begin) * extinguished(rate * sample.width);
}
