//! What is measured: a scene, and the first of its problems.

use std::sync::Arc;

use super::cases::CaseBasis;
use crate::Result;
use crate::io::scene_file::{self, SceneFile};
use crate::job::{AskedProblem, Job, Quiet, Scenes, Steps, Stop};
use crate::scene::{Basis, Find, Interpolation, RegularizationWeight, SolveSettings};

/// Where a scene comes from.
#[derive(Debug, Clone)]
pub(super) enum SceneSource {
    /// A file.
    File(SceneFile),
    /// A text that is part of the program, and its name.
    Known(&'static str, &'static str),
}

impl SceneSource {
    /// The small scenes that need no file.
    pub(super) fn known() -> Vec<Self> {
        vec![Self::Known("hall", include_str!("hall.json")), Self::Known("mist", include_str!("mist.json"))]
    }

    /// Reads the scene, with overrides; of an animation its first key.
    pub(super) fn load(&self, overrides: &[String]) -> Result<Scenes> {
        Ok(match self {
            Self::File(file) => match Job::of_file(file, overrides)?.into_scenes() {
                Scenes::Animation(animated) => animated.animation.keys[0].scene.clone().into(),
                Scenes::LightAnimation(animated) => animated.animation.keys[0].scene.clone().into(),
                scenes => scenes,
            },
            Self::Known("hall", text) => scene_file::parse(text, "hall", overrides)?.into(),
            Self::Known(name, text) => scene_file::parse_volume(text, name, overrides)?.into(),
        })
    }

    /// The bytes of the scene, to tell whether a log is of it.
    pub(super) fn bytes(&self) -> &[u8] {
        match self {
            Self::File(file) => file.bytes(),
            Self::Known(_, text) => text.as_bytes(),
        }
    }

    /// What the scene is called in names of cases: the file's name without its ending.
    pub(super) fn name(&self) -> String {
        match self {
            Self::File(file) => {
                let stem = file.path().file_stem().unwrap_or("scene".as_ref());
                stem.to_string_lossy().into_owned()
            }
            Self::Known(name, _) => (*name).to_owned(),
        }
    }
}

/// The same with another basis.
pub(super) fn with(mut scenes: Scenes, basis: CaseBasis) -> Scenes {
    match &mut scenes {
        Scenes::LightMap(scene) => {
            Arc::make_mut(scene).solve.basis = match basis {
                CaseBasis::Nearest => Basis::Nearest,
                CaseBasis::Linear => Basis::Bilinear,
            };
        }
        Scenes::Volume(scene) => {
            Arc::make_mut(scene).medium.interpolation = match basis {
                CaseBasis::Nearest => Interpolation::Nearest,
                CaseBasis::Linear => Interpolation::Trilinear,
            };
        }
        Scenes::Animation(_) | Scenes::LightAnimation(_) => {}
    }
    scenes
}

/// The same with these of its views alone.
pub(super) fn of_views(mut scenes: Scenes, views: &[usize]) -> Scenes {
    fn keep<T>(all: &mut Vec<T>, views: &[usize]) {
        let mut index = 0..;
        all.retain(|_| index.next().is_some_and(|index| views.contains(&index)));
    }
    match &mut scenes {
        Scenes::LightMap(scene) => keep(&mut Arc::make_mut(scene).views, views),
        Scenes::Volume(scene) => keep(&mut Arc::make_mut(scene).views, views),
        Scenes::Animation(_) | Scenes::LightAnimation(_) => {}
    }
    scenes
}

/// Whether its rows can be marched: not those of lights, nor those of a refinement.
pub(super) fn can_march(scenes: &Scenes) -> bool {
    match scenes {
        Scenes::Volume(scene) => {
            !matches!(scene.stages.first(), Some(Find::Environment | Find::Refinement) | None)
        }
        _ => true,
    }
}

/// Whether its rows can be put into slices, panes aside.
pub(super) fn has_slices(scenes: &Scenes) -> bool {
    matches!(scenes, Scenes::LightMap(scene) if scene.surroundings.is_none())
}

/// The problem of a scene, or of its first stage. Its λ are numbers, and its solves end by tolerance or iterations alone.
pub(super) fn problem(scenes: &Scenes) -> Result<AskedProblem> {
    let (mut quiet, stop) = (Quiet, Stop::default());
    let mut steps = Steps::new(&mut quiet, &stop, Vec::new());
    let mut asked = scenes.asked(&scenes.geometry()?, &mut steps)?.swap_remove(0);
    let SolveSettings { noise, fill, regularization, .. } = &mut asked.settings;
    (*noise, *fill) = (None, false);
    for weight in [&mut regularization.tikhonov, &mut regularization.gradient, &mut regularization.laplacian]
    {
        if !matches!(weight, RegularizationWeight::Relative(_)) {
            *weight = RegularizationWeight::Relative(f64::powi(2.0, -9));
        }
    }
    Ok(asked)
}
