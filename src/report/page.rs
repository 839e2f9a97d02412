//! The parts of the page that are words and numbers.

use super::data::{HueAngles, Report};
use super::plot;
use super::words::{self, bytes, count, counted, degrees, escaped, label, number, percent, seconds, share};
use crate::problem::Nouns;
use crate::{Result, Warning};

/// Title, summary, and the few numbers that matter most.
pub(super) fn opening(report: &Report) -> String {
    format!(
        "<main>\n<header>\n<p class=\"eyebrow\">unscatter {}</p>\n<h1>{}</h1>\n<p class=\"summary\">{}</p>\n\
         {}<dl class=\"tiles\">\n{}</dl>\n</header>\n",
        escaped(&report.command),
        escaped(&report.scene),
        summary(report),
        warnings(report),
        tiles(report)
    )
}

/// What a person should know, before all numbers.
fn warnings(report: &Report) -> String {
    if report.warnings.is_empty() {
        return String::new();
    }
    let item = |Warning { code, text, remedy }: &Warning| {
        let remedy =
            if remedy.is_empty() { String::new() } else { format!(" <em>{}.</em>", escaped(&upper(remedy))) };
        format!("<li id=\"{}\">{}.{remedy}</li>\n", escaped(code), escaped(&upper(text)))
    };
    let items: String = report.warnings.iter().map(item).collect();
    format!("<ul class=\"warnings\">\n{items}</ul>\n")
}

/// With a capital letter; a name at the beginning stays as it is.
fn upper(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string()).unwrap_or_default();
    first + letters.as_str()
}

fn summary(report: &Report) -> String {
    let residual = report.weighted_residual;
    let hue = match report.hue {
        Some(HueAngles { median, nine_tenths }) => {
            format!(
                ", hue is off by {} in the middle and by less than {} in nine of ten pixels",
                degrees(median),
                degrees((10.0 * nine_tenths).ceil() / 10.0)
            )
        }
        None => String::new(),
    };
    let time = total(report).map(|s| format!(", in {}", seconds(s))).unwrap_or_default();
    let nouns = &report.nouns;
    let frames = report.animation.as_ref().map(|animation| {
        let keys = counted(animation.keys.len() as u64, "key");
        format!(
            "{} of {} drawn, from {keys} ({}). ",
            count(animation.drawn),
            counted(animation.frames, "frame"),
            escaped(&animation.in_words())
        )
    });
    if !report.is_of_solve() {
        return format!("{}Nothing was looked for{time}.", frames.unwrap_or_default());
    }
    format!(
        "{}{}, {}: {}{hue}{time}. It stopped {}, after {}.",
        frames.unwrap_or_default(),
        counted(report.problem.views, "view"),
        escaped(&counted(wanted_pixels(report), &nouns.pixel)),
        escaped(&match residual.met() {
            Some(part) => format!("the {} is met to {}", nouns.wanted, percent(part)),
            None => format!("the {} asks for no change", nouns.wanted),
        }),
        escaped(&words::stopped(&report.stop.reason, nouns)),
        counted(report.stop.iteration, "iteration"),
    )
}

fn tiles(report: &Report) -> String {
    let time =
        total(report).map(|time| tile("Time", format!("<b>{}</b>", seconds(time)))).unwrap_or_default();
    if !report.is_of_solve() {
        return time;
    }
    let change = |before: String, after: String| {
        format!("<s>{before}</s><span aria-label=\"to\"> → </span><b>{after}</b>")
    };
    let residual = report.weighted_residual;
    let met = residual.met().map(|part| {
        tile(&label(&format!("{} met", report.nouns.wanted)), format!("<b>{}</b>", percent(part)))
    });
    let mut tiles = met.unwrap_or_default();
    tiles
        .push_str(&tile(&distance(&report.nouns), change(percent(residual.before), percent(residual.after))));
    if let Some(hue) = report.hue {
        tiles.push_str(&tile("Hue off by", format!("<b>{}</b>", degrees(hue.median))));
    }
    if let Some(light) = report.light {
        tiles.push_str(&tile(
            "Brightest texel",
            format!("<b>{:.2}</b> <span>× the light</span>", light.brightest),
        ));
    }
    let coverage = &report.coverage;
    let reached = format!("{} reached", label(&coverage.elements));
    tiles.push_str(&tile(&reached, format!("<b>{}</b>", percent(share(coverage.reached, coverage.total)))));
    tiles + &time
}

fn tile(name: &str, value: String) -> String {
    format!("<div><dt>{}</dt><dd>{value}</dd></div>\n", escaped(name))
}

/// What `weighted_residual` is called.
pub(super) fn distance(nouns: &Nouns) -> String {
    format!("Distance to the {}", nouns.wanted)
}

fn wanted_pixels(report: &Report) -> u64 {
    let sum = report.matched.iter().fold(0, |sum: u64, view| sum.saturating_add(view.painted_pixels));
    if sum > 0 { sum } else { report.problem.rows }
}

/// Seconds of the whole run, if the report has them.
fn total(report: &Report) -> Option<f64> {
    report.timings.get("total").copied().or_else(|| {
        let sum: f64 = report.timings.values().sum();
        (!report.timings.is_empty()).then_some(sum)
    })
}

/// The two charts and what they mean.
pub(super) fn convergence(report: &Report) -> Result<String> {
    if report.history.is_empty() {
        return Ok(String::new());
    }
    let mut charts = String::new();
    for chart in &plot::convergence_charts(&report.history) {
        // Inside HTML the namespace is understood, and a page without any address is plainly offline.
        let svg = plot::chart(chart)?.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1);
        charts.push_str(&format!("<figure class=\"chart\">{svg}</figure>\n"));
    }
    let [wanted, found] = [&report.nouns.wanted, &report.nouns.found].map(|noun| escaped(noun));
    let applications = report.history.last().map_or(0, |last| last.operator_applications as u64);
    Ok(format!(
        "<section>\n<h2>Convergence</h2>\n<div class=\"charts\">\n{charts}</div>\n<p>The residual is how far the \
         picture is from the {wanted}. It levels off where the {wanted} asks for what no {found} can show. The \
         normal residual is how much there is left to gain. It falls to zero at the best {found}. \
         The transport was applied {} in {}{}.</p>\n<p>{}</p>\n</section>\n",
        counted(applications, "time"),
        counted(report.stop.iteration, "iteration"),
        match report.set_up_applications {
            0 => String::new(),
            before => format!(", and {} before them", counted(before, "time")),
        },
        certificate(report),
    ))
}

/// The optimality certificate, in words.
fn certificate(report: &Report) -> String {
    let certificate = &report.certificate;
    let elements = escaped(&label(&report.problem.elements));
    let (gradient, bounds) = match certificate.kind.as_str() {
        "projected-gradient" => {
            ("projected gradient", format!("{elements} held at a bound: {}.", count(certificate.at_bounds)))
        }
        _ => ("gradient", format!("{elements} may be negative: this solver keeps no bounds.")),
    };
    let restarts = match certificate.restarts {
        0 => String::new(),
        restarts => format!(" The method began again {}.", counted(restarts, "time")),
    };
    format!(
        "Certificate: computed anew at the end, the {gradient} has {} of the norm that it started with, and the residual {}. \
         At the best {} the {gradient} would be zero. {bounds}{restarts}",
        number(worst(&certificate.value)),
        number(worst(&certificate.residual)),
        escaped(&report.nouns.found)
    )
}

/// The largest of the channels.
pub(super) fn worst(channels: &[f64; 3]) -> f64 {
    channels.iter().copied().fold(0.0, f64::max)
}

/// What was not computed, in words, the largest share first.
pub(super) fn skipped(report: &Report) -> String {
    if report.skipped.is_empty() {
        return String::new();
    }
    let mut entries: Vec<_> = report.skipped.iter().collect();
    entries.sort_by(|a, b| share(b.1.count, b.1.of).total_cmp(&share(a.1.count, a.1.of)));
    let rows: String = entries
        .into_iter()
        .map(|(name, skipped)| {
            let part = share(skipped.count, skipped.of);
            format!(
                "<tr><th>{}</th><td>{}</td><td class=\"of\">of {}</td><td class=\"meter\">{}</td><td>{}</td></tr>\n",
                escaped(&words::skipped(name, &report.coverage.elements)),
                count(skipped.count),
                count(skipped.of),
                bar(part),
                percent(part)
            )
        })
        .collect();
    format!(
        "<section>\n<h2>What was skipped</h2>\n<p>Work that did not have to be done, because the \
         result does not noticeably depend on it.</p>\n<table class=\"skipped\">\n<tbody>\n{rows}</tbody>\n</table>\n</section>\n"
    )
}

fn bar(part: f64) -> String {
    format!("<span class=\"bar\"><i style=\"width:{:.2}%\"></i></span>", 100.0 * part.clamp(0.0, 1.0))
}

/// Time and memory as bars, side by side.
pub(super) fn costs(report: &Report) -> String {
    let times: Vec<_> = report.timings.iter().map(|(name, &s)| (name, s, seconds(s))).collect();
    let memory: Vec<_> = report.memory.iter().map(|(name, &n)| (name, n as f64, bytes(n))).collect();
    let time_note = total(report).map(|s| format!("{} in all", seconds(s))).unwrap_or_default();
    let of_memory = |name: &str| report.memory.get(name).map(|&n| bytes(n));
    let memory_note = match (of_memory("peak"), of_memory("budget")) {
        (Some(peak), Some(budget)) => format!("{peak} at most, of {budget} allowed"),
        (Some(peak), None) => format!("{peak} at most"),
        (None, Some(budget)) => format!("{budget} allowed"),
        (None, None) => String::new(),
    };
    let both = bars("Time", &time_note, times) + &bars("Memory", &memory_note, memory);
    if both.is_empty() { both } else { format!("<div class=\"columns\">\n{both}</div>\n") }
}

/// Named amounts as bars, the largest first; those that sum up others are left to the note.
fn bars(title: &str, note: &str, mut parts: Vec<(&String, f64, String)>) -> String {
    if parts.is_empty() {
        return String::new();
    }
    let note = if note.is_empty() { String::new() } else { format!("<p>{note}</p>\n") };
    parts.retain(|(name, ..)| !["total", "peak", "budget"].contains(&name.as_str()));
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    let most = parts.first().map_or(1.0, |part| part.1.max(f64::MIN_POSITIVE));
    let rows: String = parts
        .into_iter()
        .map(|(name, amount, words)| {
            let name = escaped(&label(name));
            format!(
                "<tr><th>{name}</th><td class=\"meter\">{}</td><td>{words}</td></tr>\n",
                bar(amount / most)
            )
        })
        .collect();
    format!(
        "<section>\n<h2>{title}</h2>\n{note}<table class=\"bars\">\n<tbody>\n{rows}</tbody>\n</table>\n\
         </section>\n"
    )
}

/// How the problem was posed and solved.
pub(super) fn settings(report: &Report) -> String {
    let problem = &report.problem;
    let strategy = &report.strategy;
    let size = problem.size.iter().map(u64::to_string).collect::<Vec<_>>().join(" × ");
    let lattice = if size.is_empty() { size } else { format!(" ({size})") };
    let active = count(problem.active_unknowns);
    let mut pairs = vec![
        ("Colours are taken as".to_string(), report.target.clone()),
        ("Solver".into(), report.solver.clone()),
        (
            label(&problem.elements),
            format!("{}{lattice}, {active} of them unknowns", count(problem.unknowns)),
        ),
        ("Constraint pixels".into(), count(problem.rows)),
        ("Non-zeros".into(), count(problem.nonzeros)),
        (
            "Rows".into(),
            format!(
                "{}: {} kept, {} walked again",
                strategy.name,
                count(strategy.kept_rows),
                count(strategy.walked_rows)
            ),
        ),
        ("Regularization".into(), regularization(report)),
        ("Adjoint error".into(), number(report.adjoint_error)),
        ("Computed on".into(), computed_on(report)),
    ];
    pairs.extend(report.settings.iter().map(|(name, value)| (label(name), value.clone())));
    let rows: String = pairs
        .iter()
        .map(|(name, value)| format!("<div><dt>{}</dt><dd>{}</dd></div>\n", escaped(name), escaped(value)))
        .collect();
    format!("<section>\n<h2>Settings</h2>\n<dl class=\"settings\">\n{rows}</dl>\n</section>\n")
}

fn regularization(report: &Report) -> String {
    let lambda = &report.regularization;
    let named =
        [("Tikhonov", lambda.tikhonov), ("Laplacian", lambda.laplacian), ("gradient", lambda.gradient)];
    let used: Vec<_> = named
        .into_iter()
        .filter(|(_, weight)| *weight != 0.0)
        .map(|(name, weight)| format!("{name} {}", number(weight)))
        .collect();
    if used.is_empty() { "none".into() } else { used.join(", ") }
}

/// Who made the page, and the script of the comparison slider.
pub(super) fn closing(report: &Report) -> String {
    format!(
        "<footer>unscatter {}. The same numbers for programs are in report.json.</footer>\n</main>\n<script>\n{}\
         </script>\n</body>\n</html>\n",
        escaped(&report.version),
        include_str!("page.js")
    )
}

/// Backend and device in words, and what a graphics adapter had to do.
fn computed_on(report: &Report) -> String {
    let on = format!("{}, {}", report.backend, report.device);
    let Some(gpu) = &report.gpu else { return on };
    let trips =
        gpu.round_trips_an_iteration.map_or(String::new(), |trips| format!(" ({trips:.1} an iteration)"));
    let sums = match gpu.deterministic {
        true => "the same bits in every run",
        false => "sums in any order, so that last digits differ from run to run",
    };
    format!(
        "{on}; {} kernels, {} round trips{trips}, {} in use at the end; {sums}",
        count(gpu.dispatches),
        count(gpu.round_trips),
        bytes(gpu.bytes)
    )
}
