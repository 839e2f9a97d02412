use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use crate::cpu::{Beam, light_volume};
use crate::march::{Density, InScattering, LitVolume, PixelRays, Refraction, VolumeTransport};
use crate::scene::{Hit, Ray, Rgb, VolumeMedium, VolumeScene, VoxelGrid, henyey_greenstein};
use crate::{Error, Result};

/// Voxels of the cached light along an axis where the scene does not say how many. A sun casts shadows, which are sharp: as
/// many as the medium has, up to this. Light from everywhere is smooth, and costs as much as it has directions: half as
/// many, but no fewer than the least (where the medium has as many) and no more than the most.
const SUN_SIDE: usize = 128;
const SKY_SIDES: [usize; 2] = [16, 64];

/// A medium as rays meet it: its extinction, the light that it scatters, and what bends the rays.
#[derive(Debug, Clone)]
pub struct Optics {
    /// Extinction.
    pub density: Arc<Density>,
    /// Light to be scattered; none where it is dark.
    pub light: Option<Arc<InScattering>>,
    /// What bends the rays.
    pub refraction: Option<Arc<Refraction>>,
    /// Mean radiance of the environment, which surfaces reflect.
    around: Rgb,
}

impl Optics {
    /// Prepares a medium under the light of a scene: the light that arrives is attenuated and shadowed once, and cached.
    ///
    /// Errors: [`Error::Value`] for anisotropic scattering of environment light, which would need one cached volume a
    /// direction.
    pub fn new(scene: &VolumeScene, medium: &VolumeMedium) -> Result<Self> {
        let density = Arc::new(Density::new(medium.extinction.clone(), medium.interpolation));
        let refraction = medium.refraction.as_ref().map(|(index, step)| {
            let step = step.unwrap_or_else(|| 0.5 * shortest_side(index.grid()));
            Ok::<_, Error>(Arc::new(Refraction::new(index.clone(), step)?))
        });
        let light = light(scene, medium, &density)?;
        Ok(Self { density, light, refraction: refraction.transpose()?, around: scene.environment.mean() })
    }

    /// What all rays share.
    pub fn transport(&self, scene: &VolumeScene, medium: &VolumeMedium) -> VolumeTransport {
        VolumeTransport {
            density: self.density.clone(),
            basis: medium.interpolation,
            quadrature: scene.solve.quadrature,
            transmittance_bound: scene.solve.transmittance_bound,
            refraction: self.refraction.clone(),
        }
    }

    /// How far rays go before they meet a surface; empty where there are no surfaces.
    pub fn lengths(&self, scene: &VolumeScene, rays: &PixelRays) -> Vec<f64> {
        if is_open(scene) {
            return Vec::new();
        }
        let length = |row: usize| self.end(scene, rays, row).1.map_or(f64::INFINITY, |(length, _)| length);
        (0..rays.len()).into_par_iter().map(length).collect()
    }

    /// What a ray sees behind the volume: the radiance there, before it passes the medium.
    pub fn background(&self, scene: &VolumeScene, rays: &PixelRays, row: usize) -> Rgb {
        let [view, pixel] = rays.pixel(row);
        let picture = scene.views.get(view as usize).and_then(|view| view.background.as_ref());
        let known = picture.map(|picture| picture.pixels[pixel as usize]).or(scene.background);
        if let (true, Some(color)) = (is_open(scene), known) {
            return color;
        }
        let (ray, hit) = self.end(scene, rays, row);
        match (hit, known) {
            (Some((_, hit)), _) => self.surface(scene, ray.at(hit.distance), hit.normal, hit.albedo),
            (None, Some(color)) => color,
            (None, None) => scene.environment.radiance(ray.direction),
        }
    }

    /// The straight ray that a row ends on, and how long the row is and what it meets there, if anything.
    fn end(&self, scene: &VolumeScene, rays: &PixelRays, row: usize) -> (Ray, Option<(f64, Hit)>) {
        let mut end = (rays.ray(row), None);
        rays.each_straight(row, self.refraction.as_deref(), |ray, a, b| {
            let start = Ray { origin: ray.at(a), direction: ray.direction };
            let hit = scene.geometry.first_hit(&start, b - a);
            end = (start, hit.map(|hit| (a + hit.distance, hit)));
            end.1.is_none()
        });
        end
    }

    /// Radiance of a diffuse surface: suns through the medium, and the mean of the environment.
    fn surface(&self, scene: &VolumeScene, point: DVec3, normal: DVec3, albedo: Rgb) -> Rgb {
        let mut sum = self.around.map(f64::from);
        for sun in &scene.lights {
            let cosine = -normal.dot(sun.direction);
            let lifted = point + normal * (1e-4 * (1.0 + point.length()));
            let towards = Ray { origin: lifted, direction: -sun.direction };
            if cosine <= 0.0 || scene.geometry.blocks(&towards, f64::INFINITY) {
                continue;
            }
            let tau = self.density.optical_depth(lifted, -sun.direction, f64::INFINITY);
            for c in 0..3 {
                sum[c] += f64::from(sun.radiance[c]) * cosine / std::f64::consts::PI * (-tau[c]).exp();
            }
        }
        std::array::from_fn(|c| (f64::from(albedo[c]) * sum[c]) as f32)
    }
}

/// Rays through pixels of a scene's views, without surfaces.
pub(super) fn open_rays(scene: &VolumeScene, pixels: &[[u32; 2]]) -> PixelRays {
    let cameras: Vec<_> = scene.views.iter().map(|view| view.view.camera.clone()).collect();
    PixelRays::new(cameras.into(), pixels, Vec::new().into())
}

fn light(scene: &VolumeScene, medium: &VolumeMedium, density: &Density) -> Result<Option<Arc<InScattering>>> {
    let sky = !scene.environment.is_dark();
    let suns: Vec<_> = scene.lights.iter().filter(|sun| sun.radiance != [0.0; 3]).collect();
    if density.cells().is_empty() || (!sky && suns.is_empty()) {
        return Ok(None);
    }
    let grid = |side: &dyn Fn(usize) -> usize| {
        let size = scene.light_size.unwrap_or(density.grid().size().map(side));
        VoxelGrid::over_cube(size, density.grid().world_from_cube())
    };
    let mut fields = Vec::new();
    let mut add = |along, grid, beams: &[Beam]| -> Result<()> {
        let radiance = Arc::new(light_volume(density, &scene.geometry, grid, beams)?);
        fields.push(LitVolume { along, radiance });
        Ok(())
    };
    // Where the phase function does not depend on the view, it is part of what arrives.
    let isotropic = henyey_greenstein(0.0, 0.0);
    let scattered = |towards, radiance: Rgb| Beam {
        towards,
        radiance: radiance.map(|value| (f64::from(value) * isotropic) as f32),
    };
    if sky {
        if medium.g != 0.0 {
            return Err(Error::value("volume.g", medium.g, "0 where there is environment light"));
        }
        let beams = scene.environment.beams().into_iter().filter(|(_, radiance)| *radiance != [0.0; 3]);
        let beams: Vec<Beam> = beams.map(|(towards, radiance)| scattered(towards, radiance)).collect();
        add(None, grid(&sky_side)?, &beams)?;
    }
    let of_suns = grid(&|side| side.min(SUN_SIDE))?;
    if medium.g == 0.0 {
        let beams: Vec<Beam> = suns.iter().map(|sun| scattered(-sun.direction, sun.radiance)).collect();
        if !beams.is_empty() {
            add(None, of_suns, &beams)?;
        }
    } else {
        for sun in suns {
            let beam = Beam { towards: -sun.direction, radiance: sun.radiance };
            add(Some((sun.direction, medium.g)), of_suns, &[beam])?;
        }
    }
    Ok(Some(Arc::new(InScattering::new(fields))))
}

/// Voxels of the light from everywhere beside so many of the medium.
fn sky_side(side: usize) -> usize {
    let [fewest, most] = SKY_SIDES;
    (side / 2).clamp(fewest.min(side), most)
}

fn is_open(scene: &VolumeScene) -> bool {
    scene.geometry.mesh().triangles.is_empty()
}

/// Length of the shortest side of a voxel, in metres.
fn shortest_side(grid: &VoxelGrid) -> f64 {
    let m = grid.world_from_grid().matrix3;
    m.x_axis.length().min(m.y_axis.length()).min(m.z_axis.length())
}
