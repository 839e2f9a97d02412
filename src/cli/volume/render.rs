use super::super::args::RenderArguments;
use super::super::progress::{Steps, interrupted, watch_interrupt};
use super::super::results::Folder;
use super::super::{Done, Manners, job, to_json};
use super::{nothing_asked, results, turntable};
use crate::problem::{Optics, VolumeProblem, VolumeRenderer, VolumeState};
use crate::scene::VolumeScene;
use crate::{Error, Result};

/// `unscatter render` of a volume: its views, and a turn around it.
pub(in crate::cli) fn render(arguments: &RenderArguments, manners: &Manners) -> Result<Done> {
    let mut steps = Steps::new(manners.quiet);
    steps.begin("reading", None);
    if arguments.light_map.is_some() {
        let expected =
            "left away: volumes have none; put one in by --set volume.emission.file=FILE or the like";
        return Err(Error::value("--light-map", "a light map", expected));
    }
    let scenes = job::load_volumes(&arguments.scene)?;
    let folder = Folder::create(arguments.output.output.clone(), &arguments.scene.scene)?;
    watch_interrupt()?;
    let mut written = Vec::new();
    let geometry = job::geometry_of(scenes.iter().map(|(_, scene)| scene))?;
    for (prefix, scene) in &scenes {
        steps.begin("lighting", None);
        let optics = Optics::new(scene, &geometry, &VolumeState::of(scene)?)?;
        if !draw(scene, &optics, prefix, arguments.turntable as usize, &folder, &mut steps, &mut written)? {
            return Ok(Done::Interrupted);
        }
    }
    folder.publish()?;
    steps.finish();
    manners.print(&to_json(&written)?, &written.join("\n"));
    Ok(Done::Completely)
}

/// Draws a scene and names the files; false when it was interrupted.
fn draw(
    scene: &VolumeScene,
    optics: &Optics,
    prefix: &str,
    turns: usize,
    folder: &Folder,
    steps: &mut Steps,
    written: &mut Vec<String>,
) -> Result<bool> {
    let in_folder = |name: String| folder.path().join(name).display().to_string();
    let last = *scene.stages.last().ok_or_else(nothing_asked)?;
    let renderer = VolumeRenderer::new(scene, &scene.medium, optics, VolumeProblem::model(scene, last));
    steps.begin("rendering", Some(scene.views.len() as u64));
    for (view, seen) in scene.views.iter().enumerate() {
        if interrupted() {
            return Ok(false);
        }
        let name = format!("{prefix}{}", seen.view.name);
        folder.write_picture(&name, &renderer.picture(view)?, scene.exposure)?;
        written.push(in_folder(format!("{name}.png")));
        steps.advance(view as u64 + 1, String::new());
    }
    let turns = turntable::pictures(&renderer, scene, turns)?;
    results::write_turntable(folder, prefix, &turns, scene.exposure)?;
    for index in 0..turns.len() {
        written.push(in_folder(format!("{prefix}turntable_{index:03}.png")));
    }
    Ok(true)
}
