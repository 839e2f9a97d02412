use std::collections::BTreeMap;

use super::super::findings::{history, strategy, weights};
use super::super::machine;
use super::super::steps::Timings;
use super::stage::Stage;
use super::staging::{Distance, Outcome};
use crate::march::Refraction;
use crate::problem::{Desired, VolumeProblem};
use crate::report::{
    Certificate, Change, Coverage, Problem, Regularization, Report, Share, StageRecord, StopRecord, ViewMatch,
};
use crate::scene::{Find, Interpolation, Quadrature, Rgb, Target, VolumeScene};

/// Everything that a volume solve has found out, to be reported.
pub(super) struct Findings<'a> {
    pub(super) scene: &'a VolumeScene,
    pub(super) outcome: &'a Outcome,
}

impl Findings<'_> {
    /// The report: the numbers of the last stage, and a summary of each.
    pub(super) fn report(&self, timings: &Timings) -> Report {
        let last = &self.outcome.last;
        let [before, after] = &self.outcome.distances;
        let outcome = &last.trial.solved.outcome;
        let lambda = last.trial.solved.weights;
        Report {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: "volume".to_owned(),
            scene: self.scene.name.clone(),
            backend: last.backend.to_owned(),
            device: last.device.clone(),
            gpu: last.work.clone(),
            target: match self.scene.target {
                Target::Tint => "tint",
                Target::Radiance => "radiance",
            }
            .to_owned(),
            solver: last.settings.solver.name().to_owned(),
            strategy: strategy(&last.trial.storage),
            problem: size(last),
            regularization: Regularization {
                tikhonov: lambda.tikhonov,
                laplacian: lambda.laplacian,
                gradient: lambda.gradient,
            },
            settings: self.settings(last),
            history: history(outcome),
            certificate: certificate(last),
            set_up_applications: last.trial.solved.set_up_applications as u64,
            stop: StopRecord {
                reason: outcome.stop.reason.name().to_owned(),
                iteration: outcome.stop.iteration as u64,
            },
            weighted_residual: Change { before: before.all, after: after.all },
            matched: matched(self.scene, &self.outcome.desired, [before, after]),
            timings: timings.iter().cloned().collect(),
            memory: self.memory(last),
            skipped: self.skipped(last),
            adjoint_error: last.trial.adjoint_error,
            coverage: covered(last),
            surroundings: None,
            stages: self.outcome.records.clone(),
            animation: None,
        }
    }

    fn settings(&self, stage: &Stage) -> BTreeMap<String, String> {
        let transport = stage.problem.traversal.transport();
        let quadrature = match transport.quadrature {
            Quadrature::Exact => "exact, cell by cell".to_owned(),
            Quadrature::March { steps } => format!("march of {steps} steps along the diagonal"),
        };
        let finds: Vec<&str> = self.outcome.records.iter().map(|stage| stage.find.as_str()).collect();
        let mut settings = vec![
            ("looked_for", finds.join(", then ")),
            (
                "interpolation",
                match transport.basis {
                    Interpolation::Nearest => "nearest",
                    Interpolation::Trilinear => "trilinear",
                }
                .to_owned(),
            ),
            ("quadrature", quadrature),
            ("iterations", format!("at most {}", stage.settings.iterations)),
            ("tolerance", stage.settings.tolerance.to_string()),
            ("transmittance_bound", format!("{:.1e}", stage.settings.transmittance_bound)),
            ("bounds", format!("{:?}", stage.settings.bounds)),
            ("weights", weights(&stage.trial.solved.relative_weights)),
            ("metric", format!("{:?}", stage.settings.metric_in_use()).to_lowercase()),
        ];
        if let Some(refraction) = &transport.refraction {
            settings.push(("refraction", refraction_in_words(refraction, &stage.problem)));
        }
        if stage.find == Find::Joint {
            let [emission, albedo] = self.scene.pull;
            settings.push(("pull", format!("emission {emission}, albedo {albedo}")));
        }
        settings.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }

    fn memory(&self, stage: &Stage) -> BTreeMap<String, u64> {
        let mut memory = BTreeMap::from([
            ("matrix".to_owned(), stage.trial.storage.bytes),
            ("everything_else".to_owned(), stage.other_bytes),
        ]);
        memory.extend(self.scene.solve.memory.map(|budget| ("budget".to_owned(), budget)));
        memory.extend(machine::peak_memory().map(|peak| ("peak".to_owned(), peak)));
        memory
    }

    fn skipped(&self, stage: &Stage) -> BTreeMap<String, Share> {
        let problem = &stage.problem;
        let rows = problem.targets.len();
        let pixels: usize =
            self.scene.views.iter().map(|view| view.view.camera.size().iter().product::<usize>()).sum();
        let [empty, bricks] = stage.problem.empty_bricks();
        let history = &stage.trial.solved.outcome.history;
        let last = history.progress.last();
        let (walks, iterations) = last.map_or((0, 0), |last| (last.operator_applications, last.iteration));
        let share = |count: u64, of: u64| Share { count, of };
        let candidates = problem.candidates() as u64;
        let mut skipped = vec![
            ("pixels", share((pixels - rows) as u64, pixels as u64)),
            ("unknowns", share(candidates - stage.trial.solved.columns.len() as u64, candidates)),
            ("empty_bricks", share(empty as u64, bricks as u64)),
            ("channel_iterations", share(history.spared as u64, 3 * iterations as u64)),
            ("walks", share((walks * stage.trial.storage.kept_rows) as u64, (walks * rows) as u64)),
        ];
        if problem.outside_hull > 0 {
            skipped.push(("outside_hull", share(problem.outside_hull as u64, candidates)));
        }
        if problem.left_out.without_logarithm > 0 {
            let all = (rows + problem.left_out.without_logarithm) as u64;
            skipped.push(("without_logarithm", share(problem.left_out.without_logarithm as u64, all)));
        }
        skipped.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }
}

/// How near each view of which something is wanted has come.
pub(super) fn matched(
    scene: &VolumeScene,
    desired: &[Desired],
    [before, after]: [&Distance; 2],
) -> Vec<ViewMatch> {
    let views = scene.views.iter().zip(desired).enumerate();
    views
        .filter(|(_, (_, desired))| desired.is_wanted())
        .map(|(index, (view, desired))| ViewMatch {
            view: view.view.name.clone(),
            painted_pixels: desired.pixels.iter().filter(|pixel| pixel[3] > 0.0).count() as u64,
            weighted_residual: Change { before: before.views[index], after: after.views[index] },
            ..ViewMatch::default()
        })
        .collect()
}

/// A stage in a few numbers.
pub(super) fn record(stage: &Stage, round: usize, is_taken: bool, [before, after]: [f64; 2]) -> StageRecord {
    let stop = stage.trial.solved.outcome.stop;
    StageRecord {
        frame: None,
        find: stage.find.name().to_owned(),
        round: round as u64 + 1,
        is_taken,
        problem: size(stage),
        weighted_residual: Change { before, after },
        stop: StopRecord { reason: stop.reason.name().to_owned(), iteration: stop.iteration as u64 },
        certificate: certificate(stage),
    }
}

fn size(stage: &Stage) -> Problem {
    let storage = stage.trial.storage;
    let problem = &stage.problem;
    Problem {
        rows: problem.targets.len() as u64,
        unknowns: problem.candidates() as u64,
        active_unknowns: stage.trial.solved.columns.len() as u64,
        nonzeros: if storage.walked_rows == 0 { storage.kept_nonzeros } else { problem.plan.nonzeros },
        views: problem.views() as u64,
        size: problem.size().iter().map(|&side| side as u64).collect(),
    }
}

/// The step along bent rays, and what it costs: measured on some of the rows.
fn refraction_in_words(refraction: &Refraction, problem: &VolumeProblem) -> String {
    const SAMPLES: usize = 256;
    let rays = problem.traversal.rays();
    let sampled = (0..rays.len()).step_by(rays.len().div_ceil(SAMPLES).max(1));
    let errors: Vec<f64> = sampled.map(|row| refraction.step_error(&rays.ray(row))).collect();
    let worst = errors.iter().copied().fold(0.0, f64::max);
    let mean = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
    format!(
        "Euler steps of {:.2e} m; half as long they would move the rays by {mean:.1e} m on average, {worst:.1e} m at most",
        refraction.step()
    )
}

fn certificate(stage: &Stage) -> Certificate {
    let outcome = &stage.trial.solved.outcome;
    let keeps_bounds = stage.settings.solver.keeps_bounds();
    let bounds = stage.problem.formulation().bounds;
    let is_at_bound = |&&column: &&u32| {
        let (x, [lower, upper]): (&Rgb, _) =
            (&stage.trial.solved.x[column as usize], bounds.of(column as usize));
        (0..3).any(|c| f64::from(x[c]) <= lower[c] || f64::from(x[c]) >= upper[c])
    };
    let held = stage.trial.solved.columns.iter().filter(is_at_bound).count();
    Certificate {
        kind: if keeps_bounds { "projected-gradient" } else { "normal-residual" }.to_owned(),
        value: outcome.true_normal_residual,
        residual: outcome.true_residual,
        at_bounds: if keeps_bounds { held as u64 } else { 0 },
        restarts: outcome.history.restarts as u64,
    }
}

fn covered(stage: &Stage) -> Coverage {
    let total = stage.problem.candidates() as u64;
    let reached = stage.trial.solved.columns.len() as u64;
    let weak = stage.trial.coverage.0.iter().filter(|voxel| {
        let most = f64::from(voxel[0].max(voxel[1]).max(voxel[2]));
        most > 0.0 && most < stage.trial.solved.weights.tikhonov
    });
    Coverage { reached, total, unreached: total - reached, filled: None, weak: Some(weak.count() as u64) }
}
