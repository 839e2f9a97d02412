use rayon::prelude::*;

use super::volume::{LightColumns, LitRows, VolumeRows};
use super::{LightMapProblem, VolumeProblem};
use crate::cpu::{HostOperator, TileMetric};
use crate::gpu::{self, Accumulation, Gpu, GpuVector, Kept, Transport, Walked};
use crate::march::{LightMapTraversal, Traversal, VolumeTraversal, Weight};
use crate::operator::{
    Added, CpuVector, LinearOperator, MatrixRows, Metric, Product, RowTable, Storage, Tiling,
    TransportOperator, WalkPlan, brought, fetched,
};
use crate::scene::Strategy;
use crate::{Error, Result};

/// `T` of a light-map problem on a graphics adapter.
pub type GpuLightMapOperator = GpuOperator<LightMapTraversal>;

/// `T` of a traversal on a graphics adapter.
///
/// Rows that are kept are walked once by the processor, in f64; rows that are not are walked by the adapter.
#[derive(Debug)]
pub struct GpuOperator<T> {
    gpu: Gpu,
    transport: Transport,
    /// The same rows on the processor: what the kept ones and the tiles are made from.
    rows: HostOperator<T>,
    storage: Storage,
}

impl GpuOperator<LightMapTraversal> {
    /// Keeps all rows on the adapter where `strategy` and the `budget` in bytes allow, else walks them there; `deterministic`
    /// sums are the same in every run.
    ///
    /// Errors: [`Error::TooLarge`] when all rows must be kept and exceed the budget, [`Error::AdapterMemory`];
    /// [`Error::Unsupported`] for light whose squares f32 does not hold.
    pub fn new(
        gpu: &Gpu,
        problem: &LightMapProblem,
        strategy: Strategy,
        budget: u64,
        deterministic: bool,
    ) -> Result<Self> {
        check_brightness(gpu, problem)?;
        let colored = !problem.is_grey();
        Self::of(
            gpu,
            &Rows {
                count: problem.constraints.len(),
                elements: problem.elements(),
                channels: if colored { 3 } else { 1 },
                plan: &problem.plan,
            },
            (strategy, budget),
            &|strategy, budget| problem.operator_with(strategy, budget),
            || {
                let rows = &problem.traversal;
                let walked = Walked::light_map(gpu, rows, colored, deterministic)?;
                let Some(beside) = rows.beside() else { return Ok(Transport::Walked(walked)) };
                let beside =
                    if colored { table(&Walk::<_, 3>(&beside)) } else { table(&Walk::<_, 1>(&beside)) };
                let beside = Kept::new(gpu, beside, problem.elements())?;
                Ok(Transport::Added(Box::new(Added::new(walked, beside)?)))
            },
        )
    }
}

impl GpuOperator<VolumeRows> {
    /// Keeps all rows on the adapter where `strategy` and the `budget` in bytes allow, else walks them there; `deterministic`
    /// sums are the same in every run.
    ///
    /// Errors: [`Error::TooLarge`] when all rows must be kept and exceed the budget, [`Error::AdapterMemory`].
    pub fn of_volume(
        gpu: &Gpu,
        problem: &VolumeProblem,
        strategy: Strategy,
        budget: u64,
        deterministic: bool,
    ) -> Result<Self> {
        let size = Rows {
            count: problem.targets.len(),
            elements: problem.start.len(),
            channels: if problem.is_grey() { 1 } else { 3 },
            plan: &problem.plan,
        };
        Self::of(
            gpu,
            &size,
            (strategy, budget),
            &|strategy, budget| {
                HostOperator::new(
                    problem.traversal.clone(),
                    problem.is_grey(),
                    &problem.plan,
                    strategy,
                    budget,
                )
            },
            || match &problem.traversal {
                VolumeRows::Voxels(rows) => {
                    Ok(Transport::Walked(Walked::volume(gpu, rows, !problem.is_grey(), deterministic)?))
                }
                VolumeRows::Linearized(_) => Err(Error::TooLarge {
                    what: "the rows of a refinement, which an adapter only keeps".to_owned(),
                    needed: format!("{} bytes", problem.kept_bytes()),
                    limit: format!("{budget} bytes"),
                    remedy: "raise --memory, lower the views' sizes or volume.size, or use --backend cpu",
                }),
                VolumeRows::Lights(rows) => light_volumes(gpu, rows, problem.is_grey(), budget),
            },
        )
    }
}

/// G V + D of lights on an adapter, each factor kept there.
///
/// Errors: [`Error::TooLarge`], [`Error::AdapterMemory`].
fn light_volumes(gpu: &Gpu, rows: &LitRows, is_grey: bool, budget: u64) -> Result<Transport> {
    let (lights, voxels) = (rows.basis().len(), rows.scattered.parts()[0].voxels().len());
    let columns = match &*rows.columns {
        LightColumns::Grey(columns) => table(columns),
        LightColumns::Colored(columns) => table(columns),
    };
    let kept = |rows: &VolumeTraversal| {
        let plan = WalkPlan::of(rows, is_grey);
        let bytes = Kept::bytes(plan.nonzeros, rows.rays().len(), voxels, if is_grey { 1 } else { 3 });
        if 2 * bytes > budget {
            return Err(Error::TooLarge {
                what: "what the voxels scatter, on an adapter".to_owned(),
                needed: format!("{} bytes", 2 * bytes),
                limit: format!("{budget} bytes"),
                remedy: "raise --memory, lower the views' sizes or light_size, or use --backend cpu",
            });
        }
        Ok(if is_grey { table(&Walk::<_, 1>(rows)) } else { table(&Walk::<_, 3>(rows)) })
    };
    let scattered = Kept::new(gpu, kept(&rows.scattered)?, voxels)?;
    let seen = if is_grey { table(&Walk::<_, 1>(&rows.seen)) } else { table(&Walk::<_, 3>(&rows.seen)) };
    let [columns, seen] = [Kept::new(gpu, columns, lights)?, Kept::new(gpu, seen, lights)?];
    Ok(Transport::Product(Box::new(Product::new(scattered, columns, seen)?)))
}

fn nonzeros(product: &Product<Kept, Kept, Kept>) -> u64 {
    let (scattered, columns, seen) = product.factors();
    [scattered, columns, seen].iter().map(|kept| kept.nonzeros() as u64).sum()
}

/// A traversal's rows in f32.
struct Walk<'a, T, const C: usize>(&'a T);

impl<T: Traversal<f64, C>, const C: usize> MatrixRows<f32, C> for Walk<'_, T, C> {
    fn rows(&self) -> usize {
        self.0.rows()
    }

    fn visit(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f32, C>)) {
        self.0.walk(row, &mut |element, weight| visit(element, weight.map(|weight| weight as f32)));
    }
}

/// How many rows there are to keep.
struct Rows<'a> {
    count: usize,
    elements: usize,
    channels: usize,
    plan: &'a WalkPlan,
}

impl<T: Traversal<f64, 1> + Traversal<f64, 3>> GpuOperator<T> {
    fn of(
        gpu: &Gpu,
        size: &Rows,
        (strategy, budget): (Strategy, u64),
        host: &dyn Fn(Strategy, u64) -> Result<HostOperator<T>>,
        walk: impl FnOnce() -> Result<Transport>,
    ) -> Result<Self> {
        let bytes = Kept::bytes(size.plan.nonzeros, size.count, size.elements, size.channels);
        let keep = || -> Result<_> {
            // What is kept may not take the room that a solve needs.
            let _free = gpu.reserve(VECTORS * 12 * (size.count + size.elements) as u64)?;
            let rows = host(Strategy::Assembled, u64::MAX)?;
            let table = match &rows {
                HostOperator::Grey(transport) => table(transport),
                HostOperator::Colored(transport) => table(transport),
            };
            Ok((Kept::new(gpu, table, size.elements)?, rows))
        };
        let kept = match strategy {
            Strategy::MatrixFree => None,
            // Once on the adapter, once on the processor while it is made.
            _ if 2 * bytes <= budget => match keep() {
                Err(error) if strategy == Strategy::Auto && is_of_size(&error) => None,
                kept => Some(kept?),
            },
            Strategy::Assembled => {
                return Err(Error::TooLarge {
                    what: "the assembled transport on an adapter".to_owned(),
                    needed: format!("{} bytes", 2 * bytes),
                    limit: format!("{budget} bytes"),
                    remedy: "raise --memory, lower the sizes, or choose the strategy `auto` or `matrix-free`",
                });
            }
            Strategy::Auto => None,
        };
        let (transport, rows, storage) = match kept {
            Some((kept, rows)) => {
                let storage = Storage {
                    kept_rows: rows.storage().kept_rows,
                    walked_rows: 0,
                    kept_nonzeros: kept.nonzeros() as u64,
                    bytes,
                    ..Storage::default()
                };
                (Transport::Kept(kept), rows, storage)
            }
            None => {
                let transport = walk()?;
                let storage = match &transport {
                    Transport::Product(product) => Storage {
                        kept_rows: size.count,
                        kept_nonzeros: nonzeros(product),
                        of_light_volumes: true,
                        ..Storage::default()
                    },
                    _ => Storage { walked_rows: size.count, ..Storage::default() },
                };
                (transport, host(Strategy::MatrixFree, 0)?, storage)
            }
        };
        Ok(Self { gpu: gpu.clone(), transport, rows, storage })
    }

    /// Whether its products are the same bits in every run.
    pub fn is_deterministic(&self) -> bool {
        match &self.transport {
            Transport::Kept(_) | Transport::Product(_) => true,
            Transport::Walked(walked) => walked.accumulation() == Accumulation::Fixed,
            Transport::Added(added) => added.terms().0.accumulation() == Accumulation::Fixed,
        }
    }
}

/// Sums of squares are made in f32 on an adapter: those of fainter light would be zero, and of brighter light infinite.
///
/// Errors: [`Error::Unsupported`].
fn check_brightness(gpu: &Gpu, problem: &LightMapProblem) -> Result<()> {
    const HELD: std::ops::RangeInclusive<f32> = 1e-15..=1e15;
    let brightest = problem.start.iter().copied().fold(0.0, f32::max);
    if brightest == 0.0 || HELD.contains(&brightest) {
        return Ok(());
    }
    Err(Error::Unsupported {
        adapter: gpu.record().name.clone(),
        problem: format!(
            "computes sums in f32, and a light of radiance {brightest:e} is beyond what they hold"
        ),
        remedy: "use another unit, in which light.radiance is from 1e-15 to 1e15, or use --backend cpu",
    })
}

/// Whether an error says that something is too large, so that something smaller may do.
fn is_of_size(error: &Error) -> bool {
    matches!(error, Error::TooLarge { .. } | Error::AdapterMemory { .. })
}

/// Vectors over rows or elements that a solve has on an adapter at most, with those of its system.
const VECTORS: u64 = 16;

/// Rows that one task reads.
const ROWS_AT_ONCE: usize = 1024;

fn table<const C: usize>(rows: &impl MatrixRows<f32, C>) -> RowTable {
    let starts: Vec<usize> = (0..rows.rows()).step_by(ROWS_AT_ONCE).collect();
    let part = |start: usize| {
        let mut part = RowTable { offsets: vec![0], elements: Vec::new(), weights: vec![Vec::new(); C] };
        for row in start..(start + ROWS_AT_ONCE).min(rows.rows()) {
            rows.visit(row, &mut |element, weight: Weight<f32, C>| {
                part.elements.push(element as u32);
                part.weights.iter_mut().zip(weight).for_each(|(weights, weight)| weights.push(weight));
            });
            part.offsets.push(part.elements.len());
        }
        part
    };
    let parts: Vec<RowTable> = starts.into_par_iter().map(part).collect();
    RowTable::joined(&parts, C)
}

impl<T: Traversal<f64, 1> + Traversal<f64, 3>> LinearOperator for GpuOperator<T> {
    type Domain = GpuVector;
    type Range = GpuVector;

    fn domain(&self) -> GpuVector {
        self.transport.domain()
    }

    fn range(&self) -> GpuVector {
        self.transport.range()
    }

    fn apply(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        self.transport.apply(x, y)
    }

    fn apply_adjoint(&self, y: &GpuVector, x: &mut GpuVector) -> Result<()> {
        self.transport.apply_adjoint(y, x)
    }
}

impl<T: Traversal<f64, 1> + Traversal<f64, 3>> TransportOperator for GpuOperator<T> {
    type Vector = GpuVector;

    fn squares(&self, weights: &CpuVector) -> Result<CpuVector> {
        let (y, mut x) = (brought(self.range(), &weights.0)?, self.domain());
        match &self.transport {
            Transport::Kept(kept) => kept.squares(&y, &mut x)?,
            Transport::Walked(walked) => walked.squares(&y, &mut x)?,
            // The squares of a product or a sum are not those of its parts; the processor walks its rows once.
            Transport::Product(_) | Transport::Added(_) => return self.rows.squares(weights),
        }
        Ok(CpuVector(fetched(&x)?))
    }

    fn tile_metric(
        &self,
        tiling: &Tiling,
        weights: &[f64],
        added: &[f64],
    ) -> Result<Box<dyn Metric<GpuVector>>> {
        let (gpu, unknowns) = (&self.gpu, added.len());
        Ok(Box::new(match &self.rows {
            HostOperator::Grey(transport) => {
                let metric = TileMetric::new(transport, tiling, weights, added)?;
                gpu::TileMetric::new(gpu, unknowns, metric.blocks())?
            }
            HostOperator::Colored(transport) => {
                let metric = TileMetric::new(transport, tiling, weights, added)?;
                gpu::TileMetric::new(gpu, unknowns, metric.blocks())?
            }
        }))
    }

    fn storage(&self) -> Storage {
        self.storage
    }
}
