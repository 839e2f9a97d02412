//! Results and plans as a person reads them.

use std::path::Path;

use crate::job::{Plan, mebibytes};
use crate::report::{self, Report};

/// A plan in a few lines.
pub(super) fn of_plan(plan: &Plan) -> String {
    let iteration = plan.seconds_per_iteration;
    let count = |name: &str| plan.skipped.get(name).map_or(0, |share| share.count);
    let of = |name: &str| plan.skipped.get(name).map_or(0, |share| share.of);
    let mut skipped = Vec::new();
    let mut note = |is_some: bool, words: String| {
        if is_some {
            skipped.push(words)
        }
    };
    let (beside, outside, bricks) = (count("beside"), count("outside_hull"), of("empty_bricks"));
    let (dark, logarithm) = (of("shadowed_cells"), count("without_logarithm"));
    note(
        dark > 0,
        format!(
            "{:.0} % of the rays' length over the map is in shadow",
            100.0 * count("shadowed_cells") as f64 / dark.max(1) as f64
        ),
    );
    note(bricks > 0, format!("{} of {bricks} bricks are empty", count("empty_bricks")));
    note(outside > 0, format!("{outside} {} are outside the visual hull", plan.unit));
    note(beside > 0, format!("{beside} wanted pixels meet nothing that is looked for"));
    note(logarithm > 0, format!("{logarithm} have no logarithm"));
    let around = match plan.surrounding_unknowns {
        0 => String::new(),
        lights => {
            format!(
                ", and {lights} lights around them; {} for what they meet",
                mebibytes(plan.prepared_bytes)
            )
        }
    };
    format!(
        "{}, {}: {} views, {} pixels\n\
         rows        {} pixels of which something is wanted\n\
         unknowns    {} of {} {} at most, of which those that a row reaches are solved for{around}\n\
         non-zeros   about {}\n\
         skipped     {}\n\
         matrix      {} if kept, and {} for everything else; {} are allowed\n\
         strategy    {} ({:.0} % of the rows are kept)\n\
         time        {:.2} s to set up, then about {iteration:.3} s an iteration: at most {:.1} s for {} iterations",
        plan.scene,
        plan.find,
        plan.views,
        plan.pixels,
        plan.rows,
        plan.unknowns - plan.surrounding_unknowns,
        plan.candidates - plan.surrounding_unknowns,
        plan.unit,
        plan.nonzeros,
        if skipped.is_empty() { "nothing".to_owned() } else { skipped.join("; ") },
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
