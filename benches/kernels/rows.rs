//! Products of rows that are kept on the adapter, and walked there; fixed point; iterations.

use std::cell::LazyCell;
use std::ops::Deref;
use std::time::{Duration, Instant};

use glam::DVec3;
use unscatter::Result;
use unscatter::gpu::{DeviceOperator, Gpu, GpuVector, Kept, Walked, swept};
use unscatter::march::{EpipolarSettings, EpipolarTraversal, LightMapTraversal, Traversal, ViewRay};
use unscatter::operator::{Blocks, Identity, LinearOperator, Stacked, Vector, WalkPlan};
use unscatter::problem::VolumeRows;
use unscatter::scene::{Find, Interpolation};
use unscatter::solve::{Beginning, Cgls, Control, LeastSquares, Limits, drive};

use crate::rates::{Rates, Round, Work};
use crate::scenes::field::Field;
use crate::scenes::kept_rows;
use crate::scenes::volume::Cloud;
use crate::{COLOR, on_adapter};

/// Bytes of a ray that is walked, and of a non-zero that is kept.
pub const RAY: u64 = 160;
pub const NONZERO: u64 = 8;
/// Iterations of a run; software adapters take seconds for one.
pub fn iterations(gpu: &Gpu) -> usize {
    if gpu.record().is_hardware() { 32 } else { 3 }
}

/// `rows kept`, `rows kept after interleave`, `walked`, `walked, near sums` and `walked, fixed point`, by plain tactics and by those for
/// hardware.
pub fn light_map(rates: &mut Rates, group: &str, [gpu, chosen]: &[Gpu; 2], field: &Field) {
    let traversal = LazyCell::new(|| field.traversal());
    let nonzeros = LazyCell::new(|| foreseen(&*traversal));
    let walked = |gpu, fixed| Walked::light_map(gpu, &traversal, false, fixed).unwrap();
    let [planes, interleaved] = [gpu, chosen].map(|gpu| LazyCell::new(|| kept(gpu, &*traversal)));
    let alone = LazyCell::new(|| walked(gpu, false));
    let beside = LazyCell::new(|| walked(chosen, false));
    let fixed = LazyCell::new(|| walked(gpu, true));
    let (rays, [_, sums @ ..]) = (field.painted as u64, &PRODUCTS);
    // More than that has no room.
    if field.painted < Field::LARGE.painted {
        let work = || Work { rays, nonzeros: *nonzeros, bytes: NONZERO * *nonzeros, ..Work::default() };
        products(rates, group, ("rows kept", &PRODUCTS), gpu, &planes, &work);
        products(rates, group, ("rows kept after interleave", &PRODUCTS), chosen, &interleaved, &work);
        iteration(rates, group, "rows kept", gpu, &planes, &work);
        iteration(rates, group, "rows kept after interleave", chosen, &interleaved, &work);
    }
    let work = || Work { rays, nonzeros: *nonzeros, bytes: RAY * rays, ..Work::default() };
    products(rates, group, ("walked", &PRODUCTS), gpu, &alone, &work);
    products(rates, group, ("walked, near sums", sums), chosen, &beside, &work);
    products(rates, group, ("walked, fixed point", sums), gpu, &fixed, &work);
    iteration(rates, group, "walked", gpu, &alone, &work);
}

/// Rows over slices.
pub fn slices(rates: &mut Rates, group: &str, gpu: &Gpu, field: &Field) {
    let swept = LazyCell::new(|| {
        let exact = field.traversal();
        // Of a picture with as many pixels.
        let angle = 1.0 / (exact.rays().len() as f64).sqrt();
        let rows = EpipolarTraversal::new(&exact, &|_| angle, EpipolarSettings::default()).unwrap();
        (swept(gpu, &rows, true).unwrap(), rows.bytes())
    });
    let products: [(&str, Product); 2] = [
        ("over slices: sweep_gather and sweep_shown", |operator, x, y| operator.apply(x, y)),
        ("over slices: sweep_scatter and sweep_spread", |operator, x, y| operator.apply_adjoint(y, x)),
    ];
    for (name, apply) in products {
        rates.bench(group, name, || {
            let (operator, bytes) = &*swept;
            let (mut x, mut y) = (operator.domain(), operator.range());
            x.fill([1.0, 0.5, 0.25]);
            y.fill([1.0, 0.5, 0.25]);
            let bytes = bytes + COLOR * (x.len() + y.len()) as u64;
            let work = Work { rays: field.painted as u64, bytes, ..Work::default() };
            (work, on_adapter(gpu, move || apply(&**operator, &mut x, &mut y)))
        });
    }
}

/// Emission of a volume, as far as it is walked or kept.
pub fn volumes(rates: &mut Rates, gpu: &Gpu, shrunk: usize) {
    for (name, basis) in [("nearest", Interpolation::Nearest), ("trilinear", Interpolation::Trilinear)] {
        let rows = LazyCell::new(|| {
            let problem = Cloud::seen_twice(false, basis).shrunk(shrunk).problem(Find::Emission);
            let VolumeRows::Voxels(rows) = problem.traversal else { unreachable!("rows over voxels") };
            rows
        });
        let nonzeros = LazyCell::new(|| foreseen(&*rows));
        let walked = |fixed| Walked::volume(gpu, &rows, false, fixed).unwrap();
        let kept = LazyCell::new(|| kept(gpu, &*rows));
        let alone = LazyCell::new(|| walked(false));
        let fixed = LazyCell::new(|| walked(true));
        let group = format!("volume, {name}");
        let (rays, [_, sums @ ..]) = (|| rows.rays().len() as u64, &PRODUCTS);
        let work =
            || Work { rays: rays(), nonzeros: *nonzeros, bytes: NONZERO * *nonzeros, ..Work::default() };
        products(rates, &group, ("rows kept", &PRODUCTS), gpu, &kept, &work);
        iteration(rates, &group, "rows kept", gpu, &kept, &work);
        let work = || Work { rays: rays(), nonzeros: *nonzeros, bytes: RAY * rays(), ..Work::default() };
        products(rates, &group, ("walked", &PRODUCTS), gpu, &alone, &work);
        products(rates, &group, ("walked, fixed point", sums), gpu, &fixed, &work);
        iteration(rates, &group, "walked", gpu, &alone, &work);
    }
}

fn foreseen(traversal: &impl Traversal<f64, 1>) -> u64 {
    WalkPlan::new::<1>(traversal).nonzeros
}

pub fn kept<T: Traversal<f64, 1> + Clone>(gpu: &Gpu, traversal: &T) -> Kept {
    let table = kept_rows::<1>(traversal);
    let mut met = vec![0; traversal.elements()];
    table.elements.iter().for_each(|&element| met[element as usize] += 1);
    println!("one element is met by {} of {} rays", met.iter().max().unwrap(), traversal.rows());
    Kept::new(gpu, table, met.len()).unwrap()
}

type Product = fn(&dyn DeviceOperator, &mut GpuVector, &mut GpuVector) -> Result<()>;

const PRODUCTS: [(&str, Product); 3] = [
    ("gather", |operator, x, y| operator.apply(x, y)),
    ("scatter", |operator, x, y| operator.apply_adjoint(y, x)),
    ("squares", |operator, x, y| operator.squares(y, x).map(drop)),
];

/// `matrix` is the work of one product without its vectors.
fn products(
    rates: &mut Rates,
    group: &str,
    (way, of): (&str, &[(&str, Product)]),
    gpu: &Gpu,
    operator: &impl Deref<Target: DeviceOperator + Sized>,
    matrix: &dyn Fn() -> Work,
) {
    for (product, apply) in of {
        rates.bench(group, &format!("{way}: {product}"), || {
            let (operator, mut x, mut y) = (&**operator, operator.domain(), operator.range());
            x.fill([1.0, 0.5, 0.25]);
            y.fill([1.0, 0.5, 0.25]);
            let matrix = matrix();
            let bytes = matrix.bytes + COLOR * (x.len() + y.len()) as u64;
            (Work { bytes, ..matrix }, on_adapter(gpu, move || apply(operator, &mut x, &mut y)))
        });
    }
}

/// What fixed point adds to a scatter: that of rays which pass the map by.
pub fn fixed_point(rates: &mut Rates, gpu: &Gpu, field: &Field) {
    rates.bench("fixed point", "largest_bits, fixed_scale and fixed_finish", || {
        let some = field.traversal();
        let beside = ViewRay { origin: DVec3::splat(1e4), direction: DVec3::Z, ..some.rays()[0] };
        let rays = vec![beside; some.rays().len()];
        let traversal = LightMapTraversal::new(some.transport().clone(), rays.into());
        let walked = Walked::light_map(gpu, &traversal, false, true).unwrap();
        let (mut x, mut y) = (walked.domain(), walked.range());
        y.fill([1.0, 0.5, 0.25]);
        // Two words a sum, filled and read.
        let bytes = COLOR * (y.len() + 5 * x.len()) as u64;
        let scatter = move || walked.apply_adjoint(&y, &mut x);
        (Work { bytes, ..Work::default() }, on_adapter(gpu, scatter))
    });
}

/// Conjugate gradients, by the clock.
fn iteration(
    rates: &mut Rates,
    group: &str,
    way: &str,
    gpu: &Gpu,
    operator: &impl Deref<Target: DeviceOperator + Sized>,
    matrix: &dyn Fn() -> Work,
) {
    rates.bench(group, &format!("{way}: iteration"), || {
        let operator = &**operator;
        let [_, round_trips] = iterate(gpu, operator);
        println!("{group}/{way}: an iteration waits {round_trips:.1} times");
        let [elements, rows] = [operator.domain().len(), operator.range().len()];
        let vectors = Cgls::<Stacked<GpuVector>>::VECTORS;
        let vectors = vectors.domain * elements + vectors.range * (rows + elements);
        let matrix = matrix();
        let bytes = 2 * (matrix.bytes + COLOR * (rows + elements + vectors) as u64);
        let (rays, nonzeros) = (2 * matrix.rays, 2 * matrix.nonzeros);
        let work = Work { rays, nonzeros, bytes, round_trips, ..Work::default() };
        let round: Round = Box::new(move || Duration::from_secs_f64(iterate(gpu, operator)[0]));
        (work, round)
    });
}

/// Seconds that an iteration takes, and how often it waits.
fn iterate(gpu: &Gpu, operator: &dyn DeviceOperator) -> [f64; 2] {
    let pull = Identity::scaled(&operator.domain(), [0.05; 3]);
    let stacked = Stacked::new(operator).over(pull).unwrap();
    let mut targets = operator.range();
    targets.fill([0.02, 0.01, 0.03]);
    let rhs = Blocks::new(targets, vec![operator.domain()]);
    let limits = Limits::new(iterations(gpu), 0.0);
    let problem = LeastSquares::new(&stacked, &rhs);
    let start = stacked.domain();
    let mut marks = Vec::new();
    drive(&mut Cgls::new(&stacked), &problem, Beginning::At(&start), &limits, |_, _| {
        marks.push((Instant::now(), gpu.round_trips()));
        Ok(Control::Continue)
    })
    .unwrap();
    let [(begun, trips), .., (ended, all_trips)] = marks[..] else { return [f64::NAN; 2] };
    let iterations = (marks.len() - 1) as f64;
    [(ended - begun).as_secs_f64() / iterations, (all_trips - trips) as f64 / iterations]
}
