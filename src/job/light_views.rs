//! The pictures of the views of a light-map scene.

use std::path::Path;
use std::sync::Arc;

use super::air::write_air;
use super::engine::Engine;
use super::exposure::readable;
use super::folder::Folder;
use super::placement::Placement;
use super::steps::Steps;
use super::warnings;
use crate::problem::{Drawing, DrawnLight, Maps, Renderer, Rendering, fit};
use crate::scene::{Image, Rgb, Scene};
use crate::visibility::Geometry;
use crate::{Result, io};

/// Draws all views under the scene's light, or under a light map; none when somebody stopped it.
pub(super) fn draw_views(
    scene: &Scene,
    maps: &Maps,
    (light_map, light, drawing): (Option<&[Rgb]>, DrawnLight, Drawing),
    engine: &mut Engine,
    steps: &mut Steps<'_>,
) -> Result<Option<Vec<Rendering>>> {
    steps.begin("rendering", Some(scene.views.len() as u64));
    let renderer = Renderer::new(scene, maps, light_map)?.showing(light).drawing(drawing);
    let mut drawn = Vec::new();
    for view in 0..scene.views.len() {
        if steps.stops() {
            return Ok(None);
        }
        drawn.push(engine.draw(|canvas| renderer.picture(view, canvas))?);
        steps.advance(view as u64 + 1, "");
    }
    Ok(Some(drawn))
}

/// Draws the views of scenes and writes them; their names begin with what stands beside each scene. False when somebody stopped it.
pub(super) fn draw(
    scenes: &[(String, Scene)],
    geometry: &Arc<Geometry>,
    (light_map, light, drawing): (Option<&Path>, DrawnLight, Drawing),
    (engine, folder): (&mut Engine, &Folder),
    steps: &mut Steps<'_>,
    names: &mut Vec<String>,
) -> Result<bool> {
    let picture = light_map.map(io::image::read_radiance).transpose()?;
    let texels = picture.as_ref().map(|picture| &picture.pixels[..]);
    let mut drawn: Vec<(String, [Image; 2])> = Vec::new();
    let Some((_, first)) = scenes.first() else { return Ok(true) };
    for (index, (prefix, scene)) in scenes.iter().enumerate() {
        if index > 0 {
            steps.begin("tracing", None);
        }
        let mut map = scene.light_map.clone();
        if let (Some(path), Some(picture)) = (light_map, &picture) {
            (map.size, map.square_texels) = (picture.size(), false);
            map.extent = Placement::beside(path, map.size, &scene.light.frame())?.or(map.extent);
        }
        let maps = fit(scene, &map, geometry)?;
        if index == 0 {
            warnings::tell_of_fog(scene, &maps.geometry);
            warnings::tell_of_panes(&maps);
            warnings::tell_of_air(scene, &maps.geometry);
        }
        write_air(&maps, folder, prefix)?;
        let Some(views) = draw_views(scene, &maps, (texels, light, drawing), engine, steps)? else {
            return Ok(false);
        };
        let names = scene.views.iter().map(|view| format!("{prefix}{}", view.name));
        drawn.extend(names.zip(views.into_iter().map(|it| [it.before, it.after])));
    }
    let exposure = first.exposure.unwrap_or_else(|| readable(drawn.iter().map(|(_, [before, _])| before)));
    for (name, [_, after]) in drawn {
        folder.write_picture(&name, &after, exposure)?;
        names.push(format!("{name}.png"));
    }
    Ok(true)
}
