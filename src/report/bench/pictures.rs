//! Pictures of scattered light on the page of a benchmark: error against time, and how time grows with the maps.

use super::super::words::{bytes, escaped, number, seconds};
use super::data::{PictureRecord, exponent};
use super::figures::{figure, power, put};
use super::scatter::{Mark, Scatter};
use crate::Result;

/// Texels along a side of the maps of which charts are drawn, where there are several.
const CHARTED: usize = 1024;
/// The error that methods are compared at as maps grow: half of what 8 bits show.
pub const EQUAL_ERROR: f64 = 0.5 / 255.0;

/// The section; empty without records.
///
/// Errors: those of charts.
pub(super) fn section(records: &[PictureRecord]) -> Result<String> {
    if records.is_empty() {
        return Ok(String::new());
    }
    let mut text = "<section>\n<h2>Pictures of scattered light</h2>\n<p>The first view of each scene, first hits apart. Errors are root mean squares of the \
                    difference from the exact rows, relative to the brightest pixel; min-max trees draw the plain light, all others a light map. Numbers beside \
                    marks are steps, samples or coefficients.</p>\n"
        .to_owned();
    for (scene, size) in cases(records) {
        let of: Vec<&PictureRecord> =
            records.iter().filter(|it| it.scene == scene && [it.width, it.height] == size).collect();
        text.push_str(&figure(&chart(scene, size, &of))?);
    }
    text.push_str(&growth_table(records));
    text.push_str(&all(records));
    text.push_str("</section>\n");
    Ok(text)
}

/// Scenes and sizes of pictures, in their order.
fn cases(records: &[PictureRecord]) -> Vec<(&str, [usize; 2])> {
    let mut cases: Vec<(&str, [usize; 2])> = Vec::new();
    for record in records {
        let case = (record.scene.as_str(), [record.width, record.height]);
        if !cases.contains(&case) {
            cases.push(case);
        }
    }
    cases
}

fn chart(scene: &str, [width, height]: [usize; 2], of: &[&PictureRecord]) -> Scatter {
    let nearest = of.iter().map(|it| it.map).min_by_key(|map| map.abs_diff(CHARTED)).unwrap_or(CHARTED);
    let mut groups = Vec::new();
    let is_shown = |it: &&&PictureRecord| it.map == nearest && it.light_map == (it.method != "min-max");
    for record in of.iter().filter(is_shown).filter(|it| it.method != "exact") {
        let mark = Mark {
            at: [record.set_up_seconds + record.seconds, record.error],
            name: format!(
                "{}: error {}, {} and {} to set up",
                record.words(),
                number(record.error),
                seconds(record.seconds),
                seconds(record.set_up_seconds)
            ),
            label: record.number.map(|it| it.to_string()).unwrap_or_default(),
        };
        put(&mut groups, record.method.clone(), true, mark);
    }
    let exact = of.iter().find(|it| it.map == nearest && it.light_map && it.method == "exact");
    let beside = exact.map_or(String::new(), |it| format!("; exact: {}", seconds(it.seconds)));
    Scatter {
        title: format!("{scene}, {width} × {height}, maps of {nearest}²{beside}"),
        x: "seconds, set-up included".into(),
        y: "error".into(),
        groups,
    }
}

/// How one method's time grows with the maps.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureGrowth {
    /// The scene, and the size of the picture.
    pub scene: String,
    /// Pixels across and downwards.
    pub size: [usize; 2],
    /// The method.
    pub method: String,
    /// Texels along a side, seconds of a picture without its set-up, its number and its error. Of epipolar it is the quickest with an error of
    /// [`EQUAL_ERROR`] at most, or the one with the least error.
    pub points: Vec<(usize, f64, Option<usize>, f64)>,
    /// The e of seconds ~ side^e that fits best.
    pub exponent: Option<f64>,
}

/// How times grow with the maps, of the exact rows and of slices at equal error.
pub fn growth(records: &[PictureRecord]) -> Vec<PictureGrowth> {
    let mut all = Vec::new();
    for (scene, size) in cases(records) {
        for method in ["exact", "epipolar"] {
            let of = |it: &&PictureRecord| {
                it.scene == scene && [it.width, it.height] == size && it.light_map && it.method == method
            };
            let mut maps: Vec<usize> = records.iter().filter(of).map(|it| it.map).collect();
            maps.dedup();
            let chosen = |map: usize| {
                let of_map: Vec<&PictureRecord> =
                    records.iter().filter(of).filter(|it| it.map == map).collect();
                let good = of_map.iter().filter(|it| it.error <= EQUAL_ERROR);
                let quickest = good.min_by(|a, b| a.seconds.total_cmp(&b.seconds));
                quickest.or(of_map.iter().min_by(|a, b| a.error.total_cmp(&b.error))).copied()
            };
            let points: Vec<(usize, f64, Option<usize>, f64)> = maps
                .into_iter()
                .filter_map(chosen)
                .map(|it| (it.map, it.seconds, it.number, it.error))
                .collect();
            let fitted: Vec<[f64; 2]> = points.iter().map(|point| [point.0 as f64, point.1]).collect();
            if !points.is_empty() {
                let exponent = exponent(&fitted);
                all.push(PictureGrowth {
                    scene: scene.to_owned(),
                    size,
                    method: method.to_owned(),
                    points,
                    exponent,
                });
            }
        }
    }
    all
}

fn growth_table(records: &[PictureRecord]) -> String {
    let row = |growth: &PictureGrowth| {
        let points: Vec<String> = growth
            .points
            .iter()
            .map(|(map, time, samples, error)| {
                let samples = samples
                    .map_or(String::new(), |it| format!(" with {it} samples, error {}", number(*error)));
                format!("{map}²: {}{samples}", seconds(*time))
            })
            .collect();
        format!(
            "<tr><th>{}, {} × {}: {}</th><td>{}</td><td>{}</td></tr>\n",
            escaped(&growth.scene),
            growth.size[0],
            growth.size[1],
            escaped(&growth.method),
            points.join(" · "),
            power(growth.exponent)
        )
    };
    let rows: String = growth(records).iter().map(row).collect();
    format!(
        "<p>How the time of a picture under a light map grows with the side of the maps: seconds ~ side<sup>e</sup>. Of epipolar the quickest whose error is at most \
         half of what 8 bits show.</p>\n<table class=\"bench\">\n<thead><tr><th></th><th>maps</th><th>e</th></tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n"
    )
}

fn all(records: &[PictureRecord]) -> String {
    let row = |it: &PictureRecord| {
        format!(
            "<tr><th>{}, {} × {}, {}², {}: {}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.2} %</td><td>{}</td></tr>\n",
            escaped(&it.scene),
            it.width,
            it.height,
            it.map,
            if it.light_map { "light map" } else { "plain" },
            escaped(&it.words()),
            seconds(it.set_up_seconds),
            seconds(it.seconds),
            number(it.error),
            number(it.largest),
            100.0 * it.within,
            bytes(it.bytes)
        )
    };
    let rows: String = records.iter().map(row).collect();
    format!(
        "<details><summary>All pictures</summary>\n<table class=\"bench\">\n<thead><tr><th></th><th>set-up</th><th>time</th><th>error</th><th>largest</th>\
         <th>within 1/255</th><th>slices</th></tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n</details>\n"
    )
}
