//! FISTA as a solve of a light map composes it: the texels that a ray reaches are unknown and not negative, the pull to the start lies
//! below the data, and the metric is that of tiles.

use std::borrow::Cow;
use std::cell::LazyCell;
use std::ops::Deref;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use unscatter::Result;
use unscatter::cpu::{self, TileMetric};
use unscatter::gpu::{self, DeviceOperator, Gpu, GpuVector, Walked};
use unscatter::march::LightMapTraversal;
use unscatter::operator::{
    CpuVector, LinearOperator, Metric, Storage, TileBlocks, Tiling, TransportOperator, Vector, WalkPlan,
};
use unscatter::problem::{Formulation, Lattice, Part, Start, System, SystemOperator};
use unscatter::scene::{SolveSettings, Strategy};
use unscatter::solve::{Beginning, Control, Fista, Limits, drive};

use crate::COLOR;
use crate::rates::{Rates, Round, Work};
use crate::rows::{NONZERO, RAY, iterations, kept};
use crate::scenes::field::Field;

/// Of `kept` and of `walked` rows.
pub fn bench(rates: &mut Rates, group: &str, gpu: &Gpu, field: &Field) {
    let kept = LazyCell::new(|| Rows::new(gpu, field, |rows| Box::new(kept(gpu, rows))));
    let walked = LazyCell::new(|| {
        Rows::new(gpu, field, |rows| Box::new(Walked::light_map(gpu, rows, false, false).unwrap()))
    });
    // The metric is made from rows that are kept on the processor, and more than that has no room.
    if field.painted >= Field::LARGE.painted {
        return;
    }
    let system = LazyCell::new(|| kept.system(field));
    solve(rates, group, (gpu, "rows kept"), &kept, &system, |rows| NONZERO * rows.nonzeros);
    let system = LazyCell::new(|| walked.system(field));
    solve(rates, group, (gpu, "walked"), &walked, &system, |rows| RAY * rows.range().len() as u64);
}

/// Rows on an adapter, and on the processor, which makes the metric from them.
struct Rows {
    gpu: Gpu,
    products: Box<dyn DeviceOperator>,
    host: cpu::Transport<LightMapTraversal, f32, 1>,
    nonzeros: u64,
    metric_bytes: AtomicU64,
}

impl Rows {
    fn new(
        gpu: &Gpu,
        field: &Field,
        on_adapter: impl FnOnce(&LightMapTraversal) -> Box<dyn DeviceOperator>,
    ) -> Self {
        let traversal = field.traversal();
        let plan = WalkPlan::new::<1>(&traversal);
        Self {
            gpu: gpu.clone(),
            products: on_adapter(&traversal),
            host: cpu::Transport::new(traversal, &plan, Strategy::Auto, u64::MAX).unwrap(),
            nonzeros: plan.nonzeros,
            metric_bytes: AtomicU64::new(0),
        }
    }

    /// What the default settings make of it.
    fn system(&self, field: &Field) -> System<'_, GpuVector> {
        let settings = SolveSettings::default();
        let ones = vec![[1.0; 3]; field.painted];
        let coverage = self.squares(&CpuVector(ones.clone())).unwrap();
        let size = [field.map; 2];
        let formulation = Formulation {
            held_out: None,
            targets: vec![[0.02, 0.01, 0.03]; field.painted].into(),
            weights: Cow::Owned(ones),
            wanted: [1.0; 3],
            parts: vec![Part {
                noun: "texels",
                start: Start::Everywhere([1.0; 3], field.map * field.map),
                bounds: settings.solver.kept(settings.bounds),
                pull: 1.0,
                lattice: Some(Lattice { size: &size, places: None }),
                pairs: &[],
                joined: &[],
                fade: 0.0,
                scale: 0,
            }],
            remedy: "",
        };
        System::new(&formulation, self, &coverage, &settings).unwrap()
    }
}

impl LinearOperator for Rows {
    type Domain = GpuVector;
    type Range = GpuVector;

    fn domain(&self) -> GpuVector {
        self.products.domain()
    }

    fn range(&self) -> GpuVector {
        self.products.range()
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        self.products.apply(x, y)
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        self.products.apply_adjoint(y, x)
    }
}

impl TransportOperator for Rows {
    fn squares(&self, weights: &CpuVector) -> Result<CpuVector> {
        self.host.squares(weights)
    }

    fn tile_metric(
        &self,
        tiling: &Tiling,
        weights: &[f64],
        added: &[f64],
    ) -> Result<Box<dyn Metric<GpuVector>>> {
        let metric = TileMetric::new(&self.host, tiling, weights, added)?;
        self.metric_bytes.store(metric.bytes(), Ordering::Relaxed);
        Ok(Box::new(gpu::TileMetric::new(&self.gpu, added.len(), metric.channels(), metric.blocks())?))
    }

    fn storage(&self) -> Storage {
        Storage::default()
    }
}

/// An iteration, and all of them with what comes before the first and after the last, by the clock.
fn solve<'a>(
    rates: &mut Rates,
    group: &str,
    (gpu, way): (&Gpu, &str),
    rows: &impl Deref<Target = Rows>,
    system: &impl Deref<Target = System<'a, GpuVector>>,
    matrix: impl Fn(&Rows) -> u64,
) {
    let work = |iterations: u64| {
        let vectors = Fista::<SystemOperator<GpuVector>>::VECTORS;
        let [unknowns, painted] = [system.start().len(), rows.range().len()];
        let vectors = vectors.domain * unknowns + vectors.range * (painted + unknowns);
        // Two products, the metric twice, and each vector read and written once.
        let once = matrix(rows)
            + rows.metric_bytes.load(Ordering::Relaxed)
            + COLOR * (painted + unknowns + vectors) as u64;
        Work {
            rays: 2 * iterations * painted as u64,
            nonzeros: 2 * iterations * rows.nonzeros,
            bytes: 2 * iterations * once,
            ..Work::default()
        }
    };
    rates.bench(group, &format!("{way}: fista, an iteration"), || {
        let system = &**system;
        let [Run { dispatches, round_trips, .. }, _] = run(gpu, system);
        let round: Round = Box::new(move || Duration::from_secs_f64(run(gpu, system)[0].seconds));
        (Work { dispatches, round_trips, ..work(1) }, round)
    });
    rates.bench(group, &format!("{way}: fista, a run of {}", iterations(gpu)), || {
        let system = &**system;
        let [_, Run { dispatches, round_trips, .. }] = run(gpu, system);
        let round: Round = Box::new(move || Duration::from_secs_f64(run(gpu, system)[1].seconds));
        (Work { dispatches, round_trips, ..work(iterations(gpu) as u64) }, round)
    });
}

/// What an iteration takes, or all of them.
struct Run {
    seconds: f64,
    dispatches: f64,
    round_trips: f64,
}

/// An iteration after the first, in the mean, and the whole run.
fn run(gpu: &Gpu, system: &System<GpuVector>) -> [Run; 2] {
    let mark = || (Instant::now(), gpu.dispatches(), gpu.round_trips());
    let mut marks = vec![mark()];
    let mut fista = Fista::new(system.operator());
    let (problem, limits) = (system.problem(), Limits::new(iterations(gpu), 0.0));
    drive(&mut fista, &problem, Beginning::At(system.start()), &limits, |_, _| {
        marks.push(mark());
        Ok(Control::Continue)
    })
    .unwrap();
    marks.push(mark());
    let [begun, first, .., last, ended] = marks[..] else { panic!("a run of fewer than two iterations") };
    let between = |from: (Instant, u64, u64), to: (Instant, u64, u64), times: usize| Run {
        seconds: (to.0 - from.0).as_secs_f64() / times as f64,
        dispatches: (to.1 - from.1) as f64 / times as f64,
        round_trips: (to.2 - from.2) as f64 / times as f64,
    };
    [between(first, last, marks.len() - 3), between(begun, ended, 1)]
}
