use std::ops::Range;

use crate::operator::WalkPlan;

/// Elements a block: bands begin and end at multiples of it, and a plan counts visits by it.
const BLOCK: usize = WalkPlan::BLOCK;
/// Bands that the work is shared among, at least and at most: enough for the threads of a workstation to balance.
const SHARES: [u64; 2] = [8, 32];
/// Non-zeros that a row should have in each band: the time should go to them, not to their offsets.
const IN_BAND: u64 = 32;
/// Elements whose slots stand together. Between them is a cache line of room: a ray across the rows of a map as wide as a power of
/// two would else meet the same few sets of a cache again and again.
const RUN: usize = 512;
/// Slots of that room: a cache line of padded f32.
const LINE: usize = 4;

/// The elements cut into ranges of about equal work.
///
/// A scatter gives each band to one task, which alone writes to it and meets the rows in their order:
/// no atomics, no private copies, the same sums for any number of threads.
#[derive(Debug, Clone)]
pub(super) struct Bands {
    ranges: Vec<Range<usize>>,
    /// Where the slots of each band lie.
    slots: Vec<Range<usize>>,
    of_block: Vec<u32>,
}

impl Bands {
    /// The most elements of a band: 16 bits tell them apart.
    pub(super) const LONGEST: usize = 1 << 16;

    /// Bands for the rows of a plan.
    pub(super) fn for_plan(plan: &WalkPlan) -> Self {
        Self::balanced(plan.elements, &plan.visits, plan.sampled)
    }

    /// Bands over elements whose blocks were visited as often as `visits` says, by so many rows.
    fn balanced(elements: usize, visits: &[u64], rows: usize) -> Self {
        let blocks = elements.div_ceil(BLOCK);
        let visits_of = |block: usize| visits.get(block).copied().unwrap_or(0);
        let visited = visits.iter().sum::<u64>();
        let shares = (visited / rows.max(1) as u64 / IN_BAND).clamp(SHARES[0], SHARES[1]);
        let share = (visited / shares).max(1);
        let (mut ranges, mut of_block) = (Vec::new(), Vec::with_capacity(blocks));
        let (mut start, mut sum) = (0, 0);
        for block in 0..blocks {
            of_block.push(ranges.len() as u32);
            sum += visits_of(block);
            let end = (block + 1) * BLOCK;
            if sum >= share || end - start + BLOCK > Self::LONGEST {
                ranges.push(start..end);
                (start, sum) = (end, 0);
            }
        }
        match ranges.last_mut() {
            Some(last) if start >= elements => last.end = elements,
            _ => ranges.push(start..elements),
        }
        let mut end = 0;
        let slots = ranges.iter().map(|range: &Range<usize>| {
            let first = end;
            end += slots_of(range.len());
            first..end
        });
        Self { slots: slots.collect(), ranges, of_block }
    }

    pub(super) fn len(&self) -> usize {
        self.ranges.len()
    }

    /// All of them.
    pub(super) fn elements(&self) -> usize {
        self.ranges.last().map_or(0, |last| last.end)
    }

    /// The band of an element, and the elements in it.
    #[inline]
    pub(super) fn of(&self, element: usize) -> (usize, Range<usize>) {
        let band = self.of_block[element / BLOCK] as usize;
        (band, self.ranges[band].clone())
    }

    /// The elements of a band.
    #[inline]
    pub(super) fn range(&self, band: usize) -> Range<usize> {
        self.ranges[band].clone()
    }

    /// The slot of an element of a band, both counted from its start.
    #[inline]
    pub(super) fn slot(element: usize) -> usize {
        element + element / RUN * LINE
    }

    /// Slots of all bands together.
    pub(super) fn all_slots(&self) -> usize {
        self.slots.last().map_or(0, |last| last.end)
    }

    /// Elements that stand together, of those of a band.
    pub(super) fn runs_mut<T>(elements: &mut [T]) -> impl Iterator<Item = &mut [T]> {
        elements.chunks_mut(RUN)
    }

    /// Their slots, of those of a band.
    pub(super) fn runs_of_slots<T>(slots: &mut [T]) -> impl Iterator<Item = &mut [T]> {
        slots.chunks_mut(RUN + LINE)
    }

    /// Values in slots, cut into bands.
    pub(super) fn split_slots<'a, T>(&self, values: &'a mut [T]) -> Vec<&'a mut [T]> {
        cut(&self.slots, values)
    }

    /// Values of all elements, cut into bands.
    pub(super) fn split<'a, T>(&self, values: &'a mut [T]) -> Vec<&'a mut [T]> {
        cut(&self.ranges, values)
    }
}

/// Slots of so many elements.
fn slots_of(elements: usize) -> usize {
    elements.checked_sub(1).map_or(0, |last| Bands::slot(last) + 1)
}

fn cut<'a, T>(ranges: &[Range<usize>], mut values: &'a mut [T]) -> Vec<&'a mut [T]> {
    let mut parts = Vec::with_capacity(ranges.len());
    for range in ranges {
        let (part, rest) = values.split_at_mut(range.len());
        parts.push(part);
        values = rest;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_cover_every_element_once_and_know_their_own() {
        for elements in [1, 63, 64, 65, 1000, 64 * 40, 64 * 40 + 1, 3 * Bands::LONGEST + 5] {
            for seed in 0..5u64 {
                let visits: Vec<u64> = (0..elements.div_ceil(BLOCK) as u64)
                    .map(|block| (block * 7919 + seed) % 13 * seed)
                    .collect();
                let bands = Bands::balanced(elements, &visits, 7);
                let mut values = vec![0u8; elements];
                let mut next = 0;
                for (number, band) in bands.split(&mut values).into_iter().enumerate() {
                    let range = bands.range(number);
                    assert_eq!(range.start, next);
                    assert_eq!(range.len(), band.len());
                    assert!(range.clone().all(|element| bands.of(element) == (number, range.clone())));
                    assert!(range.len() <= Bands::LONGEST);
                    let slots: Vec<usize> = (0..range.len()).map(Bands::slot).collect();
                    assert!(slots.is_sorted_by(|a, b| a < b));
                    assert!(slots.iter().all(|&slot| slot < bands.slots[number].len()));
                    next = range.end;
                }
                assert_eq!(next, elements);
            }
        }
    }
}
