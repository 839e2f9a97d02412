//! A volume while somebody paints on its pictures.

use std::sync::Arc;

use super::preview::{Preview, scaled, volume_seen_at};
use super::{Job, Options, Scenes, Solution, Stop};
use crate::problem::{Canvas, Model, Optics, VolumeProblem, VolumeRenderer, VolumeState, paint};
use crate::scene::{Camera, Image, Stroke, VolumeScene, VolumeView};
use crate::visibility::Geometry;
use crate::{Error, Result};

/// Previews are solved roughly: iterations at most, and the part of its start to which the gradient falls.
const ITERATIONS: usize = 60;
const TOLERANCE: f64 = 1e-2;
/// Steps of a refinement.
const STEPS: usize = 3;

/// The previews of a volume: as it is, and as solves find it of what is painted. A solve begins with the volume of the scene each time, and
/// another thread may run it.
///
/// Points and radii of strokes are in pixels of the full pictures.
pub struct LiveVolume {
    /// With pictures of the preview's size, and settings for a rough solve.
    scene: Arc<VolumeScene>,
    scales: Vec<f32>,
    options: Options,
    state: VolumeState,
    optics: Optics,
    model: Model,
    before: Vec<Image>,
    found: Option<Solution>,
}

impl LiveVolume {
    /// Errors: [`Error::Empty`] for a scene without a volume, or of one that changes from frame to frame; those of drawing it.
    pub(super) fn new(job: Job, preview: Preview) -> Result<Self> {
        let options = Options { turntable: 0, ..job.options.clone() };
        let Scenes::Volume(scene) = job.into_scenes() else {
            return Err(Error::Empty {
                reason: "there is no scene of one volume".to_owned(),
                remedy: "give a scene with a volume that stays as it is",
            });
        };
        let mut scene = Arc::unwrap_or_clone(scene);
        let full: Vec<usize> = scene.views.iter().map(|view| view.view.camera.size()[0]).collect();
        let views: Result<_> = scene.views.iter().map(|view| volume_seen_at(view, preview)).collect();
        scene.views = views?;
        let pairs = scene.views.iter().zip(&full);
        let scales = pairs.map(|(view, &full)| view.view.camera.size()[0] as f32 / full as f32).collect();
        (scene.rounds, scene.extinction.steps) = (1, scene.extinction.steps.min(STEPS));
        scene.solve.iterations = scene.solve.iterations.min(ITERATIONS);
        scene.solve.tolerance = scene.solve.tolerance.max(TOLERANCE);
        let geometry = Arc::new(Geometry::new(scene.mesh.clone())?);
        let state = VolumeState::of(&scene)?;
        let optics = Optics::new(&scene, &geometry, &state)?;
        let last = scene.stages.last().copied().ok_or_else(super::volume::nothing_asked)?;
        let model = VolumeProblem::model(&scene, last);
        let renderer = VolumeRenderer::new(&scene, &state.medium, &optics, model);
        let before = (0..scene.views.len()).map(|view| renderer.picture(view, &Canvas::Processor));
        let before = before.collect::<Result<Vec<_>>>()?;
        Ok(Self { scene: Arc::new(scene), scales, options, state, optics, model, before, found: None })
    }

    /// How many views there are.
    pub fn views(&self) -> usize {
        self.before.len()
    }

    /// Width and height of a view's preview.
    pub fn size(&self, view: usize) -> [usize; 2] {
        self.before[view].size()
    }

    /// Paints a view anew: these strokes and no others.
    ///
    /// Errors: [`Error::Value`] for a stroke that paints no pixel; then nothing has changed.
    pub fn repaint(&mut self, view: usize, strokes: Vec<Stroke>) -> Result<()> {
        let scale = self.scales[view];
        let mut painted = self.scene.views[view].view.clone();
        painted.strokes = strokes.into_iter().map(|stroke| scaled(stroke, scale)).collect();
        paint(&painted)?;
        Arc::make_mut(&mut self.scene).views[view].view = painted;
        Ok(())
    }

    /// Whether anything is wanted of any view.
    pub fn is_wanted(&self) -> bool {
        self.scene.views.iter().any(VolumeView::is_wanted)
    }

    /// The job whose solution is that of the previews, for whichever thread runs it.
    pub fn job(&self, stop: Stop) -> Job {
        Job::new(Scenes::Volume(self.scene.clone())).with(Options { stop, ..self.options.clone() })
    }

    /// Shows what such a job has found; nothing: the volume as it is.
    pub fn show(&mut self, found: Option<Solution>) {
        self.found = found;
    }

    /// A view of the volume as it is.
    pub fn before(&self, view: usize) -> &Image {
        &self.before[view]
    }

    /// A view of what was found.
    pub fn after(&self, view: usize) -> &Image {
        self.found.as_ref().and_then(|found| found.volume_picture(view)).unwrap_or(&self.before[view])
    }

    /// What is wanted of a view, over the volume as it is.
    pub fn target(&self, view: usize) -> Image {
        self.compared(view, self.before(view), |wanted, shown, weight| shown + weight * (wanted - shown))
    }

    /// How far that is missed; black where nothing is wanted.
    pub fn difference(&self, view: usize) -> Image {
        self.compared(view, self.after(view), |wanted, shown, weight| weight * (wanted - shown).abs())
    }

    fn compared(&self, view: usize, shown: &Image, of: impl Fn(f32, f32, f32) -> f32) -> Image {
        let mut picture = shown.clone();
        let wanted = self.found.as_ref().and_then(|found| found.wanted_of_volume(view));
        for (index, pixel) in picture.pixels.iter_mut().enumerate() {
            let [r, g, b, weight] = wanted.map_or([0.0; 4], |wanted| wanted[index]);
            *pixel = [0, 1, 2].map(|c| of([r, g, b][c], pixel[c], weight.min(1.0)));
        }
        picture
    }

    /// The share of the paint that is met, once something was found.
    pub fn met(&self) -> Option<f64> {
        self.found.as_ref().and_then(|found| found.report().weighted_residual.met())
    }

    /// What a camera sees that is none of a view's: of what was found, or of the volume as it is.
    ///
    /// Errors: those of drawing it.
    pub fn picture_from(&self, camera: &Camera) -> Result<Image> {
        match &self.found {
            Some(found) => found.volume_from(camera),
            None => {
                let Self { scene, state, optics, model, .. } = self;
                VolumeRenderer::new(scene, &state.medium, optics, *model)
                    .picture_from(camera, &Canvas::Processor)
            }
        }
    }

    /// How far the middle of the volume is from a camera, in units of the scene.
    pub fn depth(&self, camera: &Camera) -> f64 {
        let corners = self.scene.medium.extinction.grid().corners();
        let middle = corners.iter().sum::<glam::DVec3>() / 8.0;
        let distance = middle.distance(camera.position());
        if distance > 0.0 { distance } else { 1.0 }
    }
}
