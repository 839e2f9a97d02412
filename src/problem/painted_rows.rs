//! The rays through painted pixels, of one scene or of several before whose suns one light map stands.

use std::sync::Arc;

use rayon::prelude::*;

use super::colors::panes_before;
use super::extents::fit_to;
use super::surfaces::lengths;
use super::{Constraint, Maps, Surfaces};
use crate::march::{LightMapTransport, LightMapTraversal, RowSuns, SeenPane, SeenPanes, ViewRay};
use crate::scene::{Quadrature, Rgb, Scene};
use crate::visibility::{Geometry, Hit};
use crate::{Error, Result};

/// Painted pixels with what their rays meet.
pub(super) struct PaintedRows {
    pub(super) constraints: Vec<Constraint>,
    pub(super) hits: Vec<Option<Hit>>,
    /// Those of each scene.
    pub(super) maps: Vec<Maps>,
    /// The radiance that looks add to each.
    pub(super) added: Vec<Rgb>,
    pub(super) traversal: LightMapTraversal,
    /// Whether one weight serves all channels, panes aside.
    pub(super) is_grey: bool,
}

/// Those of one scene.
struct OfScene {
    constraints: Vec<Constraint>,
    hits: Vec<Option<Hit>>,
    maps: Maps,
    rays: Vec<ViewRay>,
    added: Vec<Rgb>,
    panes: Vec<Vec<SeenPane>>,
}

impl OfScene {
    fn new(
        scene: &Scene,
        geometry: &Arc<Geometry>,
        constraints: Vec<Constraint>,
        surfaces: &dyn Surfaces,
    ) -> Result<Self> {
        let hits = surfaces.hits(scene, geometry, &constraints)?;
        let lengths = lengths(&hits);
        let maps = fit_to(scene, &scene.light_map, geometry, &constraints, &lengths, surfaces)?;
        let ray = |(pixel, &length): (&Constraint, &f64)| {
            let ray = scene.views[pixel.view].camera.pixel_ray(pixel.x, pixel.y);
            maps.view_ray(&ray, length, &scene.medium)
        };
        let (rays, added) = constraints.par_iter().zip(&lengths).map(ray).unzip();
        let panes = panes_before(scene, geometry, &constraints, &lengths);
        Ok(Self { constraints, hits, maps, rays, added, panes })
    }
}

impl PaintedRows {
    /// The views of later scenes are counted behind those of the scenes before them. Weights are relative to the first sun: what stands for a
    /// part of its light stands for the same part of the others'.
    ///
    /// Errors: [`Error::Value`] for a sun that has light in a channel in which the first one has none, and for light maps that do not lie at
    /// the same place; those of `surfaces` and of the maps.
    pub(super) fn new(
        scenes: Vec<(&Scene, Vec<Constraint>)>,
        geometry: &Arc<Geometry>,
        surfaces: &dyn Surfaces,
    ) -> Result<Self> {
        let first = scenes[0].0;
        let (mut parts, mut shares, mut views) = (Vec::with_capacity(scenes.len()), Vec::new(), 0);
        for (scene, constraints) in scenes {
            let mut part = OfScene::new(scene, geometry, constraints, surfaces)?;
            let share = share(scene.light.radiance, first.light.radiance)?;
            part.constraints.iter_mut().for_each(|pixel| pixel.view += views);
            for ray in &mut part.rays {
                ray.scattering = [0, 1, 2].map(|c| ray.scattering[c] * share[c]);
            }
            views += scene.views.len();
            shares.push(share);
            parts.push(part);
        }
        if parts.iter().any(|part| part.maps.light_map != parts[0].maps.light_map) {
            let expected = "given, and the same for all suns before which one light map stands";
            return Err(Error::value("light_map.extent", "one of several", expected));
        }
        let is_grey = shares.iter().all(|share| *share == [share[0]; 3])
            && parts.iter().all(|part| part.maps.is_grey(&first.medium));
        let suns = (parts.len() > 1).then(|| RowSuns {
            shadow_maps: parts.iter().map(|part| part.maps.shadow_map.clone()).collect(),
            of_rows: (0..).zip(&parts).flat_map(|(sun, part)| part.rays.iter().map(move |_| sun)).collect(),
        });
        let maps = parts.iter().map(|part| part.maps.clone()).collect();
        let mut parts = parts.into_iter();
        let Some(mut all) = parts.next() else { unreachable!("there is a first scene") };
        for part in parts {
            all.constraints.extend(part.constraints);
            all.hits.extend(part.hits);
            all.rays.extend(part.rays);
            all.added.extend(part.added);
            all.panes.extend(part.panes);
        }
        let panes = SeenPanes::new(all.panes.iter().map(|row| &row[..]));
        let transport = transport(first, &all.maps, first.solve.quadrature);
        let OfScene { constraints, hits, rays, added, .. } = all;
        let traversal = LightMapTraversal::new(transport, rays.into()).through_panes(panes);
        let traversal = match suns {
            None => traversal,
            Some(suns) => traversal.under(Arc::new(suns)),
        };
        Ok(Self { constraints, hits, maps, added, traversal, is_grey })
    }
}

/// The radiance of a sun as a share of the first one's.
fn share(radiance: Rgb, first: Rgb) -> Result<[f64; 3]> {
    if (0..3).any(|c| first[c] == 0.0 && radiance[c] > 0.0) {
        let expected = "above 0 at the first key in each channel in which a later one has light";
        return Err(Error::value("light.radiance", format!("{first:?}"), expected));
    }
    Ok([0, 1, 2].map(|c| match radiance[c] == first[c] {
        true => 1.0,
        false => f64::from(radiance[c]) / f64::from(first[c]),
    }))
}

/// What all rays of a scene share.
pub(super) fn transport(scene: &Scene, maps: &Maps, quadrature: Quadrature) -> LightMapTransport {
    LightMapTransport {
        sigma_t: scene.medium.sigma_t,
        shadow_map: maps.shadow_map.clone(),
        light_map: maps.light_map,
        basis: scene.solve.basis,
        quadrature,
        transmittance_bound: scene.solve.transmittance_bound,
        mask: None,
    }
}
