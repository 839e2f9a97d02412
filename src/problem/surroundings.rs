//! Light beside that of the light map: what view rays show of the sun on surfaces and of lights from everywhere.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::constraints::RowRadiance;
use super::{Constraint, Maps};
use crate::march::{FurtherWeights, LightMapTraversal, Reflected, SeenPane, ViewRay, weight_between};
use crate::scene::{Basis, Grid, Ray, Rgb, Scene, luminance, rgb};
use crate::visibility::{Geometry, Hit};
use crate::{Error, Result};

/// A view ray, the first solid surface on it, and the panes before that.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub(super) ray: Ray,
    pub(super) hit: Option<Hit>,
    pub(super) panes: Vec<SeenPane>,
}

impl Seen {
    pub(super) fn along(maps: &Maps, ray: Ray) -> Self {
        let hit = maps.geometry.first_hit(&ray, f64::INFINITY);
        Self::up_to(&maps.geometry, ray, hit)
    }

    /// Where the surface has been found already.
    pub(super) fn up_to(geometry: &Geometry, ray: Ray, hit: Option<Hit>) -> Self {
        let length = hit.map_or(f64::INFINITY, |hit| hit.distance);
        Self { ray, hit, panes: SeenPane::through(&geometry.panes(&ray, length)) }
    }

    /// What passes of light from the surface through all panes.
    fn passes(&self) -> [f64; 3] {
        self.panes.last().map_or([1.0; 3], |pane| pane.passes)
    }

    /// The point of the surface, and its radiance towards the eye per radiance of light that comes over one steradian from a
    /// direction. None where that light does not arrive.
    pub(super) fn reflected(&self, scene: &Scene, maps: &Maps, towards: DVec3) -> Option<(DVec3, Rgb)> {
        let hit = self.hit?;
        let cosine = hit.normal.dot(towards);
        if cosine <= 0.0 {
            return None;
        }
        let point = self.ray.at(hit.distance);
        let origin = hit.lifted(point, hit.distance);
        let arriving = maps.geometry.transmittance(&Ray { origin, direction: towards }, f64::INFINITY);
        if arriving == [0.0; 3] {
            return None;
        }
        let (transmittance, passes) = (scene.medium.transmittance(hit.distance), self.passes());
        let on_the_way = |c: usize| transmittance[c] * passes[c] * f64::from(arriving[c]);
        Some((point, rgb(|c| (f64::from(hit.albedo[c]) * cosine / PI * on_the_way(c)) as f32)))
    }

    /// Radiance of medium and surface under light that is the same from everywhere and meets nothing on its way; on the surface another light may arrive in its place.
    pub(super) fn under_ambient(&self, scene: &Scene, ambient: Rgb, arriving: Option<Rgb>) -> Rgb {
        let [of_medium, of_surface, of_both] = self.of_ambient(scene);
        match arriving {
            None => rgb(|c| ambient[c] * of_both[c]),
            Some(arriving) => rgb(|c| ambient[c] * of_medium[c] + arriving[c] * of_surface[c]),
        }
    }

    /// Radiance of the medium, of the surface and of both per radiance of light that arrives there.
    fn of_ambient(&self, scene: &Scene) -> [Rgb; 3] {
        let transmittance = self.hit.map_or([0.0; 3], |hit| scene.medium.transmittance(hit.distance));
        // A pane takes away a part of all that is behind it.
        let taken = |c: usize| {
            let mut before = 1.0;
            let taken = self.panes.iter().map(|pane| {
                let behind = scene.medium.transmittance(pane.distance)[c] - transmittance[c];
                (std::mem::replace(&mut before, pane.passes[c]) - pane.passes[c]) * behind
            });
            taken.sum::<f64>()
        };
        let passes = self.passes();
        let surface = rgb(|c| self.hit.map_or(0.0, |hit| passes[c] as f32 * hit.albedo[c]));
        let medium = scene.medium.albedo.map(|albedo| albedo as f32);
        let untaken = rgb(|c| medium[c] * (1.0 - taken(c) as f32));
        let behind = transmittance.map(|passes| passes as f32);
        [
            rgb(|c| untaken[c] - behind[c] * medium[c]),
            rgb(|c| behind[c] * surface[c]),
            rgb(|c| untaken[c] + behind[c] * (surface[c] - medium[c])),
        ]
    }

    /// Radiance that is seen per radiance of each light of the sky: what the medium scatters, and what the surface reflects. It is
    /// 0 for lights that are not asked for.
    ///
    /// Where a ray meets no surface it ends in the medium, which is everywhere: nobody sees the sky itself.
    pub(super) fn of_sky(
        &self,
        scene: &Scene,
        maps: &Maps,
        is_asked_for: impl Fn(usize) -> bool,
    ) -> Vec<[f64; 3]> {
        let lights =
            scene.surroundings.as_ref().and_then(|it| it.sky.as_ref()).map_or(0, |sky| sky.start.len());
        let mut weights = vec![[0.0; 3]; lights];
        let length = self.hit.map_or(f64::INFINITY, |hit| hit.distance);
        let end = length.min(scene.medium.reach(scene.solve.transmittance_bound));
        for beam in maps.sky.iter().filter(|beam| is_asked_for(beam.light)) {
            let ray = ViewRay::new(&self.ray, length, &beam.frame, &scene.medium);
            let scattered =
                weight_between(&ray, &self.panes, scene.medium.sigma_t, &beam.shadow_map, [0.0, end]);
            let reflected = self.reflected(scene, maps, beam.towards).map_or([0.0; 3], |(_, share)| share);
            for c in 0..3 {
                weights[beam.light][c] += beam.solid_angle * (scattered[c] + f64::from(reflected[c]));
            }
        }
        weights
    }
}

/// The texels around a point of the light map, and where the point lies between them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corners {
    /// Of the lower row, then of the upper one.
    texels: [[usize; 2]; 2],
    between: [f32; 2],
}

impl Corners {
    /// Around a world-space point.
    pub(super) fn around(maps: &Maps, basis: Basis, point: DVec3) -> Option<Self> {
        let grid: &Grid = &maps.light_map;
        let p = maps.frame.light_from_world(point);
        let p = grid.grid_from_light(DVec2::new(p.x, p.y));
        let size = DVec2::new(grid.size[0] as f64, grid.size[1] as f64);
        if p.cmplt(DVec2::ZERO).any() || p.cmpge(size).any() {
            return None;
        }
        let (low, high, between) = match basis {
            Basis::Nearest => (p, p, DVec2::ZERO),
            Basis::Bilinear => {
                let q = (p - 0.5).clamp(DVec2::ZERO, size - 1.0);
                (q.floor(), (q.floor() + 1.0).min(size - 1.0), q - q.floor())
            }
        };
        let row = |y: f64| [low.x, high.x].map(|x| y as usize * grid.size[0] + x as usize);
        Some(Self { texels: [row(low.y), row(high.y)], between: between.as_vec2().to_array() })
    }

    /// The texels' value there.
    pub(super) fn value(&self, texels: &[Rgb]) -> Rgb {
        let mix = |a: Rgb, b: Rgb, f: f32| rgb(|c| a[c] + f * (b[c] - a[c]));
        let row = |[a, b]: [usize; 2]| mix(texels[a], texels[b], self.between[0]);
        mix(row(self.texels[0]), row(self.texels[1]), self.between[1])
    }

    /// What a surface there shows of each texel, with this share of the light.
    fn reflected(&self, share: Rgb) -> Reflected {
        let [x, y] = self.between;
        let mut reflected = Reflected::NOTHING;
        for (row, of_row) in self.texels.iter().zip([1.0 - y, y]) {
            for (&texel, of_texel) in row.iter().zip([1.0 - x, x]) {
                reflected.add(texel, share.map(|share| share * of_row * of_texel));
            }
        }
        reflected
    }
}

/// The rows of a scene that looks for its surroundings: all that they show, light by light.
pub(super) struct AllLight {
    /// The weights of what is looked for beside the texels along the rays.
    pub(super) further: FurtherWeights,
    /// What is known of the rows.
    pub(super) radiance: RowRadiance,
}

/// What arrives at the surfaces that painted pixels show, view by view; none where it is the ambient light.
struct ArrivingLight<'s> {
    scene: &'s Scene,
    of_views: Vec<Option<Vec<Rgb>>>,
}

impl<'s> ArrivingLight<'s> {
    fn new(scene: &'s Scene, maps: &Maps, constraints: &[Constraint]) -> Self {
        let of_view = |view: usize| {
            let light = maps.surface_light.as_ref()?;
            let is_painted = constraints.iter().any(|pixel| pixel.view == view);
            is_painted.then(|| light.arriving(&scene.views[view].camera, &maps.geometry))
        };
        Self { scene, of_views: (0..scene.views.len()).map(of_view).collect() }
    }

    fn at(&self, pixel: &Constraint) -> Option<Rgb> {
        let width = self.scene.views[pixel.view].camera.size()[0];
        self.of_views[pixel.view].as_ref().map(|arriving| arriving[pixel.y * width + pixel.x])
    }
}

/// One row of it.
struct RowLight {
    further: Vec<Rgb>,
    reflected: Reflected,
    known: Rgb,
    plain: Rgb,
    white: Rgb,
}

impl AllLight {
    /// None for a scene that asks for no surroundings.
    ///
    /// Errors: [`Error::Empty`] when the sun or the sky is looked for and no row shows anything of it.
    pub(super) fn new(
        scene: &Scene,
        maps: &Maps,
        constraints: &[Constraint],
        hits: &[Option<Hit>],
        traversal: &LightMapTraversal,
    ) -> Result<Option<Self>> {
        let Some(settings) = &scene.surroundings else { return Ok(None) };
        let start = settings.start(scene.light.radiance);
        let arriving = ArrivingLight::new(scene, maps, constraints);
        let rows: Vec<RowLight> = constraints
            .par_iter()
            .zip(hits)
            .enumerate()
            .map(|(row, (pixel, &hit))| {
                let ray = scene.views[pixel.view].camera.pixel_ray(pixel.x, pixel.y);
                let seen = Seen::up_to(&maps.geometry, ray, hit);
                RowLight::new(scene, maps, (&seen, arriving.at(pixel)), traversal, row, &start)
            })
            .collect();
        let is_seen = |of: std::ops::Range<usize>| {
            rows.iter().any(|row| row.further[of.clone()].iter().flatten().any(|&weight| weight > 0.0))
        };
        let suns = usize::from(settings.sun);
        if settings.sun && !is_seen(0..1) {
            return Err(Error::Empty {
                reason: "no painted pixel shows any of the sun from outside the light map".to_owned(),
                remedy: "leave surroundings.sun away, or set a smaller light_map.extent",
            });
        }
        if settings.sky.is_some() && !is_seen(suns..start.len()) {
            return Err(Error::Empty {
                reason: format!(
                    "none of the {} lights of surroundings.environment reaches what the painted pixels show",
                    start.len() - suns
                ),
                remedy: "spread them over the sphere, or turn lights.up towards where light can come from",
            });
        }
        let weights: Vec<Rgb> = rows.iter().flat_map(|row| &row.further).copied().collect();
        let reflected = rows.iter().map(|row| row.reflected).collect();
        Ok(Some(Self {
            further: FurtherWeights::new(start.len(), &weights, reflected)?,
            radiance: RowRadiance {
                known: rows.iter().map(|row| row.known).collect(),
                plain: rows.iter().map(|row| row.plain).collect(),
                white: rows.iter().map(|row| row.white).collect(),
            },
        }))
    }
}

impl RowLight {
    fn new(
        scene: &Scene,
        maps: &Maps,
        (seen, arriving): (&Seen, Option<Rgb>),
        traversal: &LightMapTraversal,
        row: usize,
        start: &[Rgb],
    ) -> Self {
        let sun = seen.reflected(scene, maps, -scene.light.direction);
        let corners = sun.and_then(|(point, _)| Corners::around(maps, scene.solve.basis, point));
        let share = sun.map_or([0.0; 3], |(_, share)| share);
        let (outside, lit) = (traversal.outside_weight(row), traversal.lit_weight(row));
        let of_sun = rgb(|c| outside[c] as f32 + if corners.is_none() { share[c] } else { 0.0 });
        let is_sought = scene.surroundings.as_ref().is_some_and(|it| it.sun);
        let of_sky = seen.of_sky(scene, maps, |_| true);
        let of_sky = of_sky.into_iter().map(|weight| weight.map(|value| value as f32));
        let further: Vec<Rgb> = is_sought.then_some(of_sun).into_iter().chain(of_sky).collect();
        let ambient = seen.under_ambient(scene, scene.ambient, arriving);
        let unsought = if is_sought { [0.0; 3] } else { scene.light.radiance };
        let lights = further.iter().zip(start).skip(usize::from(is_sought));
        let under = |color: fn(Rgb) -> Rgb| {
            let sun = color(scene.light.radiance);
            let ambient = seen.under_ambient(scene, color(scene.ambient), arriving.map(color));
            rgb(|c| {
                let sky: f32 = lights.clone().map(|(weight, start)| weight[c] * color(*start)[c]).sum();
                (lit[c] as f32 + share[c]) * sun[c] + ambient[c] + sky
            })
        };
        Self {
            reflected: corners.map_or(Reflected::NOTHING, |corners| corners.reflected(share)),
            known: rgb(|c| ambient[c] + of_sun[c] * unsought[c]),
            plain: under(|color| color),
            white: under(|color| [luminance(color); 3]),
            further,
        }
    }
}
