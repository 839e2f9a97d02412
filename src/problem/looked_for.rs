use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::Debug;

use serde::{Deserialize, Serialize};

use super::{Formulation, Solved, evenly};
use crate::Result;
use crate::cpu::{HostOperator, kept_bytes};
#[cfg(feature = "gpu")]
use crate::gpu::{DeviceOperator, Gpu, GpuOperator};
use crate::march::{EpipolarSettings, Real, Traversal};
#[cfg(feature = "gpu")]
use crate::operator::HostRows;
use crate::operator::{CpuVector, OnHost, WalkPlan};
use crate::scene::{Quadrature, Rgb, SolveSettings, Strategy};
use crate::sparse::ExplicitMatrix;

/// What is looked for in pictures, as jobs and labs see it: light maps, volumes, lights around them.
///
/// A row is a pixel, and an element is one of the numbers that are looked for. Both have three channels.
pub trait Problem: Debug + Send + Sync {
    /// b of each row: radiance, for extinction optical depth.
    fn targets(&self) -> &[Rgb];

    /// w of each row and channel, dimensionless.
    fn weights(&self) -> CpuVector;

    /// The view of a row, and its pixel there, counted row by row of the picture.
    fn pixel(&self, row: usize) -> [usize; 2];

    /// What walking the rows will take.
    fn plan(&self) -> &WalkPlan;

    /// Whether one weight serves all channels.
    fn is_grey(&self) -> bool;

    /// The problem as methods solve it.
    ///
    /// Errors: [`crate::Error::Value`] naming a bound.
    fn formulation(&self, settings: &SolveSettings) -> Result<Formulation<'_>>;

    /// Makes of what a method has found what the problem hands over; texels, for one, may be filled.
    ///
    /// Errors: [`crate::Error::NonFinite`] naming an element.
    fn complete(&self, _settings: &SolveSettings, solved: Solved) -> Result<Solved> {
        Ok(solved)
    }

    /// The problem of some of its rows.
    fn picked(&self, rows: &[usize]) -> Box<dyn Problem>;

    /// The same rows with another quadrature, and cut at another transmittance where one is given. None where the rows have no such
    /// form.
    fn integrated(
        &self,
        quadrature: Quadrature,
        transmittance_bound: Option<f64>,
    ) -> Option<Box<dyn Problem>>;

    /// The same rows, walked without skipping what is empty or evenly lit. None where these rows skip nothing.
    fn unskipped(&self) -> Option<Unskipped>;

    /// The same pixels over slices: rows whose cost does not grow with the map, near the exact ones. None where there are no such rows.
    fn sliced(&self, _settings: EpipolarSettings) -> Option<Result<Box<dyn Problem>>> {
        None
    }

    /// Bound on what cutting the rows at the transmittance bound loses: the norm of the loss over all rows and channels, for
    /// elements of 1. None where no bound is known.
    fn most_lost(&self) -> Option<f64>;

    /// Makes the plan anew, so that this can be timed.
    fn replan(&mut self);

    /// The non-zeros of a row.
    fn row(&self, row: usize, visit: &mut dyn FnMut(usize, [f64; 3]));

    /// T on the processor in f32, with as much of it kept as a strategy and `budget` bytes allow.
    ///
    /// Errors: [`crate::Error::TooLarge`] when all of it must be kept and does not fit.
    fn on_cpu(&self, strategy: Strategy, budget: u64) -> Result<OnHost>;

    /// The same in f64: what solutions are measured against.
    fn wide(&self, strategy: Strategy) -> Result<OnHost<f64>>;

    /// T on a graphics adapter, kept or walked there. `deterministic` sums are the same in every run.
    ///
    /// Errors: [`crate::Error::TooLarge`] when rows must be kept and exceed the budget, [`crate::Error::AdapterMemory`];
    /// [`crate::Error::Unsupported`] for what there is no kernel for.
    #[cfg(feature = "gpu")]
    fn on_gpu(&self, gpu: &Gpu, strategy: Strategy, budget: u64, deterministic: bool) -> Result<GpuOperator>;

    /// T as an explicit matrix of at most `most` non-zeros.
    ///
    /// Errors: [`crate::Error::TooLarge`] for more.
    fn explicit(&self, most: u64) -> Result<ExplicitMatrix>;

    /// The number of elements that could be looked for, whether any row reaches them or not.
    fn candidates(&self) -> usize;

    /// Bytes of what is prepared for the rows beside the scene, such as shadow maps and weights.
    fn prepared_bytes(&self) -> u64;

    /// Bytes of the rays, one a row.
    fn ray_bytes(&self) -> u64;

    /// Gives `add` all numbers that T depends on beside rows, targets and start. They tell one problem from another.
    fn digest(&self, add: &mut dyn FnMut(u64));

    /// What is not computed because nothing depends on it: its name in reports, and how many are skipped of how many.
    fn skipped(&self) -> Vec<(&'static str, [usize; 2])>;

    /// What reports call its things; elements are called by [`super::Part::noun`].
    fn nouns(&self) -> Nouns;

    /// Settings of rays and elements, by name, in words.
    fn settings_in_words(&self) -> Vec<(&'static str, String)>;

    /// The number of rows.
    fn rows(&self) -> usize {
        self.targets().len()
    }

    /// The problem of at most so many of its rows, evenly spread.
    fn sampled(&self, rows: usize) -> Box<dyn Problem> {
        self.picked(&evenly(rows, self.rows()))
    }

    /// The views that weigh anything.
    fn views(&self) -> BTreeSet<usize> {
        let weights = self.weights();
        let weighs = |row: &usize| weights.0[*row].iter().any(|&weight| weight > 0.0);
        (0..self.rows()).filter(weighs).map(|row| self.pixel(row)[0]).collect()
    }

    /// Bytes that keeping all rows would take on the processor, as the plan foresees it.
    fn kept_bytes(&self) -> u64 {
        kept_bytes::<f32>(self.plan(), if self.is_grey() { 1 } else { 3 })
    }
}

/// What reports call the things of a problem.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Nouns {
    /// What is found, such as `light map`.
    pub found: Cow<'static, str>,
    /// A pixel of which something is wanted, such as `painted pixel`.
    pub pixel: Cow<'static, str>,
    /// What such pixels are compared with, such as `paint`.
    pub wanted: Cow<'static, str>,
}

impl Nouns {
    pub(super) fn new(found: &'static str, pixel: &'static str, wanted: &'static str) -> Self {
        Self { found: found.into(), pixel: pixel.into(), wanted: wanted.into() }
    }
}

impl Default for Nouns {
    fn default() -> Self {
        Self::new("solution", "wanted pixel", "target")
    }
}

/// Rows that are walked without skipping.
#[derive(Debug)]
pub struct Unskipped {
    /// What is skipped otherwise.
    pub what: &'static str,
    /// The setting that does so for a whole job.
    pub switch: &'static str,
    /// The unit of `work`, in the plural.
    pub unit: &'static str,
    /// How much is done with skipping and without, in `unit`.
    pub work: [f64; 2],
    /// The rows.
    pub problem: Box<dyn Problem>,
}

/// T of a traversal on the processor.
pub(super) fn on_host<F: Real, T>(
    rows: &T,
    (is_grey, plan): (bool, &WalkPlan),
    (strategy, budget): (Strategy, u64),
) -> Result<OnHost<F>>
where
    T: Traversal<f64, 1> + Traversal<f64, 3> + Clone + Send + Sync + 'static,
{
    Ok(Box::new(HostOperator::<T, F>::new(rows.clone(), is_grey, plan, strategy, budget)?))
}

/// T of a traversal on a graphics adapter: all rows kept there where `strategy` and the `budget` in bytes allow, else what `otherwise`
/// gives.
///
/// Errors: [`crate::Error::TooLarge`] when rows must be kept and exceed the budget, [`crate::Error::AdapterMemory`]; those of `otherwise`.
#[cfg(feature = "gpu")]
pub(super) fn on_gpu<T>(
    rows: &T,
    (is_grey, plan): (bool, &WalkPlan),
    gpu: &Gpu,
    (strategy, budget): (Strategy, u64),
    otherwise: &dyn Fn() -> Result<Box<dyn DeviceOperator>>,
) -> Result<GpuOperator>
where
    T: Traversal<f64, 1> + Traversal<f64, 3> + Clone + Debug + Send + Sync + 'static,
{
    let on_host = |strategy| -> Result<Box<dyn HostRows>> {
        Ok(Box::new(HostOperator::<T, f32>::new(rows.clone(), is_grey, plan, strategy, u64::MAX)?))
    };
    GpuOperator::new(gpu, (plan, if is_grey { 1 } else { 3 }), (strategy, budget), &on_host, otherwise)
}

/// The matrix of a traversal.
pub(super) fn explicit<T: Traversal<f64, 1> + Traversal<f64, 3>>(
    rows: &T,
    is_grey: bool,
    most: u64,
) -> Result<ExplicitMatrix> {
    if is_grey { ExplicitMatrix::new::<1>(rows, most) } else { ExplicitMatrix::new::<3>(rows, most) }
}

/// The non-zeros of a row of a traversal.
pub(super) fn row_of<T: Traversal<f64, 1> + Traversal<f64, 3>>(
    rows: &T,
    is_grey: bool,
    row: usize,
    visit: &mut dyn FnMut(usize, [f64; 3]),
) {
    match is_grey {
        true => rows.walk_shared(row, &mut |element, [weight]: [f64; 1]| visit(element, [weight; 3])),
        false => rows.walk_shared(row, &mut |element, weights: [f64; 3]| visit(element, weights)),
    }
}
