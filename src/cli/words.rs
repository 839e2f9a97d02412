//! Results and plans as a person reads them.

use std::path::Path;

use crate::job::{Plan, mebibytes};
use crate::report::{
    AnimationRecord, Certificate, Change, HueAngles, ProblemSize, Report, Share, StageRecord, StopRecord,
};

/// A plan in a few lines.
pub(super) fn of_plan(plan: &Plan) -> String {
    let iteration = plan.seconds_per_iteration;
    let skipped = plan.skipped.iter().filter(|(_, share)| share.of > 0);
    let skipped = skipped.map(|(name, Share { count, of })| match name.as_str() {
        "shadowed_cells" => {
            format!("{:.0} % of the rays' length is in shadow", 100.0 * *count as f64 / *of as f64)
        }
        "dark_rays" => format!("{count} rays are cut off where next to no light arrives from"),
        "empty_bricks" => format!("{count} of {of} bricks are empty"),
        "outside_hull" => format!("{count} {} are outside the visual hull", plan.unit),
        "beside" => format!("{count} wanted pixels meet nothing that is looked for"),
        "without_logarithm" => format!("{count} wanted pixels have no logarithm"),
        other => format!("{count} of {of} {other}"),
    });
    let skipped: Vec<String> = skipped.collect();
    let around = match plan.surrounding_unknowns {
        0 => String::new(),
        count => format!(", and {count} {} around them", plan.surrounding_unit),
    };
    let prepared = match plan.prepared_bytes {
        0 => String::new(),
        bytes => format!(", {} of it for what rays meet", mebibytes(bytes)),
    };
    format!(
        "{}, {}: {}, {} pixels\n\
         rows        {} pixels of which something is wanted\n\
         unknowns    {} of {} {} at most, of which those that a row reaches are solved for{around}\n\
         non-zeros   about {}\n\
         skipped     {}\n\
         matrix      {} if kept, and {} for everything else{prepared}; {} are allowed\n\
         strategy    {} ({:.0} % of the rows are kept)\n\
         time        {:.2} s to set up{}, then about {iteration:.3} s an iteration: at most {:.1} s for {}",
        plan.scene,
        plan.find,
        counted(plan.views as u64, "view"),
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
        if plan.kept > 0.0 {
            format!(", {:.2} s to keep the rows", plan.keeping_seconds)
        } else {
            String::new()
        },
        plan.most_seconds(),
        match plan.solves {
            1 => format!("{} iterations", plan.iterations),
            solves => format!("{solves} solves of {} iterations", plan.iterations),
        },
    )
}

/// A report in a few lines: how well paint or pictures are met, over everything and view by view; with its `numbers`, too.
pub(super) fn of_report(report: &Report, folder: &Path, numbers: bool) -> String {
    let pixel = &report.nouns.pixel;
    let mut lines = Vec::new();
    let total = report.timings.get("total").copied().unwrap_or_default();
    // Rows may be others than those that somebody painted, too: pixels that are kept.
    let pixels = match report.matched.iter().map(|view| view.painted_pixels).sum::<u64>() {
        0 => report.problem.rows,
        painted => painted,
    };
    lines.push(match report.is_of_solve() {
        true => format!(
            "{}: {}; {} in {}, {total:.1} s in all",
            report.scene,
            met(report, &report.weighted_residual, report.hue.as_ref()),
            counted(pixels, pixel),
            counted(report.problem.views, "view"),
        ),
        false => format!("{}: {total:.1} s in all", report.scene),
    });
    for view in &report.matched {
        let met = met(report, &view.weighted_residual, view.hue.as_ref());
        let numbers =
            if numbers { format!(" ({})", residual(&view.weighted_residual)) } else { String::new() };
        lines.push(format!("  {:<16} {met}{numbers}", view.view));
    }
    if let Some(light) = &report.light {
        lines.push(format!(
            "  brightest texel {:.2} times the light; {:.1} % of the painted light comes from outside the light map",
            light.brightest,
            100.0 * light.outside
        ));
    }
    if let Some(around) = &report.surroundings {
        lines.push(format!("  around the light map: {}", around.in_words()));
    }
    if numbers && report.is_of_solve() {
        lines.extend(of_solves(report, pixel));
    }
    if let Some(animation) = &report.animation {
        for key in &animation.keys {
            let told = key.weighted_residual.map(|change| met(report, &change, None));
            lines.extend(told.map(|met| format!("  frame {:<10} {met}", key.frame)));
        }
        let spread: u64 = animation.keys.iter().map(|key| key.spread_voxels).sum();
        let filled = if spread > 0 { format!("; diffusion filled {spread} voxels") } else { String::new() };
        let AnimationRecord { frames, drawn, keys, .. } = animation;
        lines.push(format!("{drawn} of {frames} frames from {}{filled}", counted(keys.len() as u64, "key")));
    }
    lines.push(format!("results in {}", folder.join("report.html").display()));
    lines.join("\n")
}

/// How much of what was wanted has come, and how far off hues are.
fn met(report: &Report, change: &Change, hue: Option<&HueAngles>) -> String {
    let wanted = &report.nouns.wanted;
    let met = match change.met() {
        Some(part) => format!("{wanted} met to {:.0} %", (100.0 * part).floor()),
        None => format!("{wanted} asks for no change"),
    };
    let hue = hue.map(|HueAngles { median, nine_tenths }| {
        format!(", hue off by {median:.0}° (nine of ten pixels within {:.0}°)", nine_tenths.ceil())
    });
    met + &hue.unwrap_or_default()
}

/// The solves of a report, in numbers.
fn of_solves(report: &Report, pixel: &str) -> Vec<String> {
    let of_stage = |stage: &StageRecord| {
        let ended = ended(&stage.weighted_residual, &stage.certificate, &stage.stop);
        let taken = if stage.is_taken { "" } else { "; not taken, for it came no nearer" };
        format!("  {}: {}; {ended}{taken}", stage.label(), of_size(&stage.problem, pixel))
    };
    match report.stages.is_empty() {
        true => {
            let ended = ended(&report.weighted_residual, &report.certificate, &report.stop);
            vec![format!("  {}; {ended}", of_size(&report.problem, pixel))]
        }
        false => report.stages.iter().map(of_stage).collect(),
    }
}

fn of_size(size: &ProblemSize, pixel: &str) -> String {
    format!(
        "{} in {}, {} of {} {} reached, {} non-zeros",
        counted(size.rows, pixel),
        counted(size.views, "view"),
        size.active_unknowns,
        size.unknowns,
        size.elements,
        size.nonzeros
    )
}

/// A count and its noun: `1 view`, `3 views`.
fn counted(n: u64, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

fn residual(Change { before, after }: &Change) -> String {
    format!("residual {before:.4} → {after:.4}")
}

fn ended(change: &Change, certificate: &Certificate, stop: &StopRecord) -> String {
    format!(
        "{}, gradient at {:.1e} of its start after {} ({})",
        residual(change),
        certificate.value.iter().copied().fold(0.0, f64::max),
        counted(stop.iteration, "iteration"),
        stop.reason
    )
}
