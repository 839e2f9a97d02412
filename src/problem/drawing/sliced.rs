//! Pictures over slices: by a sweep, by min-max trees, or prefiltered.

use std::sync::Arc;

use rayon::prelude::*;

use super::method::DrawingMethod;
use super::rays::{PictureRays, SunLight};
use crate::march::{
    EpipolarSettings, EpipolarTraversal, Fan, FanRay, Fans, MinMaxTree, Prefilter, PrefilterWeighting,
    Prefiltered, SlicedRays,
};
use crate::scene::{Rgb, rgb};
use crate::{Error, Result};

/// Largest error of transmittance: far below what 8 bits show.
const TOLERANCE: f64 = 1e-4;
/// Samples of a slice where a method has another number of its own.
const SAMPLES: usize = 2048;

/// The slices of a picture.
#[derive(Debug)]
pub(super) struct PictureSlices {
    rows: EpipolarTraversal,
}

impl PictureSlices {
    pub(super) fn new(light: SunLight, of: &PictureRays, method: DrawingMethod) -> Self {
        let SunLight { scene, maps, .. } = light;
        let samples = match method {
            DrawingMethod::MinMax { samples } | DrawingMethod::Epipolar { samples } => samples,
            _ => SAMPLES,
        };
        let (shadow, light_map) = (maps.shadow_map.grid(), &maps.light_map);
        let pitch = |density: glam::DVec2| density.recip().min_element();
        let fans = Fans::new(
            &SlicedRays {
                rays: of.rays,
                reach: scene.medium.reach(scene.solve.transmittance_bound),
                angle: of.angle,
                shadow_maps: vec![&maps.shadow_map],
                of_row: &|_| 0,
                sigma_t: scene.medium.sigma_t,
                region: shadow.extent.union(light_map.extent),
                pitch: pitch(shadow.density()).min(pitch(light_map.density())),
            },
            EpipolarSettings { samples, tolerance: TOLERANCE, ..EpipolarSettings::default() },
        );
        Self { rows: EpipolarTraversal::over(Arc::new(fans), *light_map, scene.solve.basis) }
    }

    /// The texels of the light map over them.
    #[cfg(feature = "gpu")]
    pub(super) fn rows(&self) -> &EpipolarTraversal {
        &self.rows
    }

    /// Bytes that they take.
    pub(super) fn bytes(&self) -> u64 {
        self.rows.bytes()
    }

    /// What the rays of the picture show.
    ///
    /// Errors: [`Error::Empty`] for a light map before min-max trees.
    pub(super) fn shown(&self, method: DrawingMethod, light: SunLight) -> Result<Vec<[Rgb; 2]>> {
        let start = light.scene.light.radiance;
        let plain = match method {
            DrawingMethod::MinMax { .. } => self.by_trees(start),
            DrawingMethod::Prefiltered { coefficients } => self.prefiltered(coefficients, None, start),
            _ => self.swept(None, start),
        };
        let Some((texels, outside)) = light.change else {
            return Ok(plain.into_iter().map(|plain| [plain, [0.0; 3]]).collect());
        };
        let change = match method {
            DrawingMethod::MinMax { .. } => {
                return Err(Error::Empty {
                    reason: "a min-max tree knows light and shadow, and not the colours of a light map"
                        .to_owned(),
                    remedy: "draw with method epipolar or exact, or without a light map",
                });
            }
            DrawingMethod::Prefiltered { coefficients } => {
                self.prefiltered(coefficients, Some(texels), outside)
            }
            _ => self.swept(Some(texels), outside),
        };
        Ok(plain.into_iter().zip(change).map(|(plain, change)| [plain, change]).collect())
    }

    /// Under light that is `outside` beside the light map, and everywhere where there are no texels.
    fn swept(&self, texels: Option<&[Rgb]>, outside: Rgb) -> Vec<Rgb> {
        let [r, g, b] = outside;
        let shown = self.rows.fans().gather::<f32>(&|fan, samples| match texels {
            None => samples.fill([r, g, b, 0.0]),
            Some(texels) => {
                self.rows.light_at(
                    texels,
                    outside,
                    fan,
                    fan.needed().iter().copied().map(usize::from),
                    samples,
                );
            }
        });
        self.with_what_is_beside(shown, outside)
    }

    fn by_trees(&self, light: Rgb) -> Vec<Rgb> {
        let fans = self.rows.fans();
        self.each_fan(light, |fan| {
            let tree = MinMaxTree::new(fan);
            move |ray: &FanRay| {
                let (weight, _) = tree.weight(ray, fans.sigma_t());
                rgb(|c| weight[c] as f32 * light[c])
            }
        })
    }

    fn prefiltered(&self, coefficients: usize, texels: Option<&[Rgb]>, outside: Rgb) -> Vec<Rgb> {
        let fans = self.rows.fans();
        let weighting = PrefilterWeighting::Transmittance;
        // Samples of constant light are 1.
        let times = if texels.is_none() { outside } else { [1.0; 3] };
        self.each_fan(outside, |fan| {
            let light = texels.map(|texels| {
                let mut samples = vec![[0.0; 4]; fan.slopes.len()];
                self.rows.light_at(texels, outside, fan, 0..fan.slopes.len(), &mut samples);
                samples
            });
            let filter = Prefilter::new((fan, fans.rays_of(fan)), fans.sigma_t(), weighting);
            let filtered = Prefiltered::new(filter, coefficients, light.as_deref());
            move |ray: &FanRay| {
                let shown = filtered.of(ray);
                rgb(|c| shown[c] as f32 * times[c])
            }
        })
    }

    /// What rays show, of the samples of their fan by something that is made of each fan, and of the light beside them.
    fn each_fan<'a, F: Fn(&FanRay) -> Rgb>(
        &'a self,
        beside: Rgb,
        of: impl Fn(&'a Fan) -> F + Sync,
    ) -> Vec<Rgb> {
        let fans = self.rows.fans();
        let rays = |fan: &'a Fan| -> Vec<[f32; 4]> {
            let shown = of(fan);
            let ray = |ray: &FanRay| {
                let (shown, scattering) = (shown(ray), ray.scattering());
                let [r, g, b] = rgb(|c| shown[c] * scattering[c]);
                [r, g, b, 0.0]
            };
            fans.rays_of(fan).iter().map(ray).collect()
        };
        let shown: Vec<Vec<[f32; 4]>> = fans.fans().par_iter().map(rays).collect();
        self.with_what_is_beside(shown.concat(), beside)
    }

    /// The same with the light before the first sample and behind the last, where everything is lit.
    fn with_what_is_beside(&self, mut shown: Vec<[f32; 4]>, light: Rgb) -> Vec<Rgb> {
        if light != [0.0; 3] {
            self.rows.fans().add_beside(light, &mut shown);
        }
        self.rows.of_rows(&shown)
    }
}
