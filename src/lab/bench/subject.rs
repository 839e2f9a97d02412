//! What is measured: a scene, and a sample of its rows in one basis.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::cases::Between;
use crate::cpu::HostOperator;
use crate::io::scene_file;
use crate::job::{Job, Quiet, SHADOW_TEXEL, Steps, Stop, problems};
use crate::march::{LightMapTraversal, Traversal, VolumeTransport, VolumeTraversal};
use crate::operator::{CpuVector, WalkPlan};
use crate::problem::{Formulation, LightMapProblem, Traced, VolumeProblem, VolumeRows, constraints, evenly};
use crate::scene::{
    Basis, Find, Interpolation, Quadrature, Rgb, Scene, SolveSettings, Strategy, VolumeScene, Weight,
};
use crate::sparse::ExplicitMatrix;
use crate::visibility::Geometry;
use crate::{Error, Result};

/// Non-zeros that an explicit matrix may have.
const NONZEROS: u64 = 50_000_000;

/// Where a scene comes from.
#[derive(Debug, Clone)]
pub(super) enum Source {
    /// A file.
    File(PathBuf),
    /// A text that is part of the program, and its name.
    Known(&'static str, &'static str),
}

impl Source {
    /// The small scenes that need no file.
    pub(super) fn known() -> Vec<Self> {
        vec![Self::Known("hall", include_str!("hall.json")), Self::Known("mist", include_str!("mist.json"))]
    }

    /// Reads the scene, with overrides.
    pub(super) fn load(&self, overrides: &[String]) -> Result<Stage> {
        match self {
            Self::File(path) => {
                let job = Job::open_with(path, overrides)?;
                Ok(match job.volume_scenes().into_iter().next() {
                    // Of an animation its first key.
                    Some((_, scene)) => Stage::Volume(Box::new(scene)),
                    None => Stage::LightMap(Box::new(job.into_light_map()?)),
                })
            }
            Self::Known("hall", text) => {
                Ok(Stage::LightMap(Box::new(scene_file::parse(text, "hall", overrides)?)))
            }
            Self::Known(name, text) => {
                Ok(Stage::Volume(Box::new(scene_file::parse_volume(text, name, overrides)?)))
            }
        }
    }

    /// The bytes of the scene, to tell whether a log is of it.
    pub(super) fn bytes(&self) -> Result<Vec<u8>> {
        match self {
            Self::File(path) => std::fs::read(path).map_err(|source| Error::File {
                action: "read",
                path: path.clone(),
                source,
            }),
            Self::Known(_, text) => Ok(text.as_bytes().to_vec()),
        }
    }

    /// What the scene is called in names of cases: the file's name without its ending.
    pub(super) fn name(&self) -> String {
        match self {
            Self::File(path) => {
                path.file_stem().unwrap_or(Path::new("scene").as_os_str()).to_string_lossy().into_owned()
            }
            Self::Known(name, _) => (*name).to_owned(),
        }
    }
}

/// A scene.
#[derive(Debug)]
pub(super) enum Stage {
    LightMap(Box<Scene>),
    Volume(Box<VolumeScene>),
}

impl Stage {
    /// The same with another basis.
    pub(super) fn with(mut self, between: Between) -> Self {
        match (&mut self, between) {
            (Self::LightMap(scene), Between::Nearest) => scene.solve.basis = Basis::Nearest,
            (Self::LightMap(scene), Between::Linear) => scene.solve.basis = Basis::Bilinear,
            (Self::Volume(scene), Between::Nearest) => scene.medium.interpolation = Interpolation::Nearest,
            (Self::Volume(scene), Between::Linear) => scene.medium.interpolation = Interpolation::Trilinear,
        }
        self
    }

    /// The same with these of its views alone.
    pub(super) fn of_views(mut self, views: &[usize]) -> Self {
        fn keep<T>(all: &mut Vec<T>, views: &[usize]) {
            let mut index = 0..;
            all.retain(|_| index.next().is_some_and(|index| views.contains(&index)));
        }
        match &mut self {
            Self::LightMap(scene) => keep(&mut scene.views, views),
            Self::Volume(scene) => keep(&mut scene.views, views),
        }
        self
    }

    /// Whether its rows can be marched: not those of lights, nor those of a refinement.
    pub(super) fn can_march(&self) -> bool {
        match self {
            Self::LightMap(_) => true,
            Self::Volume(scene) => {
                !matches!(scene.stages.first(), Some(Find::Environment | Find::Refinement) | None)
            }
        }
    }

    /// The hierarchy over its triangles.
    pub(super) fn geometry(&self) -> Result<Arc<Geometry>> {
        let mesh = match self {
            Self::LightMap(scene) => &scene.mesh,
            Self::Volume(scene) => &scene.mesh,
        };
        Ok(Arc::new(Geometry::new(mesh.clone())?))
    }

    /// Its problem; of several stages the first.
    pub(super) fn problem(&self) -> Result<Problem> {
        self.problem_over(&self.geometry()?)
    }

    /// The same over a hierarchy that is there.
    pub(super) fn problem_over(&self, geometry: &Arc<Geometry>) -> Result<Problem> {
        Ok(match self {
            Self::LightMap(scene) => {
                Problem::LightMap(LightMapProblem::of(scene, geometry, constraints(scene)?, &Traced)?)
            }
            Self::Volume(scene) => {
                let (mut quiet, stop) = (Quiet, Stop::default());
                let mut steps = Steps::new(&mut quiet, &stop, Vec::new());
                let (find, problem) = problems(scene, geometry, &mut steps)?.swap_remove(0);
                Problem::Volume(find, problem)
            }
        })
    }

    /// How it is solved, with weights that are numbers, and no end but the tolerance's and the iterations'.
    pub(super) fn settings(&self) -> SolveSettings {
        let mut settings = match self {
            Self::LightMap(scene) => scene.solve.clone(),
            Self::Volume(scene) => {
                VolumeProblem::settings(scene, scene.stages.first().copied().unwrap_or(Find::Emission))
            }
        };
        (settings.noise, settings.fill) = (None, false);
        let chosen = |weight: &mut Weight| {
            if !matches!(weight, Weight::Relative(_)) {
                *weight = Weight::Relative(f64::powi(2.0, -9));
            }
        };
        chosen(&mut settings.regularization.tikhonov);
        chosen(&mut settings.regularization.gradient);
        chosen(&mut settings.regularization.laplacian);
        settings
    }
}

/// A problem, or a sample of it.
#[derive(Debug)]
pub(super) enum Problem {
    LightMap(LightMapProblem),
    Volume(Find, VolumeProblem),
}

/// The rows of either kind.
#[derive(Debug, Clone)]
pub(super) enum Rows {
    LightMap(LightMapTraversal),
    Volume(VolumeRows),
}

impl<const C: usize> Traversal<f64, C> for Rows {
    fn rows(&self) -> usize {
        match self {
            Self::LightMap(rows) => Traversal::<f64, C>::rows(rows),
            Self::Volume(rows) => Traversal::<f64, C>::rows(rows),
        }
    }

    fn elements(&self) -> usize {
        match self {
            Self::LightMap(rows) => Traversal::<f64, C>::elements(rows),
            Self::Volume(rows) => Traversal::<f64, C>::elements(rows),
        }
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, crate::march::Weight<f64, C>)) {
        match self {
            Self::LightMap(rows) => rows.walk(row, visit),
            Self::Volume(rows) => rows.walk(row, visit),
        }
    }
}

impl Problem {
    /// At most so many of its rows, evenly spread.
    pub(super) fn sampled(&self, rows: usize) -> Self {
        self.picked(&evenly(rows, self.len()))
    }

    /// Some of its rows.
    pub(super) fn picked(&self, rows: &[usize]) -> Self {
        match self {
            Self::LightMap(problem) => Self::LightMap(problem.picked(rows)),
            Self::Volume(find, problem) => Self::Volume(*find, problem.picked(rows)),
        }
    }

    /// The views that have rows, each with its rows.
    pub(super) fn rows_of_views(&self) -> BTreeMap<usize, Vec<usize>> {
        let mut views = BTreeMap::<usize, Vec<usize>>::new();
        for row in 0..self.len() {
            let view = match self {
                Self::LightMap(problem) => problem.constraints[row].view,
                Self::Volume(_, problem) => problem.traversal.rays().pixel(row)[0] as usize,
            };
            views.entry(view).or_default().push(row);
        }
        views
    }

    /// The same rows, integrated in another way or cut at another transmittance; none where they cannot be.
    pub(super) fn walked(&self, quadrature: Quadrature, bound: Option<f64>) -> Option<Self> {
        let mut changed = self.sampled(usize::MAX);
        match &mut changed {
            Self::LightMap(problem) => {
                let mut transport = problem.traversal.transport().clone();
                transport.quadrature = quadrature;
                transport.transmittance_bound = bound.unwrap_or(transport.transmittance_bound);
                problem.traversal = problem.traversal.through(transport);
            }
            Self::Volume(_, problem) => match &problem.traversal {
                VolumeRows::Voxels(rows) => {
                    let transport = rows.transport().clone();
                    let transport = VolumeTransport {
                        quadrature,
                        transmittance_bound: bound.unwrap_or(transport.transmittance_bound),
                        ..transport
                    };
                    let (rays, parts) = (rows.rays().clone(), rows.parts().to_vec());
                    problem.traversal = VolumeRows::Voxels(VolumeTraversal::new(transport, rays, parts));
                }
                _ if quadrature == Quadrature::Exact && bound.is_none() => {}
                _ => return None,
            },
        }
        Some(changed)
    }

    pub(super) fn rows(&self) -> Rows {
        match self {
            Self::LightMap(problem) => Rows::LightMap(problem.traversal.clone()),
            Self::Volume(_, problem) => Rows::Volume(problem.traversal.clone()),
        }
    }

    pub(super) fn len(&self) -> usize {
        match self {
            Self::LightMap(problem) => problem.constraints.len(),
            Self::Volume(_, problem) => problem.targets.len(),
        }
    }

    pub(super) fn start(&self) -> Vec<Rgb> {
        match self {
            Self::LightMap(problem) => problem.starts(),
            Self::Volume(_, problem) => problem.start.clone(),
        }
    }

    pub(super) fn weights(&self) -> CpuVector {
        match self {
            Self::LightMap(problem) => problem.weights(),
            Self::Volume(_, problem) => problem.row_weights(),
        }
    }

    pub(super) fn formulation(&self, settings: &SolveSettings) -> Result<Formulation<'_>> {
        match self {
            Self::LightMap(problem) => problem.formulation(settings),
            Self::Volume(_, problem) => Ok(problem.formulation()),
        }
    }

    pub(super) fn is_grey(&self) -> bool {
        match self {
            Self::LightMap(problem) => problem.is_grey(),
            Self::Volume(_, problem) => problem.is_grey(),
        }
    }

    pub(super) fn plan(&self) -> &WalkPlan {
        match self {
            Self::LightMap(problem) => &problem.plan,
            Self::Volume(_, problem) => &problem.plan,
        }
    }

    /// Foresees the rows anew, as a part of what is timed.
    pub(super) fn replan(&mut self) {
        let plan = WalkPlan::of(&self.rows(), self.is_grey());
        match self {
            Self::LightMap(problem) => problem.plan = plan,
            Self::Volume(_, problem) => problem.plan = plan,
        }
    }

    pub(super) fn explicit(&self) -> Result<ExplicitMatrix> {
        match self.is_grey() {
            true => ExplicitMatrix::new::<1>(&self.rows(), NONZEROS),
            false => ExplicitMatrix::new::<3>(&self.rows(), NONZEROS),
        }
    }

    /// T in f64.
    pub(super) fn wide(&self, strategy: Strategy) -> Result<HostOperator<Rows, f64>> {
        HostOperator::new(self.rows(), self.is_grey(), self.plan(), strategy, u64::MAX)
    }

    /// Bytes of what rays meet: the shadow map, or properties and cached light of the medium.
    pub(super) fn scene_bytes(&self) -> u64 {
        match self {
            Self::LightMap(problem) => (problem.maps.shadow_map.grid().len() * SHADOW_TEXEL) as u64,
            Self::Volume(_, problem) => {
                (problem.candidates() * size_of::<Rgb>()) as u64 + problem.prepared_bytes()
            }
        }
    }
}
