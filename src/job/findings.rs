//! What a solve has found out, to be reported.

use std::collections::BTreeMap;

use super::compute::Computed;
use super::steps::Timings;
use crate::Result;
use crate::operator::Scalars;
use crate::problem::{Formulation, Part, Problem, RegularizationWeights};
use crate::report::{Certificate, Coverage, ProblemSize, Report, RowStrategy, Share, StopRecord};
use crate::scene::{Rgb, SolveSettings, Strategy, Target};
use crate::solve::Outcome;

/// Everything that a solve has found out.
#[derive(Clone, Copy)]
pub(crate) struct Findings<'a> {
    pub(crate) problem: &'a dyn Problem,
    pub(crate) settings: &'a SolveSettings,
    pub(crate) computed: &'a Computed,
}

impl Findings<'_> {
    /// The report on a scene of so many pixels, but for how near its pictures have come.
    pub(crate) fn report(
        &self,
        command: &str,
        (scene, target, pixels): (&str, Target, usize),
        timings: &Timings,
    ) -> Result<Report> {
        let Computed { backend, device, work, storage, adjoint_error, solved, .. } = self.computed;
        Ok(Report {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: command.to_owned(),
            scene: scene.to_owned(),
            backend: (*backend).to_owned(),
            device: device.clone(),
            gpu: work.clone(),
            target: match target {
                Target::Tint => "tint",
                Target::WhiteTint => "white-tint",
                Target::Radiance => "radiance",
            }
            .to_owned(),
            solver: self.settings.solver.name().to_owned(),
            strategy: RowStrategy {
                name: match (storage.kept_rows, storage.walked_rows) {
                    _ if storage.of_light_volumes => "light volumes",
                    _ if self.settings.strategy == Strategy::Epipolar => "epipolar",
                    (_, 0) => "assembled",
                    (0, _) => "matrix-free",
                    _ => "mixed",
                }
                .to_owned(),
                kept_rows: storage.kept_rows as u64,
                walked_rows: storage.walked_rows as u64,
            },
            problem: self.size()?,
            nouns: self.problem.nouns(),
            regularization: solved.weights,
            settings: self.settings_in_words()?,
            history: solved.outcome.history.progress.clone(),
            certificate: self.certificate()?,
            set_up_applications: solved.set_up_applications as u64,
            stop: self.stop(),
            timings: timings.iter().cloned().collect(),
            memory: self.memory(),
            skipped: self.skipped(pixels),
            adjoint_error: *adjoint_error,
            out_of_reach: self.computed.out_of_reach.into(),
            coverage: self.covered()?,
            ..Report::default()
        })
    }

    pub(crate) fn size(&self) -> Result<ProblemSize> {
        let Computed { storage, solved, .. } = self.computed;
        let formulation = self.formulation()?;
        let lattice = formulation.parts.first().and_then(|part| part.lattice);
        Ok(ProblemSize {
            rows: self.problem.rows() as u64,
            unknowns: self.problem.candidates() as u64,
            elements: nouns(&formulation.parts),
            active_unknowns: solved.columns.len() as u64,
            nonzeros: match storage.walked_rows {
                0 => storage.kept_nonzeros,
                _ => self.problem.plan().nonzeros,
            },
            views: self.problem.views().len() as u64,
            size: lattice.map_or(Vec::new(), |it| it.size.iter().map(|&side| side as u64).collect()),
        })
    }

    pub(crate) fn stop(&self) -> StopRecord {
        let stop = self.computed.solved.outcome.stop;
        StopRecord { reason: stop.reason.name().to_owned(), iteration: stop.iteration as u64 }
    }

    pub(crate) fn certificate(&self) -> Result<Certificate> {
        let Computed { coverage, solved, .. } = self.computed;
        let Outcome { history, true_residual, true_normal_residual, .. } = &solved.outcome;
        let keeps_bounds = self.settings.solver.keeps_bounds();
        let bounds = self.formulation()?.bounds()?;
        let is_held = |&element: &usize| {
            let (x, [lower, upper]) = (&solved.x[element], bounds.of(element));
            is_reached(&coverage.0[element])
                && (0..3).any(|c| f64::from(x[c]) <= lower[c] || f64::from(x[c]) >= upper[c])
        };
        let held = if keeps_bounds { (0..solved.x.len()).filter(is_held).count() } else { 0 };
        Ok(Certificate {
            kind: if keeps_bounds { "projected-gradient" } else { "normal-residual" }.to_owned(),
            value: *true_normal_residual,
            residual: *true_residual,
            at_bounds: held as u64,
            restarts: history.restarts as u64,
        })
    }

    fn formulation(&self) -> Result<Formulation<'_>> {
        self.problem.formulation(self.settings)
    }

    fn settings_in_words(&self) -> Result<BTreeMap<String, String>> {
        let solve = self.settings;
        let RegularizationWeights { tikhonov, gradient, laplacian } = self.computed.solved.relative_weights;
        let mut words = self.problem.settings_in_words();
        words.extend([
            ("iterations", format!("at most {}", solve.iterations)),
            ("tolerance", solve.tolerance.to_string()),
            ("accuracy", format!("{:.0e}", solve.accuracy)),
            ("transmittance_bound", format!("{:.1e}", solve.transmittance_bound)),
            ("bounds", self.bounds_in_words()?),
            (
                "weights",
                format!(
                    "tikhonov {tikhonov:.3e}, gradient {gradient:.3e}, laplacian {laplacian:.3e}, relative to the columns"
                ),
            ),
            ("metric", format!("{:?}", solve.metric_in_use()).to_lowercase()),
        ]);
        Ok(words.into_iter().map(|(name, value)| (name.to_owned(), value)).collect())
    }

    fn bounds_in_words(&self) -> Result<String> {
        if !self.settings.solver.keeps_bounds() {
            return Ok("none: this solver keeps none".to_owned());
        }
        let words = |bound: Scalars, none: &str| match (bound == [bound[0]; 3], bound[0].is_finite()) {
            (true, false) => none.to_owned(),
            (true, true) => bound[0].to_string(),
            _ => format!("{bound:?}"),
        };
        let formulation = self.formulation()?;
        let parts = formulation.parts.iter().map(|part| {
            let [lower, upper] = part.bounds;
            format!("from {} to {}", words(lower, "any"), words(upper, "any"))
        });
        let mut parts: Vec<String> = parts.collect();
        parts.dedup();
        Ok(parts.join(", then "))
    }

    fn memory(&self) -> BTreeMap<String, u64> {
        let mut memory = BTreeMap::from([
            ("matrix".to_owned(), self.computed.storage.bytes),
            ("everything_else".to_owned(), self.computed.other_bytes),
        ]);
        memory.extend(self.settings.memory.map(|budget| ("budget".to_owned(), budget)));
        memory.extend(super::peak_memory().map(|peak| ("peak".to_owned(), peak)));
        memory
    }

    fn skipped(&self, pixels: usize) -> BTreeMap<String, Share> {
        let Computed { storage, solved, .. } = self.computed;
        let (rows, candidates) = (self.problem.rows(), self.problem.candidates());
        let mut of_rows: Vec<[usize; 2]> = (0..rows).map(|row| self.problem.pixel(row)).collect();
        of_rows.dedup();
        let history = &solved.outcome.history;
        let last = history.progress.last();
        let (walks, iterations) = last.map_or((0, 0), |last| (last.operator_applications, last.iteration));
        let mut skipped = self.problem.skipped();
        skipped.extend([
            ("pixels", [pixels - of_rows.len(), pixels]),
            ("unknowns", [candidates - solved.columns.len(), candidates]),
            ("channel_iterations", [history.spared, 3 * iterations]),
            ("walks", [walks * storage.kept_rows, walks * rows]),
        ]);
        skipped.into_iter().map(share).collect()
    }

    /// How far rows reach the elements that have a place; those without, such as lights around a light map, are in every row.
    fn covered(&self) -> Result<Coverage> {
        let Computed { coverage, solved, .. } = self.computed;
        let formulation = self.formulation()?;
        let (mut total, mut reached_elements, mut weak, mut joined) = (self.problem.candidates(), 0, 0, 0);
        for (elements, part) in formulation.ranges() {
            if part.lattice.is_none() {
                total -= elements.len();
                continue;
            }
            // Where the data weigh less than the regularization, the start decides.
            let most = |squares: &Rgb| f64::from(squares[0].max(squares[1]).max(squares[2]));
            let is_weak = |squares: &&Rgb| most(squares) > 0.0 && most(squares) < solved.weights.tikhonov;
            reached_elements += reached(&coverage.0[elements.clone()]);
            let of_part = &coverage.0[elements.clone()];
            joined += part.joined.iter().filter(|&&element| !is_reached(&of_part[element as usize])).count();
            weak += coverage.0[elements].iter().filter(is_weak).count();
        }
        let (total, reached) = (total as u64, reached_elements);
        let placed = formulation.parts.iter().filter(|part| part.lattice.is_some());
        Ok(Coverage {
            elements: nouns(placed),
            reached,
            total,
            unreached: total - reached,
            joined: (joined > 0).then_some(joined as u64),
            filled: self.settings.fill.then(|| total - reached),
            weak: Some(weak as u64),
        })
    }
}

/// What the elements of some parts are, such as `texels and lights`.
fn nouns<'a>(parts: impl IntoIterator<Item = &'a Part<'a>>) -> String {
    let mut nouns: Vec<&str> = parts.into_iter().map(|part| part.noun).collect();
    nouns.dedup();
    nouns.join(" and ")
}

/// How many of some elements a row reaches, given the squares of their weights.
pub(crate) fn reached(squares: &[Rgb]) -> u64 {
    squares.iter().filter(|squares| is_reached(squares)).count() as u64
}

fn is_reached(squares: &Rgb) -> bool {
    squares.iter().any(|&value| value > 0.0)
}

/// How many of how many, as reports have it.
pub(crate) fn share((name, [count, of]): (&'static str, [usize; 2])) -> (String, Share) {
    (name.to_owned(), Share { count: count as u64, of: of as u64 })
}
