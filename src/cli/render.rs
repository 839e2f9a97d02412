use super::args::RenderArguments;
use super::placement::Placement;
use super::progress::{Steps, interrupted, watch_interrupt};
use super::results::Folder;
use super::{Done, Manners, job, to_json};
use crate::io::scene_file::Subject;
use crate::problem::{fit, render};
use crate::{Result, io};

/// `unscatter render`: the views under the plain light, or under a light map from a file.
pub(super) fn run(arguments: &RenderArguments, manners: &Manners) -> Result<Done> {
    if io::scene_file::subject(&arguments.scene.scene)? != Subject::LightMap {
        return super::volume::render(arguments, manners);
    }
    let mut steps = Steps::new(manners.quiet);
    steps.begin("reading", None);
    let mut scene = job::load(&arguments.scene, &[])?;
    let folder = Folder::create(arguments.output.output.clone(), &arguments.scene.scene)?;
    let light_map = match &arguments.light_map {
        Some(path) => {
            let picture = io::image::read_image(path)?;
            scene.light_map.size = picture.size();
            scene.light_map.extent = Placement::beside(path)?.or(scene.light_map.extent);
            Some(picture)
        }
        None => None,
    };
    watch_interrupt()?;
    steps.begin("tracing", None);
    let maps = fit(&scene)?;
    steps.begin("rendering", Some(scene.views.len() as u64));
    let mut written = Vec::new();
    for (view, seen) in scene.views.iter().enumerate() {
        if interrupted() {
            return Ok(Done::Interrupted);
        }
        let texels = light_map.as_ref().map(|picture| &picture.pixels[..]);
        let rendering = render(&scene, &maps, texels, view)?;
        folder.write_picture(&seen.name, &rendering.after, scene.exposure)?;
        written.push(folder.path().join(format!("{}.png", seen.name)).display().to_string());
        steps.advance(view as u64 + 1, String::new());
    }
    folder.publish()?;
    steps.finish();
    manners.print(&to_json(&written)?, &written.join("\n"));
    Ok(Done::Completely)
}
