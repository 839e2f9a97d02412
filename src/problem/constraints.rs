use rayon::prelude::*;

use super::Painting;
use crate::scene::{Opacity, Rgb, Scene, View, luminance, rgb};
use crate::{Error, Result};

/// Pixels without paint that are kept as they are: one in so many along each axis, with the weight of all.
const KEPT_STRIDE: usize = 4;

/// One painted pixel, or one that should stay as it is: a row of the problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constraint {
    /// Index of the view.
    pub view: usize,
    /// Column of the pixel.
    pub x: usize,
    /// Row of the pixel.
    pub y: usize,
    /// The painted colour: radiance for [`Target::Radiance`](crate::scene::Target), else dimensionless.
    pub color: Rgb,
    /// How far the wish goes from what is there to the painted colour, from 0 to 1; 0 where nothing is painted.
    pub opacity: f32,
    /// The weight of the wish, from 0 to 1, or that of several pixels that should stay as they are; 0 where nothing is wished.
    pub weight: f32,
}

impl Constraint {
    /// Whether it is painted.
    pub fn is_painted(&self) -> bool {
        self.opacity > 0.0 && self.weight > 0.0
    }
}

/// What is known of the light that rows show, before anything is looked for.
///
/// Shapes  one colour a row
/// Units   radiance
pub(super) struct RowRadiance {
    /// The constant share of a row, which no unknown changes.
    pub(super) known: Vec<Rgb>,
    /// What a row shows under the lights as they are: what a tint is relative to.
    pub(super) plain: Vec<Rgb>,
    /// What it would show, were each light as bright as it is, but white.
    pub(super) white: Vec<Rgb>,
}

impl RowRadiance {
    /// Rows are under these suns, and relative to the first: white light is as bright as each of them.
    pub(super) fn white_of(&mut self, suns: &[Rgb], of_rows: &[u32]) {
        let white = |sun: Rgb| rgb(|c| if sun[c] > 0.0 { luminance(sun) / sun[c] } else { 0.0 });
        let first = white(suns[0]);
        for (row, &sun) in self.white.iter_mut().zip(of_rows) {
            let own = white(suns[sun as usize]);
            *row = rgb(|c| if first[c] > 0.0 { row[c] / first[c] * own[c] } else { row[c] });
        }
    }

    /// Adds light that no unknown changes.
    pub(super) fn add(&mut self, added: &[Rgb]) {
        for rows in [&mut self.known, &mut self.plain, &mut self.white] {
            rows.iter_mut().zip(added).for_each(|(row, more)| *row = rgb(|c| row[c] + more[c]));
        }
    }
}

/// All painted pixels, view by view, row by row, and those that should stay as they are. All other pixels are among them, too, where
/// [`Skipping`](crate::scene::Skipping) does not skip them.
///
/// Errors: [`Error::Empty`] when nothing is painted.
pub fn constraints(scene: &Scene) -> Result<Vec<Constraint>> {
    let constraints = pixels(scene)?;
    if !constraints.iter().any(Constraint::is_painted) {
        return Err(Error::Empty {
            reason: "no pixel is painted in any view".to_owned(),
            remedy: "add strokes or layers to at least one view",
        });
    }
    Ok(constraints)
}

/// All painted pixels, as [`constraints`] gives them; none where nothing is painted.
///
/// Errors: those of [`paint`](super::paint), with the view's name.
pub fn pixels(scene: &Scene) -> Result<Vec<Constraint>> {
    let of_view = |(view, painted): (usize, &View)| {
        let painting = super::paint(painted)?;
        let [width, height] = painting.colors.size();
        let pixels = (0..width * height).map(|index| {
            let pixel = Constraint { view, x: index % width, y: index / width, ..UNPAINTED };
            wished(pixel, &painting, (scene.opacity, painted.keep))
        });
        Ok(pixels.filter(|pixel| pixel.weight > 0.0 || !scene.solve.skip.pixels).collect())
    };
    // The first fault is that of the first view that has one.
    let views: Vec<Result<Vec<Constraint>>> = scene.views.par_iter().enumerate().map(of_view).collect();
    Ok(views.into_iter().collect::<Result<Vec<_>>>()?.concat())
}

const UNPAINTED: Constraint = Constraint { view: 0, x: 0, y: 0, color: [1.0; 3], opacity: 0.0, weight: 0.0 };

/// What is wished of a pixel of a painted picture.
pub(super) fn wished(
    Constraint { view, x, y, .. }: Constraint,
    painting: &Painting,
    (meaning, keep): (Opacity, f32),
) -> Constraint {
    let index = y * painting.colors.size()[0] + x;
    let [r, g, b, opacity] = painting.colors.pixels[index];
    let (opacity, weight) = match meaning {
        _ if opacity <= 0.0 => {
            let is_kept = [x, y].iter().all(|along| along % KEPT_STRIDE == KEPT_STRIDE / 2);
            let weight = if is_kept { keep * (KEPT_STRIDE * KEPT_STRIDE) as f32 } else { 0.0 };
            return Constraint { view, x, y, weight, ..UNPAINTED };
        }
        Opacity::Strength => (painting.strengths[index], painting.coverage[index] * painting.weights[index]),
        Opacity::Weight => (1.0, opacity * painting.weights[index]),
    };
    Constraint { view, x, y, color: [r, g, b], opacity, weight }
}
