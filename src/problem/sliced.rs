//! Painted pixels over slices: the rows of a light map whose cost does not grow with the map.

#[cfg(feature = "gpu")]
use super::looked_for::on_gpu;
use super::looked_for::{Nouns, explicit, row_of};
use super::{Formulation, Problem, Solved, Unskipped};
use crate::cpu::HostOperator;
#[cfg(feature = "gpu")]
use crate::gpu::{Gpu, GpuOperator, Kept, swept};
use crate::march::{EpipolarSettings, EpipolarTraversal};
use crate::operator::{CpuVector, OnHost, WalkPlan};
use crate::scene::{Quadrature, Rgb, SolveSettings, Strategy};
use crate::sparse::ExplicitMatrix;
use crate::{Error, Result};

/// A light map behind painted pixels, as slices show it: all is that of the exact rows but T.
#[derive(Debug)]
pub(super) struct SlicedProblem {
    exact: Box<dyn Problem>,
    settings: EpipolarSettings,
    rows: EpipolarTraversal,
    plan: WalkPlan,
}

impl SlicedProblem {
    /// The problem whose rows are put into slices by such settings, and what became of them.
    pub(super) fn new(exact: Box<dyn Problem>, rows: EpipolarTraversal, settings: EpipolarSettings) -> Self {
        let plan = WalkPlan::of(&rows, exact.is_grey());
        Self { exact, settings, rows, plan }
    }
}

impl Problem for SlicedProblem {
    fn targets(&self) -> &[Rgb] {
        self.exact.targets()
    }

    fn weights(&self) -> CpuVector {
        self.exact.weights()
    }

    fn pixel(&self, row: usize) -> [usize; 2] {
        self.exact.pixel(row)
    }

    fn plan(&self) -> &WalkPlan {
        &self.plan
    }

    fn is_grey(&self) -> bool {
        self.exact.is_grey()
    }

    fn formulation(&self, settings: &SolveSettings) -> Result<Formulation<'_>> {
        self.exact.formulation(settings)
    }

    fn complete(&self, settings: &SolveSettings, solved: Solved) -> Result<Solved> {
        self.exact.complete(settings, solved)
    }

    fn picked(&self, rows: &[usize]) -> Box<dyn Problem> {
        let exact = self.exact.picked(rows);
        match exact.sliced(self.settings) {
            Some(Ok(sliced)) => sliced,
            // Some of the rows are refused only where all were.
            _ => exact,
        }
    }

    fn integrated(&self, _: Quadrature, _: Option<f64>) -> Option<Box<dyn Problem>> {
        None
    }

    fn unskipped(&self) -> Option<Unskipped> {
        None
    }

    fn most_lost(&self) -> Option<f64> {
        self.exact.most_lost()
    }

    fn replan(&mut self) {
        self.plan = WalkPlan::of(&self.rows, self.is_grey());
    }

    fn row(&self, row: usize, visit: &mut dyn FnMut(usize, [f64; 3])) {
        row_of(&self.rows, self.is_grey(), row, visit);
    }

    fn on_cpu(&self, strategy: Strategy, budget: u64) -> Result<OnHost> {
        Ok(Box::new(HostOperator::<_, f32>::new(
            self.rows.clone(),
            self.is_grey(),
            &self.plan,
            kept(strategy),
            budget,
        )?))
    }

    fn wide(&self, strategy: Strategy) -> Result<OnHost<f64>> {
        let (rows, is_grey) = (self.rows.clone(), self.is_grey());
        Ok(Box::new(HostOperator::<_, f64>::new(rows, is_grey, &self.plan, kept(strategy), u64::MAX)?))
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, gpu: &Gpu, strategy: Strategy, budget: u64, _: bool) -> Result<GpuOperator> {
        let is_grey = self.is_grey();
        let samples = self.rows.fans().samples();
        // Four texels each, once on the adapter and once on the processor while it is made.
        let needed = 2 * Kept::bytes(4 * samples as u64, samples, self.rows.light_map().len(), 1);
        if needed > budget {
            return Err(Error::TooLarge {
                what: "the samples of all slices on an adapter".to_owned(),
                needed: format!("{needed} bytes"),
                limit: format!("{budget} bytes"),
                remedy: "raise solve.memory, lower the sizes, or compute on the processor",
            });
        }
        let swept = || swept(gpu, &self.rows, is_grey);
        on_gpu(&self.rows, (is_grey, &self.plan), gpu, (kept(strategy), budget), &swept)
    }

    fn explicit(&self, most: u64) -> Result<ExplicitMatrix> {
        explicit(&self.rows, self.is_grey(), most)
    }

    fn candidates(&self) -> usize {
        self.exact.candidates()
    }

    fn prepared_bytes(&self) -> u64 {
        self.exact.prepared_bytes() + self.rows.bytes() + self.rows.room_bytes()
    }

    fn ray_bytes(&self) -> u64 {
        self.exact.ray_bytes()
    }

    fn digest(&self, add: &mut dyn FnMut(u64)) {
        self.exact.digest(add);
    }

    fn skipped(&self) -> Vec<(&'static str, [usize; 2])> {
        self.exact.skipped()
    }

    fn nouns(&self) -> Nouns {
        self.exact.nouns()
    }

    fn settings_in_words(&self) -> Vec<(&'static str, String)> {
        self.exact.settings_in_words()
    }
}

/// The rows over slices that stand for the exact ones while a method iterates, where the strategy is that.
///
/// Errors: [`Error::Value`] for a problem that has none; those of [`EpipolarTraversal::new`].
pub fn near(problem: &dyn Problem, strategy: Strategy) -> Result<Option<Box<dyn Problem>>> {
    if strategy != Strategy::Epipolar {
        return Ok(None);
    }
    let expected = "another strategy here: light maps alone have rows over slices";
    let sliced = problem.sliced(EpipolarSettings::CORRECTED).transpose()?;
    sliced.map(Some).ok_or_else(|| Error::value("solve.strategy", "epipolar", expected))
}

/// Slices are swept unless their rows are asked for.
fn kept(strategy: Strategy) -> Strategy {
    match strategy {
        Strategy::Assembled => Strategy::Assembled,
        Strategy::Auto | Strategy::MatrixFree | Strategy::Epipolar => Strategy::MatrixFree,
    }
}
