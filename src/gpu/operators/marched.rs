//! Pictures in equal steps along their rays, on the device.

use glam::DVec2;

use super::picture::LightPicture;
use super::rounds;
use crate::Result;
use crate::gpu::device::{Allocation, Gpu};
use crate::gpu::kernels::layout::{MarchParams, MarchRay};
use crate::gpu::kernels::{Kernel, Program, RAYS, Variant};
use crate::gpu::vectors::{GpuVector, Slab};
use crate::march::ViewRay;
use crate::operator::expect_len;
use crate::scene::{Basis, Grid};
use crate::visibility::ShadowMap;

/// What the steps of all rays are taken through.
#[derive(Debug, Clone, Copy)]
pub struct Marched<'a> {
    /// Extinction a channel, in 1/metre.
    pub sigma_t: [f64; 3],
    /// What is lit.
    pub shadow_map: &'a ShadowMap,
    /// The texels.
    pub light_map: Grid,
    /// How they are interpolated.
    pub basis: Basis,
    /// Steps a ray.
    pub steps: usize,
    /// Where nothing more is seen along a ray, in metres.
    pub reach: f64,
}

/// A picture in equal steps, each worth its middle.
#[derive(Debug)]
pub struct MarchedPicture {
    gpu: Gpu,
    params: MarchParams,
    sigma_t: [f64; 3],
    rows: usize,
    texels: usize,
    depths: Allocation,
    /// Rays from some rows on, so many as can be seen at once.
    slabs: Vec<(usize, usize, Allocation)>,
}

impl MarchedPicture {
    /// Hands rays and shadow map over.
    ///
    /// Errors: [`Error::AdapterMemory`](crate::Error::AdapterMemory); [`Error::TooLarge`](crate::Error::TooLarge) for maps and pictures that a kernel cannot
    /// see as a whole, and for more steps than a software adapter makes.
    pub fn new(gpu: &Gpu, of: &Marched, rays: &[ViewRay]) -> Result<Self> {
        let (map, remedy) =
            (of.shadow_map, "lower the maps' or the views' sizes, or compute on the processor");
        let [width, height] = map.grid().size;
        let texels = of.light_map.len();
        let largest = (width * height).max(texels + 1).max(rays.len());
        gpu.expect_visible("a map or a picture on the adapter", 4 * largest as u64, remedy)?;
        rounds::check(gpu, || of.steps, "take fewer steps, or compute on the processor")?;
        let depths: Vec<f32> = (0..width * height).map(|k| map.depth(k % width, k / width)).collect();
        let at_once = gpu.rays_at_once(size_of::<MarchRay>());
        let slab = |(number, rays): (usize, &[ViewRay])| {
            let rays: Vec<MarchRay> = rays.iter().map(|ray| march_ray(of, ray)).collect();
            Ok((number * at_once, rays.len(), gpu.upload("the rays", &rays)?))
        };
        Ok(Self {
            gpu: gpu.clone(),
            params: MarchParams {
                shadow_size: [width as u32, height as u32],
                light_size: of.light_map.size.map(|side| side as u32),
                steps: of.steps as u32,
                bilinear: u32::from(of.basis == Basis::Bilinear),
                ..MarchParams::default()
            },
            sigma_t: of.sigma_t,
            rows: rays.len(),
            texels,
            depths: gpu.upload("the shadow map", &depths)?,
            slabs: rays.chunks(at_once).enumerate().map(slab).collect::<Result<_>>()?,
        })
    }
}

fn march_ray(of: &Marched, ray: &ViewRay) -> MarchRay {
    let step = ray.length.min(of.reach) / of.steps as f64;
    let over =
        |t: f64| DVec2::new(ray.origin.x, ray.origin.y) + t * DVec2::new(ray.direction.x, ray.direction.y);
    let single = |v: DVec2| [v.x as f32, v.y as f32];
    let in_grid = |grid: &Grid| {
        let [begin, next] = [0.0, step].map(|t| grid.grid_from_light(over(t)));
        [single(begin), single(next - begin)]
    };
    let ([shadow_at, shadow_step], [light_at, light_step]) =
        (in_grid(of.shadow_map.grid()), in_grid(&of.light_map));
    MarchRay {
        scattering: ray.scattering.map(|it| it as f32),
        step: step as f32,
        shadow_at,
        shadow_step,
        light_at,
        light_step,
        depth: (ray.origin.z - of.shadow_map.depth_origin()) as f32,
        depth_step: (step * ray.direction.z) as f32,
        pad0: 0,
        pad1: 0,
    }
}

impl LightPicture for MarchedPicture {
    fn shown(&self, x: &GpuVector) -> Result<GpuVector> {
        expect_len("the texels", x, self.texels + 1)?;
        let y = GpuVector::zeros(&self.gpu, self.rows);
        for [channel, channels] in GpuVector::channels(&[x, &y]) {
            let bound = |vector: &GpuVector, len| vector.binding(Slab { channel, channels, first: 0, len });
            let mut sigma_t = [0.0; 4];
            for c in 0..channels as usize {
                sigma_t[c] = self.sigma_t[channel as usize + c] as f32;
            }
            for (first_row, rays, records) in &self.slabs {
                let params = MarchParams {
                    sigma_t,
                    rays: *rays as u32,
                    first_row: *first_row as u32,
                    channel,
                    channels,
                    x_stride: x.stride as u32,
                    y_stride: y.stride as u32,
                    ..self.params
                };
                let bindings =
                    [bound(&y, self.rows), records.whole(), self.depths.whole(), bound(x, self.texels + 1)];
                let program = Program::new(Kernel::March, Variant::Lanes);
                self.gpu.dispatch(program, &params, &[&bindings], self.gpu.grid(*rays, RAYS));
                self.gpu.hand_over();
            }
        }
        self.gpu.check()?;
        Ok(y)
    }
}
