use super::{Lattices, TILE_SIDE as SIDE};

/// Which tile an element belongs to: squares of 8 × 8 neighbours, or cubes of 4 × 4 × 4, of which only the unknown elements
/// count.
#[derive(Debug, Clone)]
pub struct Tiling {
    /// For every element its tile and its place there; the tile is `u32::MAX` where it is not unknown.
    places: Vec<(u32, u8)>,
    /// The unknowns of each tile, by their index among the unknowns.
    members: Vec<Vec<u32>>,
}

impl Tiling {
    /// Tiles over a lattice of `size` elements along two axes, of which `columns` are unknown.
    pub fn new(size: [usize; 2], columns: &[u32]) -> Self {
        Self::placed(&size.into(), size[0] * size[1], columns, columns)
    }

    /// Tiles over lattices: `columns` are the unknowns among so many `elements`, and `at` their places. Those that are [`NOWHERE`](super::NOWHERE) share
    /// tiles in their order.
    pub fn placed(lattices: &Lattices, elements: usize, columns: &[u32], at: &[u32]) -> Self {
        let mut places = vec![(u32::MAX, 0); elements];
        let mut numbers = std::collections::HashMap::new();
        let mut members: Vec<Vec<u32>> = Vec::new();
        let mut without_place = 0;
        for ((&column, &place), unknown) in columns.iter().zip(at).zip(0u32..) {
            let key = match lattices.locate(place) {
                Some((lattice, size, within)) => (lattice, tile_of(size, within)),
                None => {
                    without_place += 1;
                    (usize::MAX, (without_place - 1) / (SIDE * SIDE))
                }
            };
            let number = numbers.entry(key).or_insert(u32::MAX);
            if *number == u32::MAX {
                *number = members.len() as u32;
                members.push(Vec::with_capacity(SIDE * SIDE));
            }
            let tile = &mut members[*number as usize];
            places[column as usize] = (*number, tile.len() as u8);
            tile.push(unknown);
        }
        Self { places, members }
    }

    /// Bytes that a metric over at most so many unknowns takes.
    pub fn bytes<F, const C: usize>(unknowns: usize) -> u64 {
        (unknowns * SIDE * SIDE * size_of::<[F; C]>()) as u64
    }

    /// The tile of an element and its place there; none where it is not unknown.
    #[inline]
    pub fn place(&self, element: usize) -> Option<(u32, u8)> {
        let (tile, place) = self.places[element];
        (tile != u32::MAX).then_some((tile, place))
    }

    /// The unknowns of each tile, by their index among the unknowns.
    pub fn members(&self) -> &[Vec<u32>] {
        &self.members
    }
}

/// The tile of a place in a lattice.
fn tile_of(size: &[usize], mut place: usize) -> usize {
    // 64 members whatever the dimensions.
    let side = if size.len() > 2 { SIDE / 2 } else { SIDE };
    let (mut tile, mut stride) = (0, 1);
    for &length in size {
        tile += place % length / side * stride;
        stride *= length.div_ceil(side);
        place /= length;
    }
    tile
}

/// The blocks of a metric of tiles, on the host.
pub trait TileBlocks {
    /// Weights an entry: one for all channels, or one each.
    fn channels(&self) -> usize;

    /// The unknowns of each tile, and its symmetric matrix row by row, an entry's weights together.
    fn blocks(&self) -> Box<dyn Iterator<Item = (&[u32], &[f32])> + '_>;
}
