use std::iter;
use std::ops::Range;

use super::Scalars;
use crate::{Error, Result};

/// l ≤ x ≤ u, one pair of bounds a channel; infinite where there is none. Ranges of elements may have bounds of their own.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounds {
    /// l and u from the first element on.
    first: [Scalars; 2],
    /// Elements from which on other l and u hold, with those; the elements rise, and none is 0.
    others: Vec<(usize, [Scalars; 2])>,
}

impl Bounds {
    /// No bound at all.
    pub const NONE: Self = Self { first: [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]], others: Vec::new() };

    /// 0 ≤ x.
    pub const NOT_NEGATIVE: Self = Self { first: [[0.0; 3], [f64::INFINITY; 3]], others: Vec::new() };

    /// The same for all elements.
    ///
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
        Ok(Self { first: [lower, upper], others: Vec::new() })
    }

    /// These for the elements before `index`, and `others` from there on, whose elements are counted from `index`.
    ///
    /// Parts that began at `index` or behind it are gone, so calls usually come with indices that rise.
    pub fn then(mut self, index: usize, others: Self) -> Self {
        if index == 0 {
            return others;
        }
        self.others.truncate(self.others.partition_point(|(begin, _)| *begin < index));
        self.others.push((index, others.first));
        self.others.extend(others.others.into_iter().map(|(begin, bounds)| (index + begin, bounds)));
        self
    }

    /// l and u of an element. Who goes through many walks the [`parts`](Self::parts) instead.
    pub fn of(&self, element: usize) -> &[Scalars; 2] {
        match self.begun(element) {
            0 => &self.first,
            count => &self.others[count - 1].1,
        }
    }

    /// The first `len` elements as ranges that share l and u, in their order; none is empty.
    pub fn parts(&self, len: usize) -> impl Iterator<Item = (Range<usize>, [Scalars; 2])> {
        self.parts_of(0..len)
    }

    /// The same of the elements in a range.
    pub(crate) fn parts_of(&self, range: Range<usize>) -> impl Iterator<Item = (Range<usize>, [Scalars; 2])> {
        let begun = self.begun(range.start);
        let changes = self.others[begun..].iter().copied().take_while(move |(begin, _)| *begin < range.end);
        let ends = changes.clone().map(|(begin, _)| begin).chain([range.end]);
        let begins = iter::once((range.start, *self.of(range.start))).chain(changes);
        let parts = begins.zip(ends).map(|((begin, bounds), end)| (begin..end, bounds));
        parts.filter(|(part, _)| !part.is_empty())
    }

    /// How many of the other parts begin at or before an element.
    fn begun(&self, element: usize) -> usize {
        self.others.partition_point(|(begin, _)| *begin <= element)
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

    /// Four parts, of which the last begins behind the elements that are asked for.
    fn four() -> Bounds {
        let bounds = |upper: f64| Bounds::new([-1.0; 3], [upper; 3]).unwrap();
        bounds(1.0).then(3, bounds(2.0)).then(4, bounds(3.0)).then(9, bounds(4.0))
    }

    fn uppers(bounds: &Bounds, len: usize) -> Vec<f64> {
        (0..len).map(|element| bounds.of(element)[1][0]).collect()
    }

    #[test]
    fn parts_are_the_bounds_of_their_elements() {
        let bounds = four();
        assert_eq!(uppers(&bounds, 10), [1.0, 1.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0, 3.0, 4.0]);
        for range in (0..12).flat_map(|begin| (begin..12).map(move |end| begin..end)) {
            let mut next = range.start;
            for (part, found) in bounds.parts_of(range.clone()) {
                assert!(part.start == next && !part.is_empty(), "{range:?}: {part:?}");
                assert!(part.clone().all(|element| *bounds.of(element) == found), "{range:?}: {part:?}");
                next = part.end;
            }
            assert_eq!(next, range.end);
        }
        assert_eq!(bounds.parts(9).count(), 3);
        assert_eq!(bounds.parts(0).count(), 0);
    }

    #[test]
    fn what_is_said_last_holds_from_its_index_on() {
        let before = uppers(&four(), 12);
        for index in 0..12 {
            let both = uppers(&four().then(index, four()), 12);
            assert_eq!(both[..index], before[..index]);
            assert_eq!(both[index..], before[..12 - index]);
        }
    }
}
