//! Heterogeneous air in pictures and rows: a factor of what each ray scatters of the sun.

use glam::DVec3;
use rayon::prelude::*;

use super::sight::Sight;
use super::transfer::seen_far;
use super::upsampling::Coarse;
use crate::Result;
use crate::march::HeterogeneityField;
use crate::scene::{AirStroke, BlendVolume, Camera, Heterogeneity, Ray, Scene};
use crate::visibility::Geometry;

/// Heterogeneous air around the views of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct HeterogeneousAir {
    /// With shares that add up to 1 at most; the rest is even air.
    fields: Vec<(f64, HeterogeneityField)>,
    /// Where rays without a surface end, in metres.
    far: f64,
    /// Pixels from one ray to the next.
    upsample: usize,
}

impl HeterogeneousAir {
    /// None where the air of a scene is even. `views` is what its views see.
    ///
    /// Errors: those of [`HeterogeneityField::new`].
    pub(super) fn of(scene: &Scene, geometry: &Geometry, views: &Sight) -> Result<Option<Self>> {
        let parts = &scene.looks.heterogeneity;
        if parts.is_empty() {
            return Ok(None);
        }
        let far = seen_far([scene], geometry);
        let fitted = FittedAir::over([views], far);
        let field = |(share, air): &(f64, Heterogeneity)| {
            let (bounds, size) = fitted.of(air);
            let field = HeterogeneityField::new(air, bounds, size);
            Ok((*share, field.map_err(|error| error.inside("looks.heterogeneity"))?))
        };
        let fields = parts.iter().map(field).collect::<Result<Vec<_>>>()?;
        let upsample = parts.iter().map(|(_, air)| air.upsample).min().unwrap_or(1);
        Ok(Some(Self { fields, far, upsample }))
    }

    /// The factor of a ray of so many metres; infinitely many where there is no surface.
    pub fn factor(&self, ray: &Ray, length: f64) -> f64 {
        let end = self.end(length);
        let uneven: f64 = self.fields.iter().map(|(share, field)| share * field.mean(ray, end)).sum();
        let even = 1.0 - self.fields.iter().map(|(share, _)| share).sum::<f64>();
        uneven + even.max(0.0)
    }

    fn end(&self, length: f64) -> f64 {
        if length.is_finite() { length } else { self.far }
    }

    /// Its parts with their shares.
    pub fn fields(&self) -> &[(f64, HeterogeneityField)] {
        &self.fields
    }

    /// The factors of some rays of a picture, whose depths are between those of the others.
    ///
    /// Cost    one mean for every `upsample` × `upsample` pixels, and one for each pixel that none of the four around it is like
    pub(super) fn over_picture<'a>(&'a self, camera: &'a Camera, geometry: &Geometry) -> PictureAir<'a> {
        let coarse = (self.upsample > 1).then(|| {
            let [width, height] = camera.size().map(|side| side.div_ceil(self.upsample) + 1);
            let sample = |index: usize| {
                let [x, y] = [index % width, index / width].map(|at| (at * self.upsample) as f64);
                let [right, bottom] = camera.size().map(|side| side as f64);
                let ray = camera.ray(x.min(right), y.min(bottom));
                let length =
                    geometry.first_hit(&ray, f64::INFINITY).map_or(f64::INFINITY, |hit| hit.distance);
                (self.end(length), [self.factor(&ray, length)])
            };
            Coarse::new(width, (0..width * height).into_par_iter().map(sample).collect())
        });
        PictureAir { air: self, camera, coarse }
    }

    /// Bytes of its volumes.
    pub fn bytes(&self) -> usize {
        self.fields.iter().map(|(_, field)| field.bytes()).sum()
    }
}

/// Heterogeneous air along the rays of one picture.
pub(super) struct PictureAir<'a> {
    air: &'a HeterogeneousAir,
    camera: &'a Camera,
    coarse: Option<Coarse<1>>,
}

impl PictureAir<'_> {
    /// The factor of a pixel whose ray has so many metres.
    pub(super) fn factor(&self, pixel: usize, ray: &Ray, length: f64) -> f64 {
        let found = self.coarse.as_ref().and_then(|coarse| {
            let width = self.camera.size()[0];
            let at = [pixel % width, pixel / width].map(|at| (at as f64 + 0.5) / self.air.upsample as f64);
            coarse.between(at, self.air.end(length)).map(|[factor]| factor)
        });
        found.unwrap_or_else(|| self.air.factor(ray, length))
    }
}

/// Where blend volumes and noise lie when a scene does not say so.
#[derive(Debug, Clone, Copy)]
pub(super) struct FittedAir {
    bounds: [DVec3; 2],
    size: f64,
}

impl FittedAir {
    /// Over what views see, up to `far` metres: the noise has half the longest side, rounded to 1, 2 or 5 times a power of ten, and
    /// the box goes out to tenths of that, so that smaller pictures of the same views have the same air.
    pub(super) fn over<'s>(views: impl IntoIterator<Item = &'s Sight>, far: f64) -> Self {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &[from, to] in views.into_iter().flat_map(Sight::stretches) {
            let end = from + (to - from).clamp_length_max(far);
            (low, high) = (low.min(from).min(end), high.max(from).max(end));
        }
        let half = (0.5 * (high - low).max_element()).max(f64::MIN_POSITIVE);
        let power = 10f64.powf(half.log10().floor());
        let size = power * [5.0, 2.0].into_iter().find(|times| times * power <= half).unwrap_or(1.0);
        let step = 0.1 * size;
        Self { bounds: [(low / step).floor() * step, (high / step + 1e-9).ceil() * step], size }
    }

    /// Those of some air: what it says of them, and the rest fitted.
    pub(super) fn of(&self, air: &Heterogeneity) -> ([DVec3; 2], f64) {
        (air.bounds.unwrap_or(self.bounds), air.noise.size.unwrap_or(self.size))
    }
}

/// What of heterogeneous air no view sees.
#[derive(Debug, Clone, PartialEq)]
pub enum UnseenAir {
    /// No ray meets the box of the blend volumes.
    Box,
    /// No ray passes a stroke: of which blend volume, and which one.
    Stroke(&'static str, usize),
}

/// What of the air of a scene no view sees, as far as every eighth pixel of each view tells.
pub fn unseen_air(scene: &Scene, geometry: &Geometry) -> Vec<UnseenAir> {
    let Some((_, air)) = scene.looks.heterogeneity.first() else { return Vec::new() };
    let sight = Sight::of_views(scene, geometry);
    let passes = |bounds: [DVec3; 2], reach: &dyn Fn(DVec3) -> bool| {
        sight.stretches().iter().any(|&[from, to]| {
            let Some([enter, leave]) = across(bounds, from, to) else { return false };
            (0..=32).any(|k| reach(from.lerp(to, enter + (leave - enter) * f64::from(k) / 32.0)))
        })
    };
    if air.bounds.is_some_and(|bounds| !passes(bounds, &|_| true)) {
        return vec![UnseenAir::Box];
    }
    let unseen = |(name, blend): (&'static str, &BlendVolume)| -> Vec<UnseenAir> {
        let strokes = blend.strokes.iter().enumerate();
        let is_unseen =
            |stroke: &AirStroke| !passes(stroke.bounds(), &|point| stroke.opacity_at(point) > 0.0);
        let unseen = strokes.filter(|(_, stroke)| is_unseen(stroke));
        unseen.map(|(number, _)| UnseenAir::Stroke(name, number)).collect()
    };
    let blends = &air.blends;
    let blends =
        [("amount", &blends.amount), ("frequency", &blends.frequency), ("intensity", &blends.intensity)];
    blends.into_iter().flat_map(unseen).collect()
}

/// The part of a stretch that is in a box, as shares of its length.
fn across([low, high]: [DVec3; 2], from: DVec3, to: DVec3) -> Option<[f64; 2]> {
    let mut inside = [0.0f64, 1.0];
    for axis in 0..3 {
        let (origin, slope) = (from[axis], to[axis] - from[axis]);
        if slope == 0.0 {
            if origin < low[axis] || origin > high[axis] {
                return None;
            }
            continue;
        }
        let [a, b] = [(low[axis] - origin) / slope, (high[axis] - origin) / slope];
        inside = [inside[0].max(a.min(b)), inside[1].min(a.max(b))];
    }
    (inside[0] <= inside[1]).then_some(inside)
}
