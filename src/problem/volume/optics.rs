use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::VolumeState;
use crate::cpu::{Beam, light_volume};
use crate::march::{Density, InScattering, LitVolume, PixelRays, Refraction, VolumeTransport};
use crate::scene::{
    DirectionalLight, Environment, Ray, Rgb, VolumeMedium, VolumeScene, VoxelGrid, henyey_greenstein,
};
use crate::visibility::{Geometry, Hit};
use crate::{Error, Result};

/// Voxels of the cached light along an axis at most, where the scene does not say how many: as many as the medium has. A sun casts
/// shadows, which are sharp; light from everywhere is smooth, and costs as much as it has directions.
///
/// Relative error of pictures of a medium of 24³ lit at 24³: 0.9 % by a sun, from everywhere 0.6 % in a thin medium and 1.6 % in one of
/// up to 1.5 optical depths a voxel (docs/volumes.md).
const SUN_SIDE: usize = 128;
const SKY_SIDE: usize = 64;

/// A medium as rays meet it: its extinction, the light that it scatters, what bends the rays, and the surfaces around it.
#[derive(Debug, Clone)]
pub struct Optics {
    /// Surfaces in front of the medium, inside it and behind.
    geometry: Arc<Geometry>,
    /// Extinction.
    pub density: Arc<Density>,
    /// Light to be scattered; none where it is dark.
    pub light: Option<Arc<InScattering>>,
    /// The part of it that comes from suns.
    pub suns: Option<Arc<InScattering>>,
    /// What bends the rays.
    pub refraction: Option<Arc<Refraction>>,
    /// What comes from everywhere else.
    environment: Environment,
    /// Its mean radiance, which surfaces reflect.
    around: Rgb,
}

/// What a ray sees behind the volume.
pub(super) enum Behind {
    /// Radiance that does not depend on the environment.
    Known(Rgb),
    /// The environment in a direction.
    Sky(DVec3),
    /// A diffuse surface: its albedo, and what it reflects of the suns.
    Surface(Rgb, Rgb),
}

impl Optics {
    /// Prepares a medium under the suns of a scene and its environment: the light that arrives is attenuated and shadowed once,
    /// and cached. The hierarchy must be of the scene's triangles; it does not depend on the state, so that one serves many.
    ///
    /// Errors: [`Error::Value`] for anisotropic scattering of environment light, which would need one cached volume a
    /// direction.
    pub fn new(scene: &VolumeScene, geometry: &Arc<Geometry>, state: &VolumeState) -> Result<Self> {
        let VolumeState { medium, environment } = state;
        let density = Density::new(medium.extinction.clone(), medium.interpolation);
        let density = Arc::new(if scene.solve.skip.bricks { density } else { density.entered_everywhere() });
        let refraction = medium.refraction.as_ref().map(|(index, step)| {
            let step = step.unwrap_or_else(|| 0.5 * shortest_side(index.grid()));
            Ok::<_, Error>(Arc::new(Refraction::new(index.clone(), step)?))
        });
        let sky = sky(scene, geometry, medium, environment, &density)?;
        let suns = suns(scene, geometry, medium, &density)?;
        let together = |fields: Vec<LitVolume>| match fields.is_empty() {
            true => None,
            false => Some(Arc::new(InScattering::new(fields))),
        };
        Ok(Self {
            geometry: geometry.clone(),
            light: together(sky.into_iter().chain(suns.iter().cloned()).collect()),
            suns: together(suns),
            density,
            refraction: refraction.transpose()?,
            around: environment.mean(),
            environment: environment.clone(),
        })
    }

    /// The hierarchy over the scene's triangles.
    pub fn geometry(&self) -> &Arc<Geometry> {
        &self.geometry
    }

    /// Whether white light arrives as grey light everywhere.
    pub(super) fn is_lit_grey(&self) -> bool {
        self.density.is_grey() && self.geometry.is_grey()
    }

    /// What comes from everywhere but the suns.
    pub fn environment(&self) -> &Environment {
        &self.environment
    }

    /// What all rays share.
    pub fn transport(&self, scene: &VolumeScene, medium: &VolumeMedium) -> VolumeTransport {
        VolumeTransport {
            density: self.density.clone(),
            basis: medium.interpolation,
            quadrature: scene.solve.quadrature,
            accuracy: scene.solve.accuracy,
            transmittance_bound: scene.solve.transmittance_bound,
            refraction: self.refraction.clone(),
        }
    }

    /// Distances in metres to the surfaces that rays meet, infinite for rays that meet none; empty where there are no surfaces.
    pub fn lengths(&self, rays: &PixelRays) -> Vec<f64> {
        if self.geometry.is_open() {
            return Vec::new();
        }
        let length = |row: usize| self.end(rays, row).1.map_or(f64::INFINITY, |(length, _)| length);
        (0..rays.len()).into_par_iter().map(length).collect()
    }

    /// What a ray sees behind the volume: the radiance there, before it passes the medium.
    pub fn background(&self, scene: &VolumeScene, rays: &PixelRays, row: usize) -> Rgb {
        match self.behind(scene, rays, row) {
            Behind::Known(color) => color,
            Behind::Sky(towards) => self.environment.radiance(towards),
            Behind::Surface(albedo, suns) => std::array::from_fn(|c| albedo[c] * self.around[c] + suns[c]),
        }
    }

    /// The part of it that is not the environment's.
    pub(super) fn known_background(&self, scene: &VolumeScene, rays: &PixelRays, row: usize) -> Rgb {
        match self.behind(scene, rays, row) {
            Behind::Known(color) => color,
            Behind::Sky(_) => [0.0; 3],
            Behind::Surface(_, suns) => suns,
        }
    }

    pub(super) fn behind(&self, scene: &VolumeScene, rays: &PixelRays, row: usize) -> Behind {
        let [view, pixel] = rays.pixel(row);
        let picture = scene.views.get(view as usize).and_then(|view| view.background.as_ref());
        let known = picture.map(|picture| picture.pixels[pixel as usize]).or(scene.background);
        if let (true, Some(color)) = (self.geometry.is_open(), known) {
            return Behind::Known(color);
        }
        let (ray, hit) = self.end(rays, row);
        match (hit, known) {
            (Some((length, hit)), _) => {
                let suns = self.reflected(scene, hit.lifted(ray.at(hit.distance), length), hit.normal);
                Behind::Surface(hit.albedo, std::array::from_fn(|c| hit.albedo[c] * suns[c]))
            }
            (None, Some(color)) => Behind::Known(color),
            (None, None) => Behind::Sky(ray.direction),
        }
    }

    /// The straight ray that a row ends on; and, where it meets a surface, the length of the row in metres and the hit.
    fn end(&self, rays: &PixelRays, row: usize) -> (Ray, Option<(f64, Hit)>) {
        let mut end = (rays.ray(row), None);
        rays.each_straight(row, self.refraction.as_deref(), |ray, a, b| {
            let start = Ray { origin: ray.at(a), direction: ray.direction };
            // No view of a volume looks through panes.
            let hit = self.geometry.first_surface(&start, b - a);
            end = (start, hit.map(|hit| (a + hit.distance, hit)));
            end.1.is_none()
        });
        end
    }

    /// Radiance that a white diffuse surface just below a point reflects of the suns, through the medium.
    fn reflected(&self, scene: &VolumeScene, point: DVec3, normal: DVec3) -> Rgb {
        let mut sum = [0.0; 3];
        for sun in &scene.lights {
            let cosine = -normal.dot(sun.direction);
            let towards = Ray { origin: point, direction: -sun.direction };
            let passes = self.geometry.transmittance(&towards, f64::INFINITY);
            if cosine <= 0.0 || passes == [0.0; 3] {
                continue;
            }
            let tau = self.density.optical_depth(point, -sun.direction, f64::INFINITY);
            for c in 0..3 {
                sum[c] +=
                    f64::from(passes[c] * sun.radiance[c]) * cosine / std::f64::consts::PI * (-tau[c]).exp();
            }
        }
        sum.map(|value| value as f32)
    }
}

/// Rays through pixels of a scene's views, without surfaces.
pub(super) fn open_rays(scene: &VolumeScene, pixels: &[[u32; 2]]) -> PixelRays {
    let cameras: Vec<_> = scene.views.iter().map(|view| view.view.camera.clone()).collect();
    PixelRays::new(cameras.into(), pixels, Vec::new().into())
}

/// The grid of the cached light.
fn light_grid(scene: &VolumeScene, density: &Density, most: usize) -> Result<VoxelGrid> {
    let size = scene.light_size.unwrap_or(density.grid().size().map(|side| side.min(most)));
    VoxelGrid::over_cube(size, density.grid().world_from_cube())
}

/// The grid of the light from everywhere.
pub(super) fn sky_grid(scene: &VolumeScene, density: &Density) -> Result<VoxelGrid> {
    light_grid(scene, density, SKY_SIDE)
}

/// Light from one direction, times the phase function of scattering that is the same in all directions.
pub(super) fn scattered(towards: DVec3, radiance: Rgb) -> Beam {
    let isotropic = henyey_greenstein(0.0, 0.0);
    Beam { towards, radiance: radiance.map(|value| (f64::from(value) * isotropic) as f32) }
}

/// Errors: [`Error::Value`] where the phase function depends on the view, so that every direction would need a volume.
pub(super) fn check_phase(medium: &VolumeMedium) -> Result<()> {
    if medium.g == 0.0 {
        return Ok(());
    }
    Err(Error::value("volume.g", medium.g, "0 where there is environment light"))
}

fn sky(
    scene: &VolumeScene,
    geometry: &Geometry,
    medium: &VolumeMedium,
    environment: &Environment,
    density: &Density,
) -> Result<Option<LitVolume>> {
    if density.cells().is_empty() || environment.is_dark() {
        return Ok(None);
    }
    check_phase(medium)?;
    let beams = environment.beams().into_iter().filter(|(_, radiance)| *radiance != [0.0; 3]);
    let beams: Vec<Beam> = beams.map(|(towards, radiance)| scattered(towards, radiance)).collect();
    let radiance = light_volume(density, geometry, sky_grid(scene, density)?, &beams)?;
    Ok(Some(LitVolume { along: None, radiance: Arc::new(radiance) }))
}

fn suns(
    scene: &VolumeScene,
    geometry: &Geometry,
    medium: &VolumeMedium,
    density: &Density,
) -> Result<Vec<LitVolume>> {
    let suns: Vec<_> = scene.lights.iter().filter(|sun| sun.radiance != [0.0; 3]).collect();
    if density.cells().is_empty() || suns.is_empty() {
        return Ok(Vec::new());
    }
    let grid = light_grid(scene, density, SUN_SIDE)?;
    let lit = |along, beams: &[Beam]| -> Result<LitVolume> {
        let radiance = Arc::new(light_volume(density, geometry, grid, beams)?);
        Ok(LitVolume { along, radiance })
    };
    // Where the phase function does not depend on the view, it is part of what arrives.
    if medium.g == 0.0 {
        let beams: Vec<Beam> = suns.iter().map(|sun| scattered(-sun.direction, sun.radiance)).collect();
        return Ok(vec![lit(None, &beams)?]);
    }
    let of_sun = |sun: &&DirectionalLight| {
        let beam = Beam { towards: -sun.direction, radiance: sun.radiance };
        lit(Some((sun.direction, medium.g)), &[beam])
    };
    suns.iter().map(of_sun).collect()
}

/// Length of the shortest side of a voxel, in metres.
fn shortest_side(grid: &VoxelGrid) -> f64 {
    let m = grid.world_from_grid().matrix3;
    m.x_axis.length().min(m.y_axis.length()).min(m.z_axis.length())
}
