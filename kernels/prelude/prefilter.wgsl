// Prefiltered visibility over slices: sums of sines and cosines along the samples of a fan, and what rays read of them.

struct PrefilterParams {
    fans: u32,
    rays: u32,
    // The first sample among those of x̂.
    first_sample: u32,
    // Pairs of a sine and a cosine.
    harmonics: u32,
    // The first channel that is bound, how many are, and numbers from one to the next.
    channel: u32,
    channels: u32,
    x_stride: u32,
    y_stride: u32,
}

struct PrefilterFan {
    // Extinction along the reference ray a metre of ξ, a channel.
    rates: vec3<f32>,
    samples: u32,
    first_sample: u32,
    first_edge: u32,
    pad0: u32,
    pad1: u32,
}

struct PrefilterSample {
    // ξ from the first edge on, and the sample's width.
    begin: f32,
    width: f32,
    // Where the angle of its surface is in the half period of the series.
    place: f32,
}

struct PrefilterRay {
    // What the ray loses up to its end, times its scattering.
    gain: vec3<f32>,
    row: u32,
    // The part of the sums at its edge; the rest is that of the edge before.
    far: vec3<f32>,
    edge: u32,
    place: f32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> params: PrefilterParams;

const PI: f32 = 3.1415927;

// Where the sums of an edge begin: sines and cosines in turns, and behind them the mean of the light.
fn sums_of(edge: u32, channel: u32) -> u32 {
    return (edge * params.channels + channel) * (2u * params.harmonics + 1u);
}
