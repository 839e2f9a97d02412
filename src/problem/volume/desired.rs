//! What the pictures of a volume should show, pixel by pixel.

use crate::problem::paint;
use crate::scene::{Image, Opacity, Rgb, Target, VolumeScene, luminance, mixed};
use crate::{Error, Result};

/// What a view should show.
#[derive(Debug, Clone)]
pub struct Desired {
    /// The radiance of each pixel, and its weight; no weight where nothing is wanted.
    pub pixels: Vec<[f32; 4]>,
}

impl Desired {
    /// What each view of a scene should show. `before` are the pictures as they are, of the views on which something is painted;
    /// nothing is asked of the others.
    ///
    /// A picture counts with its alpha. What is painted is radiance, or a tint of the luminance that is seen there; its alpha is its strength, or
    /// its weight. Unpainted pixels of a view that is painted on stay as they are, with the view's weight.
    ///
    /// Errors: [`Error::Empty`] when no view has a picture or paint, and those of [`paint`].
    pub fn of(scene: &VolumeScene, before: &dyn Fn(usize) -> Result<Image>) -> Result<Vec<Self>> {
        let desired = (0..scene.views.len())
            .map(|view| Self::of_view(scene, view, before))
            .collect::<Result<Vec<_>>>()?;
        if desired.iter().all(|view| view.pixels.iter().all(|pixel| pixel[3] <= 0.0)) {
            return Err(Error::Empty {
                reason: "no view says what its picture should show".to_owned(),
                remedy: "give at least one view a `picture`, strokes or layers",
            });
        }
        Ok(desired)
    }

    fn of_view(scene: &VolumeScene, index: usize, before: &dyn Fn(usize) -> Result<Image>) -> Result<Self> {
        let view = &scene.views[index];
        let count = view.view.camera.size().iter().product();
        let painted = !view.view.strokes.is_empty() || !view.view.layers.is_empty();
        let mut pixels = match &view.picture {
            Some(picture) => picture.pixels.clone(),
            None => vec![[0.0; 4]; count],
        };
        if !painted {
            return Ok(Self { pixels });
        }
        // Paint is a change of what the picture shows: the target where there is one, else the volume as it is.
        let seen: Vec<Rgb> = match &view.picture {
            Some(picture) => picture.pixels.iter().map(|&[r, g, b, _]| [r, g, b]).collect(),
            None => before(index)?.pixels,
        };
        for (pixel, &[r, g, b]) in pixels.iter_mut().zip(&seen) {
            if view.picture.is_none() {
                *pixel = [r, g, b, view.view.keep];
            }
        }
        let painting = paint(&view.view)?;
        for (index, (pixel, seen)) in pixels.iter_mut().zip(&seen).enumerate() {
            let [r, g, b, opacity] = painting.colors.pixels[index];
            let weight = painting.weights[index];
            if opacity > 0.0 {
                let painted = match scene.target {
                    Target::Radiance => [r, g, b],
                    // Unlike a slide a volume can add light, so paint of any colour is as bright as what is seen.
                    Target::Tint | Target::WhiteTint => [r, g, b].map(|color| color * luminance(*seen)),
                };
                let ([r, g, b], weight) = match scene.opacity {
                    Opacity::Strength => {
                        let strength = painting.strengths[index];
                        (mixed(seen, &painted, strength.into()), painting.coverage[index] * weight)
                    }
                    Opacity::Weight => (painted, opacity * weight),
                };
                *pixel = [r, g, b, weight];
            }
        }
        Ok(Self { pixels })
    }

    /// Whether anything is wanted of the view.
    pub fn is_wanted(&self) -> bool {
        self.pixels.iter().any(|pixel| pixel[3] > 0.0)
    }

    /// How far a picture is from it: √(Σ w ‖L − L*‖² / Σ w ‖L*‖²), and Σ w ‖L − L*‖² and Σ w ‖L*‖² themselves.
    pub fn residual(&self, picture: &Image) -> (f64, [f64; 2]) {
        let mut sums = [0.0; 2];
        for (&[r, g, b, weight], shown) in self.pixels.iter().zip(&picture.pixels) {
            for (wanted, shown) in [r, g, b].into_iter().zip(shown) {
                sums[0] += f64::from(weight) * f64::from(shown - wanted).powi(2);
                sums[1] += f64::from(weight) * f64::from(wanted).powi(2);
            }
        }
        (if sums[1] > 0.0 { (sums[0] / sums[1]).sqrt() } else { 0.0 }, sums)
    }
}
