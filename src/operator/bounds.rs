use std::ops::Range;

use super::Scalars;
use crate::{Error, Result};

/// l ≤ x ≤ u, one pair of bounds a channel; infinite where there is none. Elements from some index on may have others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    first: [Scalars; 2],
    /// Where the elements with bounds of their own begin, and these.
    then: Option<(usize, [Scalars; 2])>,
}

impl Bounds {
    /// No bound at all.
    pub const NONE: Self = Self { first: [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]], then: None };

    /// 0 ≤ x.
    pub const NOT_NEGATIVE: Self = Self { first: [[0.0; 3], [f64::INFINITY; 3]], then: None };

    /// Errors: [`Error::Value`] naming `lower` or `upper` for a NaN, for l > u, and for bounds that no finite number
    /// meets.
    pub fn new(lower: Scalars, upper: Scalars) -> Result<Self> {
        for c in 0..3 {
            if lower[c].is_nan() || lower[c] == f64::INFINITY {
                return Err(Error::value("lower", lower[c], "a number, or none for no bound"));
            }
            // Not `lower > upper`: a NaN must not pass.
            if !(lower[c] <= upper[c] && upper[c] > f64::NEG_INFINITY) {
                return Err(Error::value("upper", upper[c], "a number that is not below `lower`"));
            }
        }
        Ok(Self { first: [lower, upper], then: None })
    }

    /// The same for the elements before `index`, and `others` from there on.
    pub fn then(self, index: usize, others: Self) -> Self {
        Self { then: Some((index, others.first)), ..self }
    }

    /// l and u of an element.
    #[inline(always)]
    pub fn of(&self, element: usize) -> &[Scalars; 2] {
        match &self.then {
            Some((index, others)) if element >= *index => others,
            _ => &self.first,
        }
    }

    /// Where bounds change among `len` elements: ranges that share theirs, with l and u.
    pub fn parts(&self, len: usize) -> [(Range<usize>, [Scalars; 2]); 2] {
        let (index, others) = self.then.unwrap_or((len, self.first));
        let index = index.min(len);
        [(0..index, self.first), (index..len, others)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_that_no_number_meets_are_refused_by_name() {
        let infinity = f64::INFINITY;
        for (lower, upper, name) in [
            (1.0, 0.5, "upper"),
            (0.0, f64::NAN, "upper"),
            (f64::NAN, 1.0, "lower"),
            (infinity, infinity, "lower"),
            (-infinity, -infinity, "upper"),
        ] {
            let refused = Bounds::new([0.0, lower, 0.0], [1.0, upper, 1.0]);
            assert!(matches!(refused, Err(Error::Value { path, .. }) if path == name), "{lower} {upper}");
        }
        assert_eq!(Bounds::new([-infinity; 3], [infinity; 3]).ok(), Some(Bounds::NONE));
        assert!(Bounds::new([2.0; 3], [2.0; 3]).is_ok());
    }
}
