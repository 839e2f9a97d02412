use super::VoxelGrid;

/// Voxels a side of a brick.
pub const BRICK: usize = 8;

/// A set of voxels, kept as bricks of 8 × 8 × 8 bits and numbered brick by brick.
///
/// The numbering keeps neighbours together, so that vectors over the set are read and written close to where they were
/// before; and bricks without any voxel can be passed in one step.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelSet {
    size: [usize; 3],
    bricks: Vec<Brick>,
    len: usize,
    /// Whether walks pass over bricks that hold nothing.
    passes_over: bool,
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Brick {
    /// Voxels in the bricks before, and in this one.
    first: u32,
    len: u16,
    /// Voxels in the slices before, of this brick.
    before: [u16; BRICK],
    /// One bit a voxel, one word a slice: x in the lowest three bits of the place, y above.
    slices: [u64; BRICK],
}

impl VoxelSet {
    /// The voxels of a lattice for which `holds` of their index is true.
    pub fn new(size: [usize; 3], holds: impl Fn(usize) -> bool) -> Self {
        let bricks = size.map(|side| side.div_ceil(BRICK));
        let mut set =
            Self { size, bricks: vec![Brick::default(); bricks.iter().product()], len: 0, passes_over: true };
        let mut index = 0;
        for k in 0..size[2] {
            for j in 0..size[1] {
                for i in 0..size[0] {
                    if holds(index) {
                        let (brick, slice, bit) = set.place([i, j, k]);
                        set.bricks[brick].slices[slice] |= 1 << bit;
                    }
                    index += 1;
                }
            }
        }
        set.count();
        set
    }

    /// All voxels of a lattice.
    pub fn all(size: [usize; 3]) -> Self {
        Self::new(size, |_| true)
    }

    /// Numbers the voxels.
    fn count(&mut self) {
        let mut len = 0u32;
        for brick in &mut self.bricks {
            brick.first = len;
            let mut inside = 0;
            for (before, slice) in brick.before.iter_mut().zip(&brick.slices) {
                *before = inside;
                inside += slice.count_ones() as u16;
            }
            brick.len = inside;
            len += u32::from(inside);
        }
        self.len = len as usize;
    }

    /// Voxels of the lattice along each axis.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Bricks along each axis.
    pub fn bricks(&self) -> [usize; 3] {
        self.size.map(|side| side.div_ceil(BRICK))
    }

    /// How many voxels are in it.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether none is.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> u64 {
        size_of_val(&self.bricks[..]) as u64
    }

    /// Of each brick, x fastest: how many voxels are in the bricks before, how many in its slices before, and its bits, one word a
    /// slice: x in the lowest three bits of the place, y above.
    pub fn records(&self) -> impl ExactSizeIterator<Item = (u32, [u16; BRICK], [u64; BRICK])> + '_ {
        self.bricks.iter().map(|brick| (brick.first, brick.before, brick.slices))
    }

    /// Whether no voxel of a brick is in it.
    #[inline(always)]
    pub fn is_brick_empty(&self, [i, j, k]: [usize; 3]) -> bool {
        let [across, down, _] = self.bricks();
        self.bricks[(k * down + j) * across + i].len == 0
    }

    /// The same, with walks that enter every brick.
    pub fn entered_everywhere(self) -> Self {
        Self { passes_over: false, ..self }
    }

    /// Whether walks pass over bricks that hold nothing.
    pub fn passes_over_bricks(&self) -> bool {
        self.passes_over
    }

    /// Whether walks pass over a brick.
    #[inline(always)]
    pub fn is_passed_over(&self, brick: [usize; 3]) -> bool {
        self.passes_over && self.is_brick_empty(brick)
    }

    /// Bricks without a voxel, and all bricks.
    pub fn empty_bricks(&self) -> [usize; 2] {
        [self.bricks.iter().filter(|brick| brick.len == 0).count(), self.bricks.len()]
    }

    /// The number of a voxel in the set.
    #[inline(always)]
    pub fn number(&self, voxel: [usize; 3]) -> Option<u32> {
        let (brick, slice, bit) = self.place(voxel);
        let brick = &self.bricks[brick];
        let word = brick.slices[slice];
        if word >> bit & 1 == 0 {
            return None;
        }
        let below = word & ((1 << bit) - 1);
        Some(brick.first + u32::from(brick.before[slice]) + below.count_ones())
    }

    /// Whether a voxel is in the set.
    #[inline(always)]
    pub fn contains(&self, voxel: [usize; 3]) -> bool {
        let (brick, slice, bit) = self.place(voxel);
        self.bricks[brick].slices[slice] >> bit & 1 == 1
    }

    /// The voxels, in the order of their numbers.
    pub fn voxels(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        let [across, down, _] = self.bricks();
        self.bricks.iter().enumerate().flat_map(move |(index, brick)| {
            let corner = [index % across, index / across % down, index / across / down].map(|i| i * BRICK);
            brick.slices.iter().enumerate().flat_map(move |(slice, &word)| {
                bits(word)
                    .map(move |bit| [corner[0] + bit % BRICK, corner[1] + bit / BRICK, corner[2] + slice])
            })
        })
    }

    /// Their indices in the lattice, x fastest, in the order of their numbers.
    pub fn indices(&self) -> Vec<u32> {
        let [width, height, _] = self.size;
        self.voxels().map(|[i, j, k]| ((k * height + j) * width + i) as u32).collect()
    }

    /// The voxels that are in both.
    pub fn intersection(&self, other: &Self) -> Self {
        let mut both = self.clone();
        for (mine, other) in both.bricks.iter_mut().zip(&other.bricks) {
            mine.slices.iter_mut().zip(&other.slices).for_each(|(mine, other)| *mine &= other);
        }
        both.count();
        both
    }

    /// The voxels that are in either.
    pub fn union(&self, other: &Self) -> Self {
        let mut either = self.clone();
        for (mine, other) in either.bricks.iter_mut().zip(&other.bricks) {
            mine.slices.iter_mut().zip(&other.slices).for_each(|(mine, other)| *mine |= other);
        }
        either.count();
        either
    }

    /// The cells between voxel centres, one more along each axis, of which some corner is in the set.
    pub fn cells_between(&self) -> Self {
        let size = self.size;
        let mut cells = Self {
            size: size.map(|side| side + 1),
            bricks: vec![Brick::default(); size.map(|side| (side + 1).div_ceil(BRICK)).iter().product()],
            len: 0,
            passes_over: self.passes_over,
        };
        for [i, j, k] in self.voxels() {
            for corner in 0..8 {
                let cell = [i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2)];
                let (brick, slice, bit) = cells.place(cell);
                cells.bricks[brick].slices[slice] |= 1 << bit;
            }
        }
        cells.count();
        cells
    }

    #[inline(always)]
    fn place(&self, [i, j, k]: [usize; 3]) -> (usize, usize, usize) {
        let [across, down, _] = self.bricks();
        let brick = (k / BRICK * down + j / BRICK) * across + i / BRICK;
        (brick, k % BRICK, j % BRICK * BRICK + i % BRICK)
    }
}

impl VoxelGrid {
    /// The voxels of the grid for which `holds` of their index is true.
    pub fn set(&self, holds: impl Fn(usize) -> bool) -> VoxelSet {
        VoxelSet::new(self.size(), holds)
    }
}

/// The places of the bits that are set.
fn bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = word.trailing_zeros() as usize;
        (word != 0).then(|| {
            word &= word - 1;
            bit
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_run_through_the_set_in_the_order_of_its_voxels() {
        for size in [[1, 1, 1], [8, 8, 8], [9, 17, 3], [30, 5, 21]] {
            let holds = |index: usize| index.wrapping_mul(2_654_435_761) >> 7 & 3 == 0;
            let set = VoxelSet::new(size, holds);
            let indices = set.indices();
            assert_eq!(indices.len(), set.len());
            assert_eq!(set.len(), (0..size.iter().product()).filter(|&index| holds(index)).count());
            for (number, voxel) in set.voxels().enumerate() {
                assert_eq!(set.number(voxel), Some(number as u32));
                assert!(holds(indices[number] as usize) && set.contains(voxel));
                assert!(!set.is_brick_empty(voxel.map(|i| i / BRICK)));
            }
            assert_eq!(VoxelSet::all(size).intersection(&set), set);
        }
    }

    #[test]
    fn cells_between_centres_touch_the_set() {
        let set = VoxelSet::new([4, 3, 2], |index| index == 0 || index == 23);
        let cells: Vec<[usize; 3]> = set.cells_between().voxels().collect();
        assert_eq!(cells.len(), 16);
        assert!(cells.contains(&[0, 0, 0]) && cells.contains(&[1, 1, 1]) && cells.contains(&[4, 3, 2]));
    }
}
