// Sums in f32 where the device has no atomic addition for them: read, add, and swap in if nobody else was there meanwhile.
@group(0) @binding(2) var<storage, read_write> x: array<atomic<u32>>;

var<workgroup> near_sums: array<atomic<u32>, NEAR_NUMBERS>;

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

fn deposit_near(k: u32, value: f32, plane: u32) {
    var old = atomicLoad(&near_sums[k]);
    loop {
        let swapped = atomicCompareExchangeWeak(&near_sums[k], old, bitcast<u32>(bitcast<f32>(old) + value));
        if swapped.exchanged {
            break;
        }
        old = swapped.old_value;
    }
}

fn flush_near(i: u32, k: u32) {
    let sum = bitcast<f32>(atomicLoad(&near_sums[k]));
    if sum != 0.0 {
        deposit(i, sum, 0u);
    }
}
