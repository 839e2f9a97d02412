//! Pictures by methods that a graphics adapter has kernels for.

use super::super::painted_rows::transport;
use super::method::DrawingMethod;
use super::rays::{MARCHED_TO, PictureRays, SunLight};
use super::sliced::PictureSlices;
use crate::Result;
use crate::gpu::{Gpu, GpuVector, LightPicture, Marched, MarchedPicture, PrefilteredPicture, SweptPicture};
use crate::operator::{Vector, brought, fetched};
use crate::scene::{Quadrature, Rgb};

/// The rays of a picture on an adapter, whatever the light.
#[derive(Debug)]
pub(super) struct OnAdapter {
    gpu: Gpu,
    picture: Box<dyn LightPicture>,
    elements: usize,
}

impl OnAdapter {
    /// None where there is no kernel for the method.
    ///
    /// Errors: [`crate::Error::AdapterMemory`]; [`crate::Error::TooLarge`] for what kernels cannot see as a whole.
    pub(super) fn new(
        gpu: &Gpu,
        method: DrawingMethod,
        light: SunLight,
        of: &PictureRays,
    ) -> Result<Option<Self>> {
        let slices = || PictureSlices::new(light, of, method);
        let picture: Box<dyn LightPicture> = match method {
            DrawingMethod::March { steps } => {
                let transport = transport(light.scene, light.maps, Quadrature::Exact);
                let marched = Marched {
                    sigma_t: transport.sigma_t,
                    shadow_map: &transport.shadow_map,
                    light_map: transport.light_map,
                    basis: transport.basis,
                    steps,
                    reach: light.scene.medium.reach(MARCHED_TO),
                };
                Box::new(MarchedPicture::new(gpu, &marched, of.rays)?)
            }
            DrawingMethod::Prefiltered { coefficients } => {
                Box::new(PrefilteredPicture::new(gpu, slices().rows(), coefficients)?)
            }
            DrawingMethod::Epipolar { .. } => Box::new(SweptPicture::new(gpu, slices().rows())?),
            DrawingMethod::Exact | DrawingMethod::MinMax { .. } | DrawingMethod::Bilateral { .. } => {
                return Ok(None);
            }
        };
        Ok(Some(Self { gpu: gpu.clone(), picture, elements: light.maps.light_map.len() + 1 }))
    }

    /// What the rays show under the plain light, and what a light map changes of that.
    pub(super) fn shown(&self, light: SunLight) -> Result<Vec<[Rgb; 2]>> {
        let mut x = GpuVector::zeros(&self.gpu, self.elements);
        x.fill(light.scene.light.radiance.map(f64::from));
        let plain: Vec<Rgb> = fetched(&self.picture.shown(&x)?)?;
        let Some((texels, outside)) = light.change else {
            return Ok(plain.into_iter().map(|plain| [plain, [0.0; 3]]).collect());
        };
        let x = brought(x, &[texels, &[outside]].concat())?;
        let change: Vec<Rgb> = fetched(&self.picture.shown(&x)?)?;
        Ok(plain.into_iter().zip(change).map(|(plain, change)| [plain, change]).collect())
    }
}
