//! Pictures of a volume: of its views, and from all around, so that what no target shows can be seen.

use glam::{DAffine3, DVec3};

use super::super::engine::Engine;
use super::super::steps::Steps;
use crate::problem::{Model, Optics, VolumeRenderer};
use crate::scene::{Camera, Image, VolumeMedium, VolumeScene};
use crate::{Error, Result};

/// The pictures of all views.
pub(super) fn view_pictures(
    scene: &VolumeScene,
    medium: &VolumeMedium,
    optics: &Optics,
    model: Model,
    engine: &mut Engine,
    steps: &mut Steps<'_>,
) -> Result<Vec<Image>> {
    steps.begin("rendering", Some(scene.views.len() as u64));
    let renderer = VolumeRenderer::new(scene, medium, optics, model);
    let draw = |view: usize| {
        let picture = engine.draw(|canvas| renderer.picture(view, canvas))?;
        steps.advance(view as u64 + 1, "");
        Ok(picture)
    };
    (0..scene.views.len()).map(draw).collect()
}

/// The longer side of a picture of a turntable at most.
const LONGEST_TURN: usize = 240;

/// So many pictures, from the first view on once around the middle of the volume, about the axis that is up in the world.
pub(super) fn turntable(
    renderer: &VolumeRenderer,
    scene: &VolumeScene,
    count: usize,
    engine: &mut Engine,
    steps: &Steps<'_>,
) -> Result<Vec<Image>> {
    let Some(first) = scene.views.first() else { return Ok(Vec::new()) };
    let corners = scene.medium.extinction.grid().corners();
    let middle = corners.iter().sum::<DVec3>() / 8.0;
    let size = first.view.camera.size();
    let shrink = (LONGEST_TURN as f64 / size[0].max(size[1]) as f64).min(1.0);
    let size = size.map(|side| ((side as f64 * shrink).round() as usize).max(1));
    let mut turned = Vec::with_capacity(count);
    for index in 0..count {
        if steps.stops() {
            break;
        }
        let angle = std::f64::consts::TAU * index as f64 / count as f64;
        let turn = DAffine3::from_translation(middle)
            * DAffine3::from_rotation_y(angle)
            * DAffine3::from_translation(-middle);
        let camera: Camera = first.view.camera.moved(turn, size)?;
        turned.push(engine.draw(|canvas| renderer.picture_from(&camera, canvas))?);
    }
    Ok(turned)
}

/// The error of a scene without a stage.
pub(in crate::job) fn nothing_asked() -> Error {
    Error::Empty { reason: "nothing is looked for".to_owned(), remedy: "say what to `find`" }
}
