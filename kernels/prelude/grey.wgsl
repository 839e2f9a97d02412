// One weight for all channels.
alias Weight = f32;

struct Moments {
    m0: Weight,
    m1: Weight,
    m2: Weight,
}

fn channels_of(weight: Weight) -> vec3<f32> {
    return vec3(weight);
}

fn weight_of(v: vec3<f32>) -> Weight {
    return v.x;
}

fn all_extinguished(s: Weight) -> Weight {
    return extinguished(s);
}

fn all_moments(s: Weight) -> Moments {
    let m = moments(s);
    return Moments(m.x, m.y, m.z);
}

fn is_positive(weight: Weight) -> bool {
    return weight > 0.0;
}

fn largest(weight: Weight) -> f32 {
    return weight;
}

fn smallest(weight: Weight) -> f32 {
    return weight;
}

// The weights of the bound channels.
fn weights_of(weight: Weight) -> vec3<f32> {
    return vec3(weight);
}
