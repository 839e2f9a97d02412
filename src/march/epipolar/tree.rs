//! Sums of what is before a place, in a tree of partial sums.

use super::super::Real;

/// A tree of partial sums (Fenwick 1994) over places, of M colours each.
///
/// Both pairs of operations take O(log n), and are transposes of each other: `add` and `before`, `add_before` and `behind`.
pub(super) struct Sums<'a, X, const M: usize> {
    nodes: &'a mut [[[X; 4]; M]],
}

impl<'a, X: Real, const M: usize> Sums<'a, X, M> {
    /// Of so many places, all zero, in `room`.
    pub(super) fn new(room: &'a mut Vec<[X; 4]>, places: usize) -> Self {
        room.clear();
        room.resize((places + 1) * M, [X::zero(); 4]);
        Self { nodes: room.as_chunks_mut::<M>().0 }
    }

    /// Adds to a place.
    #[inline(always)]
    pub(super) fn add(&mut self, place: usize, values: &[[X; 4]; M]) {
        let mut node = place + 1;
        while let Some(sum) = self.nodes.get_mut(node) {
            add(sum, values);
            node += lowest_bit(node);
        }
    }

    /// The sum over all places before one.
    #[inline(always)]
    pub(super) fn before(&self, place: usize) -> [[X; 4]; M] {
        let (mut node, mut sum) = (place, [[X::zero(); 4]; M]);
        while node > 0 {
            add(&mut sum, &self.nodes[node]);
            node -= lowest_bit(node);
        }
        sum
    }

    /// Adds to all places before one.
    #[inline(always)]
    pub(super) fn add_before(&mut self, place: usize, values: &[[X; 4]; M]) {
        let mut node = place;
        while node > 0 {
            add(&mut self.nodes[node], values);
            node -= lowest_bit(node);
        }
    }

    /// What a place has been given by [`Self::add_before`] of places behind it.
    #[inline(always)]
    pub(super) fn behind(&self, place: usize) -> [[X; 4]; M] {
        let (mut node, mut sum) = (place + 1, [[X::zero(); 4]; M]);
        while let Some(part) = self.nodes.get(node) {
            add(&mut sum, part);
            node += lowest_bit(node);
        }
        sum
    }
}

#[inline(always)]
fn lowest_bit(node: usize) -> usize {
    node & node.wrapping_neg()
}

#[inline(always)]
fn add<X: Real, const M: usize>(sum: &mut [[X; 4]; M], values: &[[X; 4]; M]) {
    for (sum, value) in sum.iter_mut().zip(values) {
        (0..4).for_each(|c| sum[c] += value[c]);
    }
}

/// Does what depends on the number of terms, which is known when it is compiled.
macro_rules! per_terms {
    ($terms:expr, $m:ident => $done:expr) => {
        per_terms!(@ $terms, $m => $done, 1 2 3 4 5 6 7 8 9 10 11 12)
    };
    (@ $terms:expr, $m:ident => $done:expr, $($count:literal)*) => {
        match $terms {
            $($count => { const $m: usize = $count; $done })*
            terms => unreachable!("an expansion of {terms} terms"),
        }
    };
}
pub(super) use per_terms;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_a_list() {
        let places = 37;
        let mut room = Vec::new();
        let mut sums = Sums::<f64, 2>::new(&mut room, places);
        let value = |k: usize| [[k as f64; 4], [0.5 - (k * k % 7) as f64; 4]];
        for place in (0..places).map(|k| k * 5 % places) {
            sums.add(place, &value(place));
        }
        for place in 0..=places {
            let found = sums.before(place);
            for m in 0..2 {
                assert_eq!(found[m][0], (0..place).map(|k| value(k)[m][0]).sum::<f64>());
            }
        }
        let mut sums = Sums::<f64, 2>::new(&mut room, places);
        (0..=places).for_each(|place| sums.add_before(place, &value(place)));
        for place in 0..places {
            let found = sums.behind(place);
            for m in 0..2 {
                assert_eq!(found[m][0], (place + 1..=places).map(|k| value(k)[m][0]).sum::<f64>());
            }
        }
    }
}
