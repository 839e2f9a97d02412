//! What a job asks for: problem by problem, each from its scene as it is.

use std::sync::Arc;
use std::time::Instant;

use super::memory::{self, MemoryBudget};
use super::steps::Steps;
use super::{Scenes, film, light_map, volume};
use crate::Result;
use crate::problem::{Problem, Traced, TransferProblem, VolumeProblem, settle_key_frames};
use crate::scene::{Find, KeyFrame, Scene, SolveSettings, Sought, VolumeScene};
use crate::visibility::Geometry;

/// A problem, before anything is solved.
pub(crate) struct AskedProblem {
    /// What the scene is called.
    pub(crate) scene: String,
    /// What is looked for.
    pub(crate) find: &'static str,
    /// Views and their pixels.
    pub(crate) views: usize,
    pub(crate) pixels: usize,
    pub(crate) problem: Box<dyn Problem>,
    /// How it is asked to be solved; see [`MemoryBudget::settled`].
    pub(crate) settings: SolveSettings,
    pub(crate) memory: MemoryBudget,
    /// How often such a problem is solved at most: steps of a refinement, and rounds.
    pub(crate) solves: usize,
    /// Seconds that making the problems of its scene took, once there was a hierarchy.
    pub(crate) seconds: f64,
}

impl Scenes {
    /// The hierarchy over the triangles, which key frames share.
    pub(crate) fn geometry(&self) -> Result<Arc<Geometry>> {
        let mesh = match self {
            Self::LightMap(scene) => Some(&scene.mesh),
            Self::Volume(scene) => Some(&scene.mesh),
            Self::Animation(animated) => animated.animation.keys.first().map(|key| &key.scene.mesh),
            Self::LightAnimation(animated) => animated.animation.keys.first().map(|key| &key.scene.mesh),
        };
        Ok(Arc::new(Geometry::new(mesh.cloned().unwrap_or_default())?))
    }

    /// The volume scenes: one, or those of the key frames, with what the names of their files begin with.
    pub(crate) fn volumes(&self) -> Vec<(String, VolumeScene)> {
        match self {
            Self::LightMap(_) | Self::LightAnimation(_) => Vec::new(),
            Self::Volume(scene) => vec![(String::new(), VolumeScene::clone(scene))],
            Self::Animation(animated) => {
                let keys = animated.animation.keys.iter();
                let named = |key: &KeyFrame| {
                    let name = format!("{}, frame {}", key.scene.name, key.frame);
                    (film::of_frame("frame", key.frame), VolumeScene { name, ..key.scene.clone() })
                };
                keys.map(named).collect()
            }
        }
    }

    /// The scenes of light maps: one, or those of the key frames, with what the names of their files begin with.
    pub(crate) fn light_scenes(&self, geometry: &Arc<Geometry>) -> Result<Vec<(String, Scene)>> {
        match self {
            Self::LightMap(scene) => Ok(vec![(String::new(), Scene::clone(scene))]),
            Self::Volume(_) | Self::Animation(_) => Ok(Vec::new()),
            Self::LightAnimation(animated) => {
                let animated = settle_key_frames(animated, geometry)?;
                let named = |KeyFrame { frame, scene }: KeyFrame<Scene>| {
                    let name = format!("{}, frame {frame}", scene.name);
                    (film::of_frame("frame", frame), Scene { name, ..scene })
                };
                Ok(animated.animation.keys.into_iter().map(named).collect())
            }
        }
    }

    /// Those of them whose paint is looked at.
    pub(crate) fn painted_scenes(&self, geometry: &Arc<Geometry>) -> Result<Vec<Scene>> {
        let mut scenes: Vec<Scene> =
            self.light_scenes(geometry)?.into_iter().map(|(_, scene)| scene).collect();
        if let Self::LightAnimation(animated) = self {
            scenes.truncate(animated.light_maps.count(scenes.len()));
        }
        Ok(scenes)
    }

    /// All problems: each light map or transfer function, or each stage of each volume. Frames can be drawn without any.
    pub(crate) fn asked(&self, geometry: &Arc<Geometry>, steps: &mut Steps<'_>) -> Result<Vec<AskedProblem>> {
        let mut all = Vec::new();
        let others = match self {
            Self::LightAnimation(animated) => settle_key_frames(animated, geometry)?.others(),
            _ => Vec::new(),
        };
        for scene in self.painted_scenes(geometry)? {
            steps.begin("tracing", None);
            let (clock, memory) = (Instant::now(), MemoryBudget::of_light_map(&scene));
            let painted = memory::painted(&scene)?;
            let (find, problem): (_, Box<dyn Problem>) = match scene.find {
                Sought::LightMap => {
                    let problem = light_map::problem_of((&scene, painted), &others, geometry, &Traced)?;
                    ("light map", Box::new(problem))
                }
                Sought::Transfer => {
                    ("transfer function", Box::new(TransferProblem::of(&scene, geometry, painted, &Traced)?))
                }
            };
            let seconds = clock.elapsed().as_secs_f64();
            all.push(AskedProblem {
                scene: scene.name.clone(),
                find,
                views: scene.views.len(),
                pixels: scene.pixels(),
                settings: scene.solve.clone(),
                problem,
                memory,
                solves: 1,
                seconds,
            });
        }
        for (_, scene) in self.volumes() {
            let (clock, memory) = (Instant::now(), MemoryBudget::of_volume(&scene));
            let problems = volume::problems(&scene, geometry, steps)?;
            let seconds = clock.elapsed().as_secs_f64();
            for problem in problems {
                all.push(AskedProblem {
                    scene: scene.name.clone(),
                    find: problem.find.name(),
                    views: scene.views.len(),
                    pixels: scene.pixels(),
                    settings: VolumeProblem::settings(&scene, problem.find),
                    solves: scene.rounds
                        * if problem.find == Find::Refinement { scene.extinction.steps } else { 1 },
                    problem: Box::new(problem),
                    memory,
                    seconds,
                });
            }
        }
        Ok(all)
    }
}
