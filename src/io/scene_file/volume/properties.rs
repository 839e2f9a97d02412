//! The medium of a volume scene.

use std::sync::Arc;

use glam::DAffine3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::field::{Field, GridSize};
use super::place::Place;
use crate::io::scene_file::assets::Assets;
use crate::io::scene_file::channels::Channels;
use crate::io::scene_file::flaw::{At, Built, Flaw, checked, within};
use crate::io::scene_file::transform::Transform;
use crate::io::volume::Stored;
use crate::scene::{self, VolumeMedium, VoxelGrid};

/// A heterogeneous medium in a box of voxels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Volume {
    /// Extinction coefficient σ_t in 1/metre; not negative.
    pub extinction: Field,
    /// Single-scattering albedo from 0 to 1; 1 when not given.
    #[serde(default = "white", skip_serializing_if = "is_white")]
    #[schemars(!skip_serializing_if)]
    pub albedo: Field,
    /// Radiance that a piece of the medium emits per optical depth; none when not given.
    #[serde(default = "black", skip_serializing_if = "is_black")]
    #[schemars(!skip_serializing_if)]
    pub emission: Field,
    /// Where the unit cube that the voxels fill stands in the world. When not given, where a file says, else from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_world: Option<Transform>,
    /// Voxels along each axis for what is constant or made: N, or [x, y, z]; those of an extinction file when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<GridSize>,
    /// What lies between the centres of voxels, and the basis of what is looked for. When not given, `trilinear` where a view is painted, and
    /// `nearest` where there are pictures alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interpolation: Option<Interpolation>,
    /// Mean cosine of the Henyey–Greenstein phase function, inside (−1, 1); 0 where there is environment light.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub g: f64,
    /// What bends the rays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refraction: Option<Refraction>,
}

/// What lies between the centres of voxels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// Constant in each voxel.
    #[default]
    Nearest,
    /// Trilinear between the centres.
    Trilinear,
}

/// A changing index of refraction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Refraction {
    /// The index, above 0; 1 at the rim of the volume, for rays are straight outside.
    pub index: Field,
    /// Length of a step along a bent ray, in metres; half a voxel when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<f64>,
}

/// Steps of Gauss–Newton at most when not given.
const STEPS: usize = 10;

/// How extinction is looked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Extinction {
    /// Radiance that the medium is taken to have everywhere and in every direction.
    pub medium_radiance: Channels,
    /// Whether each channel has an extinction of its own.
    pub colored: bool,
    /// Steps of Gauss–Newton that a refinement takes at most, from 1 to 1000: fewer where a step brings nothing more.
    #[serde(skip_serializing_if = "is_usual")]
    #[schemars(!skip_serializing_if)]
    pub steps: usize,
    /// What the medium is taken to give in a refinement.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(!skip_serializing_if)]
    pub gives: Gives,
}

/// What a medium gives per optical depth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Gives {
    /// The same everywhere: `medium_radiance`.
    #[default]
    MediumRadiance,
    /// The emission of the volume, and the light of the scene that its albedo scatters once.
    SingleScattering,
}

impl Default for Extinction {
    fn default() -> Self {
        Self { medium_radiance: Channels::Grey(0.0), colored: false, steps: STEPS, gives: Gives::default() }
    }
}

/// The least and the largest value of a property.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// The least value: one number or [r, g, b]; 0 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lower: Option<Channels>,
    /// The largest value: one number or [r, g, b]; of albedo 1, of the others none when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upper: Option<Channels>,
}

/// The least and the largest values of what is looked for.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PropertyBounds {
    /// Of emission.
    pub emission: Range,
    /// Of albedo, inside 0 to 1.
    pub albedo: Range,
    /// Of extinction.
    pub extinction: Range,
    /// Of the lights of the environment.
    pub environment: Range,
}

impl Volume {
    /// The medium. What is the same everywhere and not looked for takes one voxel. Where extinction comes from files that
    /// say where they lie, it is brought to `frames`, what those of all frames fill together.
    pub(super) fn build(
        &self,
        assets: &Assets,
        looked_for: &[scene::Find],
        frames: Option<&VoxelGrid>,
    ) -> Built<VolumeMedium> {
        let stored = |field: &Field, name: &str| field.stored(assets).at(name);
        let extinction = stored(&self.extinction, "extinction")?;
        let albedo = stored(&self.albedo, "albedo")?;
        let emission = stored(&self.emission, "emission")?;
        let index = self.refraction.as_ref().map(|refraction| &refraction.index);
        let index = index.map(|index| stored(index, "refraction.index")).transpose()?.flatten();
        fn place(stored: &Option<Stored>) -> Option<&VoxelGrid> {
            stored.as_ref().filter(|stored| stored.placed).map(|stored| stored.volume.grid())
        }
        let of_extinction = place(&extinction).map(|own| frames.unwrap_or(own));
        let of_another = [&albedo, &emission, &index].into_iter().find_map(place);
        let place = self.place(of_extinction, of_another)?;

        let size = self.size.map(GridSize::sides);
        let voxels = extinction.as_ref().map(|stored| place.voxels(stored, frames)).transpose();
        let voxels = voxels.at("extinction")?;
        let extinction = match (extinction, voxels) {
            (Some(stored), Some(voxels)) => EXTINCTION.of_file(stored, &place, &voxels, assets),
            _ => EXTINCTION.filled(&self.extinction, size, place.world_from_cube, assets),
        };
        let extinction = extinction.and_then(|volume| self.extinction.kept(volume)).at("extinction")?;
        let (size, voxels) = (size.unwrap_or(extinction.grid().size()), *extinction.grid());
        let field = |field: &Field, stored: Option<Stored>, name: &str, limits: &Limits| -> Built<_> {
            use scene::Find::{Albedo, Emission, Joint};
            let is_found = looked_for.iter().any(|find| match find {
                Emission => name == "emission",
                Albedo => name == "albedo",
                Joint => name == "emission" || name == "albedo",
                scene::Find::Extinction | scene::Find::Refinement | scene::Find::Environment => false,
            });
            let size = if matches!(field, Field::Constant(_)) && !is_found { [1; 3] } else { size };
            let volume = match stored {
                Some(stored) => limits.of_file(stored, &place, &voxels, assets),
                None => limits.filled(field, Some(size), voxels.world_from_cube(), assets),
            };
            Ok(Arc::new(volume.and_then(|volume| field.kept(volume)).at(name)?))
        };
        let refraction = self.refraction.as_ref().map(|refraction| -> Built<_> {
            let index = field(&refraction.index, index, "index", &INDEX).at("refraction")?;
            if index.channels() != 1 {
                return Err(Flaw::new(
                    "refraction.index",
                    "rays of all channels are one; give a grey volume",
                ));
            }
            let step = refraction.step.map(|step| checked("step", step, "above 0 metres", |step| step > 0.0));
            Ok((index, step.transpose().at("refraction")?))
        });
        Ok(VolumeMedium {
            refraction: refraction.transpose()?,
            albedo: field(&self.albedo, albedo, "albedo", &ALBEDO)?,
            emission: field(&self.emission, emission, "emission", &EMISSION)?,
            g: checked("g", self.g, "inside (-1, 1)", |g| g > -1.0 && g < 1.0)?,
            interpolation: self.interpolation.unwrap_or_default().into(),
            extinction: Arc::new(extinction),
        })
    }

    /// Where it lies when its files of extinction, or else another, lie there.
    pub(super) fn place(
        &self,
        of_extinction: Option<&VoxelGrid>,
        of_another: Option<&VoxelGrid>,
    ) -> Built<Place> {
        let to_world = self.to_world.as_ref().map(Transform::build).transpose().at("to_world")?;
        Ok(Place::new(to_world, of_extinction, of_another, self.interpolation.unwrap_or_default().into()))
    }
}

/// The values that a property may have.
pub(super) struct Limits {
    least: f32,
    greatest: f32,
    expected: &'static str,
    /// What it is where a file says nothing.
    outside: f32,
}

pub(super) const EXTINCTION: Limits =
    Limits { least: 0.0, greatest: f32::MAX, expected: "not negative", outside: 0.0 };
const ALBEDO: Limits = Limits { least: 0.0, greatest: 1.0, expected: "from 0 to 1", outside: 0.0 };
const EMISSION: Limits = EXTINCTION;
const INDEX: Limits =
    Limits { least: f32::MIN_POSITIVE, greatest: f32::MAX, expected: "above 0", outside: 1.0 };

impl Limits {
    /// What a file holds, in the box that `voxels` fill.
    pub(super) fn of_file(
        &self,
        mut stored: Stored,
        place: &Place,
        voxels: &VoxelGrid,
        assets: &Assets,
    ) -> Built<scene::Volume> {
        self.check(&stored.volume, stored.first)?;
        if !stored.outside.iter().all(|&value| self.has(value)) {
            stored.outside = [self.outside; 3];
        }
        place.put(stored, voxels, assets)
    }

    /// What is constant or made.
    fn filled(
        &self,
        field: &Field,
        size: Option<[usize; 3]>,
        world_from_cube: DAffine3,
        assets: &Assets,
    ) -> Built<scene::Volume> {
        let volume = field.filled(assets, size, world_from_cube)?;
        self.check(&volume, [0; 3])?;
        Ok(volume)
    }

    fn has(&self, value: f32) -> bool {
        self.least <= value && value <= self.greatest
    }

    /// Whether all values are allowed; a flaw that names the first voxel where they are not, counted from `first`.
    fn check(&self, volume: &scene::Volume, first: [i64; 3]) -> Built<()> {
        let wrong = volume.samples().iter().position(|value| !self.has(value));
        let Some(index) = wrong else { return Ok(()) };
        let voxel = volume.grid().voxel(index / volume.channels());
        let [i, j, k] = std::array::from_fn(|axis| first[axis] + voxel[axis] as i64);
        let value = volume.samples().get(index);
        let expected = self.expected;
        Err(Flaw::new("", format!("{value} in voxel ({i}, {j}, {k}) is not allowed; it must be {expected}")))
    }
}

impl Extinction {
    pub(super) fn build(&self) -> Built<scene::ExtinctionSettings> {
        Ok(scene::ExtinctionSettings {
            medium_radiance: self.medium_radiance.rgb("medium_radiance", f32::MAX)?,
            is_grey: !self.colored,
            steps: within("steps", self.steps, [1, 1000])?,
            is_scattering: self.gives == Gives::SingleScattering,
        })
    }
}

impl PropertyBounds {
    /// Puts in the bounds that are not given.
    pub(super) fn settle(&mut self) {
        let usual = scene::PropertyBounds::default();
        self.emission.settle(usual.emission);
        self.albedo.settle(usual.albedo);
        self.extinction.settle(usual.extinction);
        self.environment.settle(usual.environment);
    }

    pub(super) fn build(&self) -> Built<scene::PropertyBounds> {
        let usual = scene::PropertyBounds::default();
        Ok(scene::PropertyBounds {
            emission: self.emission.build(usual.emission).at("emission")?,
            albedo: self.albedo.build(usual.albedo).at("albedo")?,
            extinction: self.extinction.build(usual.extinction).at("extinction")?,
            environment: self.environment.build(usual.environment).at("environment")?,
        })
    }
}

impl Range {
    fn settle(&mut self, [least, largest]: [[f64; 3]; 2]) {
        self.lower.get_or_insert(Channels::Rgb(least).simplest());
        // Infinity is no number of a document.
        if largest.iter().all(|bound| bound.is_finite()) {
            self.upper.get_or_insert(Channels::Rgb(largest).simplest());
        }
    }

    fn build(&self, [least, largest]: [[f64; 3]; 2]) -> Built<[[f64; 3]; 2]> {
        let lower = self.lower.map_or(least, Channels::wide);
        let upper = self.upper.map_or(largest, Channels::wide);
        for c in 0..3 {
            let within = |value: f64| least[c] <= value && value <= largest[c];
            if !within(lower[c]) {
                return Err(Flaw::value(
                    "lower",
                    lower[c],
                    "physically possible: not negative, of albedo at most 1",
                ));
            }
            // Not `upper < lower`: a NaN must not pass.
            if !(within(upper[c]) && lower[c] <= upper[c]) {
                return Err(Flaw::value("upper", upper[c], "not below `lower`, of albedo at most 1"));
            }
        }
        Ok([lower, upper])
    }
}

impl From<Interpolation> for scene::Interpolation {
    fn from(interpolation: Interpolation) -> Self {
        match interpolation {
            Interpolation::Nearest => Self::Nearest,
            Interpolation::Trilinear => Self::Trilinear,
        }
    }
}

fn white() -> Field {
    Field::Constant(Channels::Grey(1.0))
}

fn is_white(field: &Field) -> bool {
    *field == white()
}

fn black() -> Field {
    Field::Constant(Channels::Grey(0.0))
}

fn is_black(field: &Field) -> bool {
    *field == black()
}

fn is_usual(steps: &usize) -> bool {
    *steps == STEPS
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Voxels of the cached light.
pub(super) fn light_size(size: Option<GridSize>) -> Built<Option<[usize; 3]>> {
    let Some(size) = size else { return Ok(None) };
    VoxelGrid::new(size.sides(), DAffine3::IDENTITY)?;
    Ok(Some(size.sides()))
}
