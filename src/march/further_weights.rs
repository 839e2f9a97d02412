use super::{Real, Weight};
use crate::scene::Rgb;
use crate::{Error, Result};

/// The weights that rows of a light map have beside those of the texels along their rays: of further elements, which stand behind the
/// texels, and of texels that the surface at a ray's end reflects.
///
/// They are kept, because each takes the visibility of many directions.
///
/// Shapes  weights: [rows, further elements], reflected: [rows, at most 4 texels], one channel or three
/// Units   further elements: dimensionless; reflected texels: 1/sr
#[derive(Debug, Clone)]
pub struct FurtherWeights {
    /// The number of further elements.
    further: usize,
    /// One number a weight, or three.
    channels: usize,
    /// Of row after row and further element after further element.
    weights: Vec<f32>,
    /// Of each row what its surface shows of the light map.
    reflected: Vec<Reflected>,
}

/// What a surface shows of the texels around a point of it: at most four, none twice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflected([(u32, Rgb); 4]);

/// Not a texel.
const NONE: u32 = u32::MAX;

impl Reflected {
    /// Nothing.
    pub const NOTHING: Self = Self([(NONE, [0.0; 3]); 4]);

    /// Adds a texel; of a fifth nothing is kept.
    pub fn add(&mut self, texel: usize, weight: Rgb) {
        let texel = texel as u32;
        if let Some(place) = self.0.iter_mut().find(|(other, _)| *other == texel || *other == NONE) {
            place.0 = texel;
            (0..3).for_each(|c| place.1[c] += weight[c]);
        }
    }

    /// The weights of all texels together.
    pub fn sum(&self) -> Rgb {
        self.0.iter().fold([0.0; 3], |sum, (_, weight)| std::array::from_fn(|c| sum[c] + weight[c]))
    }

    fn is_grey(&self) -> bool {
        self.0.iter().all(|(_, weight)| *weight == [weight[0]; 3])
    }
}

impl FurtherWeights {
    /// From the weights of `further` elements in row after row, and what each row's surface shows of the texels.
    ///
    /// Errors: [`Error::Shape`] when there is not one weight a row and element.
    pub fn new(further: usize, weights: &[Rgb], reflected: Vec<Reflected>) -> Result<Self> {
        let expected = further * reflected.len();
        if weights.len() != expected {
            return Err(Error::Shape {
                what: "the weights of the further elements",
                expected,
                got: weights.len(),
            });
        }
        let is_grey = reflected.iter().all(Reflected::is_grey)
            && weights.iter().all(|weight| *weight == [weight[0]; 3]);
        let (channels, weights) = match is_grey {
            true => (1, weights.iter().map(|weight| weight[0]).collect()),
            false => (3, weights.as_flattened().to_vec()),
        };
        Ok(Self { further, channels, weights, reflected })
    }

    /// Bytes that so many rows take at most.
    pub fn bytes(rows: usize, further: usize) -> u64 {
        (rows * (further * size_of::<Rgb>() + size_of::<Reflected>())) as u64
    }

    /// The number of further elements.
    pub fn further(&self) -> usize {
        self.further
    }

    /// Whether one number serves for all channels.
    pub fn is_grey(&self) -> bool {
        self.channels == 1
    }

    /// The weight of a further element in a row.
    pub fn weight(&self, row: usize, further: usize) -> Rgb {
        let at = (row * self.further + further) * self.channels;
        std::array::from_fn(|c| self.weights[at + c.min(self.channels - 1)])
    }

    /// What the surface of a row shows of the texels.
    pub fn reflected(&self, row: usize) -> &Reflected {
        &self.reflected[row]
    }

    /// The same of some rows.
    pub fn picked(&self, rows: &[usize]) -> Self {
        let width = self.further * self.channels;
        Self {
            weights: rows
                .iter()
                .flat_map(|row| &self.weights[row * width..(row + 1) * width])
                .copied()
                .collect(),
            reflected: rows.iter().map(|&row| self.reflected[row]).collect(),
            ..*self
        }
    }

    /// Visits a row: the texels that `walk` visits with what the surface shows of them, and further elements behind so many texels.
    ///
    /// A texel on the surface is visited once, along the ray or behind it.
    pub(super) fn walk<F: Real, const C: usize>(
        &self,
        row: usize,
        texels: usize,
        walk: impl FnOnce(&mut dyn FnMut(usize, Weight<F, C>)),
        visit: &mut impl FnMut(usize, Weight<F, C>),
    ) {
        let mut left = self.reflected[row].0;
        let wide = |weight: Rgb| -> Weight<F, C> { std::array::from_fn(|c| F::of(f64::from(weight[c]))) };
        walk(&mut |element, mut weight| {
            if let Some(place) = left.iter_mut().find(|(texel, _)| *texel as usize == element) {
                let shown = wide(place.1);
                (0..C).for_each(|c| weight[c] += shown[c]);
                place.0 = NONE;
            }
            visit(element, weight);
        });
        let is_seen = |weight: &Rgb| weight.iter().any(|&value| value > 0.0);
        for (texel, weight) in left.into_iter().filter(|(texel, weight)| *texel != NONE && is_seen(weight)) {
            visit(texel as usize, wide(weight));
        }
        for further in 0..self.further {
            let weight = self.weight(row, further);
            if is_seen(&weight) {
                visit(texels + further, wide(weight));
            }
        }
    }
}
