// Sums in f32, by the device's own atomic addition: fast, in whatever order the rays arrive.
@group(0) @binding(2) var<storage, read_write> x: array<atomic<f32>>;

fn scale_of_near(plane: u32) -> f32 {
    return group_scale();
}

fn deposit(i: u32, value: f32, plane: u32) {
    atomicAdd(&x[i], value);
}

fn deposit_words(i: u32, words: vec2<u32>, plane: u32) {
    deposit(i, float_from_fixed(words) / group_scale(), plane);
}
