//! The one offline page: pictures first, then the numbers.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::data::{AnimationRecord, Change, Report, StageRecord, ViewMatch};
use super::page;
use super::words::{Nouns, count, counted, degrees, escaped, percent};
use crate::{Error, Result};

/// The pictures of a page, each a PNG file in memory.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Pictures {
    /// One entry a view, in the order of the page.
    pub views: Vec<ViewPictures>,
    /// The light map that was found.
    pub light_map: Vec<u8>,
    /// How strongly the painted pixels determine each of its texels.
    pub coverage: Option<Vec<u8>>,
    /// What was found from all around, in place of a light map.
    pub turntable: Vec<Vec<u8>>,
    /// Some frames of an animation, small: their numbers and pictures.
    pub frames: Vec<(u64, Vec<u8>)>,
    /// The light around it as a latitude-longitude picture, where that was found.
    pub environment: Option<Vec<u8>>,
}

/// The pictures of one view, each a PNG file in memory.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ViewPictures {
    /// Name of the view, the same as in [`ViewMatch::view`].
    pub name: String,
    /// What was painted.
    pub target: Vec<u8>,
    /// The view under the start.
    pub before: Vec<u8>,
    /// The view under what was found.
    pub after: Vec<u8>,
    /// How far the scattered light misses what was painted.
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

/// What was found: a light map, or a volume from all around.
fn found(report: &Report, pictures: &Pictures) -> Result<String> {
    if report.is_of_volume() { volume(report, pictures) } else { light_map(report, pictures) }
}

fn volume(report: &Report, pictures: &Pictures) -> Result<String> {
    let turns: String = pictures
        .turntable
        .iter()
        .enumerate()
        .map(|(index, png)| {
            let angle = degrees(360.0 * index as f64 / pictures.turntable.len() as f64);
            figure("turn", &angle, "", &format!("turntable[{index}]"), png)
        })
        .collect::<Result<_>>()?;
    let strip: String = pictures
        .frames
        .iter()
        .enumerate()
        .map(|(index, (frame, png))| {
            let is_key = |animation: &AnimationRecord| animation.keys.iter().any(|key| key.frame == *frame);
            let note = if report.animation.as_ref().is_some_and(is_key) { "key" } else { "" };
            figure("turn", &format!("Frame {frame}"), note, &format!("frames[{index}]"), png)
        })
        .collect::<Result<_>>()?;
    let turns = turns + &strip;
    let has_rounds = report.stages.iter().any(|stage| stage.round > 1);
    let stages: String = report.stages.iter().map(|record| stage(record, has_rounds)).collect();
    let environment = environment(pictures)?;
    let turns = match turns.is_empty() {
        true => turns,
        false => format!("<div class=\"turns\">\n{turns}</div>\n"),
    };
    let of_lights = report.stages.last().is_some_and(|last| last.unknowns() == "lights");
    Ok(format!(
        "<section>\n<h2>Volume</h2>\n{turns}{environment}<table class=\"facts stages\">\n<thead><tr><th>looked for\
         </th><th>pixels</th><th>unknowns</th><th>iterations</th><th>before</th><th>after</th></tr></thead>\n<tbody>\n{stages}</tbody>\n\
         </table>\n<p>{}</p>\n</section>\n",
        unreached(report, if of_lights { "Lights" } else { "Voxels" }),
    ))
}

/// What became of the unknowns that no wanted ray reaches.
fn unreached(report: &Report, unknowns: &str) -> String {
    if let Some(animation) = &report.animation {
        let filled = animation.keys.iter().map(|key| key.spread_voxels).sum();
        return format!(
            "Voxels with extinction at some frame that no wanted ray reaches at a key were filled there by diffusion: {} at all \
             keys together.",
            count(filled)
        );
    }
    format!(
        "{unknowns} that no wanted ray reaches keep their start value: {} of {}.",
        count(report.coverage.unreached),
        count(report.coverage.total),
    )
}

/// The light from everywhere, where that was found.
fn environment(pictures: &Pictures) -> Result<String> {
    let note = "all directions: up at the top, −Z in the middle";
    let picture = pictures.environment.as_ref();
    let figure = picture.map(|png| figure("sky", "The light around it", note, "environment", png));
    Ok(figure.transpose()?.unwrap_or_default())
}

/// One line of the table of what was looked for.
fn stage(stage: &StageRecord, has_rounds: bool) -> String {
    format!(
        "<tr><th>{}{}{}</th><td>{}</td><td>{} {}</td><td>{}, {}</td><td>{}</td><td>{}</td></tr>\n",
        if has_rounds { format!("{}. ", stage.round) } else { String::new() },
        escaped(&stage.label()),
        if stage.is_taken { "" } else { " (not taken)" },
        count(stage.problem.rows),
        count(stage.problem.active_unknowns),
        stage.unknowns(),
        count(stage.stop.iteration),
        match stage.stop.reason.as_str() {
            "tolerance" | "exact" => "converged".to_owned(),
            "iterations" => "the limit".to_owned(),
            other => escaped(other),
        },
        percent(stage.weighted_residual.before),
        percent(stage.weighted_residual.after),
    )
}

fn light_map(report: &Report, pictures: &Pictures) -> Result<String> {
    let coverage = &report.coverage;
    let found =
        figure("found", "The light map", "what the light passes through", "light_map", &pictures.light_map)?;
    let reach = match &pictures.coverage {
        Some(png) => figure("coverage", "Coverage", "where the painted pixels reach it", "coverage", png)?,
        None => String::new(),
    };
    let weak = match coverage.weak {
        Some(weak) if weak > 0 => format!(
            " Of those, {} get so little light to the paint that mostly the regularization decides them.",
            count(weak)
        ),
        _ => String::new(),
    };
    let others = match coverage.filled {
        Some(_) => "were filled from their neighbours",
        None => "keep their start value",
    };
    let around = match &report.surroundings {
        Some(found) => {
            format!(
                "<p>Around the light map: {}.</p>\n{}",
                escaped(&found.in_words()),
                environment(pictures)?
            )
        }
        None => String::new(),
    };
    Ok(format!(
        "<section>\n<h2>Light map</h2>\n<div class=\"maps\">\n{found}<div class=\"beside\">\n<p>The painted pixels reach {} \
         of its {} texels ({}).{weak} The other {} {others}: no stroke says anything about \
         them.</p>\n{reach}</div>\n</div>\n{around}</section>\n",
        count(coverage.reached),
        count(coverage.total),
        percent(super::words::share(coverage.reached, coverage.total)),
        count(coverage.unreached),
    ))
}

fn views(report: &Report, pictures: &Pictures) -> Result<String> {
    let mut sections = String::new();
    for (index, view) in pictures.views.iter().enumerate() {
        let matched = report.matched.iter().find(|matched| matched.view == view.name);
        sections.push_str(&one_view(index, view, matched, &Nouns::of(report))?);
    }
    if pictures.views.is_empty() {
        // No pictures were asked for, and their numbers are there.
        let numbers = |matched: &ViewMatch| {
            let facts = facts(matched, &Nouns::of(report));
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
    let part = |class, title, note, name: &str, png| {
        figure(class, title, note, &format!("views[{index}].{name}"), png)
    };
    let facts = matched.map(|matched| facts(matched, nouns)).unwrap_or_default();
    Ok(format!(
        "<article class=\"view\">\n<h3>{}</h3>\n<div class=\"pictures\">\n{}{}{}\
         <figure class=\"compare\" hidden></figure>\n<div class=\"aside\">\n{}{facts}</div>\n</div>\n</article>\n",
        escaped(&view.name),
        part("target", "Target", nouns.target, "target", &view.target)?,
        part("before", "Before", nouns.before, "before", &view.before)?,
        part("after", "After", nouns.after, "after", &view.after)?,
        part("difference", "Difference", nouns.difference, "difference", &view.difference)?,
    ))
}

/// How well a view matches, as a small table.
fn facts(matched: &ViewMatch, nouns: &Nouns) -> String {
    let mut rows = row(nouns.distance, matched.weighted_residual, percent);
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
        counted(matched.painted_pixels, nouns.pixel)
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
