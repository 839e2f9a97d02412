//! Sums of what is before a place.

use super::super::Real;

/// Places of a block, and blocks of a large one.
pub(super) const BLOCK: usize = 16;
const LARGE: usize = BLOCK * BLOCK;

/// Values of M colours at each of n places, of which those count that are on, with the sums of blocks of 16 and of 256 places.
///
/// A place is switched in three steps, without a branch, and what is before one takes up to 15 places, 15 blocks and n / 256 large ones.
/// Samples are several times as many as rays, so this is quicker than a tree that takes O(log n) for both. Both pairs of operations
/// are transposes of each other: [`Self::switch_on`] and [`Self::before`], [`Self::add_before`] and [`Self::switch_off`].
pub(super) struct Sums<'a, X, const M: usize> {
    values: &'a mut [[[X; 4]; M]],
    blocks: &'a mut [[[X; 4]; M]],
    large: &'a mut [[[X; 4]; M]],
    /// Which places of a block are on, a bit each.
    on: &'a mut [u16],
}

/// What sums need room for.
#[derive(Default)]
pub(super) struct Room<X> {
    blocks: Vec<[X; 4]>,
    on: Vec<u16>,
}

impl<'a, X: Real, const M: usize> Sums<'a, X, M> {
    /// Of such values; all places are off.
    pub(super) fn new(values: &'a mut [[X; 4]], room: &'a mut Room<X>) -> Self {
        let values = values.as_chunks_mut::<M>().0;
        let (blocks, large) = (values.len() / BLOCK + 1, values.len() / LARGE + 1);
        room.blocks.clear();
        room.blocks.resize((blocks + large) * M, [X::zero(); 4]);
        room.on.clear();
        room.on.resize(blocks, 0);
        let (blocks, large) = room.blocks.as_chunks_mut::<M>().0.split_at_mut(blocks);
        Self { values, blocks, large, on: &mut room.on }
    }

    /// Switches places on whose values are zero.
    pub(super) fn begin(&mut self, places: &[u16]) {
        for &place in places {
            self.on[usize::from(place) / BLOCK] |= 1 << (usize::from(place) % BLOCK);
        }
    }

    /// Counts the value of a place.
    #[inline(always)]
    pub(super) fn switch_on(&mut self, place: usize) {
        let value = self.values[place];
        add(&mut self.blocks[place / BLOCK], &value);
        add(&mut self.large[place / LARGE], &value);
        self.on[place / BLOCK] |= 1 << (place % BLOCK);
    }

    /// The sum of the values before a place that are on.
    #[inline(always)]
    pub(super) fn before(&self, place: usize) -> [[X; 4]; M] {
        let mut sum = [[X::zero(); 4]; M];
        self.large[..place / LARGE].iter().for_each(|large| add(&mut sum, large));
        self.blocks[place / LARGE * BLOCK..place / BLOCK].iter().for_each(|block| add(&mut sum, block));
        on_before(self.on, place, |place| add(&mut sum, &self.values[place]));
        sum
    }

    /// Adds to the values before a place that are on.
    #[inline(always)]
    pub(super) fn add_before(&mut self, place: usize, values: &[[X; 4]; M]) {
        self.large[..place / LARGE].iter_mut().for_each(|large| add(large, values));
        self.blocks[place / LARGE * BLOCK..place / BLOCK].iter_mut().for_each(|block| add(block, values));
        on_before(self.on, place, |place| add(&mut self.values[place], values));
    }

    /// From here on nothing is added to the value of a place, which is known now.
    #[inline(always)]
    pub(super) fn switch_off(&mut self, place: usize) {
        let value = &mut self.values[place];
        add(value, &self.blocks[place / BLOCK]);
        add(value, &self.large[place / LARGE]);
        self.on[place / BLOCK] &= !(1 << (place % BLOCK));
    }
}

/// The places of the block of one that are on and before it.
#[inline(always)]
fn on_before(on: &[u16], place: usize, mut visit: impl FnMut(usize)) {
    let mut left = on[place / BLOCK] & ((1 << (place % BLOCK)) - 1);
    while left != 0 {
        visit(place / BLOCK * BLOCK + left.trailing_zeros() as usize);
        left &= left - 1;
    }
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

    /// Places in an order of their own, so that neighbours are switched at different times.
    fn shuffled(places: usize) -> impl Iterator<Item = usize> {
        (0..places).map(move |k| k * 5 % places)
    }

    fn value(k: usize) -> [[f64; 4]; 2] {
        [[k as f64; 4], [0.5 - (k * k % 7) as f64; 4]]
    }

    #[test]
    fn sums_are_those_of_a_list() {
        for places in [1, 16, 37, 256, 613] {
            let (mut values, mut room) = ((0..places).flat_map(value).collect::<Vec<_>>(), Room::default());
            let mut sums = Sums::<f64, 2>::new(&mut values, &mut room);
            let mut is_on = vec![false; places];
            for switched in shuffled(places) {
                sums.switch_on(switched);
                is_on[switched] = true;
                for place in [0, switched, switched + 1, places] {
                    let found = sums.before(place);
                    let sum =
                        |m: usize| (0..place).filter(|&k| is_on[k]).map(|k| value(k)[m][0]).sum::<f64>();
                    assert_eq!([found[0][3], found[1][0]], [sum(0), sum(1)], "{place} of {places}");
                }
            }
        }
    }

    #[test]
    fn what_is_added_ends_where_a_place_is_switched_off() {
        for places in [1, 16, 37, 256, 613] {
            let (mut values, mut room) = (vec![[0.0; 4]; 2 * places], Room::default());
            let mut sums = Sums::<f64, 2>::new(&mut values, &mut room);
            // One in three takes no part.
            let with = |place: &usize| place % 3 != 1;
            sums.begin(&(0..places).filter(with).map(|place| place as u16).collect::<Vec<_>>());
            let (mut is_on, mut expected) = (vec![true; places], vec![[0.0; 2]; places]);
            for (k, switched) in shuffled(places).filter(with).enumerate() {
                let before = k * 7 % (places + 1);
                sums.add_before(before, &value(k));
                for place in (0..before).filter(|place| is_on[*place] && with(place)) {
                    (0..2).for_each(|m| expected[place][m] += value(k)[m][0]);
                }
                sums.switch_off(switched);
                is_on[switched] = false;
            }
            for (place, expected) in expected.into_iter().enumerate() {
                assert_eq!([values[2 * place][2], values[2 * place + 1][0]], expected, "{place} of {places}");
            }
        }
    }
}
