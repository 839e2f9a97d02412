//! The metric of tiles, and the depth pass.

use std::cell::LazyCell;

use unscatter::cpu::{TileMetric, Transport};
use unscatter::gpu::{self, Gpu, GpuVector, surfaces_seen};
use unscatter::operator::{Bounds, LinearOperator, Metric, TileBlocks, Tiling, Vector, WalkPlan};
use unscatter::scene::Strategy;

use crate::rates::{Rates, Work, by_the_clock};
use crate::scenes::Numbers;
use crate::scenes::field::Field;
use crate::{COLOR, on_adapter};

type Operation = fn(&gpu::TileMetric, &mut GpuVector, &GpuVector);

/// What a metric does, and how many vectors it reads or writes.
const OPERATIONS: [(&str, u64, Operation); 3] = [
    ("stretch", 2, |metric, v, _| metric.stretch(v)),
    ("shrink", 2, |metric, v, _| metric.shrink(v)),
    ("descend", 3, |metric, x, y| metric.descend(x, y, [1.0; 3], &Bounds::NOT_NEGATIVE)),
];

/// Over all texels of a field.
pub fn bench(rates: &mut Rates, both: &[Gpu; 2], field: &Field) {
    let made = LazyCell::new(|| {
        let traversal = field.traversal();
        let plan = WalkPlan::new::<1>(&traversal);
        let kept = Transport::<_, f32, 1>::new(traversal, &plan, Strategy::Auto, u64::MAX).unwrap();
        let texels: Vec<u32> = (0..kept.domain().len() as u32).collect();
        let tiling = Tiling::new([field.map; 2], &texels);
        let (ones, added) = (vec![1.0; field.painted], vec![1e-6; texels.len()]);
        let metric = TileMetric::new(&kept, &tiling, &ones, &added).unwrap();
        let [plain, held] = both
            .each_ref()
            .map(|gpu| gpu::TileMetric::new(gpu, texels.len(), metric.channels(), metric.blocks()).unwrap());
        ([plain, held], metric.bytes())
    });
    let ways = [(0, "tiles"), (1, "tiles held")];
    let all = ways.into_iter().flat_map(|way| OPERATIONS.map(|operation| (way, operation)));
    for ((way, words), (name, vectors, operate)) in all {
        rates.bench("metric", &format!("{words}: {name}"), || {
            let (gpu, (metrics, bytes)) = (&both[way], &*made);
            let metric = &metrics[way];
            let zeros = GpuVector::zeros(gpu, field.map * field.map);
            let (mut x, y) = (zeros.zeros_like(), zeros);
            x.fill([1.0, 0.5, 0.25]);
            let bytes = bytes + vectors * COLOR * x.len() as u64;
            let nonzeros = bytes / size_of::<f32>() as u64;
            let operate = move || {
                operate(metric, &mut x, &y);
                Ok(())
            };
            (Work { nonzeros, bytes, ..Work::default() }, on_adapter(gpu, operate))
        });
    }
}

/// 100,000 small triangles in a picture of 1920 × 1080, with sending and fetching: rays are pixels.
pub fn surfaces(rates: &mut Rates, gpu: &Gpu) {
    const PICTURE: [usize; 2] = [1920, 1080];
    const TRIANGLES: u32 = 100_000;
    rates.bench("depth pass", "surfaces", || {
        let mut n = Numbers(7);
        let mut corners = Vec::new();
        for _ in 0..TRIANGLES {
            let centre: [f64; 3] = [n.uniform(-1.0, 1.0), n.uniform(-1.0, 1.0), n.uniform(0.1, 0.9)];
            let corner = |[x, y]: [f64; 2]| [centre[0] + 0.02 * x, centre[1] + 0.02 * y, centre[2], 1.0];
            corners.extend([[0.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(corner));
        }
        let triangles: Vec<[u32; 3]> = (0..TRIANGLES).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let pixels = (PICTURE[0] * PICTURE[1]) as u64;
        // A corner is 20 bytes; of a pixel the triangle and its depth.
        let bytes = 8 * pixels + 20 * corners.len() as u64;
        let draw = move || surfaces_seen(gpu, &corners, &triangles, PICTURE).unwrap();
        (Work { rays: pixels, bytes, ..Work::default() }, by_the_clock(draw))
    });
}
