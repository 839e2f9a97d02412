use std::borrow::Cow;
use std::ops::Range;

use super::HeldOut;
use crate::operator::{Bounds, Lattices, NOWHERE, Scalars};
use crate::scene::Rgb;
use crate::{Error, Result};

/// A least-squares problem in pictures, whatever is looked for: `min ½ Σ w (T x − b)² + regularizers, l ≤ x ≤ u`.
#[derive(Debug, Clone)]
pub struct Formulation<'a> {
    /// b of each row: radiance, for extinction optical depth.
    pub targets: Cow<'a, [Rgb]>,
    /// w of each row and channel, dimensionless.
    pub weights: Cow<'a, [Rgb]>,
    /// Σ w L² over the rows, a number a channel, with L all that a row should show: what noise is relative to.
    pub wanted: Scalars,
    /// The elements: one part a kind, one behind the other.
    pub parts: Vec<Part<'a>>,
    /// Rows of the same T that are kept out of the fit, and end the solve where it follows noise; none where nobody asks.
    pub held_out: Option<&'a HeldOut>,
    /// What a person can do when the rows are too dark to be computed with.
    pub remedy: &'static str,
}

/// Elements of one kind, side by side among all elements.
#[derive(Debug, Clone, Copy)]
pub struct Part<'a> {
    /// What the elements are, in the plural, such as `texels`.
    pub noun: &'static str,
    /// x₀: the regularizers pull to it, and elements that no row reaches keep it.
    pub start: Start<'a>,
    /// l and u of each channel, in the unit of the elements; infinite where there is no bound.
    pub bounds: [Scalars; 2],
    /// Factor of the pull towards the start, dimensionless; 1 leaves it as the settings say.
    pub pull: f64,
    /// Which elements lie beside which; none for elements without neighbours.
    pub lattice: Option<Lattice<'a>>,
    /// Elements that lie side by side where that is not what the lattice says, by their numbers within the part; empty where it is.
    pub pairs: &'a [[u32; 2]],
    /// Elements that the gradient joins to those that a row reaches, by their numbers within the part, in increasing order; a pull to their
    /// start lets what was found fade in them. On a plane lattice only of the first part, with one start for all.
    pub joined: &'a [u32],
    /// λ of that pull where it is not reached, relative to that of the gradient: 1 / ℓ², ℓ the length in elements over which it fades.
    pub fade: f64,
    /// Number of the group of parts whose λ is relative to one mean column norm. Columns of another group may be far longer.
    pub scale: usize,
}

/// x₀.
#[derive(Debug, Clone, Copy)]
pub enum Start<'a> {
    /// The same for so many elements.
    Everywhere(Rgb, usize),
    /// One an element.
    Each(&'a [Rgb]),
}

impl Start<'_> {
    /// The number of elements.
    pub fn len(&self) -> usize {
        match self {
            Self::Everywhere(_, len) => *len,
            Self::Each(start) => start.len(),
        }
    }

    /// Whether there is no element.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// x₀ of an element.
    pub fn of(&self, element: usize) -> Rgb {
        match self {
            Self::Everywhere(start, _) => *start,
            Self::Each(start) => start[element],
        }
    }
}

/// Where elements lie side by side.
#[derive(Debug, Clone, Copy)]
pub struct Lattice<'a> {
    /// Places along each axis, the first running fastest.
    pub size: &'a [usize],
    /// The place of each element; none where they are the places in order.
    pub places: Option<&'a [u32]>,
}

impl<'a> Formulation<'a> {
    /// The same problem with some of its rows, in this order.
    pub fn picked(self, rows: &[usize]) -> Self {
        let of = |values: &[Rgb]| Cow::Owned(rows.iter().map(|&row| values[row]).collect());
        Self { targets: of(&self.targets), weights: of(&self.weights), ..self }
    }

    /// The number of elements.
    pub fn elements(&self) -> usize {
        self.parts.iter().map(|part| part.start.len()).sum()
    }

    /// The parts, each with its elements.
    pub fn ranges(&self) -> impl Iterator<Item = (Range<usize>, &Part<'a>)> {
        self.parts.iter().scan(0, |first, part| {
            let begin = *first;
            *first += part.start.len();
            Some((begin..*first, part))
        })
    }

    /// x₀ of all elements.
    pub fn starts(&self) -> Vec<Rgb> {
        self.parts
            .iter()
            .flat_map(|part| (0..part.start.len()).map(|element| part.start.of(element)))
            .collect()
    }

    /// l and u of all elements.
    ///
    /// Errors: [`Error::Value`] naming `lower` or `upper`.
    pub fn bounds(&self) -> Result<Bounds> {
        let (mut bounds, mut last) = (Bounds::NONE, None);
        for (elements, part) in self.ranges() {
            if last != Some(part.bounds) {
                let [lower, upper] = part.bounds;
                bounds = bounds.then(elements.start, Bounds::new(lower, upper)?);
                last = Some(part.bounds);
            }
        }
        Ok(bounds)
    }

    /// The lattices of the parts, one behind the other.
    pub fn lattices(&self) -> Lattices {
        Lattices::new(self.parts.iter().filter_map(|part| part.lattice).map(|lattice| lattice.size.to_vec()))
    }

    /// The places of some elements, in increasing order, in those lattices; [`NOWHERE`] for elements without a place, and without neighbours.
    pub fn places(&self, elements: &[u32]) -> Vec<u32> {
        let (mut places, mut first) = (vec![NOWHERE; elements.len()], 0);
        for (range, part) in self.ranges() {
            let Some(lattice) = part.lattice else { continue };
            let before = |end: usize| elements.partition_point(|&element| (element as usize) < end);
            for index in before(range.start)..before(range.end) {
                let within = elements[index] as usize - range.start;
                places[index] = first + lattice.places.map_or(within as u32, |places| places[within]);
            }
            first += lattice.size.iter().product::<usize>() as u32;
        }
        places
    }

    /// Errors: [`Error::Shape`] when its parts do not belong together.
    pub(super) fn check(&self) -> Result<()> {
        let same = |what, expected: usize, got: usize| {
            if expected == got { Ok(()) } else { Err(Error::Shape { what, expected, got }) }
        };
        same("the weights", self.targets.len(), self.weights.len())?;
        self.parts.iter().try_for_each(|part| match part.lattice.and_then(|lattice| lattice.places) {
            Some(places) => same("the places of the elements", part.start.len(), places.len()),
            None => Ok(()),
        })
    }
}
