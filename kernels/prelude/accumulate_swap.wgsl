// Sums in f32 where the device has no atomic addition for them: read, add, and swap in if nobody else was there meanwhile.
@group(0) @binding(2) var<storage, read_write> x: array<atomic<u32>>;

fn scale_of_near(plane: u32) -> f32 {
    return group_scale();
}

fn deposit(i: u32, value: f32, plane: u32) {
    var old = atomicLoad(&x[i]);
    loop {
        let swapped = atomicCompareExchangeWeak(&x[i], old, bitcast<u32>(bitcast<f32>(old) + value));
        if swapped.exchanged {
            break;
        }
        old = swapped.old_value;
    }
}

fn deposit_words(i: u32, words: vec2<u32>, plane: u32) {
    deposit(i, float_from_fixed(words) / group_scale(), plane);
}
