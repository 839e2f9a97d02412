use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use crate::cpu::{Beam, light_volume};
use crate::march::{Density, InScattering, LitVolume, PixelRays, Refraction, VolumeTransport};
use crate::scene::{Ray, Rgb, VolumeMedium, VolumeScene, VoxelGrid, henyey_greenstein};
use crate::{Error, Result};

/// Voxels of the cached light along an axis where the scene does not say how many: half of the medium's, for light is
/// smooth, but no fewer (where the medium has as many) and no more than these.
const LIGHT_SIDES: [usize; 2] = [16, 64];

/// A medium as rays meet it: its extinction, the light that it scatters, and what bends the rays.
#[derive(Debug, Clone)]
pub struct Optics {
    /// Extinction.
    pub density: Arc<Density>,
    /// Light to be scattered; none where it is dark.
    pub light: Option<Arc<InScattering>>,
    /// What bends the rays.
    pub refraction: Option<Arc<Refraction>>,
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
        Ok(Self { density, light, refraction: refraction.transpose()? })
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
        if scene.geometry.mesh().triangles.is_empty() {
            return Vec::new();
        }
        (0..rays.len()).into_par_iter().map(|row| self.end(scene, rays, row).0).collect()
    }

    /// What a ray sees behind the volume: the radiance there, before it passes the medium.
    pub fn background(&self, scene: &VolumeScene, rays: &PixelRays, row: usize) -> Rgb {
        let (length, ray) = self.end(scene, rays, row);
        if length.is_finite()
            && let Some(hit) = scene.geometry.first_hit(&ray, f64::INFINITY)
        {
            let point = ray.at(hit.distance);
            return self.surface(scene, point, hit.normal, hit.albedo);
        }
        let [view, pixel] = rays.pixel(row);
        let picture = scene.views.get(view as usize).and_then(|view| view.background.as_ref());
        match (picture, scene.background) {
            (Some(picture), _) => picture.pixels[pixel as usize],
            (None, Some(color)) => color,
            (None, None) => scene.environment.radiance(ray.direction),
        }
    }

    /// How far a ray goes, and the straight ray that it ends on.
    fn end(&self, scene: &VolumeScene, rays: &PixelRays, row: usize) -> (f64, Ray) {
        let is_open = scene.geometry.mesh().triangles.is_empty();
        let mut end = (f64::INFINITY, rays.ray(row));
        rays.each_straight(row, self.refraction.as_deref(), |ray, a, b| {
            let start = Ray { origin: ray.at(a), direction: ray.direction };
            end.1 = start;
            if is_open {
                return true;
            }
            match scene.geometry.first_hit(&start, b - a) {
                Some(hit) => {
                    end.0 = a + hit.distance;
                    false
                }
                None => true,
            }
        });
        end
    }

    /// Radiance of a diffuse surface: suns through the medium, and the mean of the environment.
    fn surface(&self, scene: &VolumeScene, point: DVec3, normal: DVec3, albedo: Rgb) -> Rgb {
        let around = scene.environment.mean();
        let mut sum: [f64; 3] = std::array::from_fn(|c| f64::from(around[c]));
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
    let size = scene.light_size.unwrap_or(density.grid().size().map(light_side));
    let grid = VoxelGrid::over_cube(size, density.grid().world_from_cube())?;
    let mut fields = Vec::new();
    // What does not depend on the view is one volume.
    let mut everywhere = Vec::new();
    let isotropic = henyey_greenstein(0.0, 0.0);
    let scattered = |radiance: Rgb| radiance.map(|value| (f64::from(value) * isotropic) as f32);
    if sky {
        if medium.g != 0.0 {
            return Err(Error::value("volume.g", medium.g, "0 where there is environment light"));
        }
        everywhere.extend(
            scene
                .environment
                .beams()
                .into_iter()
                .filter(|(_, radiance)| *radiance != [0.0; 3])
                .map(|(towards, radiance)| Beam { towards, radiance: scattered(radiance) }),
        );
    }
    for sun in suns {
        let towards = -sun.direction;
        if medium.g == 0.0 {
            everywhere.push(Beam { towards, radiance: scattered(sun.radiance) });
        } else {
            let beam = Beam { towards, radiance: sun.radiance };
            let radiance = light_volume(density, &scene.geometry, grid, &[beam])?;
            let along = Some((sun.direction, medium.g));
            fields.push(LitVolume { along, radiance: Arc::new(radiance) });
        }
    }
    if !everywhere.is_empty() {
        let radiance = light_volume(density, &scene.geometry, grid, &everywhere)?;
        fields.push(LitVolume { along: None, radiance: Arc::new(radiance) });
    }
    Ok(Some(Arc::new(InScattering::new(fields))))
}

/// Voxels of the cached light beside so many of the medium.
fn light_side(side: usize) -> usize {
    let [fewest, most] = LIGHT_SIDES;
    (side / 2).clamp(fewest.min(side), most)
}

/// Length of the shortest side of a voxel, in metres.
fn shortest_side(grid: &VoxelGrid) -> f64 {
    let m = grid.world_from_grid().matrix3;
    m.x_axis.length().min(m.y_axis.length()).min(m.z_axis.length())
}
