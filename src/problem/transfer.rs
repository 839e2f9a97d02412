//! Transfer functions: scattered light has a colour for two properties of its ray (Kol et al. 2017, section 4.2).

mod axes;
mod layers;

use std::f64::consts::PI;

pub(super) use axes::seen_far;
use axes::{SeenAxes, properties};
use layers::{laid_over, layer};

use crate::march::ViewRay;
use crate::scene::{
    LayerKind, LightFrame, Rgb, Scene, Transfer, TransferAxis, TransferLayer, TransferRole, luminance, rgb,
};
use crate::visibility::{Geometry, ShadowMap};
use crate::{Error, Result};

/// The transfer functions of a scene as tables, whose shares add up to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    tables: Vec<TransferTable>,
}

/// A transfer function as a table.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferTable {
    /// Its part of all.
    pub share: f64,
    /// What its colours are.
    pub role: TransferRole,
    /// The properties along its sides.
    pub axes: [TransferAxis; 2],
    /// Texels along both axes.
    pub size: [usize; 2],
    /// Where the axis of depth ends, in metres.
    pub far: f64,
    /// How far it goes from light as it is to its colours.
    pub strength: f64,
    /// The radiance of white where colours are light.
    pub white: f64,
    /// Colours: the first axis runs fastest.
    pub texels: Vec<Rgb>,
    /// Where the points of each layer are, on both axes from 0 to 1; none of layers without points.
    pub places: Vec<Vec<[f64; 2]>>,
}

/// What looks make of the light that a ray scatters: it is multiplied, and something is added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tinted {
    /// Of the light that the medium scatters, a factor a channel.
    pub factor: [f64; 3],
    /// In units of radiance, whatever the light map.
    pub added: Rgb,
}

impl Tinted {
    /// Light as it is.
    pub const NOT: Self = Self { factor: [1.0; 3], added: [0.0; 3] };
}

impl TransferFunction {
    /// Lays the layers over each other; points that are given by what a view sees are looked up there. None where the scene has no
    /// transfer function.
    ///
    /// Errors: those of [`crate::problem::diffuse`]; [`Error::NonFinite`] where colours become too large.
    pub(super) fn of(
        scene: &Scene,
        geometry: &Geometry,
        light: (&LightFrame, &ShadowMap),
    ) -> Result<Option<Self>> {
        let functions = &scene.looks.transfer;
        let table = |(share, transfer): &(f64, Transfer)| {
            Ok(TransferTable { share: *share, ..TransferTable::new(transfer, scene, geometry, light)? })
        };
        let tables = functions.iter().map(table).collect::<Result<Vec<_>>>()?;
        Ok((!tables.is_empty()).then_some(Self { tables }))
    }

    /// One table alone.
    pub fn one(table: TransferTable) -> Self {
        Self { tables: vec![TransferTable { share: 1.0, ..table }] }
    }

    /// Its tables.
    pub fn tables(&self) -> &[TransferTable] {
        &self.tables
    }

    /// Whether it gives light that no light map changes.
    pub(super) fn adds(&self) -> bool {
        self.tables.iter().any(|table| table.role == TransferRole::Color)
    }

    /// Whether one factor serves all channels of every ray.
    pub fn is_grey(&self) -> bool {
        self.tables.iter().all(TransferTable::is_grey)
    }

    /// What becomes of the light of a ray in the frame of the light.
    pub fn of_ray(&self, ray: &ViewRay, shadow_map: &ShadowMap) -> Tinted {
        let mut tinted = Tinted { factor: [0.0; 3], added: [0.0; 3] };
        for table in &self.tables {
            let color = table.at(properties(ray, shadow_map, table.axes, table.far));
            for c in 0..3 {
                let (factor, added) = match table.role {
                    TransferRole::Factor => (1.0 + table.strength * (color[c] - 1.0), 0.0),
                    TransferRole::Color => (1.0 - table.strength, table.strength * table.white * color[c]),
                };
                tinted.factor[c] += table.share * factor;
                tinted.added[c] += (table.share * added) as f32;
            }
        }
        tinted
    }
}

/// The error for a texel that is no number.
pub(super) fn not_a_number(texel: usize, [width, _]: [usize; 2]) -> Error {
    Error::NonFinite {
        what: "the transfer function".to_owned(),
        place: format!("texel ({}, {})", texel % width, texel / width),
    }
}

impl TransferTable {
    pub(super) fn new(
        transfer: &Transfer,
        scene: &Scene,
        geometry: &Geometry,
        (frame, shadow_map): (&LightFrame, &ShadowMap),
    ) -> Result<Self> {
        let Transfer { role, axes, size, far, layers, strength } = transfer;
        let far = far.unwrap_or_else(|| seen_far([scene], geometry));
        let seen = SeenAxes { scene, geometry, frame, shadow_map, axes: *axes, far };
        let mut texels = vec![[1.0; 3]; size[0] * size[1]];
        for TransferLayer { shows, blend, opacity } in layers {
            let shown = layer(shows, *size, &|point| seen.of(point.place))?;
            texels.iter_mut().zip(shown).for_each(|(below, [r, g, b, alpha])| {
                *below = laid_over(*below, [r, g, b], alpha * *opacity as f32, *blend);
            });
        }
        if let Some(index) = texels.iter().flatten().position(|value| !value.is_finite()) {
            return Err(not_a_number(index / 3, *size));
        }
        let places = layers.iter().map(|layer| match &layer.shows {
            LayerKind::Diffusion(points) => points.iter().map(|point| seen.of(point.place)).collect(),
            _ => Vec::new(),
        });
        let scattered = rgb(|c| scene.medium.albedo[c] as f32 * scene.light.radiance[c]);
        let white = f64::from(luminance(scattered)) / (4.0 * PI);
        Ok(Self {
            share: 1.0,
            role: *role,
            axes: *axes,
            size: *size,
            far,
            strength: *strength,
            white,
            texels,
            places: places.collect(),
        })
    }

    fn is_grey(&self) -> bool {
        let is_grey = |color: &Rgb| color[0] == color[1] && color[1] == color[2];
        self.role == TransferRole::Color || self.texels.iter().all(is_grey)
    }

    /// The four texels around two properties, and their weights: bilinear between the middles of texels.
    pub fn corners(&self, at: [f64; 2]) -> [(usize, f64); 4] {
        let [(left, right, u), (top, bottom, v)] = [0, 1].map(|axis| {
            let last = self.size[axis] - 1;
            let place = (at[axis] * self.size[axis] as f64 - 0.5).clamp(0.0, last as f64);
            let first = place as usize;
            (first, (first + 1).min(last), place - first as f64)
        });
        let texel = |i: usize, j: usize| j * self.size[0] + i;
        [
            (texel(left, top), (1.0 - u) * (1.0 - v)),
            (texel(right, top), u * (1.0 - v)),
            (texel(left, bottom), (1.0 - u) * v),
            (texel(right, bottom), u * v),
        ]
    }

    /// Those around the properties of a ray in the frame of the light.
    pub fn corners_of(&self, ray: &ViewRay, shadow_map: &ShadowMap) -> [(usize, f64); 4] {
        self.corners(properties(ray, shadow_map, self.axes, self.far))
    }

    /// The colour for two properties, both from 0 to 1.
    pub fn at(&self, at: [f64; 2]) -> [f64; 3] {
        let corners = self.corners(at);
        [0, 1, 2]
            .map(|c| corners.iter().map(|&(texel, weight)| weight * f64::from(self.texels[texel][c])).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_bilinear_between_the_middles_of_texels() {
        let table = TransferTable {
            share: 1.0,
            role: TransferRole::Factor,
            axes: [TransferAxis::Visibility, TransferAxis::Depth],
            size: [2, 2],
            far: 1.0,
            strength: 1.0,
            white: 1.0,
            texels: vec![[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]],
            places: Vec::new(),
        };
        for (axes, expected) in
            [([0.0, 0.0], 0.0), ([0.25, 0.25], 0.0), ([0.5, 0.25], 0.5), ([0.5, 0.5], 1.5), ([1.0, 1.0], 3.0)]
        {
            assert_eq!(table.at(axes), [expected; 3]);
        }
    }
}
