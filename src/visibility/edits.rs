//! Edits of shadow maps: what casts shadows in the air is bent (Kol et al. 2017, sec. 4.1).

mod lines;
mod morphology;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{Geometry, ShadowMap};
use crate::scene::{Grid, Holes, Kernel, LightFrame, OccluderEdit, OccluderEditKind, Radius};
use crate::{Error, Result};
use lines::Lines;
use morphology::{Extremum, Window};

/// The shadow map with edits one after the other.
///
/// Cost    closures with squares and along lines, and extrusion: the same for any radius; with discs it grows with the radius. Holes are a ray for
///         each texel in one.
/// Errors  [`Error::Value`] for a radius that is longer than the map; those of [`ShadowMap::new`]
pub fn edited(
    map: ShadowMap,
    geometry: &Geometry,
    frame: &LightFrame,
    edits: &[OccluderEdit],
) -> Result<ShadowMap> {
    if edits.is_empty() {
        return Ok(map);
    }
    let (grid, origin) = (*map.grid(), map.depth_origin());
    let mut depths = map.solid_depths();
    for (number, OccluderEdit { kind, strength }) in edits.iter().enumerate() {
        if let OccluderEditKind::Fill(_, radius) | OccluderEditKind::Extrude { radius, .. } = kind {
            check(&grid, *radius).map_err(|error| error.inside(&format!("looks.occluders[{number}]")))?;
        }
        let before = depths.clone();
        match kind {
            OccluderEditKind::Fill(Kernel::Disc, radius) => {
                let radius = texels(&grid, *radius);
                morphology::closed(&mut depths, grid.size, &Window::disc(radius));
            }
            OccluderEditKind::Fill(Kernel::Square, radius) => {
                let radius = texels(&grid, *radius);
                morphology::closed(&mut depths, grid.size, &Window::square(radius));
            }
            OccluderEditKind::Fill(Kernel::Lines(eye), radius) => {
                let lines = Lines::new(&grid, epipole(*eye, frame, origin), *radius);
                lines.filter(&mut depths, Extremum::Least);
                lines.filter(&mut depths, Extremum::Largest);
                // Neighbouring lines differ by less than a texel; closing takes no light away from what had none.
                depths.par_iter_mut().zip(&before).for_each(|(depth, before)| *depth = depth.min(*before));
            }
            OccluderEditKind::Extrude { eye, radius } => {
                let lines = Lines::new(&grid, epipole(*eye, frame, origin), *radius);
                lines.filter(&mut depths, Extremum::Least);
            }
            OccluderEditKind::Pierce(holes) => pierce(&mut depths, (&grid, origin), geometry, frame, holes),
        }
        mix(&mut depths, &before, *strength);
    }
    ShadowMap::new(grid, origin, &depths)?.with_panes_of(geometry, frame)
}

/// Whether a radius is no longer than the map: one that is was meant in another unit.
fn check(grid: &Grid, radius: Radius) -> Result<()> {
    let largest = grid.size[0].max(grid.size[1]) as f64;
    let reach = texels(grid, radius).max_element();
    if reach >= 0.0 && reach <= largest {
        return Ok(());
    }
    let expected = "0 or more, and within the shadow map";
    Err(match radius {
        Radius::Texels(texels) => Error::value("texels", texels, expected),
        Radius::Metres(length) => Error::value("length", length, expected),
    })
}

/// A radius in texels along both axes.
fn texels(grid: &Grid, radius: Radius) -> DVec2 {
    match radius {
        Radius::Texels(texels) => DVec2::splat(texels),
        Radius::Metres(metres) => metres * grid.density(),
    }
}

/// Where an eye is in the light's frame, its depth relative to that of a shadow map.
fn epipole(eye: DVec3, frame: &LightFrame, depth_origin: f64) -> DVec3 {
    frame.light_from_world(eye) - depth_origin * DVec3::Z
}

/// Lets light through what is pierced, where there are holes.
fn pierce(
    depths: &mut [f32],
    (grid, origin): (&Grid, f64),
    geometry: &Geometry,
    frame: &LightFrame,
    holes: &Holes,
) {
    let is_pierced = |triangle: usize| holes.pierced.get(triangle).copied().unwrap_or(false);
    depths.par_iter_mut().enumerate().for_each(|(texel, depth)| {
        let place = grid.centre(texel % grid.size[0], texel / grid.size[0]);
        if depth.is_finite() && holes.is_hole(place) {
            let ray = ShadowMap::ray(frame, place, origin);
            // What another edit has moved stays where nothing is pierced.
            if geometry.first_hit(&ray, f64::INFINITY).is_some_and(|hit| is_pierced(hit.triangle)) {
                let hit = geometry.first_hit_but(&ray, f64::INFINITY, is_pierced);
                *depth = hit.map_or(f32::INFINITY, |distance| distance as f32);
            }
        }
    });
}

/// Goes only part of the way. Where nothing casts a shadow, before or after, depths begin or end behind all that does.
fn mix(depths: &mut [f32], before: &[f32], strength: f64) {
    if strength == 1.0 {
        return;
    }
    let finite = depths.iter().chain(before).copied().filter(|depth| depth.is_finite());
    let behind = f64::from(finite.fold(0.0, f32::max));
    depths.par_iter_mut().zip(before).filter(|(depth, before)| **depth != **before).for_each(
        |(depth, &before)| {
            let [from, to] = [before, *depth].map(|depth| f64::from(depth).min(behind));
            *depth = if strength == 0.0 { before } else { (from + strength * (to - from)) as f32 };
        },
    );
}
