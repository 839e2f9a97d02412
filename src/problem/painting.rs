use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;

use super::segment::Segment;
use crate::scene::{RgbaImage, Stroke, View};
use crate::{Error, Result};

/// Less opacity than this is no paint; half of what one code of an 8-bit alpha is worth.
const LEAST_OPACITY: f32 = 1.0 / 512.0;

/// Pixels that all strokes of a view may put paint on, one stroke over the other: minutes of work.
const MOST_PAINTED: u64 = 1 << 35;

/// Samples along each side of a pixel on the rim of a stroke.
const SAMPLES: usize = 4;

/// How wide the rim of the hardest stroke is, in pixels: what one sample stands for, so that samples do not alias.
const SHARPEST: f64 = 1.0 / SAMPLES as f64;

/// Pixels along each side of the parts of a picture whose segments are sorted out together.
const TILE: usize = 16;

/// Edges of strokes that are no wider than this, in pixels, say nothing of the light.
const EDGE: f64 = 4.0;

/// Of distances, relative: far more than that of f64.
const ROUNDING: f64 = 1e-9;

/// Beyond this distance in pixels from its centre there is nothing of a pixel.
const HALF_DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// What is painted on a picture.
///
/// Shapes  one entry a pixel
#[derive(Debug, Clone, PartialEq)]
pub struct Painting {
    /// Straight linear colour, and in alpha the opacity of the paint; 0 where there is none.
    pub colors: RgbaImage,
    /// How far the paint of each pixel goes from what is there to its colour.
    pub strengths: Vec<f32>,
    /// How much of each pixel has paint, whatever its opacity: less than all on the edges of strokes.
    pub coverage: Vec<f32>,
    /// The weight of the paint in the solve, whatever its opacity and coverage.
    pub weights: Vec<f32>,
}

/// What is painted on a view: its layers from the bottom up, then its strokes in order, each over what is there.
///
/// With opacity a₁ over a₀ it becomes a = a₁ + a₀(1 − a₁), and the colour (c₁a₁ + c₀a₀(1 − a₁)) / a. Coverage is laid over as opacity is;
/// strength and weight are mixed by it as a colour is by opacity. Opacities below 1/512 become 0. Layers have a weight of 1, and their alpha is
/// opacity, strength and coverage.
///
/// A stroke that erases takes away the share of opacity, strength and coverage that it would put on.
///
/// A stroke covers all inside hardness · radius, and from there its coverage falls linearly to 0 at its radius; its opacity there is its own
/// times that. Its strength is its opacity times the coverage 4 pixels farther inside: a narrow edge is one that light need not have, and
/// asks for the whole colour with less weight, while a wide one asks for a gradient. Both radii are measured by the exact distance from its polyline, so caps and joins are round and a stroke that crosses itself is no
/// heavier there. Where the pen was pressed less, distances count for more: the stroke is the union of discs along it whose radius changes with the pressure.
///
/// Errors: [`Error::Shape`] for a layer that is not of the view's size; [`Error::Value`] for a layer or a stroke with
/// numbers that cannot be, and for a stroke that reaches no pixel; [`Error::TooLarge`] for more strokes than can be painted in minutes.
/// Cost: the pixels of a stroke times the segments that are about as near as the nearest; bit-identical for any number of threads.
pub fn paint(view: &View) -> Result<Painting> {
    let size = view.camera.size();
    let mut pixels = vec![Pixel::default(); size[0] * size[1]];
    for (index, layer) in view.layers.iter().enumerate() {
        check_layer(layer, size).map_err(|error| error.inside(&format!("{}.layers[{index}]", view.name)))?;
        for (below, &[r, g, b, opacity]) in pixels.iter_mut().zip(&layer.pixels) {
            below.put_over([r, g, b], 1.0, [opacity; 3]);
        }
    }
    let place = |index: usize| format!("{}.strokes[{index}]", view.name);
    let brushes = view.strokes.iter().enumerate();
    let brushes =
        brushes.map(|(index, stroke)| Brush::new(stroke).map_err(|error| error.inside(&place(index))));
    let brushes: Vec<Brush> = brushes.collect::<Result<_>>()?;
    check_work(&view.name, &brushes, size)?;
    for (index, brush) in brushes.iter().enumerate() {
        if !brush.paint(&mut pixels, size) {
            let expected = "a stroke that reaches a pixel of the picture with an opacity of at least 1/512";
            return Err(Error::value(place(index), brush.description(size), expected));
        }
    }
    pixels
        .iter_mut()
        .filter(|pixel| pixel.opacity < LEAST_OPACITY)
        .for_each(|pixel| *pixel = Pixel::default());
    let mut colors = RgbaImage::transparent(size);
    for (pixel, Pixel { color: [r, g, b], opacity, .. }) in colors.pixels.iter_mut().zip(&pixels) {
        *pixel = [*r, *g, *b, *opacity];
    }
    let of = |number: fn(&Pixel) -> f32| pixels.iter().map(number).collect();
    Ok(Painting {
        colors,
        strengths: of(|pixel| pixel.strength),
        coverage: of(|pixel| pixel.coverage),
        weights: of(|pixel| pixel.weight),
    })
}

/// Whether strokes can be painted in minutes.
fn check_work(view: &str, brushes: &[Brush<'_>], size: [usize; 2]) -> Result<()> {
    let pixels =
        |brush: &Brush<'_>| brush.reach(size).iter().map(|range| range.len() as u64).product::<u64>();
    let needed: u64 = brushes.iter().map(pixels).sum();
    if needed <= MOST_PAINTED {
        return Ok(());
    }
    Err(Error::TooLarge {
        what: format!("painting the {} strokes of view `{view}`", brushes.len()),
        needed: format!("{needed} pixels"),
        limit: MOST_PAINTED.to_string(),
        remedy: "paint them as a layer, or with smaller radii",
    })
}

fn check_layer(layer: &RgbaImage, [width, height]: [usize; 2]) -> Result<()> {
    if layer.size() != [width, height] || layer.pixels.len() != width * height {
        return Err(Error::Shape {
            what: "a painted layer",
            expected: width * height,
            got: layer.pixels.len(),
        });
    }
    let is_possible = |p: &[f32; 4]| p.iter().all(|c| c.is_finite()) && (0.0..=1.0).contains(&p[3]);
    match layer.pixels.iter().position(|pixel| !is_possible(pixel)) {
        None => Ok(()),
        Some(index) => {
            let place = format!("pixel ({}, {})", index % width, index / width);
            let got = format!("{:?}", layer.pixels[index]);
            Err(Error::value(place, got, "finite, with a weight between 0 and 1"))
        }
    }
}

/// One pixel of a painting.
#[derive(Debug, Clone, Copy, Default)]
struct Pixel {
    color: [f32; 3],
    opacity: f32,
    strength: f32,
    coverage: f32,
    weight: f32,
}

impl Pixel {
    fn put_over(&mut self, color: [f32; 3], weight: f32, [opacity, strength, coverage]: [f32; 3]) {
        if opacity <= 0.0 {
            return;
        }
        // What is there of both, and the share of the new one: one exactly where nothing was, so that paint comes through as it is.
        let over = |new: f32, old: f32| {
            let sum = new + old * (1.0 - new);
            (sum, if old > 0.0 { new / sum } else { 1.0 })
        };
        let mix = |new: f32, old: f32, share: f32| new * share + old * (1.0 - share);
        let (opacity, of_color) = over(opacity, self.opacity);
        let strength = strength + self.strength * self.coverage * (1.0 - strength);
        let (coverage, of_weight) = over(coverage, self.coverage);
        *self = Self {
            color: std::array::from_fn(|c| mix(color[c], self.color[c], of_color)),
            opacity,
            strength: mix(strength, self.strength, of_weight),
            coverage,
            weight: mix(weight, self.weight, of_weight),
        };
    }

    fn take_away(&mut self, [opacity, strength, coverage]: [f32; 3]) {
        self.opacity *= 1.0 - opacity;
        self.strength *= 1.0 - strength;
        self.coverage *= 1.0 - coverage;
    }
}

/// A stroke ready to be put on a picture, in f64 so that long segments keep thin rims.
struct Brush<'s> {
    stroke: &'s Stroke,
    segments: Vec<Segment>,
    /// The distance in pixels up to which it covers all; negative when it is thinner than a sample.
    inner: f64,
    /// The distance from which it covers nothing.
    outer: f64,
    /// The most that its distance changes a pixel.
    steepest: f64,
}

impl<'s> Brush<'s> {
    fn new(stroke: &'s Stroke) -> Result<Self> {
        check_stroke(stroke)?;
        let point = |p: [f32; 2]| DVec2::new(p[0].into(), p[1].into());
        let pressure = |i: usize| stroke.pressure.get(i).map_or(1.0, |&pressure| f64::from(pressure));
        let segments = match stroke.points.as_slice() {
            &[dab] => vec![Segment::new([point(dab); 2], [pressure(0); 2])],
            points => {
                let ends = points.windows(2).enumerate();
                ends.map(|(i, ends)| {
                    Segment::new([0, 1].map(|end| point(ends[end])), [pressure(i), pressure(i + 1)])
                })
                .collect()
            }
        };
        let radius = f64::from(stroke.radius);
        let middle = 0.5 * radius * (1.0 + f64::from(stroke.hardness));
        let half_rim = (0.5 * radius * (1.0 - f64::from(stroke.hardness))).max(0.5 * SHARPEST);
        let steepest = segments.iter().map(|segment| segment.steepest).fold(1.0, f64::max);
        Ok(Self { stroke, segments, inner: middle - half_rim, outer: middle + half_rim, steepest })
    }

    /// Whether any pixel got an opacity that counts.
    fn paint(&self, pixels: &mut [Pixel], [width, height]: [usize; 2]) -> bool {
        let [columns, rows] = self.reach([width, height]);
        let all: Vec<&Segment> = self.segments.iter().collect();
        let bands = rows.start / TILE..rows.end.div_ceil(TILE);
        let painted = pixels.par_chunks_mut(width * TILE).enumerate().skip(bands.start).take(bands.len());
        let paint = |(band, pixels): (usize, &mut [Pixel])| {
            let mut band = Band { pixels, width, top: band * TILE };
            self.paint_part(&mut band, columns.clone(), &all)
        };
        painted.map(paint).reduce(|| false, |any, part| any | part)
    }

    /// The columns and rows of the picture that it may reach.
    fn reach(&self, size: [usize; 2]) -> [Range<usize>; 2] {
        let ends = || self.segments.iter().flat_map(|segment| [segment.from, segment.to]);
        let low = ends().fold(DVec2::INFINITY, DVec2::min) - self.outer;
        let high = ends().fold(DVec2::NEG_INFINITY, DVec2::max) + self.outer;
        std::array::from_fn(|axis| pixels_between(low[axis], high[axis], size[axis]))
    }

    /// Paints some columns of a band; whether any pixel got an opacity that counts. Among `near` is the segment that is nearest, of every
    /// point there.
    ///
    /// Parts are halved as long as they are wider than a tile. In each, only those segments stay that can still be the nearest: no point of
    /// it is farther from its middle than half its diagonal. So a stroke of many segments costs little more than one of a few.
    fn paint_part(&self, band: &mut Band<'_>, columns: Range<usize>, near: &[&Segment]) -> bool {
        let size = DVec2::new(columns.len() as f64, band.rows() as f64);
        let middle = DVec2::new(columns.start as f64, band.top as f64) + 0.5 * size;
        let half_diagonal = 0.5 * size.length();
        // The least and the greatest distance that each segment may have from a point of the part.
        let ranges = near.iter().map(|segment| {
            let (distance, change) =
                (segment.squared_distance(middle).sqrt(), segment.steepest * half_diagonal);
            [distance - change, distance + change]
        });
        let ranges: Vec<[f64; 2]> = ranges.collect();
        let [nearest, farthest] =
            [0, 1].map(|end| ranges.iter().map(|range| range[end]).fold(f64::INFINITY, f64::min));
        if nearest > self.outer || columns.is_empty() {
            return false;
        }
        if farthest < self.inner - HALF_DIAGONAL * self.steepest {
            band.put_over(columns, self.stroke, |_, _| [1.0; 2]);
            return self.stroke.opacity >= LEAST_OPACITY;
        }
        let here = near.iter().zip(&ranges).filter(|&(_, range)| range[0] <= farthest * (1.0 + ROUNDING));
        let here: Vec<&Segment> = here.map(|(&segment, _)| segment).collect();
        if columns.len() > TILE {
            let cut = columns.start + columns.len() / 2;
            let left = self.paint_part(band, columns.start..cut, &here);
            return self.paint_part(band, cut..columns.end, &here) | left;
        }
        let mut reaches = false;
        band.put_over(columns, self.stroke, |x, y| {
            let [coverage, inside] = self.coverage(&here, x, y).map(|part| part as f32);
            reaches |= self.stroke.opacity * coverage >= LEAST_OPACITY;
            [coverage, inside]
        });
        reaches
    }

    /// How much it covers of a pixel, and of one farther inside.
    fn coverage(&self, near: &[&Segment], x: usize, y: usize) -> [f64; 2] {
        let distance = |point: DVec2| {
            let squared = near.iter().map(|segment| segment.squared_distance(point));
            squared.fold(f64::INFINITY, f64::min).sqrt()
        };
        let of_centre = distance(centre(x, y));
        let inside = self.covered(of_centre - EDGE);
        // Elsewhere the coverage is linear over the pixel, and its mean is that of the centre.
        let bends = |at: f64| (of_centre - at).abs() < HALF_DIAGONAL * self.steepest;
        if !bends(self.inner) && !bends(self.outer) {
            return [self.covered(of_centre), inside];
        }
        let sample = |index: usize| {
            let [u, v] = [index % SAMPLES, index / SAMPLES].map(|i| (i as f64 + 0.5) / SAMPLES as f64);
            self.covered(distance(DVec2::new(x as f64 + u, y as f64 + v)))
        };
        [(0..SAMPLES * SAMPLES).map(sample).sum::<f64>() / (SAMPLES * SAMPLES) as f64, inside]
    }

    /// How much it covers at a distance from its polyline.
    fn covered(&self, distance: f64) -> f64 {
        ((self.outer - distance) / (self.outer - self.inner)).clamp(0.0, 1.0)
    }

    fn description(&self, [width, height]: [usize; 2]) -> String {
        let Stroke { points, radius, opacity, .. } = self.stroke;
        let [x, y] = points[0];
        format!(
            "a stroke from ({x}, {y}) of radius {radius} and opacity {opacity} on {width} × {height} pixels"
        )
    }
}

fn check_stroke(stroke: &Stroke) -> Result<()> {
    if stroke.points.is_empty() || !stroke.points.iter().flatten().all(|c| c.is_finite()) {
        let got = format!("{} points", stroke.points.len());
        return Err(Error::value("points", got, "at least one point, with finite numbers"));
    }
    if !(stroke.radius.is_finite() && stroke.radius > 0.0) {
        return Err(Error::value("radius", stroke.radius, "positive and finite (pixels)"));
    }
    let is_pressed = |pressure: &f32| *pressure > 0.0 && *pressure <= 1.0;
    if !(stroke.pressure.is_empty() || stroke.pressure.len() == stroke.points.len())
        || !stroke.pressure.iter().all(is_pressed)
    {
        let got = format!("{} numbers", stroke.pressure.len());
        return Err(Error::value("pressure", got, "none, or one a point, more than 0 and at most 1"));
    }
    if !(0.0..=1.0).contains(&stroke.hardness) {
        return Err(Error::value("hardness", stroke.hardness, "between 0 and 1"));
    }
    if !(stroke.opacity > 0.0 && stroke.opacity <= 1.0) {
        return Err(Error::value("opacity", stroke.opacity, "more than 0 and at most 1"));
    }
    if !(stroke.weight > 0.0 && stroke.weight <= 1.0) {
        return Err(Error::value("weight", stroke.weight, "more than 0 and at most 1"));
    }
    if !stroke.color.iter().all(|c| c.is_finite()) {
        return Err(Error::value("color", format!("{:?}", stroke.color), "finite"));
    }
    Ok(())
}

fn centre(x: usize, y: usize) -> DVec2 {
    DVec2::new(x as f64 + 0.5, y as f64 + 0.5)
}

/// The pixels along one side of a picture that lie at least partly between two coordinates.
fn pixels_between(low: f64, high: f64, side: usize) -> Range<usize> {
    // Casts saturate, so coordinates far outside end at the border.
    let end = (high.ceil().max(0.0) as usize).min(side);
    (low.floor().max(0.0) as usize).min(end)..end
}

/// Some rows of a picture.
struct Band<'p> {
    pixels: &'p mut [Pixel],
    width: usize,
    /// The first of its rows in the picture.
    top: usize,
}

impl Band<'_> {
    fn rows(&self) -> usize {
        self.pixels.len() / self.width
    }

    /// Puts a stroke over some columns, with the coverage that it has at a pixel of the picture and farther inside.
    fn put_over(
        &mut self,
        columns: Range<usize>,
        Stroke { color, opacity, weight, erases, .. }: &Stroke,
        mut coverage: impl FnMut(usize, usize) -> [f32; 2],
    ) {
        for (y, row) in self.pixels.chunks_mut(self.width).enumerate() {
            for (x, pixel) in columns.clone().zip(&mut row[columns.clone()]) {
                let [coverage, inside] = coverage(x, self.top + y);
                match erases {
                    true => pixel.take_away([opacity * coverage, opacity * inside, opacity * coverage]),
                    false => {
                        pixel.put_over(*color, *weight, [opacity * coverage, opacity * inside, coverage])
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::DAffine3;

    use super::*;
    use crate::scene::{Camera, FovAxis};

    fn stroke(points: &[[f32; 2]], radius: f32) -> Stroke {
        Stroke {
            points: points.to_vec(),
            radius,
            hardness: 1.0,
            opacity: 1.0,
            weight: 1.0,
            pressure: Vec::new(),
            erases: false,
            color: [0.2, 0.5, 2.0],
        }
    }

    fn view(size: [usize; 2], strokes: Vec<Stroke>) -> View {
        let camera = Camera::new(DAffine3::IDENTITY, 50.0, FovAxis::Y, size).unwrap();
        View { name: "front".to_owned(), camera, strokes, layers: Vec::new(), keep: 0.0 }
    }

    fn painted(size: [usize; 2], strokes: &[Stroke]) -> RgbaImage {
        paint(&view(size, strokes.to_vec())).unwrap().colors
    }

    fn area(painting: &RgbaImage) -> f64 {
        painting.pixels.iter().map(|p| f64::from(p[3])).sum()
    }

    #[test]
    fn a_stroke_that_was_pressed_less_is_thinner_there_and_is_a_union_of_discs() {
        let size = [96, 64];
        let taper = Stroke {
            points: vec![[14.0, 30.0], [50.0, 34.0], [80.0, 20.0]],
            pressure: vec![0.2, 1.0, 0.4],
            hardness: 0.6,
            ..stroke(&[], 12.0)
        };
        let painted = paint(&view(size, vec![taper.clone()])).unwrap();
        // The best of very many discs, at the middle of each pixel.
        let disc = |x: f64, y: f64| {
            let mut best = 0.0f64;
            for (ends, pressures) in taper.points.windows(2).zip(taper.pressure.windows(2)) {
                for step in 0..=2000 {
                    let t = f64::from(step) / 2000.0;
                    let at =
                        |axis: usize| f64::from(ends[0][axis]) * (1.0 - t) + f64::from(ends[1][axis]) * t;
                    let pressure = f64::from(pressures[0]) * (1.0 - t) + f64::from(pressures[1]) * t;
                    let distance = (x - at(0)).hypot(y - at(1)) / pressure;
                    best = best.max(((12.0 - distance) / (12.0 * 0.4)).clamp(0.0, 1.0));
                }
            }
            best
        };
        let mut covered = 0.0;
        for y in 0..size[1] {
            for x in 0..size[0] {
                let expected = disc(x as f64 + 0.5, y as f64 + 0.5);
                let got = f64::from(painted.coverage[y * size[0] + x]);
                covered += got;
                // Means over pixels, where a rim that the pen hardly touched is a pixel wide.
                assert!((got - expected).abs() < 0.25, "({x}, {y}): {got}, and a disc covers {expected}");
            }
        }
        let whole = paint(&view(size, vec![Stroke { pressure: vec![1.0; 3], ..taper.clone() }])).unwrap();
        let none = paint(&view(size, vec![Stroke { pressure: Vec::new(), ..taper.clone() }])).unwrap();
        assert_eq!(whole, none);
        assert!(covered < 0.75 * f64::from(none.coverage.iter().sum::<f32>()));
        // A dab is a smaller dab, but for its rim, which is half as wide.
        let dab = |pressure: Vec<f32>, radius| Stroke { pressure, ..stroke(&[[40.0, 30.0]], radius) };
        let areas =
            [dab(vec![0.5], 16.0), dab(Vec::new(), 8.0)].map(|dab| area(&self::painted(size, &[dab])));
        assert!((areas[0] / areas[1] - 1.0).abs() < 3e-3, "{areas:?}");
        assert!(paint(&view(size, vec![Stroke { pressure: vec![0.5], ..taper }])).is_err());
    }

    #[test]
    fn what_is_erased_is_as_if_it_had_not_been_painted_and_half_of_it_is_half() {
        let on = |strokes: Vec<Stroke>| paint(&view([32, 32], strokes)).unwrap();
        let paint_all = stroke(&[[16.0, 16.0]], 60.0);
        let eraser = |opacity| Stroke { erases: true, opacity, ..stroke(&[[8.0, 16.0]], 7.0) };
        let painted = on(vec![paint_all.clone()]);
        let half = on(vec![paint_all.clone(), eraser(0.5)]);
        let whole = on(vec![paint_all.clone(), eraser(1.0)]);
        let (middle, beside) = (16 * 32 + 8, 16 * 32 + 28);
        assert_eq!(whole.colors.pixels[middle], [0.0; 4]);
        assert_eq!((whole.strengths[middle], whole.coverage[middle]), (0.0, 0.0));
        assert_eq!((half.strengths[middle], half.coverage[middle]), (0.5, 0.5));
        assert_eq!(half.colors.pixels[middle][..3], painted.colors.pixels[middle][..3]);
        for erased in [&half, &whole] {
            assert_eq!(erased.colors.pixels[beside], painted.colors.pixels[beside]);
            assert_eq!(erased.strengths[beside], painted.strengths[beside]);
        }
        // Paint on top of what was erased is paint.
        let again = on(vec![paint_all.clone(), eraser(1.0), stroke(&[[8.0, 16.0]], 3.0)]);
        assert_eq!(again.colors.pixels[middle], painted.colors.pixels[middle]);
        // The rim of an eraser takes a part away.
        let rim = (0..1024).filter(|&k| (0.0..1.0).contains(&whole.coverage[k]) && whole.coverage[k] > 0.0);
        assert!(rim.count() > 10);
    }

    #[test]
    fn a_hard_dab_has_the_area_of_a_disc() {
        for radius in [1.0_f32, 1.7, 2.5, 8.0, 20.3] {
            for centre in [[32.0, 32.0], [32.5, 32.5], [31.9, 32.7]] {
                let got = area(&painted([64, 64], &[stroke(&[centre], radius)]));
                let expected = PI * f64::from(radius).powi(2);
                assert!((got / expected - 1.0).abs() < 0.01, "{got} for {expected} at {centre:?}");
            }
        }
    }

    #[test]
    fn a_hard_line_has_the_area_of_a_capsule_however_it_is_cut() {
        let (from, to) = ([20.0, 31.0], [75.0, 60.0]);
        let whole = painted([100, 100], &[stroke(&[from, to], 6.0)]);
        let expected = 12.0 * (55.0_f64.powi(2) + 29.0_f64.powi(2)).sqrt() + 36.0 * PI;
        assert!((area(&whole) / expected - 1.0).abs() < 0.01);
        let cut: Vec<_> =
            (0..=50).map(|i| i as f32 / 50.0).map(|t| [20.0 + 55.0 * t, 31.0 + 29.0 * t]).collect();
        let cut = painted([100, 100], &[stroke(&cut, 6.0)]);
        for (a, b) in whole.pixels.iter().zip(&cut.pixels) {
            assert!((a[3] - b[3]).abs() < 1e-4);
        }
    }

    /// Each pixel of a stroke is at least as near as the brute-force distance says, wherever the segments point.
    #[test]
    fn no_pixel_near_a_slanted_segment_is_missed() {
        for (i, radius) in [0.3_f32, 1.0, 5.0, 40.0].into_iter().cycle().take(40).enumerate() {
            let angle = i as f32 * 0.31;
            let ends = [[30.0, 30.0], [30.0 + 25.0 * angle.cos(), 30.0 + 25.0 * angle.sin()]];
            let stroke = stroke(&ends, radius);
            let painting = painted([60, 60], std::slice::from_ref(&stroke));
            let brush = Brush::new(&stroke).unwrap();
            for (index, pixel) in painting.pixels.iter().enumerate() {
                let d = brush.segments[0].squared_distance(centre(index % 60, index / 60)).sqrt();
                let radius = f64::from(radius);
                assert!(pixel[3] == 1.0 || d > radius - 0.9, "hole at {index}");
                assert!(pixel[3] == 0.0 || d < radius + 0.9, "spot at {index}");
                assert!(pixel[3] > 0.1 || d > radius - 0.25, "{d} {pixel:?}");
            }
        }
    }

    #[test]
    fn weight_falls_linearly_from_hardness_to_the_radius() {
        for (hardness, opacity) in [(0.0, 1.0), (0.25, 0.5), (0.8, 1.0)] {
            let soft = Stroke { hardness, opacity, ..stroke(&[[64.5, 64.5]], 50.0) };
            let painting = painted([129, 129], &[soft]);
            for x in 64..129 {
                let r = (x as f32 - 64.0) / 50.0;
                let expected = opacity * ((1.0 - r) / (1.0 - hardness)).clamp(0.0, 1.0);
                let got = painting.pixels[64 * 129 + x][3];
                // Over the pixel in which the ramp begins or ends its mean differs by an eighth of its slope.
                assert!((got - expected).abs() < 0.014, "{got} for {expected} at {r}");
            }
        }
    }

    #[test]
    fn a_stroke_over_itself_is_not_heavier() {
        let ends = [[10.0, 20.0], [50.0, 20.0]];
        let once = Stroke { opacity: 0.5, ..stroke(&ends, 5.0) };
        let back = Stroke { points: vec![ends[0], ends[1], ends[0], ends[1]], ..once.clone() };
        let mut closed = once.clone();
        closed.points.push(ends[1]);
        let single = painted([60, 40], std::slice::from_ref(&once));
        assert_eq!(single, painted([60, 40], &[back]));
        assert_eq!(single, painted([60, 40], &[closed]));
        let twice = painted([60, 40], &[once.clone(), once]);
        assert_eq!(twice.pixels[20 * 60 + 30][3], 0.75, "two strokes are");
    }

    #[test]
    fn later_strokes_lie_over_earlier_ones_and_both_over_the_layers() {
        let half = |color| Stroke { color, opacity: 0.5, ..stroke(&[[2.0, 2.0]], 20.0) };
        let (red, blue) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let at = |painting: &RgbaImage| painting.pixels[5];
        assert_eq!(at(&painted([4, 4], &[half(red)])), [1.0, 0.0, 0.0, 0.5], "straight, not premultiplied");
        let third = 1.0 / 3.0;
        assert_close(at(&painted([4, 4], &[half(red), half(blue)])), [third, 0.0, 2.0 * third, 0.75]);
        assert_close(at(&painted([4, 4], &[half(blue), half(red)])), [2.0 * third, 0.0, third, 0.75]);

        let layer = |pixel| RgbaImage::new([4, 4], vec![pixel; 16]).unwrap();
        let mut view = view([4, 4], vec![half(red)]);
        view.layers = vec![layer([9.0, 9.0, 9.0, 1.0]), layer([0.0, 4.0, 0.0, 1.0])];
        assert_close(at(&paint(&view).unwrap().colors), [0.5, 2.0, 0.0, 1.0]);
        view.layers.push(layer([7.0, 7.0, 7.0, 0.0]));
        assert_close(at(&paint(&view).unwrap().colors), [0.5, 2.0, 0.0, 1.0]);
        view.strokes.clear();
        view.layers = vec![layer([5.0, 5.0, 5.0, 0.0019]), layer([1.0, 2.0, 3.0, 0.0])];
        assert_eq!(at(&paint(&view).unwrap().colors), [0.0; 4], "too light to be a constraint");
    }

    fn assert_close(got: [f32; 4], expected: [f32; 4]) {
        assert!(got.iter().zip(expected).all(|(g, e)| (g - e).abs() < 1e-6), "{got:?} for {expected:?}");
    }

    #[test]
    fn what_lies_outside_the_picture_changes_nothing_inside() {
        let outside = stroke(&[[-20.0, 5.0], [10.0, 50.0], [1e30, 50.0]], 6.0);
        let moved = Stroke {
            points: outside.points.iter().map(|p| [p[0] + 30.0, p[1] + 30.0]).collect(),
            ..outside.clone()
        };
        let small = painted([30, 60], &[outside]);
        let large = painted([90, 120], &[moved]);
        for y in 0..60 {
            for x in 0..30 {
                let (a, b) = (small.pixels[y * 30 + x][3], large.pixels[(y + 30) * 90 + x + 30][3]);
                assert!((a - b).abs() < 1e-5, "({x}, {y}): {a} and {b}");
            }
        }
    }

    #[test]
    fn a_stroke_that_reaches_no_pixel_is_named() {
        let far = [stroke(&[[-50.0, 3.0]], 6.0), stroke(&[[3.0, 1e38], [5.0, f32::MAX]], 6.0)];
        let faint = Stroke { opacity: 0.001, ..stroke(&[[3.0, 3.0]], 6.0) };
        let thin = stroke(&[[3.5, 3.5]], 1e-6);
        for lost in far.into_iter().chain([faint, thin]) {
            let strokes = vec![stroke(&[[3.0, 3.0]], 2.0), lost];
            let error = paint(&view([8, 8], strokes)).unwrap_err();
            assert!(matches!(&error, Error::Value { path, .. } if path == "front.strokes[1]"), "{error}");
        }
    }

    #[test]
    fn what_would_take_hours_to_paint_is_refused_at_once() {
        let wide = stroke(&[[2000.0, 2000.0]], 9000.0);
        let error = paint(&view([4096, 4096], vec![wide; 3000])).unwrap_err();
        assert!(
            matches!(&error, Error::TooLarge { needed, .. } if needed == "50331648000 pixels"),
            "{error}"
        );
    }

    #[test]
    fn impossible_strokes_and_layers_are_refused() {
        let fine = || stroke(&[[3.0, 3.0]], 2.0);
        let bad = [
            Stroke { points: vec![], ..fine() },
            Stroke { points: vec![[1.0, f32::NAN]], ..fine() },
            Stroke { radius: 0.0, ..fine() },
            Stroke { radius: f32::INFINITY, ..fine() },
            Stroke { hardness: 1.5, ..fine() },
            Stroke { hardness: f32::NAN, ..fine() },
            Stroke { opacity: 0.0, ..fine() },
            Stroke { color: [0.0, f32::NAN, 0.0], ..fine() },
        ];
        for bad in bad {
            let error = paint(&view([8, 8], vec![bad])).unwrap_err();
            assert!(matches!(&error, Error::Value { path, .. } if path.starts_with("front.strokes[0].")));
        }
        let huge = Stroke { radius: f32::MAX, ..fine() };
        assert_eq!(area(&painted([8, 8], &[huge])), 64.0);
        for (size, pixel) in [([8, 7], [0.0; 4]), ([8, 8], [0.0, f32::NAN, 0.0, 1.0]), ([8, 8], [1.5; 4])] {
            let mut view = view([8, 8], vec![fine()]);
            view.layers.push(RgbaImage::new(size, vec![pixel; size[0] * size[1]]).unwrap());
            assert!(matches!(paint(&view), Err(Error::Shape { .. } | Error::Value { .. })));
        }
    }

    #[test]
    fn of_many_segments_the_nearest_one_counts_and_far_ones_cost_nothing() {
        // Wide, soft and in many pieces: a pixel is nearer than the radius to thousands of them.
        let points: Vec<_> =
            (0..20_000).map(|i| i as f32 * 0.05).map(|t| [t, 300.0 + 200.0 * (0.02 * t).sin()]).collect();
        let wide = Stroke { hardness: 0.2, ..stroke(&points, 250.0) };
        let (painting, brush) =
            (painted([1000, 600], std::slice::from_ref(&wide)), Brush::new(&wide).unwrap());
        for index in (0..600_000).step_by(7919) {
            let from = centre(index % 1000, index / 1000);
            let squared = brush.segments.iter().map(|segment| segment.squared_distance(from));
            let distance = squared.fold(f64::INFINITY, f64::min).sqrt();
            let got = f64::from(painting.pixels[index][3]);
            assert!((got - brush.covered(distance)).abs() < 2e-3, "{got} at {distance}");
        }
    }

    #[test]
    fn any_number_of_threads_paints_the_same_bits() {
        let points: Vec<_> =
            (0..300).map(|i| i as f32 * 0.1).map(|t| [60.0 + t * t.cos(), 60.0 + t * t.sin()]).collect();
        let scribble = Stroke { hardness: 0.4, opacity: 0.7, ..stroke(&points, 4.0) };
        let view = view([120, 120], vec![scribble.clone(), scribble]);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| paint(&view)).unwrap()
        };
        assert_eq!(with(1), with(3));
    }
}
