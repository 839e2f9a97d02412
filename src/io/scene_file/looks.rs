//! How shafts are bent beyond what is physical, in the document.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scene::{self, HoleNoise, Holes, Mesh, OccluderEditKind, Radius, Sway};

use super::assets::Assets;
use super::file_name::FileName;
use super::flaw::{At, Built, Flaw, checked, within};
use super::heterogeneity::Heterogeneity;
use super::scene_text::SceneText;
use super::surface_light::SurfaceLight;
use super::transfer::Transfer;
use super::view::view_number;
use super::wording::nearest;

/// How single scattering is bent beyond what is physical (Kol et al. 2017). Pictures and solves alike see it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Looks {
    /// A file of looks, which carries a mood from scene to scene: `.json` with what may stand here, alone or under `looks`; or an EXR or
    /// PNG picture, which is a transfer function. What stands beside it takes the place of what it says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<FileName>,
    /// Edits of what casts shadows in the air, one after the other. Surfaces keep the shadows that they have.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub occluders: Vec<OccluderEdit>,
    /// The colour of scattered light.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transfer: Option<Transfer>,
    /// Irregular air.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heterogeneity: Option<Heterogeneity>,
    /// Light from everywhere on surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surfaces: Option<SurfaceLight>,
}

/// An edit of the shadow map of the light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OccluderEdit {
    /// Closes holes, and takes their shafts away.
    Fill(Fill),
    /// Extrudes what casts shadows along the view rays of a view: shafts are deeper, and hidden where they begin.
    Extrude(Extrude),
    /// Makes holes, and shafts with them.
    Pierce(Pierce),
}

/// Closes holes that are narrower than twice the radius: each depth becomes the least around it, then the largest of those.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fill {
    /// How far it reaches, in texels of the shadow map; this or `length`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub texels: Option<f64>,
    /// The same in units of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
    /// What is around a place.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub kernel: Kernel,
    /// The view towards which `lines` go.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<String>,
    /// How far depths go towards the edited ones, from 0 to 1.
    #[serde(default = "one")]
    pub strength: f64,
}

/// What is around a place of a shadow map.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kernel {
    /// A disc.
    #[default]
    Disc,
    /// A square, as fast for any radius.
    Square,
    /// A stretch of the line towards the eye of a view, along its view rays: what is filled is hidden behind what that view sees.
    Lines,
}

/// Extrudes what casts shadows, away from the eye of a view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Extrude {
    /// The name of the view.
    pub view: String,
    /// How far, in texels of the shadow map; this or `length`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub texels: Option<f64>,
    /// The same in units of the scene, along the shadow map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
    /// How far depths go towards the edited ones, from 0 to 1.
    #[serde(default = "one")]
    pub strength: f64,
}

/// Makes holes where Perlin's noise is below a threshold.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pierce {
    /// The side of a cell of the first octave, in units of the scene: about the distance from hole to hole.
    pub size: f64,
    /// The share of the area that becomes holes.
    #[serde(default = "half")]
    #[schemars(range(min = 0, max = 1))]
    pub share: f64,
    /// Octaves of noise: more make rims rough.
    #[serde(default = "five")]
    #[schemars(range(min = 1, max = 12))]
    pub octaves: u32,
    /// The factor from one octave to the next.
    #[serde(default = "half")]
    pub persistence: f64,
    /// Other numbers give other holes.
    #[serde(default)]
    pub seed: u32,
    /// What is pierced, by the names of objects: nodes of glTF files, objects and groups of OBJ files.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub objects: Vec<String>,
    /// The same by the names of materials.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub materials: Vec<String>,
    /// The same by numbers of the scene's `occluders`, from 0. Where nothing is named, all is pierced.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub occluders: Vec<usize>,
    /// Moves holes about; none where they stand still.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sway: Option<HoleSway>,
    /// How far depths go towards those of holes, from 0 to 1.
    #[serde(default = "one")]
    pub strength: f64,
}

/// How holes are moved: noise at places that are turned about moves them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HoleSway {
    /// By how many degrees places are turned: the time.
    pub turn: f64,
    /// How far places are moved, in cells of the noise.
    #[serde(default = "half")]
    pub amount: f64,
}

impl Looks {
    pub(super) fn build(&self, views: &[scene::View], mesh: &Mesh, assets: &Assets) -> Built<scene::Looks> {
        let mut mood = match &self.file {
            Some(file) => mood(file, views, mesh, assets).at("file")?,
            None => scene::Looks::default(),
        };
        let own = self.build_own(views, mesh, assets)?;
        if !own.occluders.is_empty() {
            mood.occluders = own.occluders;
        }
        if !own.transfer.is_empty() {
            mood.transfer = own.transfer;
        }
        if !own.heterogeneity.is_empty() {
            mood.heterogeneity = own.heterogeneity;
        }
        if !own.surfaces.is_empty() {
            mood.surfaces = own.surfaces;
        }
        Ok(mood)
    }

    /// What stands here, whatever a file says.
    fn build_own(&self, views: &[scene::View], mesh: &Mesh, assets: &Assets) -> Built<scene::Looks> {
        let transfer = self.transfer.as_ref();
        let transfer = transfer.map(|it| it.build(views, mesh, assets).at("transfer")).transpose()?;
        let edits = self.occluders.iter().enumerate();
        let edits = edits.map(|(i, edit)| edit.build(views, mesh).at(&format!("occluders[{i}]")));
        let transfer = transfer.map(|it| (1.0, it)).into_iter().collect();
        let air = self.heterogeneity.as_ref();
        let air = air.map(|it| it.build(views, assets).at("heterogeneity")).transpose()?;
        let heterogeneity = air.map(|it| (1.0, it)).into_iter().collect();
        let surfaces = self.surfaces.as_ref();
        let surfaces = surfaces.map(|it| it.build(assets).at("surfaces")).transpose()?;
        let surfaces = surfaces.map(|it| (1.0, it)).into_iter().collect();
        Ok(scene::Looks { occluders: edits.collect::<Built<_>>()?, transfer, heterogeneity, surfaces })
    }

    /// Puts in the settings that are not given.
    pub(super) fn settle(&mut self) {
        self.heterogeneity.iter_mut().for_each(Heterogeneity::settle);
        self.surfaces.iter_mut().for_each(SurfaceLight::settle);
    }
}

/// The looks of a file.
fn mood(file: &FileName, views: &[scene::View], mesh: &Mesh, assets: &Assets) -> Built<scene::Looks> {
    if !file.to_string().to_ascii_lowercase().ends_with(".json") {
        let looks = Looks { transfer: Some(Transfer::picture(file, assets)?), ..Looks::default() };
        return looks.build_own(views, mesh, assets);
    }
    let (path, bytes) = assets.text(file)?;
    let source = SceneText::of(&bytes, &path)?;
    let mut value = source.value()?;
    let is_scene = value.get("looks").is_some();
    if is_scene {
        value = serde_json::json!({ "looks": value["looks"].take() });
    }
    let looks = match is_scene {
        true => source.read::<SceneLooks>(&value)?.looks,
        false => source.read(&value)?,
    };
    if looks.file.is_some() {
        return Err(Flaw::new("", "a file of looks names no other such file"));
    }
    let built = looks.build_own(views, mesh, &assets.beside_file(&path));
    Ok(source.placed(if is_scene { built.at("looks") } else { built })?)
}

/// The looks of a whole scene file.
#[derive(Deserialize)]
struct SceneLooks {
    looks: Looks,
}

impl OccluderEdit {
    fn build(&self, views: &[scene::View], mesh: &Mesh) -> Built<scene::OccluderEdit> {
        let (kind, strength) = match self {
            Self::Fill(fill) => (fill.build(views).at("fill")?, fill.strength),
            Self::Extrude(extrude) => {
                let eye = eye(&extrude.view, views).at("extrude")?;
                let radius = radius(extrude.texels, extrude.length).at("extrude")?;
                (OccluderEditKind::Extrude { eye, radius }, extrude.strength)
            }
            Self::Pierce(pierce) => (pierce.build(mesh).at("pierce")?, pierce.strength),
        };
        let name = match self {
            Self::Fill(_) => "fill.strength",
            Self::Extrude(_) => "extrude.strength",
            Self::Pierce(_) => "pierce.strength",
        };
        Ok(scene::OccluderEdit { kind, strength: within(name, strength, [0.0, 1.0])? })
    }
}

impl Fill {
    fn build(&self, views: &[scene::View]) -> Built<OccluderEditKind> {
        let radius = radius(self.texels, self.length)?;
        let kernel = match (self.kernel, &self.view) {
            (Kernel::Disc, None) => scene::Kernel::Disc,
            (Kernel::Square, None) => scene::Kernel::Square,
            (Kernel::Lines, Some(view)) => scene::Kernel::Lines(eye(view, views)?),
            (Kernel::Lines, None) => {
                return Err(Flaw::new("", "lines go towards a view; give the name of one as `view`"));
            }
            (_, Some(_)) => {
                return Err(Flaw::new("view", "only the kernel `lines` has a view; leave it away"));
            }
        };
        Ok(OccluderEditKind::Fill(kernel, radius))
    }
}

impl Pierce {
    fn build(&self, mesh: &Mesh) -> Built<OccluderEditKind> {
        let noise = HoleNoise {
            size: checked("size", self.size, "above 0", |size| size > 0.0)?,
            octaves: within("octaves", self.octaves, [1, 12])?,
            persistence: within("persistence", self.persistence, [0.0, 4.0])?,
            seed: self.seed,
        };
        let sway = self.sway.as_ref().map(|HoleSway { turn, amount }| {
            let turn = checked("turn", *turn, "a number of degrees", |_| true).at("sway")?;
            let amount = within("amount", *amount, [-100.0, 100.0]).at("sway")?;
            Built::Ok(Sway { turn: turn.to_radians(), amount })
        });
        let share = within("share", self.share, [0.0, 1.0])?;
        Ok(OccluderEditKind::Pierce(Holes::new(self.pierced(mesh)?, noise, share, sway.transpose()?)))
    }

    /// Which triangles are pierced.
    fn pierced(&self, mesh: &Mesh) -> Built<Vec<bool>> {
        let objects: Vec<&str> = mesh.objects.iter().filter_map(|object| object.name.as_deref()).collect();
        let materials: Vec<&str> =
            mesh.materials.iter().filter_map(|material| material.name.as_deref()).collect();
        known("objects", &self.objects, &objects, "object")?;
        known("materials", &self.materials, &materials, "material")?;
        let last = mesh.objects.iter().map(|object| object.occluder).max();
        if let Some(i) = self.occluders.iter().position(|&number| last.is_none_or(|last| number > last)) {
            let expected = "the number of one of the scene's occluders, counted from 0";
            return Err(Flaw::value(format!("occluders[{i}]"), self.occluders[i], expected));
        }
        let is_all = self.objects.is_empty() && self.materials.is_empty() && self.occluders.is_empty();
        let is_pierced = |triangle: usize| {
            let (object, material) = (mesh.object(triangle), mesh.material(triangle));
            is_all
                || object.name.as_ref().is_some_and(|name| self.objects.contains(name))
                || material.name.as_ref().is_some_and(|name| self.materials.contains(name))
                || self.occluders.contains(&object.occluder)
        };
        Ok((0..mesh.triangles.len()).map(is_pierced).collect())
    }
}

/// A flaw where a name is none of those that there are.
fn known(field: &str, names: &[String], there: &[&str], what: &str) -> Built<()> {
    let unknown = names.iter().position(|name| !there.contains(&name.as_str()));
    unknown.map_or(Ok(()), |i| {
        let (name, near) = (&names[i], nearest(&names[i], there));
        let remedy = match near {
            Some(near) => format!("; did you mean `{near}`?"),
            None if there.is_empty() => format!("; no {what} here has a name"),
            None => format!("; there are {}", listed(there)),
        };
        Err(Flaw::new(format!("{field}[{i}]"), format!("no {what} is called `{name}`{remedy}")))
    })
}

/// Some names at most, each once.
fn listed(names: &[&str]) -> String {
    const MOST: usize = 12;
    let names: std::collections::BTreeSet<&str> = names.iter().copied().collect();
    let shown: Vec<String> = names.iter().take(MOST).map(|name| format!("`{name}`")).collect();
    let more = if names.len() > MOST { ", and others" } else { "" };
    format!("{}{more}", shown.join(", "))
}

/// The eye of a view.
fn eye(name: &str, views: &[scene::View]) -> Built<glam::DVec3> {
    Ok(views[view_number(name, views)?].camera.position())
}

/// The one of two radii that is given.
fn radius(texels: Option<f64>, length: Option<f64>) -> Built<Radius> {
    let sound = |name: &str, radius| checked(name, radius, "0 or more", |radius| radius >= 0.0);
    match (texels, length) {
        (Some(texels), None) => Ok(Radius::Texels(sound("texels", texels)?)),
        (None, Some(length)) => Ok(Radius::Metres(sound("length", length)?)),
        _ => Err(Flaw::new("", "say how far it reaches: either as `texels` or as a `length`")),
    }
}

fn one() -> f64 {
    1.0
}

fn half() -> f64 {
    0.5
}

fn five() -> u32 {
    5
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
