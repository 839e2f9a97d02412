//! What the medium scatters of the sun into the pixels of pictures.

use rayon::prelude::*;

#[cfg(feature = "gpu")]
use super::canvas::where_it_can;
use super::{Canvas, Maps};
use crate::Result;
#[cfg(feature = "gpu")]
use crate::gpu::{DepthPyramid, Gpu, GpuVector, Walked};
#[cfg(feature = "gpu")]
use crate::march::LightMapTransport;
use crate::march::{LightMapTraversal, LitRay, Traversal};
#[cfg(feature = "gpu")]
use crate::operator::{LinearOperator, brought, fetched};
#[cfg(feature = "gpu")]
use crate::scene::{Basis, Grid, Quadrature};
use crate::scene::{Rgb, Scene, rgb};

/// What rows of pixels show of the sun in the medium: under its own radiance, and what a light map changes of that.
pub(super) struct Scattering<'a> {
    light: Light<'a>,
    #[cfg(feature = "gpu")]
    adapter: Option<OnAdapter>,
}

/// A sun, and how far the texels of a light map differ from it, where there is one.
#[derive(Clone, Copy)]
pub(super) struct Light<'a> {
    pub(super) scene: &'a Scene,
    /// Whether one weight serves all channels, panes aside.
    pub(super) is_grey: bool,
    pub(super) change: Option<&'a [Rgb]>,
}

impl<'a> Scattering<'a> {
    #[cfg(not(feature = "gpu"))]
    pub(super) fn new(_: &Canvas, light: Light<'a>, _: &Maps) -> Result<Self> {
        Ok(Self { light })
    }

    /// Errors: [`crate::Error::AdapterMemory`].
    #[cfg(feature = "gpu")]
    pub(super) fn new(canvas: &Canvas, light: Light<'a>, maps: &Maps) -> Result<Self> {
        let adapter = match canvas {
            Canvas::Processor => None,
            Canvas::Adapter(gpu) => where_it_can(OnAdapter::new(gpu, light, maps))?,
        };
        Ok(Self { light, adapter })
    }

    /// Both, row by row; the second is black where no light map was given.
    ///
    /// Errors: those of an adapter.
    pub(super) fn of(&self, rows: &LightMapTraversal) -> Result<Vec<[Rgb; 2]>> {
        #[cfg(feature = "gpu")]
        if let Some(adapter) = &self.adapter
            && let Some(drawn) = where_it_can(adapter.of(self.light, rows))?
        {
            return Ok(drawn);
        }
        Ok(self.light.of(rows))
    }
}

impl Light<'_> {
    fn of(self, rows: &LightMapTraversal) -> Vec<[Rgb; 2]> {
        let count = rows.rays().len();
        let row = |row| {
            let lit_ray = rows.lit_ray(row);
            let lit = lit_ray.weight();
            let plain = rgb(|c| lit[c] as f32 * self.scene.light.radiance[c]);
            let change = self.change.map_or([0.0; 3], |texels| gather(self.is_grey, &lit_ray, texels));
            [plain, change]
        };
        (0..count).into_par_iter().map(row).collect()
    }
}

fn gather(is_grey: bool, row: &LitRay, texels: &[Rgb]) -> Rgb {
    let sum = if is_grey && row.is_grey() {
        Traversal::<f64, 1>::gather(row, 0, texels)
    } else {
        Traversal::<f64, 3>::gather(row, 0, texels)
    };
    sum.map(|value| value as f32)
}

/// The rays are walked twice there: through one texel that is as large as the shadow map, and through those of the light map. What lies
/// beside the shadow map is all lit, and known in closed form; what panes have coloured is walked by the processor.
///
/// Error: 1e-5 relative to the processor's pictures, as the products of [`Walked`].
#[cfg(feature = "gpu")]
struct OnAdapter {
    gpu: Gpu,
    /// The shadow map, with panes as solid as all else.
    solid: LightMapTransport,
    pyramid: DepthPyramid,
    light: GpuVector,
    change: Option<GpuVector>,
}

#[cfg(feature = "gpu")]
impl OnAdapter {
    fn new(gpu: &Gpu, Light { scene, change, .. }: Light, maps: &Maps) -> Result<Self> {
        let solid = super::painted_rows::transport(scene, maps, scene.solve.quadrature).before_panes();
        let on_gpu = |values: &[Rgb]| brought(GpuVector::zeros(gpu, values.len()), values);
        Ok(Self {
            gpu: gpu.clone(),
            pyramid: DepthPyramid::new(gpu, &solid.shadow_map)?,
            solid,
            light: on_gpu(&[scene.light.radiance])?,
            change: change.map(on_gpu).transpose()?,
        })
    }

    fn of(&self, Light { scene, is_grey, change }: Light, rows: &LightMapTraversal) -> Result<Vec<[Rgb; 2]>> {
        let one_texel = |transport: &LightMapTransport| LightMapTransport {
            light_map: Grid { size: [1, 1], ..*transport.shadow_map.grid() },
            basis: Basis::Nearest,
            quadrature: Quadrature::Exact,
            mask: None,
            ..transport.clone()
        };
        let solid = rows.through(self.solid.clone()).before_panes();
        let (over, solid_over) =
            (rows.through(one_texel(rows.transport())), solid.through(one_texel(&self.solid)));
        let plain = self.product(&solid_over, is_grey, &self.light)?;
        let changed = self.change.as_ref().map(|change| self.product(&solid, is_grey, change)).transpose()?;
        let start = scene.light.radiance;
        let beside = |rows: Option<&LightMapTraversal>, row: usize, x: &[Rgb]| {
            rows.map_or([0.0; 3], |rows| Traversal::<f64, 3>::gather(rows, row, x)).map(|sum| sum as f32)
        };
        let (colored, colored_over) = (rows.beside(), over.beside());
        let row = |row: usize| {
            let outside = over.outside_weight(row);
            let colored_plain = beside(colored_over.as_ref(), row, &[start]);
            let plain = rgb(|c| plain[row][c] + colored_plain[c] + outside[c] as f32 * start[c]);
            let Some((changed, change)) = changed.as_ref().zip(change) else { return [plain, [0.0; 3]] };
            let colored = beside(colored.as_ref(), row, change);
            [plain, rgb(|c| changed[row][c] + colored[c])]
        };
        Ok((0..rows.rays().len()).into_par_iter().map(row).collect())
    }

    fn product(&self, rows: &LightMapTraversal, is_grey: bool, x: &GpuVector) -> Result<Vec<Rgb>> {
        let walked = Walked::pixels_of_light_map(&self.gpu, &self.pyramid, rows, !is_grey)?;
        let mut y = walked.range();
        walked.apply(x, &mut y)?;
        fetched(&y)
    }
}
