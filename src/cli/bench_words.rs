//! What a benchmark says in the terminal.

use std::path::Path;

use crate::lab::bench::LEFT_OUT;
use crate::report::bench::{Against, Bench, Law, MarchStanding, Measured, Record, Sweep, front, growth};

/// Counts that fell of which so many are listed.
const SHOWN: usize = 8;

/// Standard output: what matters of each scene, laws, and where the rest is.
pub(super) fn summary(bench: &Bench, taken: usize, folder: &Path, counts: Option<&Path>) -> String {
    let mut lines = Vec::new();
    for scene in bench.scenes() {
        of_scene(bench, scene, &mut lines);
    }
    if !bench.scaling.is_empty() {
        lines.push(format!(
            "{:44} {:>9} {:>9} {:>9} {:>9}",
            "cost ~ size^e", "problem", "set-up", "products", "memory"
        ));
        lines.extend(bench.scaling.iter().flat_map(sweep));
        lines.push(String::new());
    }
    if !bench.skipping.is_empty() {
        lines.push(format!(
            "{:44} {:>9} {:>9} {:>9} {:>9} {:>9}",
            "skipped", "work", "without", "seconds", "without", "differs"
        ));
        lines.extend(bench.skipping.iter().map(|skip| {
            format!(
                "{:44} {:>9} {:>9} {:>9.1e} {:>9.1e} {:>9.0e}",
                format!("{}: {}", skip.scene, skip.what),
                skip.work.with,
                skip.work.without,
                skip.seconds.with,
                skip.seconds.without,
                skip.difference
            )
        }));
        lines.push(String::new());
    }
    for record in bench.pictures.iter().filter(|it| it.light_map == (it.method != "min-max")) {
        lines.push(format!(
            "{:44} set-up {:>7.3} s   picture {:>7.3} s   error {:>8.1e}   {:6.2} % within 1/255",
            format!("{} {}x{} {}: {}", record.scene, record.width, record.height, record.map, record.words()),
            record.set_up_seconds,
            record.seconds,
            record.error,
            100.0 * record.within
        ));
    }
    for growth in growth(&bench.pictures).iter().filter(|it| it.points.len() > 1) {
        let name = format!("{} {}x{}: {}", growth.scene, growth.size[0], growth.size[1], growth.method);
        let exponent = growth.exponent.unwrap_or_default();
        lines.push(format!("{name:44} seconds ~ side of the maps ^ {exponent:.2}"));
    }
    for law in bench.laws.iter().filter(|law| !law.holds) {
        lines.extend([format!("BROKEN  {}", law.case), format!("        {}", broken(law))]);
    }
    if let Some(counts) = counts {
        of_counts(bench, folder, counts, &mut lines);
    }
    let known = if taken > 0 { format!(", {taken} results of an earlier run") } else { String::new() };
    lines.push(format!(
        "{} of {} laws hold; {} cases{known}",
        bench.held.hold,
        bench.held.of,
        bench.records.len()
    ));
    if !bench.complete {
        lines.push("interrupted: not every case was run; --resume goes on".to_owned());
    }
    lines.push(format!("results in {}", folder.join("bench.html").display()));
    lines.join("\n")
}

fn broken(law: &Law) -> String {
    match law.before {
        Some(before) => format!("{} rose from {before} to {}; at most {}", law.law, law.error, law.bound),
        None if law.law == LEFT_OUT => law.law.to_owned(),
        None => format!("{}: {:.1e}, at most {:.1e}", law.law, law.error, law.bound),
    }
}

/// Counts that fell, and how to accept those of this run where they are not what they were.
fn of_counts(bench: &Bench, folder: &Path, counts: &Path, lines: &mut Vec<String>) {
    let fell: Vec<&Law> = bench.laws.iter().filter(|law| law.fell()).collect();
    for law in fell.iter().take(SHOWN) {
        let before = law.before.unwrap_or_default();
        lines.extend([
            format!("fell    {}", law.case),
            format!("        {} from {before} to {}", law.law, law.error),
        ]);
    }
    if fell.len() > SHOWN {
        lines.push(format!("        and {} more", fell.len() - SHOWN));
    }
    let is_broken = |law: &Law| !law.holds && (law.before.is_some() || law.law == LEFT_OUT);
    if fell.is_empty() && !bench.laws.iter().any(is_broken) {
        return;
    }
    let first = if bench.complete { "" } else { "run to the end, then " };
    lines.push("to have these counts from now on:".to_owned());
    lines.push(format!("  {first}cp {} {}", folder.join("counts.csv").display(), counts.display()));
}

fn of_scene(bench: &Bench, scene: &str, lines: &mut Vec<String>) {
    let of = |measured: Measured, basis: &str| -> Vec<&Record> {
        let records = bench.records.iter();
        let is_it = |r: &&Record| r.scene == scene && r.measured == measured && r.basis == basis;
        records.filter(is_it).collect()
    };
    for (measured, title) in [(Measured::Product, "first T x"), (Measured::Solve, "solution, to 1e-3")] {
        let records = of(measured, "linear");
        let Some(first) = records.first() else { continue };
        lines.push(format!(
            "{:44} {:>9} {:>9} {:>9} {:>9} {:>9}",
            format!("{scene}, {} rows: {title}", first.rows),
            "error",
            "seconds",
            "set-up",
            "products",
            "kept"
        ));
        let points: Vec<[f64; 2]> = records.iter().map(|record| record.point()).collect();
        let best = front(&points);
        let shown = records.iter().enumerate().filter(|(_, record)| is_shown(record));
        lines.extend(shown.map(|(index, record)| row(record, best.contains(&index))));
        lines.push(String::new());
    }
    let marches: Vec<&Against> = bench.against.iter().filter(|against| against.scene == scene).collect();
    if !marches.is_empty() {
        let count = |standing| marches.iter().filter(|march| march.standing == standing).count();
        lines.push(format!(
            "of {} marches {} are slower and worse than the exact traversal, {} quicker and worse, {} as exact",
            marches.len(),
            count(MarchStanding::Dominated),
            count(MarchStanding::Quicker),
            count(MarchStanding::AsExact)
        ));
        lines.push(String::new());
    }
}

/// What a terminal has room for: products, and exact solves to the usual tolerance with rows that are kept in f32.
fn is_shown(record: &Record) -> bool {
    let plain = record.precision == "f32" && record.strategy == "assembled" && record.steps.is_none();
    record.measured == Measured::Product && (record.precision == "f32" || record.steps.is_none())
        || plain && record.tolerance.is_none_or(|tolerance| tolerance == 1e-3)
}

fn row(record: &Record, is_best: bool) -> String {
    let what = match &record.solver {
        Some(solver) => {
            format!("{solver}, {} ({})", record.backend, record.stop.as_deref().unwrap_or_default())
        }
        None => {
            format!("{}, {} {}, {}", record.traversal(), record.backend, record.precision, record.strategy)
        }
    };
    format!(
        "{} {what:42} {:>9.1e} {:>9.2e} {:>9.2e} {:>9} {:>9}",
        if is_best { '*' } else { ' ' },
        record.error,
        record.seconds_in_all(),
        record.set_up_seconds,
        record.applications,
        format!("{} kB", record.kept_bytes / 1000)
    )
}

fn sweep(sweep: &Sweep) -> [String; 2] {
    let [problem, set_up, products, memory] =
        sweep.exponents.map(|e| e.map_or("–".to_owned(), |e| format!("{e:.2}")));
    let sizes: Vec<String> = sweep.points.iter().map(|point| point.size.to_string()).collect();
    [
        format!(
            "{:44} {problem:>9} {set_up:>9} {products:>9} {memory:>9}",
            format!("  {}: {}", sweep.scene, sweep.over)
        ),
        format!("    {}; held: {}", sizes.join(", "), sweep.held),
    ]
}
