//! `bench.html`: one file that needs no other and no network.

use super::super::plot::{self, Chart, ChartAxis, Curve};
use super::super::ticks::Spacing;
use super::super::words::{bytes, count, counted, escaped, number, seconds};
use super::data::{Against, Bench, Law, MarchStanding, Measured, Record, Skipped, Sweep};
use super::figures::{figure, power, put, without_namespace};
use super::pictures;
use super::scatter::{Mark, Scatter};
use crate::Result;
use crate::scene::SolverName;

/// What a browser may load for the page: what is in it.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'";

/// The page.
///
/// Errors: [`crate::Error::NonFinite`] for a coordinate that is a NaN or an infinity.
pub fn page(bench: &Bench) -> Result<String> {
    let mut text = head(bench);
    for scene in bench.scenes() {
        text.push_str(&of_scene(bench, scene)?);
    }
    text.push_str(&pictures::section(&bench.pictures)?);
    text.push_str(&scaling(&bench.scaling)?);
    text.push_str(&skipping(&bench.skipping));
    text.push_str(&laws(bench));
    text.push_str(&records(&bench.records));
    text.push_str(&format!(
        "<footer>unscatter {}, run as: {}. The same numbers for programs are in bench.json and bench.csv.</footer>\n</main>\n\
         </body>\n</html>\n",
        escaped(&bench.version),
        escaped(&bench.command)
    ));
    Ok(text)
}

fn head(bench: &Bench) -> String {
    let mut scenes = bench.scenes();
    scenes.extend(bench.pictures.iter().map(|picture| picture.scene.as_str()));
    scenes.dedup();
    let measured = match bench.pictures.len() as u64 {
        0 => counted(bench.records.len() as u64, "case"),
        pictures => counted(pictures, "picture"),
    };
    let laws = match bench.held.of {
        0 => String::new(),
        of => format!(" {} of {of} laws hold.", bench.held.hold),
    };
    let on = match &bench.adapter {
        Some(adapter) => format!(", and {}", escaped(adapter)),
        None => String::new(),
    };
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n<title>Benchmark · unscatter</title>\n\
         <style>\n{}{}</style>\n</head>\n<body>\n<main>\n<header>\n<p class=\"eyebrow\">unscatter bench</p>\n\
         <h1>Run time against error</h1>\n<p class=\"summary\">{}: {} on {} with {}{on}.{laws}{}</p>\n</header>\n",
        include_str!("../page.css"),
        include_str!("page.css"),
        escaped(&scenes.join(", ")),
        measured,
        escaped(&bench.machine),
        counted(bench.threads as u64, "thread"),
        if bench.complete { "" } else { " Interrupted: not every case was run." },
    )
}

fn of_scene(bench: &Bench, scene: &str) -> Result<String> {
    let of = |record: &&Record| record.scene == scene;
    let Some(first) = bench.records.iter().find(of) else { return Ok(String::new()) };
    let mut text = format!(
        "<section>\n<h2>{}</h2>\n<p>A sample of {}, {}, about {}. Numbers beside marks are steps of a march.</p>\n",
        escaped(scene),
        counted(first.rows, "row"),
        counted(first.elements, "element"),
        counted(first.nonzeros, "non-zero"),
    );
    let mut bases: Vec<&str> = Vec::new();
    for record in bench.records.iter().filter(of) {
        if !bases.contains(&record.basis.as_str()) {
            bases.push(&record.basis);
        }
    }
    for basis in bases {
        let records: Vec<&Record> =
            bench.records.iter().filter(of).filter(|record| record.basis == basis).collect();
        text.push_str(&figure(&products(basis, &records))?);
        text.push_str(&figure(&solves(basis, &records))?);
    }
    text.push_str(&against(bench.against.iter().filter(|against| against.scene == scene)));
    text.push_str("</section>\n");
    Ok(text)
}

fn products(basis: &str, records: &[&Record]) -> Scatter {
    let mut groups = Vec::new();
    for record in records.iter().filter(|record| record.measured == Measured::Product) {
        let kind = if record.steps.is_some() { "march" } else { "exact" };
        let label = format!("{kind}, {} {}, {}", record.backend, record.precision, record.strategy);
        let mark = Mark {
            at: record.point(),
            name: spoken(record),
            label: record.steps.map(|steps| steps.to_string()).unwrap_or_default(),
        };
        put(&mut groups, label, record.steps.is_some(), mark);
    }
    Scatter {
        title: format!("The first T x, basis {basis}"),
        x: "seconds, keeping rows included".into(),
        y: "error against the explicit matrix".into(),
        groups,
    }
}

fn solves(basis: &str, records: &[&Record]) -> Scatter {
    let mut groups = Vec::new();
    for record in records.iter().filter(|record| record.measured == Measured::Solve) {
        let Some(solver) = &record.solver else { continue };
        // Steps beside every solver's points would hide them.
        let is_default = solver == SolverName::default().name();
        let label = record.steps.filter(|_| is_default).map(|steps| steps.to_string()).unwrap_or_default();
        let mark = Mark { at: record.point(), name: spoken(record), label };
        put(&mut groups, solver.clone(), false, mark);
    }
    Scatter {
        title: format!("The solution, basis {basis}"),
        x: "seconds, keeping rows included".into(),
        y: "distance to the solution, relative to the start's".into(),
        groups,
    }
}

fn spoken(record: &Record) -> String {
    format!(
        "{}: error {}, {}, {}",
        record.case,
        number(record.error),
        seconds(record.seconds_in_all()),
        counted(record.applications, "application")
    )
}

fn against<'a>(marches: impl Iterator<Item = &'a Against>) -> String {
    let rows: String = marches
        .map(|march| {
            let [m, e] = march.seconds;
            let class = if march.standing == MarchStanding::AsExact { " class=\"broken\"" } else { "" };
            format!(
                "<tr{class}><th>{}, {}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                escaped(&march.basis),
                escaped(&march.strategy),
                march.steps,
                number(march.error[0]),
                seconds(m),
                number(march.error[1]),
                seconds(e),
                march.standing.words()
            )
        })
        .collect();
    if rows.is_empty() {
        return rows;
    }
    format!(
        "<details open><summary>Marches against the exact traversal, to the first T x</summary>\n<table class=\"bench\">\n\
         <thead><tr><th></th><th>steps</th><th>error</th><th>time</th><th>exact: error</th><th>time</th><th>the march is</th>\
         </tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n</details>\n"
    )
}

fn scaling(sweeps: &[Sweep]) -> Result<String> {
    if sweeps.is_empty() {
        return Ok(String::new());
    }
    let (mut charts, mut rows) = (String::new(), String::new());
    for sweep in sweeps {
        charts.push_str(&format!(
            "<figure class=\"chart\">{}<figcaption>Held: {}.</figcaption></figure>\n",
            without_namespace(&plot::chart(&chart(sweep))?),
            escaped(&sweep.held)
        ));
        let sizes: Vec<String> = sweep.points.iter().map(|point| count(point.size as u64)).collect();
        let most = sweep.points.last().map_or(0, |point| point.bytes);
        let cells: String = sweep.exponents.iter().map(|&e| format!("<td>{}</td>", power(e))).collect();
        rows.push_str(&format!(
            "<tr><th>{}: {}<small>{}</small></th><td>{}</td>{cells}<td>{}</td></tr>\n",
            escaped(&sweep.scene),
            escaped(&sweep.over),
            escaped(&sweep.held),
            sizes.join(" · "),
            bytes(most)
        ));
    }
    Ok(format!(
        "<section>\n<h2>Scaling</h2>\n<p>How cost grows with one thing, all else as it was: cost ~ size<sup>e</sup>, with the \
         exponents e that fit best. What was held is said below each.</p>\n<table class=\"bench\">\n<thead><tr><th></th><th>sizes</th><th>e of problem</th>\
         <th>of set-up</th><th>of products</th><th>of memory</th><th>memory at most</th></tr></thead>\n<tbody>\n{rows}</tbody>\n\
         </table>\n<div class=\"charts\">\n{charts}</div>\n</section>\n"
    ))
}

fn chart(sweep: &Sweep) -> Chart {
    let curve = |name: &str, index: usize, value: fn(&super::SweepPoint) -> Option<f64>| Curve {
        label: format!("{name} e={}", power(sweep.exponents[index])),
        dashed: false,
        points: sweep.points.iter().filter_map(|point| Some([point.size, value(point)?])).collect(),
    };
    Chart {
        title: format!("{}: {}", sweep.scene, sweep.over),
        x: ChartAxis { label: sweep.over.clone(), spacing: Spacing::Log },
        y: ChartAxis { label: "seconds".into(), spacing: Spacing::Log },
        curves: [
            curve("set-up", 1, |point| Some(point.set_up_seconds)),
            curve("products", 2, |point| Some(point.seconds)),
            // The last, since it is not always there, so that colours are the same in all charts.
            curve("problem", 0, |point| point.problem_seconds),
        ]
        .into_iter()
        .filter(|curve| !curve.points.is_empty())
        .collect(),
    }
}

fn skipping(skipped: &[Skipped]) -> String {
    let rows: String = skipped
        .iter()
        .map(|skip| {
            let class = if skip.difference <= skip.bound { "" } else { " class=\"broken\"" };
            format!(
                "<tr{class}><th>{}: {}</th><td>{}</td><td>{} of {} {}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                escaped(&skip.scene),
                escaped(&skip.what),
                escaped(&skip.switch),
                number(skip.work.with),
                number(skip.work.without),
                escaped(&skip.unit),
                seconds(skip.seconds.with),
                seconds(skip.seconds.without),
                number(skip.difference),
                number(skip.bound),
            )
        })
        .collect();
    if rows.is_empty() {
        return rows;
    }
    format!(
        "<section>\n<h2>Skipping</h2>\n<p>Work and time of both products, or of a solve, with and without each thing that is skipped, and \
         what it changes.</p>\n<table class=\"bench\">\n<thead><tr><th></th><th>off by</th><th>work</th><th>time</th>\
         <th>without</th><th>difference</th><th>at most</th></tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n</section>\n"
    )
}

/// A number of a law: of a count, all its digits.
fn measured(law: &Law, value: f64) -> String {
    if law.before.is_some() { count(value as u64) } else { number(value) }
}

fn laws(bench: &Bench) -> String {
    let rows: String = bench
        .laws
        .iter()
        .map(|law| {
            format!(
                "<tr{}><th>{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                if law.holds { "" } else { " class=\"broken\"" },
                escaped(&law.case),
                escaped(law.law),
                law.before.map(count).unwrap_or_default(),
                measured(law, law.error),
                measured(law, law.bound),
                match (law.holds, law.fell()) {
                    (true, true) => "fell",
                    (true, false) => "holds",
                    (false, _) => "broken",
                }
            )
        })
        .collect();
    format!(
        "<section>\n<h2>Laws</h2>\n<details{}><summary>{} of {} hold</summary>\n<table class=\"bench\">\n\
         <thead><tr><th></th><th>law</th><th>before</th><th>measured</th><th>at most</th><th></th></tr></thead>\n<tbody>\n{rows}</tbody>\n\
         </table>\n</details>\n</section>\n",
        if bench.held.hold < bench.held.of { " open" } else { "" },
        bench.held.hold,
        bench.held.of
    )
}

fn records(records: &[Record]) -> String {
    let rows: String = records
        .iter()
        .map(|record| {
            format!(
                "<tr><th>{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                escaped(&record.case),
                number(record.error),
                seconds(record.set_up_seconds),
                seconds(record.seconds),
                record.applications,
                bytes(record.kept_bytes)
            )
        })
        .collect();
    format!(
        "<section>\n<h2>Cases</h2>\n<details><summary>{}</summary>\n<table class=\"bench\">\n<thead><tr><th></th><th>error</th>\
         <th>set-up</th><th>time</th><th>applications</th><th>kept</th></tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n\
         </details>\n</section>\n",
        counted(records.len() as u64, "case")
    )
}
