//! The one offline page: pictures first, then the numbers.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::data::{Change, Coverage, KeyRecord, Report, StageRecord, ViewMatch};
use super::page;
use super::words::{count, counted, degrees, escaped, number, percent, share};
use crate::problem::Nouns;
use crate::{Error, Result};

/// The pictures of a page, each a PNG file in memory.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Pictures {
    /// One entry a view, in the order of the page.
    pub views: Vec<ViewPictures>,
    /// What was found, where one picture shows it.
    pub found: Option<FoundPicture>,
    /// How strongly the painted pixels determine each of its texels.
    pub coverage: Option<Vec<u8>>,
    /// What was found from all around, the first picture from the front.
    pub turntable: Vec<Vec<u8>>,
    /// Some frames of an animation, each its number and a small picture.
    pub frames: Vec<(u64, Vec<u8>)>,
    /// The light from everywhere as a latitude-longitude picture, where that was found.
    pub environment: Option<Vec<u8>>,
}

/// A picture of what was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundPicture {
    /// What it is.
    pub title: &'static str,
    /// What it shows, in a few words.
    pub about: String,
    /// The PNG file.
    pub png: Vec<u8>,
}

/// The pictures of one view, each a PNG file in memory.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ViewPictures {
    /// Name of the view, the same as in [`ViewMatch::view`].
    pub name: String,
    /// What is wanted.
    pub target: Vec<u8>,
    /// The view under the start.
    pub before: Vec<u8>,
    /// The view under what was found.
    pub after: Vec<u8>,
    /// How far the picture misses what is wanted.
    pub difference: Vec<u8>,
}

/// What a browser may load for the page: what is in it, and nothing else.
const POLICY: &str =
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// The page `report.html`: one file that needs no other and no network.
///
/// Shapes  the pictures may be of any size; those of one view are of one size
/// Errors  [`Error::NonFinite`] as [`Report::to_json`]; [`Error::Value`] for a picture that is not PNG
/// Cost    4/3 of the bytes of all pictures; each is in the page once
pub fn html(report: &Report, pictures: &Pictures) -> Result<String> {
    report.finite()?;
    if !report.is_of_solve() {
        let frames = format!("<section>\n<h2>Frames</h2>\n{}</section>\n", turns(report, pictures)?);
        let parts = [head(report), page::opening(report), frames, page::costs(report), page::closing(report)];
        return Ok(parts.concat());
    }
    let parts = [
        head(report),
        page::opening(report),
        found(report, pictures)?,
        views(report, pictures)?,
        page::convergence(report)?,
        page::skipped(report),
        page::costs(report),
        page::settings(report),
        page::closing(report),
    ];
    Ok(parts.concat())
}

fn head(report: &Report) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
         <title>{} · unscatter</title>\n<style>\n{}</style>\n</head>\n<body>\n",
        escaped(&report.scene),
        include_str!("page.css")
    )
}

/// What was found, as far as there are pictures of it, and how it was found.
fn found(report: &Report, pictures: &Pictures) -> Result<String> {
    let found = match &pictures.found {
        Some(FoundPicture { title, about, png }) => figure("found", title, about, "found", png)?,
        None => String::new(),
    };
    let reach = match &pictures.coverage {
        Some(png) => figure("coverage", "Coverage", "how strongly the pixels determine it", "coverage", png)?,
        None => String::new(),
    };
    let coverage = coverage(report);
    let maps = match found.is_empty() {
        true => coverage,
        false => {
            format!("<div class=\"maps\">\n{found}<div class=\"beside\">\n{coverage}{reach}</div>\n</div>\n")
        }
    };
    let around = match &report.surroundings {
        Some(found) => format!("<p>Around the light map: {}.</p>\n", escaped(&found.in_words())),
        None => String::new(),
    };
    Ok(format!(
        "<section>\n<h2>What was found</h2>\n{}{maps}{around}{}{}</section>\n",
        turns(report, pictures)?,
        environment(pictures)?,
        stages(report),
    ))
}

/// What was found from all around, and some frames.
fn turns(report: &Report, pictures: &Pictures) -> Result<String> {
    let mut turns = String::new();
    for (index, png) in pictures.turntable.iter().enumerate() {
        let angle = degrees(360.0 * index as f64 / pictures.turntable.len() as f64);
        turns += &figure("turn", &angle, "", &format!("turntable[{index}]"), png)?;
    }
    let keys = report.animation.iter().flat_map(|animation| &animation.keys);
    for (index, (frame, png)) in pictures.frames.iter().enumerate() {
        let note = keys.clone().find(|key| key.frame == *frame).map(|key| match key.weighted_residual {
            Some(Change { before, after }) => format!("key, {} → {} away", percent(before), percent(after)),
            None => "key".to_owned(),
        });
        let (title, path) = (format!("Frame {frame}"), format!("frames[{index}]"));
        turns += &figure("turn", &title, &note.unwrap_or_default(), &path, png)?;
    }
    Ok(if turns.is_empty() { turns } else { format!("<div class=\"turns\">\n{turns}</div>\n") })
}

/// Which elements the pixels determine, and what became of the others.
fn coverage(report: &Report) -> String {
    let Coverage { elements, reached, total, unreached, joined, filled, weak } = &report.coverage;
    let pixel = escaped(&report.nouns.pixel);
    let weak = match weak {
        Some(weak) if *weak > 0 => {
            format!(" {} of those weigh so little that mostly the regularization decides them.", count(*weak))
        }
        _ => String::new(),
    };
    let others = match (filled, joined) {
        (Some(_), _) => "were filled from their neighbours".to_owned(),
        (None, Some(joined)) if *joined > 0 => {
            format!(
                "keep their start value, but for {} that some view sees, into which what was found fades",
                count(*joined)
            )
        }
        _ => "keep their start value".to_owned(),
    };
    let sum = |of: fn(&KeyRecord) -> u64| {
        report.animation.iter().flat_map(|animation| &animation.keys).map(of).sum::<u64>()
    };
    let spread = match sum(|key| key.spread_voxels) {
        0 => String::new(),
        voxels => format!(
            " At all keys together, diffusion then filled {}, in {}: those with extinction at some frame that no {pixel} reaches.",
            counted(voxels, "voxel"),
            counted(sum(|key| key.spread_iterations), "iteration")
        ),
    };
    format!(
        "<p>The {pixel}s reach {} of {} {} ({}).{weak} The other {} {others}: no {pixel} says anything about them.{spread}</p>\n",
        count(*reached),
        count(*total),
        escaped(elements),
        percent(share(*reached, *total)),
        count(*unreached),
    )
}

/// The light from everywhere, where that was found.
fn environment(pictures: &Pictures) -> Result<String> {
    let note = "all directions: up at the top, −Z in the middle";
    let picture = pictures.environment.as_ref();
    let figure = picture.map(|png| figure("sky", "The light around it", note, "environment", png));
    Ok(figure.transpose()?.unwrap_or_default())
}

/// The table of what was looked for in turn, where there are stages.
fn stages(report: &Report) -> String {
    if report.stages.is_empty() {
        return String::new();
    }
    let has_rounds = report.stages.iter().any(|stage| stage.round > 1);
    let stages: String = report.stages.iter().map(|record| stage(record, has_rounds)).collect();
    format!(
        "<table class=\"facts stages\">\n<thead><tr><th>looked for</th><th>pixels</th><th>unknowns</th>\
         <th>iterations</th><th>gradient left</th><th>before</th><th>after</th></tr></thead>\n<tbody>\n{stages}</tbody>\n</table>\n"
    )
}

/// One line of the table of what was looked for.
fn stage(stage: &StageRecord, has_rounds: bool) -> String {
    format!(
        "<tr><th>{}{}{}</th><td>{}</td><td>{} {}</td><td>{}, {}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
        if has_rounds { format!("{}. ", stage.round) } else { String::new() },
        escaped(&stage.label()),
        if stage.is_taken { "" } else { " (not taken)" },
        count(stage.problem.rows),
        count(stage.problem.active_unknowns),
        escaped(&stage.problem.elements),
        count(stage.stop.iteration),
        match stage.stop.reason.as_str() {
            "tolerance" => "converged".to_owned(),
            "iterations" => "the limit".to_owned(),
            other => escaped(other),
        },
        number(page::worst(&stage.certificate.value)),
        percent(stage.weighted_residual.before),
        percent(stage.weighted_residual.after),
    )
}

fn views(report: &Report, pictures: &Pictures) -> Result<String> {
    let mut sections = String::new();
    for (index, view) in pictures.views.iter().enumerate() {
        let matched = report.matched.iter().find(|matched| matched.view == view.name);
        sections.push_str(&one_view(index, view, matched, &report.nouns)?);
    }
    if pictures.views.is_empty() {
        // No pictures were asked for; there are numbers of the views all the same.
        let numbers = |matched: &ViewMatch| {
            let facts = facts(matched, &report.nouns);
            format!("<article class=\"view\">\n<h3>{}</h3>\n{facts}</article>\n", escaped(&matched.view))
        };
        sections.extend(report.matched.iter().map(numbers));
    }
    if sections.is_empty() {
        return Ok(sections);
    }
    Ok(format!("<section>\n<h2>Views</h2>\n{sections}</section>\n"))
}

fn one_view(index: usize, view: &ViewPictures, matched: Option<&ViewMatch>, nouns: &Nouns) -> Result<String> {
    let part = |class, title, note: &str, name: &str, png| {
        figure(class, title, note, &format!("views[{index}].{name}"), png)
    };
    let facts = matched.map(|matched| facts(matched, nouns)).unwrap_or_default();
    let misses = format!("how far the picture misses the {}", escaped(&nouns.wanted));
    Ok(format!(
        "<article class=\"view\">\n<h3>{}</h3>\n<div class=\"pictures\">\n{}{}{}\
         <figure class=\"compare\" hidden></figure>\n<div class=\"aside\">\n{}{facts}</div>\n</div>\n</article>\n",
        escaped(&view.name),
        part("target", "Target", "what the picture should show", "target", &view.target)?,
        part("before", "Before", "the picture at the start", "before", &view.before)?,
        part("after", "After", "the picture with what was found", "after", &view.after)?,
        part("difference", "Difference", &misses, "difference", &view.difference)?,
    ))
}

/// How well a view matches, as a small table.
fn facts(matched: &ViewMatch, nouns: &Nouns) -> String {
    let mut rows = row(&escaped(&page::distance(nouns)), matched.weighted_residual, percent);
    if let Some(error) = matched.hue_error {
        rows.push_str(&row("Hue error", error, degrees));
    }
    if let Some(error) = matched.uncontested_hue_error {
        rows.push_str(&row("… where views agree", error, degrees));
    }
    let agreeing = match matched.uncontested_pixels {
        Some(pixels) => format!(", {} of them not contradicted by another view", count(pixels)),
        None => String::new(),
    };
    format!(
        "<table class=\"facts\">\n<thead><tr><th></th><th>before</th><th>after</th></tr></thead>\n\
         <tbody>\n{rows}</tbody>\n</table>\n<p class=\"note\">{}{agreeing}.</p>\n",
        escaped(&counted(matched.painted_pixels, &nouns.pixel))
    )
}

fn row(name: &str, change: Change, words: fn(f64) -> String) -> String {
    format!("<tr><th>{name}</th><td>{}</td><td>{}</td></tr>\n", words(change.before), words(change.after))
}

/// A picture with its caption; `path` names it should it not be PNG.
fn figure(class: &str, title: &str, note: &str, path: &str, png: &[u8]) -> Result<String> {
    let [width, height] = png_size(png).ok_or_else(|| {
        let got = format!("a picture of {} bytes that are not PNG", png.len());
        Error::value(format!("pictures.{path}"), got, "a whole PNG file")
    })?;
    let mut text = format!(
        "<figure class=\"{class}\"><img alt=\"{title}\" width=\"{width}\" height=\"{height}\" \
         src=\"data:image/png;base64,"
    );
    STANDARD.encode_string(png, &mut text);
    text.push_str(&format!("\"><figcaption><b>{title}</b> {note}</figcaption></figure>\n"));
    Ok(text)
}

/// Width and height as a PNG file states them, so that the page does not jump while it loads.
fn png_size(png: &[u8]) -> Option<[u32; 2]> {
    let header = png.strip_prefix(b"\x89PNG\r\n\x1a\n")?.get(4..16)?.strip_prefix(b"IHDR")?;
    let (width, height) = (header.get(..4)?.try_into().ok()?, header.get(4..)?.try_into().ok()?);
    Some([u32::from_be_bytes(width), u32::from_be_bytes(height)]).filter(|size| !size.contains(&0))
}

#[cfg(test)]
mod tests;
