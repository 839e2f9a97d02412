//! A volume scene as it is written.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::animation::Animation;
use super::environment::Environment;
use super::field::GridSize;
use super::properties::{Extinction, Interpolation, PropertyBounds, Volume, light_size};
use super::view::VolumeView;
use crate::io::scene_file::assets::Assets;
use crate::io::scene_file::channels::Channels;
use crate::io::scene_file::document::{Document, Opacity, Target, check_names, stem, unknown_version};
use crate::io::scene_file::file_name::FileName;
use crate::io::scene_file::flaw::{At, Built, Flaw, checked};
use crate::io::scene_file::light::Light;
use crate::io::scene_file::occluder::{Occluder, mesh_of};
use crate::io::scene_file::solve::Solve;
use crate::io::scene_file::stroke::Group;
use crate::io::transforms::Shot;
use crate::scene::{self, Rgb, VolumeMedium, VolumeScene};

/// An unscatter scene of a volume. Lengths are in metres, angles in degrees, radiance is linear Rec. 709; cameras look along
/// −Z with +Y up. File names are relative to the scene file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VolumeDocument {
    /// Where the schema is, for editors; ignored.
    #[serde(rename = "$schema", default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// Version of this format: 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u64,
    /// What the scene is called in titles and reports; the name of the file when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The medium as it is before the solve.
    pub volume: Volume,
    /// What is looked for: one property, or several in turn, each with what was found before.
    pub find: Find,
    /// How often the properties of `find` are looked for in turn at most, from 1 to 100: over and over, until the pictures come
    /// no nearer. 1 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rounds: Option<usize>,
    /// Suns.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub lights: Vec<Light>,
    /// Light from everywhere; none when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub environment: Option<Environment>,
    /// Voxels of the cached light along each axis: N, or [x, y, z]. When not given, as many as the extinction has, at most
    /// 128 for suns and 64 for the environment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light_size: Option<GridSize>,
    /// Radiance behind the volume; the environment when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub background: Option<Channels>,
    /// Surfaces before, in and behind the volume.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub occluders: Vec<Occluder>,
    /// Cameras and what their pictures should show.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub views: Vec<VolumeView>,
    /// More views from a `transforms.json`: cameras and the pictures that they should show.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transforms: Option<TransformsFile>,
    /// Groups of strokes, by whose names strokes say that they are in them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub groups: Vec<Group>,
    /// What a painted colour asks for: a tint of what is seen there, or radiance.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub target: Target,
    /// What the opacity of strokes, their soft edges and the alpha of layers ask for.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub opacity: Opacity,
    /// How extinction is looked for.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub extinction: Extinction,
    /// The least and the largest values of what is looked for.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub bounds: PropertyBounds,
    /// How strongly emission and albedo are pulled to their start, relative to `solve.tikhonov`.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub pull: Pull,
    /// Whether voxels that are seen outside of a mask are left out; true when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hull: Option<bool>,
    /// Stops by which PNG pictures are brightened, from −64 to 64.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub exposure: f64,
    /// Frames of a volume that changes, and what the pictures of some of them should show.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub animation: Option<Animation>,
    /// How the problems are solved; `lower` and `upper` are given by `bounds` here.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub solve: Solve,
}

/// What is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Find {
    /// Emission.
    Emission,
    /// Albedo, within 0 and 1.
    Albedo,
    /// Emission and albedo together.
    Joint,
    /// Extinction, for a medium of the same radiance everywhere.
    Extinction,
    /// Extinction by Gauss–Newton on the radiance that is seen, from the volume's own extinction.
    Refinement,
    /// Extinction first, then refined.
    ExtinctionThenRefinement,
    /// Extinction first, then emission and albedo together.
    ExtinctionThenJoint,
    /// Extinction first, then emission.
    ExtinctionThenEmission,
    /// Extinction first, then albedo.
    ExtinctionThenAlbedo,
    /// The lights of the environment.
    Environment,
    /// The lights of the environment first, then emission and albedo together.
    EnvironmentThenJoint,
    /// The lights of the environment first, then emission.
    EnvironmentThenEmission,
    /// The lights of the environment first, then albedo.
    EnvironmentThenAlbedo,
}

/// Views from a `transforms.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransformsFile {
    /// The file, relative to the scene file.
    pub file: FileName,
    /// Every so many frames are taken; 1 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every: Option<usize>,
    /// What the alpha of the pictures says: how much a pixel weighs, or how much of it the thing covers.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub alpha: AlphaMeaning,
}

/// What the alpha of a picture says.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AlphaMeaning {
    /// How much a pixel counts; where it is 0, nothing is known.
    #[default]
    Weight,
    /// How much of a pixel the thing covers, before the background; where it is 0, nothing is there.
    Opacity,
}

/// How strongly properties are pulled to their start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Pull {
    /// Of emission; above 0.
    pub emission: f64,
    /// Of albedo; above 0.
    pub albedo: f64,
}

fn voxels_with_extinction(medium: &VolumeMedium) -> usize {
    let extinction = &medium.extinction;
    (0..extinction.grid().len()).filter(|&index| extinction.color(index).iter().any(|&it| it > 0.0)).count()
}

/// What holds when it is not given.
const ROUNDS: usize = 1;
const HULL: bool = true;
const EVERY: usize = 1;

impl Default for Pull {
    fn default() -> Self {
        Self { emission: 1.0, albedo: 1.0 }
    }
}

impl VolumeDocument {
    /// A document with everything at its default but what has none.
    pub fn new(volume: Volume, find: Find, views: Vec<VolumeView>) -> Self {
        Self {
            schema: None,
            version: Document::VERSION,
            name: None,
            volume,
            find,
            rounds: None,
            lights: Vec::new(),
            environment: None,
            light_size: None,
            background: None,
            occluders: Vec::new(),
            views,
            transforms: None,
            groups: Vec::new(),
            target: Target::default(),
            opacity: Opacity::default(),
            extinction: Extinction::default(),
            bounds: PropertyBounds::default(),
            pull: Pull::default(),
            hull: None,
            exposure: 0.0,
            animation: None,
            solve: Solve::default(),
        }
    }

    /// The scene, of an animation that of the first key frame; `file` is where the document comes from and what file names in it
    /// are relative to.
    pub(in crate::io::scene_file) fn build(&self, file: &Path) -> Built<VolumeScene> {
        if self.animation.is_some() {
            return Ok(self.animate(file)?.animation.keys.swap_remove(0).scene);
        }
        let (stages, volume) = (self.find.stages(), self.settled_volume());
        let mut assets = Assets::beside(file).within(self.solve.memory).grouped(&self.groups)?;
        self.scene(file, &mut assets, |assets| volume.build(assets, &stages, None).at("volume"))
    }

    /// Whether something is painted, on any view or at any key.
    fn is_painted(&self) -> bool {
        let at_a_key = self.animation.as_ref().is_some_and(Animation::is_painted);
        at_a_key || self.views.iter().any(VolumeView::is_painted)
    }

    /// The volume with what it does not say and what follows from the rest.
    pub(super) fn settled_volume(&self) -> Volume {
        let usual = if self.is_painted() { Interpolation::Trilinear } else { Interpolation::Nearest };
        Volume { interpolation: Some(self.volume.interpolation.unwrap_or(usual)), ..self.volume.clone() }
    }

    /// The scene around a medium.
    pub(super) fn scene(
        &self,
        file: &Path,
        assets: &mut Assets,
        medium: impl FnOnce(&Assets) -> Built<VolumeMedium>,
    ) -> Built<VolumeScene> {
        if self.version != Document::VERSION {
            return Err(unknown_version(self.version));
        }
        // What is small is looked at before what may take long to read.
        let exposure = checked("exposure", self.exposure, "from -64 to 64 stops", |e| e.abs() <= 64.0)?;
        let usual = Solve::default();
        for (path, is_usual) in [
            ("solve.lower", self.solve.lower == usual.lower),
            ("solve.upper", self.solve.upper == usual.upper),
        ] {
            if !is_usual {
                return Err(Flaw::new(path, "the bounds of a volume's properties are given by `bounds`"));
            }
        }
        if self.solve.fill {
            return Err(Flaw::new("solve.fill", "only light maps can be filled; leave it away"));
        }
        let is_painted = self.is_painted();
        // Lights are as many in a painted scene as in any other. So is what is wrong with the settings, before anything is read.
        let of_voxels = self.solve.build_volume(None).at("solve")?.regularization;
        let extinction = self.extinction.build().at("extinction")?;
        let bounds = self.bounds.build().at("bounds")?;
        let pull = |path: &str, value: f64| checked(path, value, "above 0", |pull| pull > 0.0);
        let pull =
            [pull("emission", self.pull.emission).at("pull")?, pull("albedo", self.pull.albedo).at("pull")?];
        let light_size = light_size(self.light_size).at("light_size")?;
        let background = self.background.map(|color| color.rgb("background", f32::MAX)).transpose()?;
        let environment = self.environment.clone().unwrap_or_default();
        let lights = environment.lights.clone().unwrap_or_default();
        let light_basis = lights.build().at("environment.lights")?;
        let smoothness = lights.smoothness(is_painted).at("environment.lights")?;
        let regularization_of_sky = scene::Regularization {
            gradient: scene::RegularizationWeight::Relative(smoothness),
            ..of_voxels
        };
        let environment = environment.build(assets).at("environment")?;
        let stages = self.find.stages();
        let rounds = self.rounds.unwrap_or(ROUNDS);
        if !(1..=100).contains(&rounds) {
            return Err(Flaw::value("rounds", rounds, "from 1 to 100"));
        }
        if rounds > 1 && (stages.len() < 2 || stages[0] != scene::Find::Environment) {
            let expected = "1, but where the environment is looked for in turn with emission or albedo";
            return Err(Flaw::value("rounds", rounds, expected));
        }
        let lights = self.lights.iter().enumerate();
        let lights = lights.map(|(i, light)| light.build(assets).at(&format!("lights[{i}]")));
        let lights = lights.collect::<Built<_>>()?;
        let medium = medium(assets)?;
        let voxels = is_painted.then(|| voxels_with_extinction(&medium));
        let solve = self.solve.build_volume(voxels).at("solve")?;
        let views = self.build_views(assets, background)?;
        let mesh = mesh_of(&self.occluders, assets)?;
        Ok(VolumeScene {
            name: self.name.clone().unwrap_or_else(|| stem(file)),
            medium,
            lights,
            environment,
            light_basis: Arc::new(light_basis),
            light_size,
            background,
            mesh,
            views,
            target: self.target.into(),
            opacity: self.opacity.into(),
            stages,
            rounds,
            extinction,
            bounds,
            pull,
            hull: self.hull.unwrap_or(HULL),
            is_painted,
            regularization_of_sky,
            solve,
            exposure,
        })
    }

    /// Puts in the settings that are not given and that the schema has no default for.
    pub(in crate::io::scene_file) fn settle(&mut self, file: &Path) {
        self.schema = None;
        self.name.get_or_insert_with(|| stem(file));
        self.volume = self.settled_volume();
        let is_painted = self.is_painted();
        if !is_painted {
            self.solve.settle_volume();
        }
        self.rounds.get_or_insert(ROUNDS);
        self.lights.iter_mut().for_each(Light::settle);
        self.environment.get_or_insert_default().settle(is_painted);
        self.views.iter_mut().for_each(VolumeView::settle);
        if let Some(transforms) = &mut self.transforms {
            transforms.every.get_or_insert(EVERY);
        }
        self.bounds.settle();
        self.hull.get_or_insert(HULL);
        if let Some(animation) = &mut self.animation {
            animation.settle(&self.volume);
        }
    }

    fn build_views(&self, assets: &mut Assets, background: Option<Rgb>) -> Built<Vec<scene::VolumeView>> {
        let names = self.views.iter().map(|view| view.name.as_str());
        check_names(names)?;
        let views = self.views.iter().enumerate();
        let views = views.map(|(i, view)| view.build(assets).at(&format!("views[{i}]")));
        let mut views = views.collect::<Built<Vec<_>>>()?;
        if let Some(transforms) = &self.transforms {
            // Pictures of opacity are put before it; the light of an environment differs from pixel to pixel.
            if transforms.alpha == AlphaMeaning::Opacity && background.is_none() && self.environment.is_some()
            {
                let problem =
                    "put pictures of opacity before a `background`, and give one beside `environment`";
                return Err(Flaw::new("transforms.alpha", problem));
            }
            let more = transforms.build(assets, background.unwrap_or_default()).at("transforms")?;
            for view in more {
                let name = &view.view.name;
                if views.iter().any(|other| other.view.name.eq_ignore_ascii_case(name)) {
                    let problem = format!("there are two views called `{name}`, which names files");
                    return Err(Flaw::new("transforms.file", problem));
                }
                views.push(view);
            }
        }
        if views.is_empty() {
            return Err(Flaw::new("views", "there is no view; add one with a `name` and a `camera`"));
        }
        Ok(views)
    }
}

impl Find {
    pub(super) fn stages(self) -> Vec<scene::Find> {
        use scene::Find::{Albedo, Emission, Environment, Extinction, Joint, Refinement};
        match self {
            Self::Emission => vec![Emission],
            Self::Albedo => vec![Albedo],
            Self::Joint => vec![Joint],
            Self::Extinction => vec![Extinction],
            Self::Refinement => vec![Refinement],
            Self::ExtinctionThenRefinement => vec![Extinction, Refinement],
            Self::ExtinctionThenJoint => vec![Extinction, Joint],
            Self::ExtinctionThenEmission => vec![Extinction, Emission],
            Self::ExtinctionThenAlbedo => vec![Extinction, Albedo],
            Self::Environment => vec![Environment],
            Self::EnvironmentThenJoint => vec![Environment, Joint],
            Self::EnvironmentThenEmission => vec![Environment, Emission],
            Self::EnvironmentThenAlbedo => vec![Environment, Albedo],
        }
    }
}

impl TransformsFile {
    fn build(&self, assets: &Assets, background: Rgb) -> Built<Vec<scene::VolumeView>> {
        let every = self.every.unwrap_or(EVERY);
        if every == 0 {
            return Err(Flaw::value("every", every, "at least 1"));
        }
        let shots = assets.shots(&self.file).at("file")?;
        let shots: Vec<&Shot> = shots.iter().step_by(every).collect();
        let names = names_of(&shots);
        let views = shots.into_iter().zip(names);
        views.map(|(shot, name)| self.view(shot, name, background).at("file")).collect()
    }

    fn view(&self, shot: &Shot, name: String, background: Rgb) -> Built<scene::VolumeView> {
        let size = Assets::shot_size(shot)?;
        if shot.size.is_some_and(|said| said != size) {
            let [w, h] = shot.size.unwrap_or(size);
            let file = shot.file.display();
            let problem = format!("{file} has {} x {} pixels, not {w} x {h}", size[0], size[1]);
            return Err(Flaw::new("", problem));
        }
        let mut picture = Assets::shot_picture(shot)?;
        let mask = Assets::shot_mask(shot, size)?;
        let mut mask =
            mask.map(|mask| mask.pixels.iter().map(|pixel| pixel.iter().any(|&c| c > 0.5)).collect());
        if self.alpha == AlphaMeaning::Opacity {
            mask.get_or_insert_with(|| picture.pixels.iter().map(|pixel| pixel[3] > 0.0).collect());
            picture.pixels.iter_mut().for_each(|pixel| *pixel = before(*pixel, background));
        }
        let camera = shot.camera(size)?;
        Ok(scene::VolumeView {
            view: scene::View { name, camera, strokes: Vec::new(), layers: Vec::new(), keep: 0.0 },
            picture: Some(picture),
            mask,
            background: None,
        })
    }
}

/// A pixel of a thing before a background; of weight 1, as all of it is known.
fn before([r, g, b, alpha]: [f32; 4], background: Rgb) -> [f32; 4] {
    let over = |color: f32, behind: f32| alpha * color + (1.0 - alpha) * behind;
    [over(r, background[0]), over(g, background[1]), over(b, background[2]), 1.0]
}

/// Names of views: of each picture its file's, with that of its folder where two are called the same, and else with a number.
fn names_of(shots: &[&Shot]) -> Vec<String> {
    let count = |names: &[String]| {
        let mut counts = HashMap::new();
        names.iter().for_each(|name| *counts.entry(name.to_ascii_lowercase()).or_insert(0) += 1);
        counts
    };
    let own: Vec<String> = shots.iter().map(|shot| name_of(&shot.file)).collect();
    let counts = count(&own);
    let in_folder = |(shot, own): (&&Shot, &String)| match shot.file.parent().and_then(Path::file_name) {
        Some(folder) if counts[&own.to_ascii_lowercase()] > 1 => {
            format!("{}_{own}", name_of(Path::new(folder)))
        }
        _ => own.clone(),
    };
    let named: Vec<String> = shots.iter().zip(&own).map(in_folder).collect();
    let counts = count(&named);
    let numbered = |(index, name): (usize, String)| match counts[&name.to_ascii_lowercase()] {
        1 => name,
        _ => format!("{name}_{index}"),
    };
    named.into_iter().enumerate().map(numbered).collect()
}

/// The file's own name with what no file name of a result may have replaced.
fn name_of(file: &Path) -> String {
    let usual = |c: char| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' };
    let name: String = stem(file).chars().take(24).map(usual).collect();
    if name.is_empty() { "view".to_owned() } else { name }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shot(file: &str) -> Shot {
        let world_from_camera = glam::DAffine3::IDENTITY;
        Shot {
            file: file.into(),
            world_from_camera,
            fov_x: 40.0,
            lens: None,
            size: None,
            mask: None,
            depth: None,
        }
    }

    #[test]
    fn pictures_of_one_name_in_two_folders_are_two_views() {
        let files = ["front/0001.png", "back/0001.png", "back/0002.png", "a/b/0001.png", "c/b/0001.png"];
        let shots = files.map(shot);
        let names = names_of(&shots.iter().collect::<Vec<_>>());
        assert_eq!(names, ["front_0001", "back_0001", "0002", "b_0001_3", "b_0001_4"]);
    }

    #[test]
    fn opacity_puts_a_picture_before_the_background() {
        let background = [0.2, 0.4, 0.8];
        assert_eq!(before([1.0, 0.5, 0.0, 0.0], background), [0.2, 0.4, 0.8, 1.0]);
        assert_eq!(before([1.0, 0.5, 0.0, 1.0], background), [1.0, 0.5, 0.0, 1.0]);
        assert_eq!(before([1.0, 0.0, 0.0, 0.5], background), [0.6, 0.2, 0.4, 1.0]);
    }
}
