//! Volumes that are made and not read.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::io::scene_file::flaw::{At, Built, Flaw, checked, within};
use crate::scene::{self, Blob, Procedural};

/// A volume made of shapes with soft rims, in world space, and noise on them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Shapes {
    /// The shapes; at least one.
    #[schemars(length(min = 1))]
    pub shapes: Vec<Shape>,
    /// Value inside the shapes.
    pub inside: f64,
    /// Value outside; 0 when not given.
    #[serde(default)]
    pub outside: f64,
    /// Over how many metres the one becomes the other; above 0.
    pub edge: f64,
    /// Noise, as of smoke.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<Noise>,
}

/// A shape.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// A ball.
    Sphere(Sphere),
    /// A cylinder with round ends, or a finger.
    Capsule(Capsule),
}

/// A ball.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    /// Its middle, in metres.
    pub center: [f64; 3],
    /// Its radius, in metres.
    pub radius: f64,
}

/// All points near a segment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Capsule {
    /// Where it begins, in metres.
    pub from: [f64; 3],
    /// Where it ends, in metres.
    pub to: [f64; 3],
    /// Its radius at both ends, in metres.
    pub radii: [f64; 2],
}

/// Octaves of gradient noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Noise {
    /// Size of the largest waves, in metres.
    pub scale: f64,
    /// How many octaves, from 1 to 12; each has waves half as long.
    pub octaves: u32,
    /// What each octave weighs of the one before, from 0 to 1.
    pub gain: f64,
    /// How far the rims are moved, in metres.
    pub depth: f64,
    /// What is taken from the value inside at most, from 0 to 1.
    pub mottle: f64,
    /// Other numbers give other noise.
    pub seed: u32,
}

impl Default for Noise {
    fn default() -> Self {
        Self { scale: 0.5, octaves: 4, gain: 0.5, depth: 0.1, mottle: 0.5, seed: 0 }
    }
}

impl Shapes {
    pub(super) fn build(&self) -> Built<Procedural> {
        if self.shapes.is_empty() {
            return Err(Flaw::new("shapes", "there is no shape; add a `sphere` or a `capsule`"));
        }
        let shapes = self.shapes.iter().enumerate();
        let blobs = shapes.map(|(i, shape)| shape.build().at(&format!("shapes[{i}]")));
        Ok(Procedural {
            blobs: blobs.collect::<Built<_>>()?,
            inside: checked("inside", self.inside, "finite", |_| true)?,
            outside: checked("outside", self.outside, "finite", |_| true)?,
            edge: checked("edge", self.edge, "above 0 metres", |edge| edge > 0.0)?,
            noise: self.noise.as_ref().map(Noise::build).transpose().at("noise")?,
        })
    }
}

impl Shapes {
    /// The shapes a `share` of the way to others of the same kinds.
    pub(super) fn towards(&self, other: &Self, share: f64) -> Built<Self> {
        if self.shapes.len() != other.shapes.len() {
            let (here, before) = (other.shapes.len(), self.shapes.len());
            let problem =
                format!("there are {here} shapes and at the key before {before}; each needs its partner");
            return Err(Flaw::new("shapes", problem));
        }
        let pairs = self.shapes.iter().zip(&other.shapes).enumerate();
        let shapes = pairs.map(|(i, (from, to))| from.towards(to, share).at(&format!("shapes[{i}]")));
        Ok(Self {
            shapes: shapes.collect::<Built<_>>()?,
            inside: mixed(self.inside, other.inside, share),
            outside: mixed(self.outside, other.outside, share),
            edge: mixed(self.edge, other.edge, share),
            noise: match (&self.noise, &other.noise) {
                (None, None) => None,
                (Some(from), Some(to)) => Some(from.towards(to, share).at("noise")?),
                _ => return Err(Flaw::new("noise", "give `noise` at every key or at none")),
            },
        })
    }
}

impl Noise {
    fn towards(&self, other: &Self, share: f64) -> Built<Self> {
        if (self.octaves, self.seed) != (other.octaves, other.seed) {
            return Err(Flaw::new("", "`octaves` and `seed` must be those of the key before"));
        }
        Ok(Self {
            scale: mixed(self.scale, other.scale, share),
            gain: mixed(self.gain, other.gain, share),
            depth: mixed(self.depth, other.depth, share),
            mottle: mixed(self.mottle, other.mottle, share),
            ..self.clone()
        })
    }
}

impl Shape {
    fn towards(&self, other: &Self, share: f64) -> Built<Self> {
        let point = |from: [f64; 3], to: [f64; 3]| std::array::from_fn(|i| mixed(from[i], to[i], share));
        match (self, other) {
            (Self::Sphere(from), Self::Sphere(to)) => Ok(Self::Sphere(Sphere {
                center: point(from.center, to.center),
                radius: mixed(from.radius, to.radius, share),
            })),
            (Self::Capsule(from), Self::Capsule(to)) => Ok(Self::Capsule(Capsule {
                from: point(from.from, to.from),
                to: point(from.to, to.to),
                radii: std::array::from_fn(|end| mixed(from.radii[end], to.radii[end], share)),
            })),
            _ => Err(Flaw::new("", "it must be of the kind of its partner at the key before")),
        }
    }

    fn build(&self) -> Built<Blob> {
        let point = |path: &str, p: [f64; 3]| -> Built<DVec3> {
            p.iter().try_for_each(|&x| checked(path, x, "finite", |_| true).map(drop))?;
            Ok(DVec3::from_array(p))
        };
        let radius = |path: &str, r: f64| checked(path, r, "above 0 metres", |r| r > 0.0);
        match self {
            Self::Sphere(sphere) => {
                let center = point("center", sphere.center).at("sphere")?;
                Ok(Blob::Sphere { center, radius: radius("radius", sphere.radius).at("sphere")? })
            }
            Self::Capsule(capsule) => {
                let from = point("from", capsule.from).at("capsule")?;
                let to = point("to", capsule.to).at("capsule")?;
                for r in capsule.radii {
                    radius("radii", r).at("capsule")?;
                }
                Ok(Blob::Capsule { from, to, radii: capsule.radii })
            }
        }
    }
}

impl Noise {
    fn build(&self) -> Built<scene::Noise> {
        let part = |path: &str, value: f64| checked(path, value, "from 0 to 1", |v| (0.0..=1.0).contains(&v));
        Ok(scene::Noise {
            scale: checked("scale", self.scale, "above 0 metres", |scale| scale > 0.0)?,
            octaves: within("octaves", self.octaves, [1, 12])?,
            gain: part("gain", self.gain)?,
            depth: checked("depth", self.depth, "not negative", |depth| depth >= 0.0)?,
            mottle: part("mottle", self.mottle)?,
            seed: self.seed,
        })
    }
}

/// A number a `share` of the way from one to another.
pub(super) fn mixed(from: f64, to: f64, share: f64) -> f64 {
    (1.0 - share) * from + share * to
}
