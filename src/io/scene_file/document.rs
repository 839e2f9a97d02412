//! A scene file as it is written.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scene::{self, DirectionalLight, Scene};

use super::assets::Assets;
use super::channels::Channels;
use super::defaults::Defaults;
use super::exposure::Exposure;
use super::flaw::{At, Built, Flaw};
use super::light::Light;
use super::light_animation::LightAnimation;
use super::looks::Looks;
use super::map::{LightMap, ShadowMap};
use super::medium::Medium;
use super::occluder::{Occluder, mesh_of};
use super::solve::Solve;
use super::stroke::Group;
use super::surroundings::Surroundings;
use super::unit::Unit;
use super::view::View;

/// Pull to equal neighbours in a transfer function: less leaves bands between strokes, and more paint unmet (docs/looks.md).
const TRANSFER_GRADIENT: f64 = 4.0;

/// An unscatter scene. Lengths are in metres, angles in degrees, radiance is linear Rec. 709; cameras look along
/// −Z with +Y up. File names are relative to the scene file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Document {
    /// Where the schema is, for editors; ignored.
    #[serde(rename = "$schema", default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// Version of this format: 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u64,
    /// Which defaults settings have that are not given.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub defaults: Defaults,
    /// The unit of all lengths of this file and of the files that it names, but not of `sigma_t`, which is per metre.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub unit: Unit,
    /// Why values were chosen that were not given, by their paths: `scene.resolved.json` says so; ignored.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub chosen: BTreeMap<String, String>,
    /// What the scene is called in titles and reports; the name of the file when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The sun.
    pub light: Light,
    /// The air.
    pub medium: Medium,
    /// Radiance of the sky behind everything, and the light that surfaces get from everywhere.
    #[serde(default = "default_ambient")]
    pub ambient: Channels,
    /// Light beside that of the light map which is looked for together with it. With it paint is about all that is seen, and not about
    /// scattered light alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surroundings: Option<Surroundings>,
    /// What casts shadows and what the views see; nothing for open air.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub occluders: Vec<Occluder>,
    /// Cameras and what is painted on their pictures; at least one.
    #[schemars(length(min = 1))]
    pub views: Vec<View>,
    /// Groups of strokes, by whose names strokes say that they are in them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub groups: Vec<Group>,
    /// How shafts are bent beyond what is physical.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub looks: Looks,
    /// The light map that is looked for.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub light_map: LightMap,
    /// The shadow map of the light.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub shadow_map: ShadowMap,
    /// What is looked for behind paint.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub find: Sought,
    /// What a painted colour asks for.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub target: Target,
    /// What the opacity of strokes, their soft edges and the alpha of layers ask for.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub opacity: Opacity,
    /// Stops by which PNG pictures are brightened, from −64 to 64; or `auto`: as many as make them readable.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub exposure: Exposure,
    /// How the problem is solved.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub solve: Solve,
    /// Frames in which the sun, the cameras and the looks move; `unscatter animate` draws them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub animation: Option<LightAnimation>,
}

/// What is looked for behind paint.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sought {
    /// The light map of the sun: what it shines through.
    #[default]
    LightMap,
    /// The transfer function of `looks`: the colour of scattered light for two properties of a view ray.
    Transfer,
}

/// What a painted colour asks for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Target {
    /// The painted colour times what the light itself gives there: white asks for no change.
    #[default]
    Tint,
    /// The painted colour times what a white light as bright would give there.
    WhiteTint,
    /// The painted colour is the radiance of the scattered light itself.
    Radiance,
}

/// What opacity asks for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Opacity {
    /// How far the picture goes from what is there to the painted colour: faint paint is a faint tint.
    #[default]
    Strength,
    /// How much it weighs that the picture has the painted colour: faint paint is a weak wish for the whole colour.
    Weight,
}

impl Document {
    /// The version of the format that this library reads and writes.
    pub const VERSION: u64 = 1;

    /// A document with everything at its default but what has none.
    pub fn new(light: Light, medium: Medium, views: Vec<View>) -> Self {
        Self {
            schema: None,
            version: Self::VERSION,
            defaults: Defaults::default(),
            unit: Unit::default(),
            chosen: BTreeMap::new(),
            name: None,
            light,
            medium,
            ambient: default_ambient(),
            surroundings: None,
            occluders: Vec::new(),
            views,
            groups: Vec::new(),
            looks: Looks::default(),
            light_map: LightMap::default(),
            shadow_map: ShadowMap::default(),
            find: Sought::default(),
            target: Target::default(),
            opacity: Opacity::default(),
            exposure: Exposure::default(),
            solve: Solve::default(),
            animation: None,
        }
    }

    /// What it reads, relative to the file that it comes from.
    pub(super) fn assets(&self, file: &Path) -> Built<Assets> {
        Assets::beside(file).within(self.solve.memory).grouped(&self.groups)
    }

    /// The scene without its animation; `file` is where the document comes from.
    pub(super) fn scene(&self, file: &Path, assets: &mut Assets) -> Built<Scene> {
        if self.version != Self::VERSION {
            return Err(unknown_version(self.version));
        }
        // What is small is looked at before what may take long to read.
        let medium = self.medium.build(self.unit.metres()).at("medium")?;
        let ambient = self.ambient.rgb("ambient", f32::MAX)?;
        let light_map = self.light_map.build().at("light_map")?;
        let shadow_map = self.shadow_map.build().at("shadow_map")?;
        let exposure = self.exposure.build()?;
        let mut solve =
            self.solve().build_light_map(self.light_map.texels(), self.light_map.basis.into()).at("solve")?;
        let light = self.light.build(assets).at("light")?;
        solve.bounds = self.bounds(solve.bounds, &light);
        let surroundings = self.surroundings.as_ref();
        let surroundings = surroundings.map(|it| it.build(assets).at("surroundings")).transpose()?;
        let views = self.build_views(assets)?;
        let mesh = mesh_of(&self.occluders, assets)?;
        let looks = self.looks.build(&views, &mesh, assets).at("looks")?;
        Ok(Scene {
            name: self.name.clone().unwrap_or_else(|| stem(file)),
            light,
            medium,
            metres_per_unit: self.unit.metres(),
            mesh,
            ambient,
            surroundings,
            views,
            looks,
            light_map,
            shadow_map,
            find: self.find.into(),
            target: self.target.into(),
            opacity: self.opacity.into(),
            solve,
            exposure,
        })
    }

    /// How the problem is solved, with what follows from what is looked for.
    fn solve(&self) -> Solve {
        let mut solve = self.solve.clone();
        if self.find == Sought::Transfer {
            solve.gradient.get_or_insert_with(|| TRANSFER_GRADIENT.into());
        }
        solve
    }

    /// Bounds of texels under a light, whose radiance is the upper one of a map that only dims.
    pub(super) fn bounds(&self, given: [[f64; 3]; 2], light: &DirectionalLight) -> [[f64; 3]; 2] {
        match self.find == Sought::LightMap && self.is_gobo() && self.solve.upper.is_none() {
            true => [given[0], light.radiance.map(f64::from)],
            false => given,
        }
    }

    /// Whether the light map only dims.
    fn is_gobo(&self) -> bool {
        self.light_map.gobo.unwrap_or(self.target != Target::Radiance)
    }

    /// Puts in the settings that are not given and that the schema has no default for.
    pub(super) fn settle(&mut self, file: &Path) {
        self.schema = None;
        self.light_map.gobo = Some(self.is_gobo());
        self.solve = self.solve();
        self.solve.settle_light_map(self.light_map.texels());
        self.name.get_or_insert_with(|| stem(file));
        self.light.settle();
        self.looks.settle();
        self.surroundings.iter_mut().for_each(Surroundings::settle);
        self.views.iter_mut().for_each(|view| view.camera.settle());
        self.animation.iter_mut().for_each(|animation| animation.settle(&self.views));
    }

    fn build_views(&self, assets: &mut Assets) -> Built<Vec<scene::View>> {
        if self.views.is_empty() {
            return Err(Flaw::new("views", "there is no view; add one with a `name` and a `camera`"));
        }
        check_names(self.views.iter().map(|view| view.name.as_str()))?;
        let views = self.views.iter().enumerate();
        views.map(|(i, view)| view.build(assets).at(&format!("views[{i}]"))).collect()
    }
}

/// A flaw when two views have the same name.
pub(super) fn check_names<'a>(views: impl Iterator<Item = &'a str>) -> Built<()> {
    let mut names = std::collections::HashMap::new();
    for (i, name) in views.enumerate() {
        if let Some(first) = names.insert(name.to_ascii_lowercase(), i) {
            let expected =
                format!("different from the name of views[{first}], for it names files (case is ignored)");
            return Err(Flaw::value(format!("views[{i}].name"), format!("`{name}`"), &expected));
        }
    }
    Ok(())
}

/// A flaw that says which version this library reads.
pub(super) fn unknown_version(version: impl ToString) -> Flaw {
    Flaw::value("version", version, "1, the version of the format that this program reads")
}

impl From<Sought> for scene::Sought {
    fn from(sought: Sought) -> Self {
        match sought {
            Sought::LightMap => Self::LightMap,
            Sought::Transfer => Self::Transfer,
        }
    }
}

impl From<Target> for scene::Target {
    fn from(target: Target) -> Self {
        match target {
            Target::Tint => Self::Tint,
            Target::WhiteTint => Self::WhiteTint,
            Target::Radiance => Self::Radiance,
        }
    }
}

impl From<Opacity> for scene::Opacity {
    fn from(opacity: Opacity) -> Self {
        match opacity {
            Opacity::Strength => Self::Strength,
            Opacity::Weight => Self::Weight,
        }
    }
}

pub(super) fn stem(file: &Path) -> String {
    file.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

fn default_ambient() -> Channels {
    Channels::Grey(0.02)
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
