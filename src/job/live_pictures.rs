//! Pictures of a live job: all views under the light map as it is, from one product with the rows of their pixels.

use std::borrow::Cow;
use std::sync::Arc;

use rayon::prelude::*;

use crate::Result;
use crate::operator::NOWHERE;
use crate::problem::{Backdrop, LightMapProblem};
use crate::scene::{Image, Rgb, Scene, rgb};

/// What of all pictures does not change.
pub(super) struct Still {
    pub(super) backdrops: Vec<Backdrop>,
    /// T x₀.
    pub(super) start: Vec<Rgb>,
    /// The row of each pixel, view by view; [`NOWHERE`] for none.
    pub(super) rows: Vec<Vec<u32>>,
}

/// All previews under the light map as it is; made by [`LiveJob::pictures`](super::LiveJob::pictures).
pub struct LivePictures<'a> {
    /// What is painted, with pictures of the preview's size.
    pub(super) scene: &'a Scene,
    pub(super) problem: &'a LightMapProblem,
    pub(super) still: Arc<Still>,
    /// All elements.
    pub(super) x: Cow<'a, [Rgb]>,
    /// T (x − x₀).
    pub(super) scattered: Vec<Rgb>,
    /// How far the texels differ from the plain light.
    pub(super) texels: Vec<Rgb>,
}

impl LivePictures<'_> {
    /// The light map.
    pub fn light_map(&self) -> Result<Image> {
        light_map_of(self.problem, &self.x)
    }

    fn row(&self, view: usize, pixel: usize) -> Option<usize> {
        Some(self.still.rows[view][pixel]).filter(|&row| row != NOWHERE).map(|row| row as usize)
    }

    fn picture(&self, view: usize, mut color: impl FnMut(usize, Rgb) -> Rgb) -> Image {
        let mut picture = self.before(view).clone();
        picture.pixels.iter_mut().enumerate().for_each(|(pixel, shown)| *shown = color(pixel, *shown));
        picture
    }

    /// How many views there are.
    pub fn views(&self) -> usize {
        self.still.backdrops.len()
    }

    /// A view under the plain light.
    pub fn before(&self, view: usize) -> &Image {
        self.still.backdrops[view].before()
    }

    /// A view under the light map.
    pub fn after(&self, view: usize) -> Image {
        let scattered = |pixel| self.row(view, pixel).map_or([0.0; 3], |row| self.scattered[row]);
        self.still.backdrops[view].after(&self.texels, scattered)
    }

    /// What the paint asks for: the picture under the plain light, its scattered light replaced where it is painted.
    pub fn target(&self, view: usize) -> Image {
        let problem = self.problem;
        self.picture(view, |pixel, shown| {
            let Some(row) = self.painted(view, pixel) else { return shown };
            let (wanted, plain, weight) =
                (problem.wanted(row), problem.plain[row], problem.constraints[row].weight.min(1.0));
            rgb(|c| (shown[c] + weight * (wanted[c] - plain[c])).max(0.0))
        })
    }

    /// How far the scattered light misses what is painted; black where nothing is.
    pub fn difference(&self, view: usize) -> Image {
        self.picture(view, |pixel, _| {
            let Some(row) = self.painted(view, pixel) else { return [0.0; 3] };
            let weight = self.problem.constraints[row].weight.min(1.0);
            self.missed(row).map(|missed| weight * missed.abs())
        })
    }

    fn painted(&self, view: usize, pixel: usize) -> Option<usize> {
        self.row(view, pixel).filter(|&row| self.problem.constraints[row].is_painted())
    }

    /// Scattered radiance of a row less what is wanted of it.
    fn missed(&self, row: usize) -> Rgb {
        let (plain, wanted) = (self.problem.plain[row], self.problem.wanted(row));
        rgb(|c| plain[c] + self.scattered[row][c] - wanted[c])
    }

    /// The pixels of a view whose paint is not met because other paint says something else of its light, or nothing can bring it: more than half
    /// of the wish is missed, and more than a tenth of the plain light.
    pub fn contested(&self, view: usize) -> Vec<bool> {
        const HALF: f64 = 0.5;
        const TENTH: f64 = 0.1;
        let norm = |color: Rgb| color.iter().map(|&c| f64::from(c).powi(2)).sum::<f64>().sqrt();
        let is_missed = |row: usize| {
            let (plain, wanted) = (self.problem.plain[row], self.problem.wanted(row));
            let wish = norm(rgb(|c| wanted[c] - plain[c]));
            norm(self.missed(row)) > (HALF * wish).max(TENTH * norm(plain))
        };
        (0..self.still.rows[view].len())
            .map(|pixel| self.painted(view, pixel).is_some_and(is_missed))
            .collect()
    }

    /// How far the first surface is straight ahead in the pixels of a view, in metres; infinite where there is none.
    pub fn depths(&self, view: usize) -> Vec<f64> {
        let Self { scene, problem, .. } = self;
        let camera = &scene.views[view].camera;
        let width = camera.size()[0];
        let ahead = |pixel: usize| {
            let ray = camera.pixel_ray(pixel % width, pixel / width);
            let hit = problem.maps.geometry.first_hit(&ray, f64::INFINITY);
            hit.map_or(f64::INFINITY, |hit| hit.distance * ray.direction.dot(camera.ahead()))
        };
        (0..self.still.rows[view].len()).into_par_iter().map(ahead).collect()
    }

    /// The pixels of a view that light through the light map reaches: what paint can change.
    pub fn reached(&self, view: usize) -> Vec<bool> {
        let is_lit = |row: usize| self.still.start[row].iter().any(|&radiance| radiance > 0.0);
        (0..self.still.rows[view].len()).map(|pixel| self.row(view, pixel).is_some_and(is_lit)).collect()
    }

    /// The share of the paint that is met: 1 less what is missed, relative to what was missed under the plain light. None where nothing is
    /// painted.
    pub fn met(&self) -> Option<f64> {
        let problem = self.problem;
        let (mut missed, mut plain) = (0.0, 0.0);
        for (row, pixel) in problem.constraints.iter().enumerate().filter(|(_, pixel)| pixel.is_painted()) {
            let (now, wanted) = (self.missed(row), problem.wanted(row));
            for c in 0..3 {
                missed += f64::from(pixel.weight * now[c] * now[c]);
                plain += f64::from(pixel.weight * (problem.plain[row][c] - wanted[c]).powi(2));
            }
        }
        (plain > 0.0).then(|| 1.0 - (missed / plain).sqrt())
    }

    /// The tint that a pixel has: its scattered light relative to that of the plain light; white where there is none.
    pub fn tint(&self, view: usize, [x, y]: [usize; 2]) -> Rgb {
        let [width, height] = self.before(view).size();
        let Some(row) = self.row(view, y.min(height - 1) * width + x.min(width - 1)) else { return [1.0; 3] };
        let plain = self.problem.plain[row];
        rgb(|c| match plain[c] {
            plain if plain > 0.0 => ((plain + self.scattered[row][c]) / plain).max(0.0),
            _ => 1.0,
        })
    }
}

/// The texels of all elements of a problem as a picture.
///
/// Errors: [`Error::Shape`](crate::Error::Shape) for another number of them.
pub(super) fn light_map_of(problem: &LightMapProblem, x: &[Rgb]) -> Result<Image> {
    let [texels, _] = problem.parted(x);
    Image::new(problem.maps.light_map.size, texels.to_vec())
}
