// One weight a channel.
alias Weight = vec3<f32>;

struct Moments {
    m0: Weight,
    m1: Weight,
    m2: Weight,
}

fn channels_of(weight: Weight) -> vec3<f32> {
    return weight;
}

fn weight_of(v: vec3<f32>) -> Weight {
    return v;
}

fn all_extinguished(s: Weight) -> Weight {
    return vec3(extinguished(s.x), extinguished(s.y), extinguished(s.z));
}

fn all_moments(s: Weight) -> Moments {
    let r = moments(s.x);
    let g = moments(s.y);
    let b = moments(s.z);
    return Moments(vec3(r.x, g.x, b.x), vec3(r.y, g.y, b.y), vec3(r.z, g.z, b.z));
}

fn is_positive(weight: Weight) -> bool {
    return any(weight > Weight(0.0));
}

fn largest(weight: Weight) -> f32 {
    return max(max(weight.x, weight.y), weight.z);
}

fn smallest(weight: Weight) -> f32 {
    return min(min(weight.x, weight.y), weight.z);
}

// The weights of the bound channels.
fn weights_of(weight: Weight) -> vec3<f32> {
    if CHANNELS == 3u {
        return weight;
    }
    return vec3(weight[parameters.channel], 0.0, 0.0);
}
