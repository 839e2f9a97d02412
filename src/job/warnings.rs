//! What a painted scene and its light map give reason to warn of.

use crate::problem::{LightMapProblem, Maps, Match, UnseenAir, paint, seen_distances, unseen_air};
use crate::report::LightRecord;
use crate::scene::{Scene, Stroke, View};
use crate::visibility::{Behind, Geometry};
use crate::{Result, Warning};

/// A view through fog of more optical depths is grey, and through one of fewer shows no shafts.
const DEPTHS: [f64; 2] = [0.01, 8.0];
/// Pixels from one sampled ray of a view to the next, along both axes.
const PIXEL_STRIDE: usize = 16;
/// The part of the rays that must meet a surface for a view to have a depth.
const LEAST_HITS: f64 = 0.25;
/// The part of a stroke's paint without light from which on it lies in shadow.
const SHADOWED: f64 = 0.5;
/// Strokes of a view at most that are painted again to see whether they lie in shadow.
const MOST_STROKES: usize = 256;
/// The part of the painted pixels' light from outside the light map that is worth a word.
const OUTSIDE: f64 = 0.05;
/// The part of the painted pixels that contradict each other that is worth a word.
const CONTESTED: f64 = 0.2;
/// How much brighter than the light a texel is that is worth a word.
const BRIGHT: f64 = 1.5;
/// The part of the squared misfit at the start that is left when something of the wish is missing.
const MISSED: f64 = 0.01;
/// The part of the misfit that slightly higher bounds would take away, from which on they bind.
const HELD_BACK: f64 = 0.1;

/// Tells of views through which there is too much fog, or too little.
pub(super) fn tell_of_fog(scene: &Scene, geometry: &Geometry) {
    let sigma = scene.medium.sigma_t.iter().sum::<f64>() / 3.0;
    for view in &scene.views {
        let Some(distance) = depth_of(view, geometry) else { continue };
        let depths = sigma * distance;
        let (than, effect) = match depths {
            _ if depths > DEPTHS[1] => ("thick", "hides all that is behind it"),
            _ if depths < DEPTHS[0] => ("thin", "shows next to no light"),
            _ => continue,
        };
        let text = format!(
            "view `{}` looks through fog of {} optical depths (half of what it sees is nearer than {}, in the scene's unit): fog so {than} {effect}",
            view.name,
            figures(depths),
            figures(distance),
        );
        let remedy = format!(
            "set `medium.sigma_t={}`, which is one optical depth; or set `unit=cm` or another, if lengths are not in metres",
            figures(scene.metres_per_unit.recip() / distance)
        );
        Warning::new("fog-out-of-range", text, remedy).tell();
    }
}

/// Tells of heterogeneous air that no view sees.
pub(super) fn tell_of_air(scene: &Scene, geometry: &Geometry) {
    for unseen in unseen_air(scene, geometry) {
        let (code, text, remedy) = match unseen {
            UnseenAir::Box => (
                "unseen-air",
                "no view ray meets `looks.heterogeneity.bounds`, so that nothing of its blend volumes is seen".to_owned(),
                "leave `bounds` away, which fits them to what the views see",
            ),
            UnseenAir::Stroke(volume, number) => (
                "unseen-air",
                format!("no view sees strokes[{number}] of looks.heterogeneity.{volume}: it is hidden behind a surface, or beside all pictures"),
                "move it, or take it away",
            ),
        };
        Warning::new(code, text, remedy).tell();
    }
}

/// Tells of panes one behind the other of which there are too many.
pub(super) fn tell_of_panes(maps: &Maps) {
    let crowded = maps.shadow_map.behind().map_or(0, Behind::crowded);
    if crowded > 0 {
        let all = maps.shadow_map.grid().len() as f64;
        let text = format!(
            "light passes more than {} panes one behind the other in {:.1} % of the shadow map; those behind colour it where the last one does",
            Behind::MOST_PANES,
            100.0 * crowded as f64 / all
        );
        Warning::new("panes-too-many", text, "give what is there or is not a MASK in place of BLEND").tell();
    }
}

/// Tells of panes that hide what views of a volume would see through them.
pub(super) fn tell_of_hidden(geometry: &Geometry) {
    if geometry.has_panes() {
        let text = "some occluders let light through: it arrives coloured, but no view of a volume looks through them";
        Warning::new("panes-hide", text, "leave out panes between views and volume").tell();
    }
}

/// The median distance to the surfaces that a view sees; none where it sees few.
fn depth_of(view: &View, geometry: &Geometry) -> Option<f64> {
    let (distances, rays) = seen_distances(view, geometry, PIXEL_STRIDE);
    let sees_few = (distances.len() as f64) < LEAST_HITS * rays as f64;
    distances.get(distances.len() / 2).copied().filter(|_| !sees_few)
}

/// A number with two figures.
fn figures(value: f64) -> String {
    let decimals = (1.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{value:.decimals$}")
}

/// Tells of strokes on which no light falls.
pub(super) fn tell_of_shadow(scene: &Scene, problem: &LightMapProblem) -> Result<()> {
    for (index, view) in scene.views.iter().enumerate() {
        let rows = (0..problem.constraints.len()).filter(|&row| problem.constraints[row].view == index);
        let rows: Vec<usize> = rows.filter(|&row| problem.constraints[row].is_painted()).collect();
        // Most views have no such pixel, and need no stroke painted again.
        let dark_rows: Vec<usize> = rows.iter().copied().filter(|&row| problem.is_dark(row)).collect();
        let dark_pixels =
            || dark_rows.iter().map(|&row| [problem.constraints[row].x, problem.constraints[row].y]);
        let may_be_dark = |stroke: &&(usize, &Stroke)| may_cover(stroke.1, dark_pixels());
        let strokes: Vec<(usize, &Stroke)> = view.strokes.iter().enumerate().collect();
        let mut dark = Vec::new();
        for &(number, stroke) in strokes.iter().filter(may_be_dark).take(MOST_STROKES) {
            let share = unlit(problem, &rows, view, stroke)?;
            if share >= SHADOWED {
                dark.push((number, share));
            }
        }
        let remedy = "paint where light is seen, as `render` shows it, or take it away";
        if dark.len() == view.strokes.len() && dark.len() > 1 {
            let text = format!("all {} strokes of view `{}` lie in shadow", dark.len(), view.name);
            Warning::new("stroke-in-shadow", text, remedy).tell();
            continue;
        }
        for (number, share) in dark {
            let part = if share < 1.0 { format!("{:.0} % of it", 100.0 * share) } else { "it".to_owned() };
            let text =
                format!("strokes[{number}] of view `{}` lies in shadow: no light reaches {part}", view.name);
            Warning::new("stroke-in-shadow", text, remedy).tell();
        }
    }
    Ok(())
}

/// Whether any of some pixels lies in the box around a stroke.
fn may_cover(stroke: &Stroke, mut pixels: impl Iterator<Item = [usize; 2]>) -> bool {
    let sides = [0, 1].map(|axis| {
        let along = stroke.points.iter().map(|point| point[axis]);
        let (low, high) =
            (along.clone().fold(f32::INFINITY, f32::min), along.fold(f32::NEG_INFINITY, f32::max));
        low - stroke.radius - 1.0..high + stroke.radius + 1.0
    });
    pixels.any(|pixel| (0..2).all(|axis| sides[axis].contains(&(pixel[axis] as f32))))
}

/// The part of a stroke's paint that no light reaches; `rows` are those of its view.
fn unlit(problem: &LightMapProblem, rows: &[usize], view: &View, stroke: &Stroke) -> Result<f64> {
    let alone = View { strokes: vec![stroke.clone()], layers: Vec::new(), ..view.clone() };
    let painting = paint(&alone)?.colors;
    let (mut dark, mut all) = (0.0, 0.0);
    for &row in rows {
        let pixel = &problem.constraints[row];
        let opacity = f64::from(painting.pixels[pixel.y * painting.size()[0] + pixel.x][3]);
        if opacity > 0.0 {
            all += opacity;
            if problem.is_dark(row) {
                dark += opacity;
            }
        }
    }
    Ok(if all > 0.0 { dark / all } else { 0.0 })
}

/// Tells of a transfer function in which paint contradicts other paint.
pub(super) fn tell_of_contested_function(matched: &Match) {
    let contested = matched.contested as f64 / matched.pixels.max(1) as f64;
    if contested > CONTESTED {
        let text = format!(
            "{:.0} % of the painted pixels have the axes' values of paint of another colour; no function meets both",
            100.0 * contested
        );
        let remedy =
            "give paint on rays of the same visibility and depth one colour, or look for a light map";
        Warning::new("contradicted-paint", text, remedy).tell();
    }
}

/// Tells of what a light map that was found cannot do.
pub(super) fn tell_of_light(
    scene: &Scene,
    light: &LightRecord,
    (matched, missed): (&Match, f64),
    painted_views: usize,
) {
    let LightRecord { brightest, outside, held_back } = *light;
    if outside > OUTSIDE {
        let text = format!(
            "{:.0} % of the painted pixels' light comes from outside the light map, where it keeps its colour",
            100.0 * outside
        );
        let remedy = "leave `light_map.extent` away, and set `light_map.fit=scattered`";
        Warning::new("light-from-outside", text, remedy).tell();
    }
    let contested = matched.contested as f64 / matched.pixels.max(1) as f64;
    if contested > CONTESTED {
        let whose = if painted_views > 1 { "in another view or in the same one" } else { "in the same view" };
        let text = format!(
            "{:.0} % of the painted pixels share their light with paint of another colour, {whose}; no light map meets both",
            100.0 * contested
        );
        Warning::new(
            "contradicted-paint",
            text,
            "give all paint on one shaft the same colour: a shaft has one colour from end to end",
        )
        .tell();
    }
    if brightest > BRIGHT {
        let text = format!(
            "the light map has texels of {brightest:.1} times the light's radiance, which no slide has"
        );
        Warning::new("brightest-texel", text, "set `light_map.gobo=true`").tell();
    }
    // Where the paint is met nobody asks for more.
    if held_back > HELD_BACK && missed > MISSED {
        let text = format!(
            "the light map may not be brighter than it is: were its bound a tenth higher, the squared misfit would fall by about {:.0} %",
            100.0 * held_back
        );
        let upper = scene.solve.bounds[1].map(|bound| (2.0 * bound * 1e3).round() / 1e3);
        Warning::new(
            "bounds-bind",
            text,
            format!("paint darker, or set `solve.upper={upper:?}` or `light_map.gobo=false`"),
        )
        .tell();
    }
}
