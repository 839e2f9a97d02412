//! Results and plans as a person reads them.

use std::path::Path;

use crate::job::{LightMapPlan, Plan, VolumePlan, mebibytes};
use crate::report::{self, Report};

/// A plan in a few lines.
pub(super) fn of_plan(plan: &Plan) -> String {
    match plan {
        Plan::LightMap(plan) => of_light_map_plan(plan),
        Plan::Volume(plan) => of_volume_plan(plan),
    }
}

pub(super) fn of_light_map(report: &Report, folder: &Path) -> String {
    let hue = |change: Option<&report::Change>| {
        change.map_or(String::new(), |hue| format!(", hue off by {:.1}° → {:.1}°", hue.before, hue.after))
    };
    let mut lines = vec![format!(
        "{} painted pixels in {} views, {} of {} {} reached, {} non-zeros",
        report.problem.rows,
        report.problem.views,
        report.problem.active_unknowns,
        report.problem.unknowns,
        if report.surroundings.is_some() { "unknowns" } else { "texels" },
        report.problem.nonzeros
    )];
    if let Some(around) = &report.surroundings {
        lines.push(format!("  around the light map: {}", around.in_words()));
    }
    for view in &report.matched {
        lines.push(format!(
            "  {:<16} residual {:.3} → {:.3}{}",
            view.view,
            view.weighted_residual.before,
            view.weighted_residual.after,
            hue(view.uncontested_hue_error.as_ref())
        ));
    }
    lines.push(format!(
        "residual {:.3} → {:.3}, gradient at {:.1e} of its start after {} iterations ({}), {:.2} s in all",
        report.weighted_residual.before,
        report.weighted_residual.after,
        report.certificate.value.iter().copied().fold(0.0, f64::max),
        report.stop.iteration,
        report.stop.reason,
        report.timings.get("total").copied().unwrap_or_default()
    ));
    lines.push(format!("results in {}", folder.join("report.html").display()));
    lines.join("\n")
}

pub(super) fn of_volume(report: &Report, folder: &Path) -> String {
    let mut lines = Vec::new();
    for stage in &report.stages {
        lines.push(format!(
            "{}: {} pixels, {} of {} {}, {} non-zeros; residual {:.4} → {:.4} after {} iterations ({}){}",
            stage.label(),
            stage.problem.rows,
            stage.problem.active_unknowns,
            stage.problem.unknowns,
            stage.unknowns(),
            stage.problem.nonzeros,
            stage.weighted_residual.before,
            stage.weighted_residual.after,
            stage.stop.iteration,
            stage.stop.reason,
            if stage.is_taken { "" } else { "; not taken, for it came no nearer" },
        ));
    }
    for view in &report.matched {
        let residual = view.weighted_residual;
        lines.push(format!("  {:<16} residual {:.4} → {:.4}", view.view, residual.before, residual.after));
    }
    lines.push(format!(
        "residual {:.4} → {:.4}, {:.2} s in all",
        report.weighted_residual.before,
        report.weighted_residual.after,
        report.timings.get("total").copied().unwrap_or_default()
    ));
    if let Some(animation) = &report.animation {
        let spread: u64 = animation.keys.iter().map(|key| key.spread_voxels).sum();
        lines.push(format!(
            "{} of {} frames from {} keys, in which diffusion filled {spread} voxels",
            animation.drawn,
            animation.frames,
            animation.keys.len(),
        ));
    }
    lines.push(format!("results in {}", folder.join("report.html").display()));
    lines.join("\n")
}

fn of_light_map_plan(plan: &LightMapPlan) -> String {
    let iteration = plan.seconds_per_iteration;
    format!(
        "{}: {} views, {} pixels\n\
         rows        {} painted pixels; the other pixels are skipped\n\
         unknowns    {} texels, of which only those that painted rays reach are solved for{}\n\
         non-zeros   about {}; {:.0} % of the rays' length over the map is in shadow and skipped\n\
         matrix      {} if kept, and {} for everything else; {} are allowed\n\
         strategy    {} ({:.0} % of the rows are kept)\n\
         time        {:.2} s to set up, then about {iteration:.3} s an iteration: at most {:.1} s for {} iterations",
        plan.scene,
        plan.views,
        plan.pixels,
        plan.rows,
        plan.unknowns - plan.surrounding_unknowns,
        match plan.surrounding_unknowns {
            0 => String::new(),
            further => format!(
                "; and {further} around them, for {} of shadow maps and weights",
                mebibytes(plan.surrounding_bytes)
            ),
        },
        plan.nonzeros,
        100.0 * (1.0 - plan.lit_texels / plan.texels.max(f64::MIN_POSITIVE)),
        mebibytes(plan.matrix_bytes),
        mebibytes(plan.other_bytes),
        mebibytes(plan.budget_bytes),
        plan.strategy,
        100.0 * plan.kept,
        plan.set_up_seconds,
        iteration * plan.iterations as f64,
        plan.iterations,
    )
}

fn of_volume_plan(plan: &VolumePlan) -> String {
    let iteration = plan.seconds_per_iteration;
    format!(
        "{}, {}: {} views, {} pixels\n\
         rows        {} wanted pixels; {} more meet nothing that is looked for, {} have no logarithm\n\
         unknowns    {} of {} {}; {} are outside the visual hull, {} of {} bricks are empty\n\
         non-zeros   about {}\n\
         matrix      {} if kept, and {} for everything else; {} are allowed\n\
         strategy    {} ({:.0} % of the rows are kept)\n\
         time        {:.2} s to set up, then about {iteration:.3} s an iteration: at most {:.1} s for {} iterations",
        plan.scene,
        plan.find,
        plan.views,
        plan.pixels,
        plan.rows,
        plan.beside,
        plan.without_logarithm,
        plan.unknowns,
        plan.candidates,
        plan.unit,
        plan.outside_hull,
        plan.empty_bricks,
        plan.bricks,
        plan.nonzeros,
        mebibytes(plan.matrix_bytes),
        mebibytes(plan.other_bytes),
        mebibytes(plan.budget_bytes),
        plan.strategy,
        100.0 * plan.kept,
        plan.set_up_seconds,
        iteration * plan.iterations as f64,
        plan.iterations,
    )
}
