//! What the frames of an animation of light maps have in common.

use std::sync::Arc;

use super::fit;
use super::heterogeneity::FittedAir;
use super::sight::Sight;
use super::surface_light::fitted_radius;
use super::transfer::seen_far;
use crate::Result;
use crate::scene::{AnimatedScene, Extent, LightMaps, Scene, SurfaceMethod};
use crate::visibility::Geometry;

/// The animation with what follows from all key frames together put in where none of them says it: the far end of transfer functions, which is as far as the views
/// of all keys see, where heterogeneous air lies, how far occluders of surfaces count, and the extent of the light maps, in the frame of the light, which holds those that are looked for. `geometry` is the
/// hierarchy over the triangles.
///
/// Errors: those of [`fit`].
pub fn settle_key_frames(animated: &AnimatedScene, geometry: &Arc<Geometry>) -> Result<AnimatedScene> {
    let mut animated = animated.clone();
    let keys = &mut animated.animation.keys;
    let mut functions = keys.iter().flat_map(|key| &key.scene.looks.transfer);
    if functions.any(|(_, transfer)| transfer.far.is_none()) {
        let far = seen_far(keys.iter().map(|key| &key.scene), geometry);
        for key in keys.iter_mut() {
            for (_, transfer) in &mut key.scene.looks.transfer {
                transfer.far.get_or_insert(far);
            }
        }
    }
    if keys.iter().any(|key| !key.scene.looks.heterogeneity.is_empty()) {
        let scenes = || keys.iter().map(|key| &key.scene);
        let views: Vec<Sight> = scenes().map(|scene| Sight::of_views(scene, geometry)).collect();
        let fitted = FittedAir::over(&views, seen_far(scenes(), geometry));
        for (_, air) in keys.iter_mut().flat_map(|key| &mut key.scene.looks.heterogeneity) {
            let (bounds, size) = fitted.of(air);
            (air.bounds, air.noise.size) = (Some(bounds), Some(size));
        }
    }
    if keys.iter().any(|key| !key.scene.looks.surfaces.is_empty()) {
        let fitted = fitted_radius(keys.iter().map(|key| &key.scene), geometry);
        for (_, light) in keys.iter_mut().flat_map(|key| &mut key.scene.looks.surfaces) {
            if light.method != SurfaceMethod::Rays {
                light.radius.get_or_insert(fitted);
            }
        }
    }
    let mut extent: Option<Extent> = None;
    let has_paint =
        |scene: &Scene| scene.views.iter().any(|view| !view.strokes.is_empty() || !view.layers.is_empty());
    let looked_at = keys.iter().filter(|key| animated.light_maps != LightMaps::None && has_paint(&key.scene));
    for key in looked_at {
        let own = fit(&key.scene, &key.scene.light_map, geometry)?.light_map.extent;
        extent = Some(extent.map_or(own, |all| all.include(own.min).include(own.max)));
    }
    if let Some(extent) = extent {
        keys.iter_mut().for_each(|key| _ = key.scene.light_map.extent.get_or_insert(extent));
    }
    Ok(animated)
}
