use std::borrow::Cow;

use crate::operator::{Bounds, NOWHERE, Scalars};
use crate::scene::{Rgb, SolveSettings};
use crate::{Error, Result};

/// A least-squares problem in pictures, whatever is looked for: `min ½ Σ w (T x − b)² + regularizers, l ≤ x ≤ u`.
#[derive(Debug, Clone)]
pub struct Formulation<'a> {
    /// b of each row.
    pub targets: &'a [Rgb],
    /// w of each row.
    pub weights: Cow<'a, [Rgb]>,
    /// Σ w L², L what the rows should show, all told: what noise is relative to.
    pub wanted: Scalars,
    /// x₀, which the regularizers pull to and elements keep that no row reaches.
    pub start: Start<'a>,
    /// Where the elements lie.
    pub lattice: Lattice<'a>,
    /// l and u of the elements.
    pub bounds: Bounds,
    /// What the pull towards the start is multiplied by; none where by nothing.
    pub steering: Option<Steering>,
    /// What a person can do when the rows are too dark to be computed with.
    pub remedy: &'static str,
}

/// What the pull towards the start is multiplied by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steering {
    /// For the elements before `then_from`.
    pub first: f64,
    /// Where the others begin.
    pub then_from: usize,
    /// For the others.
    pub then: f64,
}

/// x₀.
#[derive(Debug, Clone, Copy)]
pub enum Start<'a> {
    /// The same for so many elements.
    Everywhere(Rgb, usize),
    /// The same for so many, then one for each of the others.
    Then(Rgb, usize, &'a [Rgb]),
    /// One an element.
    Each(&'a [Rgb]),
}

impl Start<'_> {
    /// The number of elements.
    pub fn len(&self) -> usize {
        match self {
            Self::Everywhere(_, len) => *len,
            Self::Then(_, first, others) => first + others.len(),
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
            Self::Then(start, first, others) => match element.checked_sub(*first) {
                None => *start,
                Some(other) => others[other],
            },
            Self::Each(start) => start[element],
        }
    }

    /// x₀ of all elements.
    pub fn to_vec(&self) -> Vec<Rgb> {
        (0..self.len()).map(|element| self.of(element)).collect()
    }
}

/// Where elements lie side by side.
#[derive(Debug, Clone, Copy)]
pub struct Lattice<'a> {
    /// Places along each axis, the first running fastest; two quantities are two such lattices, one behind the other.
    pub size: &'a [usize],
    /// The place of each element; none where they are the places in order, and then elements behind the last one have no place.
    pub places: Option<&'a [u32]>,
}

impl Lattice<'_> {
    /// The place of an element; [`NOWHERE`] where it has none, and no neighbours.
    pub fn place(&self, element: u32) -> u32 {
        match self.places {
            Some(places) => places[element as usize],
            None if (element as usize) < self.len() => element,
            None => NOWHERE,
        }
    }

    /// The elements of a problem that have a place, before those that have none.
    pub fn placed(&self, elements: usize) -> usize {
        if self.places.is_some() { elements } else { elements.min(self.len()) }
    }

    fn len(&self) -> usize {
        self.size.iter().product()
    }
}

impl Formulation<'_> {
    /// The bounds that settings ask for, for a solver that keeps any.
    ///
    /// Errors: [`Error::Value`] naming `lower` or `upper`.
    pub fn bounds_of(settings: &SolveSettings) -> Result<Bounds> {
        let [lower, upper] = settings.bounds;
        if settings.solver.keeps_bounds() { Bounds::new(lower, upper) } else { Ok(Bounds::NONE) }
    }

    /// Errors: [`Error::Shape`] when its parts do not belong together.
    pub(super) fn check(&self) -> Result<()> {
        let same = |what, expected: usize, got: usize| {
            if expected == got { Ok(()) } else { Err(Error::Shape { what, expected, got }) }
        };
        same("the weights", self.targets.len(), self.weights.len())?;
        match self.lattice.places {
            Some(places) => same("the places of the elements", self.start.len(), places.len()),
            None => Ok(()),
        }
    }
}
