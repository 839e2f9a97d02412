//! Heterogeneous air, in the document.

use std::sync::Arc;

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::march::MOST_INTENSITY;
use crate::scene;

use super::assets::Assets;
use super::file_name::FileName;
use super::flaw::{At, Built, Flaw, checked, within};
use super::solve::Quadrature;
use super::view::view_number;

/// What there is where nothing is said: noise, all of it, and light as it is.
const AMOUNT: f64 = 1.0;
const FREQUENCY: f64 = 0.0;
const INTENSITY: f64 = 1.0;
/// Voxels a side of noise and of the blend volumes.
const VOXELS: [usize; 2] = [2, 256];
/// Pixels from one ray to the next.
const UPSAMPLE: [usize; 2] = [1, 64];
/// Points of all strokes of a blend volume.
const MOST_POINTS: usize = 100_000;

/// Irregular air: what it scatters of the sun along a view ray is multiplied by the mean of `intensity · (amount · noise + 1 − amount)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Heterogeneity {
    /// What makes it irregular.
    pub noise: Noise,
    /// How much of the noise there is, from 0 to 1; 1 where nothing is said.
    pub amount: BlendVolume,
    /// At which level of detail the noise is looked up: 0 is all of it, and each level has half the frequencies of the one before. 0 where nothing is said.
    pub frequency: BlendVolume,
    /// A factor of what the air scatters, 1 where nothing is said.
    pub intensity: BlendVolume,
    /// The box in which something may be painted, in units of the scene; what the views see when not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bounds: Option<Box3>,
    /// Voxels along the longest side of that box, from 2 to 256.
    pub voxels: usize,
    /// How the mean is taken: `{ "march": { "steps": 64 } }`, or `exact`.
    pub quadrature: Quadrature,
    /// Pixels from one ray of a picture that is asked to the next, from 1 (each) to 64; the others are between those of about their depth.
    pub upsample: usize,
    /// Voxels along the longest side of the box of one volume into which all is baked, from 2 to 256; nothing is baked when not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bake: Option<usize>,
}

/// Perlin's noise in a cube that is repeated in all directions, 1 on the mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Noise {
    /// The side of the cube, in units of the scene; half the longest side of the box when not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<f64>,
    /// Cells of the first octave along a side: as many clouds.
    pub cells: u32,
    /// Octaves, each of twice the frequency of the one before: more are finer.
    pub octaves: u32,
    /// The factor from one octave to the next.
    pub persistence: f64,
    /// Other numbers give other noise.
    pub seed: u32,
    /// Voxels along a side, a power of two from 8 to 256.
    pub voxels: usize,
    /// How far it has been moved, in units of the scene: wind, in key frames.
    pub offset: [f64; 3],
}

/// Values in the air: `base` everywhere, in its place a file, and strokes over that.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BlendVolume {
    /// What is everywhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<f64>,
    /// A volume (OpenVDB or NPZ) that says where it lies; outside of it is the base.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<FileName>,
    /// Which of several grids of the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid: Option<String>,
    /// What is painted over it, one after the other.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(!skip_serializing_if)]
    pub strokes: Vec<AirStroke>,
}

/// A stroke on a plane in the air: across what a `view` looks at, at a `distance`, along `pixels`; or along `points` of a plane with a
/// `normal`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AirStroke {
    /// What is painted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Whether it takes away what has been painted before, in place of a value.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schemars(!skip_serializing_if)]
    pub erase: bool,
    /// The view that it was painted in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<String>,
    /// How far the plane is away, straight ahead, in units of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance: Option<f64>,
    /// Its path in the picture of the view, in pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pixels: Option<Vec<[f64; 2]>>,
    /// Its path in the world, in units of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<Vec<[f64; 3]>>,
    /// The normal of its plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f64; 3]>,
    /// The radius of the brush in the plane, in units of the scene.
    pub radius: f64,
    /// The radius along the normal; the same when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<f64>,
    /// How far values go towards the stroke's in the middle of the brush, from 0 to 1.
    #[serde(default = "one")]
    pub opacity: f64,
    /// The part of the radius in which the opacity is whole, from 0 to 1; it falls to 0 at the rim.
    #[serde(default = "half")]
    pub hardness: f64,
}

/// A box along the axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Box3 {
    /// Least x, y and z.
    pub min: [f64; 3],
    /// Greatest x, y and z.
    pub max: [f64; 3],
}

impl Default for Heterogeneity {
    fn default() -> Self {
        Self {
            noise: Noise::default(),
            amount: BlendVolume::default(),
            frequency: BlendVolume::default(),
            intensity: BlendVolume::default(),
            bounds: None,
            voxels: 64,
            quadrature: Quadrature::March { steps: 64 },
            upsample: 1,
            bake: None,
        }
    }
}

impl Default for Noise {
    fn default() -> Self {
        Self { size: None, cells: 4, octaves: 4, persistence: 0.5, seed: 0, voxels: 128, offset: [0.0; 3] }
    }
}

impl Heterogeneity {
    pub(super) fn build(&self, views: &[scene::View], assets: &Assets) -> Built<scene::Heterogeneity> {
        let noise = self.noise.build().at("noise")?;
        let levels = f64::from(noise.voxels.ilog2());
        let blend =
            |name: &str, blend: &BlendVolume, range: [f64; 2]| blend.build(range, views, assets).at(name);
        Ok(scene::Heterogeneity {
            blends: scene::Blends {
                amount: blend("amount", &self.amount, [AMOUNT, 1.0])?,
                frequency: blend("frequency", &self.frequency, [FREQUENCY, levels])?,
                intensity: blend("intensity", &self.intensity, [INTENSITY, MOST_INTENSITY])?,
            },
            noise,
            bounds: self.bounds.map(|bounds| bounds.build().at("bounds")).transpose()?,
            voxels: within("voxels", self.voxels, VOXELS)?,
            quadrature: self.quadrature.build()?,
            upsample: within("upsample", self.upsample, UPSAMPLE)?,
            bake: self.bake.map(|voxels| within("bake", voxels, VOXELS)).transpose()?,
        })
    }
}

impl Heterogeneity {
    /// Puts in the settings that are not given, but for what is fitted to the scene.
    pub(super) fn settle(&mut self) {
        self.amount.base.get_or_insert(AMOUNT);
        self.frequency.base.get_or_insert(FREQUENCY);
        self.intensity.base.get_or_insert(INTENSITY);
    }
}

impl Noise {
    fn build(&self) -> Built<scene::AirNoise> {
        let voxels = within("voxels", self.voxels, [8, VOXELS[1]])?;
        if !voxels.is_power_of_two() {
            return Err(Flaw::value("voxels", voxels, "a power of two: 8, 16, 32, 64, 128 or 256"));
        }
        let cells = within("cells", self.cells, [1, 128])?;
        let octaves = within("octaves", self.octaves, [1, 8])?;
        // The cells of the last octave, each of which takes two voxels at least.
        let last = (cells as usize) << (octaves - 1);
        if 2 * last > voxels {
            let problem = format!(
                "the last of {octaves} octaves has {last} cells a side, for which {voxels} voxels are too few; lower `octaves` or `cells`, or raise `voxels`"
            );
            return Err(Flaw::new("octaves", problem));
        }
        let size = self
            .size
            .map(|size| checked("size", size, "above 0, and at most 1e9", |it| it > 0.0 && it <= 1e9));
        Ok(scene::AirNoise {
            size: size.transpose()?,
            cells,
            octaves,
            persistence: within("persistence", self.persistence, [0.0, 4.0])?,
            seed: self.seed,
            voxels,
            offset: finite("offset", self.offset)?,
        })
    }
}

impl BlendVolume {
    /// `base` is what is everywhere where nothing is said, `most` the largest value.
    fn build(
        &self,
        [base, most]: [f64; 2],
        views: &[scene::View],
        assets: &Assets,
    ) -> Built<scene::BlendVolume> {
        if self.grid.is_some() && self.file.is_none() {
            return Err(Flaw::new("grid", "it is one of a file; give the `file`, too"));
        }
        let stored = self.file.as_ref().map(|file| {
            let stored = assets.volume(file, self.grid.as_deref())?;
            if !stored.placed {
                let problem = "the file does not say where its voxels lie; use OpenVDB, or an NPZ with `world_from_grid`";
                return Err(Flaw::new("", problem));
            }
            Ok(Arc::new(stored.volume))
        });
        let points: usize = self.strokes.iter().map(AirStroke::points).sum();
        within("strokes", points, [0, MOST_POINTS])?;
        let strokes = self.strokes.iter().enumerate();
        let strokes = strokes.map(|(i, stroke)| stroke.build(most, views).at(&format!("strokes[{i}]")));
        Ok(scene::BlendVolume {
            base: within("base", self.base.unwrap_or(base), [0.0, most])?,
            stored: stored.transpose().at("file")?,
            strokes: strokes.collect::<Built<_>>()?,
        })
    }
}

impl AirStroke {
    fn points(&self) -> usize {
        self.pixels.as_ref().map_or(0, Vec::len) + self.points.as_ref().map_or(0, Vec::len)
    }

    fn build(&self, most: f64, views: &[scene::View]) -> Built<scene::AirStroke> {
        let value = match (self.value, self.erase) {
            (Some(value), false) => Some(within("value", value, [0.0, most])?),
            (None, true) => None,
            _ => return Err(Flaw::new("", "give either a `value`, or `\"erase\": true`")),
        };
        let (path, normal) = self.path(views)?;
        let length = |name: &str, value: f64| checked(name, value, "above 0", |value| value > 0.0);
        Ok(scene::AirStroke {
            path,
            normal,
            radii: [length("radius", self.radius)?, length("depth", self.depth.unwrap_or(self.radius))?],
            value,
            opacity: within("opacity", self.opacity, [0.0, 1.0])?,
            hardness: within("hardness", self.hardness, [0.0, 1.0])?,
        })
    }

    /// Its path and the normal of its plane.
    fn path(&self, views: &[scene::View]) -> Built<(Vec<DVec3>, DVec3)> {
        let Self { view, distance, pixels, points, normal, .. } = self;
        match (view, distance, pixels, points, normal) {
            (Some(view), Some(distance), Some(pixels), None, None) => {
                let camera = &views[view_number(view, views)?].camera;
                let distance = checked("distance", *distance, "above 0", |distance| distance > 0.0)?;
                within("pixels", pixels.len(), [1, MOST_POINTS])?;
                let ahead = camera.ahead();
                let on_plane = |(i, pixel): (usize, &[f64; 2])| {
                    let ray = camera.ray(pixel[0], pixel[1]);
                    let cosine = ray.direction.dot(ahead);
                    let point = ray.at(distance / cosine);
                    if cosine > 1e-3 && point.is_finite() {
                        return Ok(point);
                    }
                    let expected = "a pixel whose ray meets the plane straight ahead";
                    Err(Flaw::value(format!("pixels[{i}]"), format!("{pixel:?}"), expected))
                };
                let path = pixels.iter().enumerate().map(on_plane).collect::<Built<_>>()?;
                Ok((path, ahead))
            }
            (None, None, None, Some(points), Some(normal)) => {
                within("points", points.len(), [1, MOST_POINTS])?;
                let point = |(i, &point): (usize, &[f64; 3])| finite(&format!("points[{i}]"), point);
                let path = points.iter().enumerate().map(point).collect::<Built<_>>()?;
                let unit = finite("normal", *normal)?.try_normalize();
                let unit = unit.ok_or_else(|| Flaw::value("normal", format!("{normal:?}"), "a direction"))?;
                Ok((path, unit))
            }
            _ => {
                let problem = "say where it is: `view`, `distance` and `pixels`, or `points` and a `normal`";
                Err(Flaw::new("", problem))
            }
        }
    }
}

impl Box3 {
    fn build(self) -> Built<[DVec3; 2]> {
        let (low, high) = (finite("min", self.min)?, finite("max", self.max)?);
        let sides = high - low;
        if sides.min_element() <= 0.0 {
            return Err(Flaw::value("max", format!("{:?}", self.max), "above `min` on every axis"));
        }
        if sides.min_element() < 1e-3 * sides.max_element() {
            let expected = "a box of which no side is a thousandth of another or less";
            return Err(Flaw::value("max", format!("{:?}", self.max), expected));
        }
        Ok([low, high])
    }
}

fn finite(path: &str, point: [f64; 3]) -> Built<DVec3> {
    let point = DVec3::from_array(point);
    let is_sound = point.is_finite() && point.abs().max_element() <= 1e9;
    if is_sound { Ok(point) } else { Err(Flaw::value(path, format!("{point}"), "three numbers up to 1e9")) }
}

fn one() -> f64 {
    1.0
}

fn half() -> f64 {
    0.5
}
