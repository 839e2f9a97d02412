use std::ops::Range;

/// Elements a block: bands begin and end at multiples of it.
const BLOCK: usize = 64;
/// Bands that the work is shared among, at least and at most: enough for the threads of a workstation to balance.
const SHARES: [u64; 2] = [8, 32];
/// Non-zeros that a row should have in each band, so that they and not their offsets take the time.
const IN_BAND: u64 = 32;
/// Elements a band at most, so that 16 bits tell them apart.
const LONGEST: usize = 1 << 16;

/// The elements cut into ranges of about equal work.
///
/// A scatter gives each band to one task, which alone writes to it and meets the rows in their order:
/// no atomics, no private copies, the same sums for any number of threads.
#[derive(Debug, Clone)]
pub(super) struct Bands {
    ranges: Vec<Range<usize>>,
    of_block: Vec<u32>,
}

impl Bands {
    /// Bands over elements whose blocks were visited as often as `visits` says, by so many rows.
    pub(super) fn balanced(elements: usize, visits: &[u64], rows: usize) -> Self {
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
            if sum >= share || end - start + BLOCK > LONGEST {
                ranges.push(start..end);
                (start, sum) = (end, 0);
            }
        }
        match ranges.last_mut() {
            Some(last) if start >= elements => last.end = elements,
            _ => ranges.push(start..elements),
        }
        Self { ranges, of_block }
    }

    /// In which block an element lies, for counting visits.
    pub(super) fn block_of(element: usize) -> usize {
        element / BLOCK
    }

    /// The number of blocks of so many elements.
    pub(super) fn blocks(elements: usize) -> usize {
        elements.div_ceil(BLOCK)
    }

    pub(super) fn len(&self) -> usize {
        self.ranges.len()
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

    /// A slice over all elements, cut into its bands.
    pub(super) fn split<'a, T>(&self, mut values: &'a mut [T]) -> Vec<&'a mut [T]> {
        let mut parts = Vec::with_capacity(self.ranges.len());
        for range in &self.ranges {
            let (band, rest) = values.split_at_mut(range.len());
            parts.push(band);
            values = rest;
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_cover_every_element_once_and_know_their_own() {
        for elements in [1, 63, 64, 65, 1000, 64 * 40, 64 * 40 + 1, 3 * LONGEST + 5] {
            for seed in 0..5u64 {
                let visits: Vec<u64> = (0..Bands::blocks(elements) as u64)
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
                    assert!(range.len() <= LONGEST);
                    next = range.end;
                }
                assert_eq!(next, elements);
            }
        }
    }
}
