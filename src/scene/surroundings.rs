use std::sync::Arc;

use super::{LightBasis, Rgb};

/// Light beside that of the light map which is looked for together with it.
///
/// It makes further elements behind the texels: the sun, where that is looked for, then the lights of the sky.
#[derive(Debug, Clone, PartialEq)]
pub struct Surroundings {
    /// Whether the sun's radiance outside its light map is looked for; else the sun keeps its own.
    pub sun: bool,
    /// The lights from everywhere else, where they are looked for.
    pub sky: Option<Sky>,
}

/// Lights from everywhere, infinitely far away.
#[derive(Debug, Clone, PartialEq)]
pub struct Sky {
    /// What they are.
    pub basis: Arc<LightBasis>,
    /// Their radiance to start from.
    pub start: Vec<Rgb>,
    /// Texels a side of the shadow map of each of their directions.
    pub shadow_map: usize,
}

impl Surroundings {
    /// The number of further elements.
    pub fn len(&self) -> usize {
        usize::from(self.sun) + self.sky.as_ref().map_or(0, |sky| sky.start.len())
    }

    /// Whether nothing is looked for.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What the further elements start from, given the sun's radiance.
    pub fn start(&self, sun: Rgb) -> Vec<Rgb> {
        let sky = self.sky.as_ref().map_or(&[][..], |sky| &sky.start);
        self.sun.then_some(sun).into_iter().chain(sky.iter().copied()).collect()
    }

    /// The sun among the further elements, where it is looked for.
    pub fn sun_of(&self, further: &[Rgb]) -> Option<Rgb> {
        further.first().copied().filter(|_| self.sun)
    }

    /// The lights of the sky among the further elements.
    pub fn sky_of<'a>(&self, further: &'a [Rgb]) -> &'a [Rgb] {
        further.get(usize::from(self.sun)..).unwrap_or_default()
    }
}

impl Sky {
    /// Bytes of the shadow maps of all directions: 8 a texel for its range, a third of that for the pyramid.
    pub fn shadow_bytes(&self) -> u64 {
        let directions = self.basis.len() as u64 * self.basis.samples() as u64;
        directions.saturating_mul((self.shadow_map as u64).pow(2)).saturating_mul(11)
    }
}
