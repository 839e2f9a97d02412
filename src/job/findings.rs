use std::collections::BTreeMap;

use super::compute::Computed;
use super::steps::Timings;
use super::{budget, machine};
use crate::operator::Storage;
use crate::problem::{LightMapProblem, Weights};
use crate::report::{
    Certificate, Change, Coverage, Problem, Regularization, Report, RowStrategy, Share, Step, StopRecord,
    SunRecord, SurroundingsRecord, ViewMatch,
};
use crate::scene::{Quadrature, Rgb, Scene, SolveSettings, Target};
use crate::solve::Outcome;

/// Everything that a light-map solve has found out, to be reported.
pub(crate) struct Findings<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) settings: &'a SolveSettings,
    pub(crate) problem: &'a LightMapProblem,
    pub(crate) computed: &'a Computed,
}

impl Findings<'_> {
    pub(crate) fn report(&self, timings: &Timings) -> Report {
        let storage = self.computed.storage;
        let stop = self.computed.solved.outcome.stop;
        Report {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: "light-map".to_owned(),
            scene: self.scene.name.clone(),
            backend: self.computed.backend.to_owned(),
            device: self.computed.device.clone(),
            gpu: self.computed.work.clone(),
            target: match self.scene.target {
                Target::Tint => "tint",
                Target::Radiance => "radiance",
            }
            .to_owned(),
            solver: self.settings.solver.name().to_owned(),
            strategy: strategy(&storage),
            problem: self.size(),
            regularization: Regularization {
                tikhonov: self.computed.solved.weights.tikhonov,
                laplacian: self.computed.solved.weights.laplacian,
                gradient: self.computed.solved.weights.gradient,
            },
            settings: self.settings(),
            history: history(&self.computed.solved.outcome),
            certificate: self.certificate(),
            set_up_applications: self.computed.solved.set_up_applications as u64,
            stop: StopRecord { reason: stop.reason.name().to_owned(), iteration: stop.iteration as u64 },
            weighted_residual: Change {
                before: self.computed.before.all.residual,
                after: self.computed.after.all.residual,
            },
            matched: self.matched(),
            timings: timings.iter().cloned().collect(),
            memory: self.memory(),
            skipped: self.skipped(),
            adjoint_error: self.computed.adjoint_error,
            coverage: self.covered(),
            surroundings: self.surroundings(),
            stages: Vec::new(),
            animation: None,
        }
    }

    fn surroundings(&self) -> Option<SurroundingsRecord> {
        let around = self.scene.surroundings.as_ref()?;
        let [_, further] = self.problem.parted(&self.computed.solved.x);
        let [_, covered] = self.problem.parted(&self.computed.coverage.0);
        let sun = around.sun_of(&self.problem.further_start).zip(around.sun_of(further));
        Some(SurroundingsRecord {
            sun: sun.map(|(before, after)| SunRecord { before, after }),
            lights: around.sky.as_ref().map(|_| {
                let lights = around.sky_of(covered);
                Share { count: reached(lights), of: lights.len() as u64 }
            }),
        })
    }

    fn size(&self) -> Problem {
        let storage = self.computed.storage;
        let exact = storage.walked_rows == 0;
        Problem {
            rows: self.problem.constraints.len() as u64,
            unknowns: self.computed.coverage.0.len() as u64,
            active_unknowns: self.computed.solved.columns.len() as u64,
            nonzeros: if exact { storage.kept_nonzeros } else { self.problem.plan.nonzeros },
            views: self.computed.before.views.iter().filter(|view| view.pixels > 0).count() as u64,
            size: self.problem.maps.light_map.size.map(|side| side as u64).to_vec(),
        }
    }

    fn settings(&self) -> BTreeMap<String, String> {
        let solve = self.settings;
        let quadrature = match solve.quadrature {
            Quadrature::Exact => "exact, cell by cell".to_owned(),
            Quadrature::March { steps } => format!("march of {steps} steps"),
        };
        let shadow_map = self.problem.maps.shadow_map.grid().size;
        [
            ("basis", format!("{:?}", solve.basis).to_lowercase()),
            ("quadrature", quadrature),
            ("iterations", format!("at most {}", solve.iterations)),
            ("tolerance", solve.tolerance.to_string()),
            ("transmittance_bound", format!("{:.1e}", solve.transmittance_bound)),
            ("shadow_map", format!("{} × {} texels", shadow_map[0], shadow_map[1])),
            (
                "light_from_outside_the_map",
                format!("{:.1} % of the painted pixels' light", 100.0 * self.problem.share_from_outside()),
            ),
            ("bounds", bounds(solve)),
            ("weights", weights(&self.computed.solved.relative_weights)),
            ("metric", format!("{:?}", solve.metric_in_use()).to_lowercase()),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into()
    }

    fn certificate(&self) -> Certificate {
        let Outcome { history, true_residual, true_normal_residual, .. } = &self.computed.solved.outcome;
        let keeps_bounds = self.settings.solver.keeps_bounds();
        let [of_texels, of_others] = [self.settings.bounds, [[0.0; 3], [f64::INFINITY; 3]]];
        let texels = self.problem.maps.light_map.len();
        let is_at_bound = |&(index, (x, _)): &(usize, (&Rgb, &Rgb))| {
            let [lower, upper] = if index < texels { of_texels } else { of_others };
            (0..3).any(|c| f64::from(x[c]) <= lower[c] || f64::from(x[c]) >= upper[c])
        };
        let reached = self.computed.solved.x.iter().zip(&self.computed.coverage.0).enumerate();
        let reached = reached.filter(|(_, (_, covered))| covered.iter().any(|&value| value > 0.0));
        let held = reached.filter(is_at_bound).count();
        Certificate {
            kind: if keeps_bounds { "projected-gradient" } else { "normal-residual" }.to_owned(),
            value: *true_normal_residual,
            residual: *true_residual,
            at_bounds: if keeps_bounds { held as u64 } else { 0 },
            restarts: history.restarts as u64,
        }
    }

    fn matched(&self) -> Vec<ViewMatch> {
        let views = self.scene.views.iter().zip(&self.computed.before.views).zip(&self.computed.after.views);
        views
            .filter(|((_, before), _)| before.pixels > 0)
            .map(|((view, before), after)| ViewMatch {
                view: view.name.clone(),
                painted_pixels: before.pixels as u64,
                weighted_residual: Change { before: before.residual, after: after.residual },
                hue_error: Some(Change { before: before.hue_error, after: after.hue_error }),
                uncontested_hue_error: Some(Change {
                    before: before.uncontested_hue_error,
                    after: after.uncontested_hue_error,
                }),
                uncontested_pixels: Some((before.pixels - before.contested) as u64),
            })
            .collect()
    }

    fn memory(&self) -> BTreeMap<String, u64> {
        let mut memory = BTreeMap::from([
            ("matrix".to_owned(), self.computed.storage.bytes),
            ("everything_else".to_owned(), budget::fixed_bytes(self.scene, self.settings, self.problem)),
        ]);
        memory.extend(self.settings.memory.map(|budget| ("budget".to_owned(), budget)));
        memory.extend(machine::peak_memory().map(|peak| ("peak".to_owned(), peak)));
        memory
    }

    fn skipped(&self) -> BTreeMap<String, Share> {
        let rows = self.problem.constraints.len();
        let pixels: usize =
            self.scene.views.iter().map(|view| view.camera.size().iter().product::<usize>()).sum();
        let (mut texels, mut lit, mut cut) = (0.0, 0.0, 0);
        for row in 0..rows {
            let extent = self.problem.traversal.extent(row);
            texels += extent.texels;
            lit += extent.lit_texels;
            cut += u64::from(extent.cut_off);
        }
        let history = &self.computed.solved.outcome.history;
        let last = history.progress.last();
        let (walks, iterations) = last.map_or((0, 0), |last| (last.operator_applications, last.iteration));
        let share = |count: u64, of: u64| Share { count, of };
        [
            ("pixels", share((pixels - rows) as u64, pixels as u64)),
            (
                "unknowns",
                share(
                    self.computed.coverage.0.len() as u64 - self.computed.solved.columns.len() as u64,
                    self.computed.coverage.0.len() as u64,
                ),
            ),
            ("shadowed_cells", share((texels - lit) as u64, texels as u64)),
            ("dark_rays", share(cut, rows as u64)),
            ("channel_iterations", share(history.spared as u64, 3 * iterations as u64)),
            ("walks", share((walks * self.computed.storage.kept_rows) as u64, (walks * rows) as u64)),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into()
    }

    fn covered(&self) -> Coverage {
        let [texels, _] = self.problem.parted(&self.computed.coverage.0);
        let (total, reached) = (texels.len() as u64, reached(texels));
        // Where the data weigh less than the regularization, the start decides.
        let weak = texels.iter().filter(|texel| {
            let most = f64::from(texel[0].max(texel[1]).max(texel[2]));
            most > 0.0 && most < self.computed.solved.weights.tikhonov
        });
        Coverage {
            reached,
            total,
            unreached: total - reached,
            filled: self.settings.fill.then(|| total - reached),
            weak: Some(weak.count() as u64),
        }
    }
}

/// How many of some unknowns a painted ray reaches, given the squares of their weights.
fn reached(squares: &[Rgb]) -> u64 {
    squares.iter().filter(|square| square.iter().any(|&value| value > 0.0)).count() as u64
}

/// How rows were applied.
pub(crate) fn strategy(storage: &Storage) -> RowStrategy {
    RowStrategy {
        name: match (storage.kept_rows, storage.walked_rows) {
            _ if storage.of_light_volumes => "light volumes",
            (_, 0) => "assembled",
            (0, _) => "matrix-free",
            _ => "mixed",
        }
        .to_owned(),
        kept_rows: storage.kept_rows as u64,
        walked_rows: storage.walked_rows as u64,
    }
}

/// The history of a solve.
pub(crate) fn history(outcome: &Outcome) -> Vec<Step> {
    let step = |entry: &crate::solve::Progress| Step {
        iteration: entry.iteration as u64,
        seconds: entry.seconds,
        operator_applications: entry.operator_applications as u64,
        residual: entry.residual,
        normal_residual: entry.normal_residual,
    };
    outcome.history.progress.iter().map(step).collect()
}

/// The bounds in words.
fn bounds(solve: &SolveSettings) -> String {
    if !solve.solver.keeps_bounds() {
        return "none: this solver keeps none".to_owned();
    }
    let words = |bound: [f64; 3], none: &str| {
        let equal = bound[0] == bound[1] && bound[1] == bound[2];
        match (equal, bound[0].is_finite()) {
            (true, false) => none.to_owned(),
            (true, true) => bound[0].to_string(),
            _ => format!("{bound:?}"),
        }
    };
    format!("from {} to {}", words(solve.bounds[0], "any"), words(solve.bounds[1], "any"))
}

/// The weights as a scene file would give them.
pub(crate) fn weights(weights: &Weights) -> String {
    let Weights { tikhonov, gradient, laplacian } = weights;
    format!(
        "tikhonov {tikhonov:.3e}, gradient {gradient:.3e}, laplacian {laplacian:.3e}, relative to the columns"
    )
}
