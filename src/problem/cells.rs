//! Cells over elements of a plane lattice that no row reaches: small beside those that are reached, and the larger the farther away.
//!
//! What smoothness carries into them varies the less the farther it has come, so one unknown a cell will do. Neighbouring cells of equal
//! size pull at each other as neighbouring elements do, for in two dimensions the squared gradient of a field is the same at any scale;
//! between a cell and one twice as wide it is 2/3 of that, their common side by the distance of their centres.

use std::collections::HashSet;
use std::sync::Arc;

use rayon::prelude::*;

use crate::operator::NOWHERE;
use crate::scene::Rgb;

/// Cells are at most 2 to this many elements wide.
const MOST_LEVELS: usize = 6;
/// Sweeps over each level when cells are divided: each smooths what the division has left.
const SWEEPS: usize = 3;

/// Cells over some elements of a lattice, each with an element that stands for it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Cells {
    size: [usize; 2],
    /// Which elements a row reaches.
    reached: Arc<[bool]>,
    /// Of every element that lies in a cell the binary logarithm of the cell's side; [`OUTSIDE`] of others.
    levels: Vec<u8>,
}

const OUTSIDE: u8 = u8::MAX;

impl Cells {
    /// Cells over those of the elements `joined` that are not `reached`. `size` is that of the lattice, columns and rows.
    ///
    /// Law: neighbouring cells differ by a factor of 2 at most, since a cell is no wider than its distance from where cells end.
    pub(crate) fn new(size: [usize; 2], reached: Arc<[bool]>, joined: &[u32]) -> Self {
        let mut levels = vec![OUTSIDE; reached.len()];
        for &element in joined.iter().filter(|&&element| !reached[element as usize]) {
            levels[element as usize] = 0;
        }
        let distances = distances(size, &levels);
        // Least distance in each block of the level before, none where it is no cell.
        let (mut blocks, mut least) = (size, distances);
        for level in 1..=MOST_LEVELS {
            let side = 1 << level;
            let coarser = blocks.map(|side| side / 2);
            let mut above = vec![0u32; coarser[0] * coarser[1]];
            for (index, above) in above.iter_mut().enumerate() {
                let (i, j) = (index % coarser[0], index / coarser[0]);
                let children = [[0, 0], [1, 0], [0, 1], [1, 1]];
                let distance = |[x, y]: [usize; 2]| least[(2 * j + y) * blocks[0] + 2 * i + x];
                let nearest = children.map(distance).into_iter().min().unwrap_or_default();
                if nearest >= side {
                    *above = nearest;
                    for y in j * side as usize..(j + 1) * side as usize {
                        let row = y * size[0] + i * side as usize;
                        levels[row..row + side as usize].fill(level as u8);
                    }
                }
            }
            (blocks, least) = (coarser, above);
        }
        Self { size, reached, levels }
    }

    /// The element that stands for the cell that an element lies in; the element itself where it lies in none.
    fn of(&self, element: usize) -> usize {
        match self.levels[element] {
            OUTSIDE => element,
            level => {
                let [x, y] = [element % self.size[0], element / self.size[0]].map(|at| at >> level << level);
                y * self.size[0] + x
            }
        }
    }

    fn is_in_a_cell(&self, element: usize) -> bool {
        self.levels[element] != OUTSIDE
    }

    /// The elements that stand for cells, in increasing order, and how many elements lie in each.
    pub(crate) fn each(&self) -> impl Iterator<Item = (u32, usize)> {
        let stands = |&element: &usize| self.is_in_a_cell(element) && self.of(element) == element;
        (0..self.levels.len()).filter(stands).map(|element| (element as u32, 1 << (2 * self.levels[element])))
    }

    /// Pairs of what lies side by side along each axis, lower element first: reached elements, and cells by the elements that stand for them.
    pub(crate) fn pairs(&self) -> [Vec<[u32; 2]>; 2] {
        let takes_part = |element: usize| self.reached[element] || self.is_in_a_cell(element);
        [0, 1].map(|axis| {
            let stride = [1, self.size[0]][axis];
            let mut known = HashSet::new();
            let mut pairs = Vec::new();
            for element in 0..self.levels.len() {
                let along = [element % self.size[0], element / self.size[0]][axis];
                if along + 1 == self.size[axis] || !takes_part(element) || !takes_part(element + stride) {
                    continue;
                }
                let pair = [self.of(element) as u32, self.of(element + stride) as u32];
                // Between single elements there is one pair, and it needs no looking up.
                let is_plain = pair == [element as u32, (element + stride) as u32];
                if pair[0] != pair[1] && (is_plain || known.insert(pair)) {
                    pairs.push(pair);
                }
            }
            pairs
        })
    }

    /// Values for all elements in cells, from those of the elements that stand for the cells: cells are halved over and over, and each time
    /// every new cell is moved towards the balance of its neighbours and its start, `fade` being the weight of the start of one element.
    pub(crate) fn spread(mut self, values: &mut [Rgb], start: Rgb, fade: f64) {
        let largest = self.levels.iter().copied().filter(|&level| level != OUTSIDE).max().unwrap_or_default();
        for level in (0..largest).rev() {
            for element in 0..values.len() {
                if self.levels[element] == level + 1 {
                    values[element] = values[self.of(element)];
                }
            }
            self.levels.iter_mut().filter(|mine| **mine == level + 1).for_each(|mine| *mine = level);
            self.balance(level, values, start, fade);
        }
    }

    /// Moves cells of at most one size to the balance of what lies around them, all at once.
    fn balance(&self, level: u8, values: &mut [Rgb], start: Rgb, fade: f64) {
        let own: Vec<usize> = (0..values.len())
            .filter(|&element| self.levels[element] == level && self.of(element) == element)
            .collect();
        let (side, weight) = (1usize << level, (fade * f64::from(1u32 << (2 * level))) as f32);
        for _ in 0..SWEEPS {
            let balanced: Vec<Rgb> = own
                .par_iter()
                .map(|&element| {
                    let (mut sum, mut weights) = (start.map(|value| weight * value), weight);
                    for (neighbour, weight) in self.beside(element, side).into_iter().flatten() {
                        (0..3).for_each(|c| sum[c] += weight * values[neighbour][c]);
                        weights += weight;
                    }
                    if weights == 0.0 {
                        return values[element];
                    }
                    std::array::from_fn(|c| {
                        values[element][c] + 0.8 * (sum[c] / weights - values[element][c])
                    })
                })
                .collect();
            own.iter().zip(balanced).for_each(|(&element, value)| values[element] = value);
        }
    }

    /// What lies on the four sides of a cell, at most two of it on each, and how much it counts.
    fn beside(&self, element: usize, side: usize) -> [Option<(usize, f32)>; 8] {
        let ([x, y], [width, height], half) =
            ([element % self.size[0], element / self.size[0]], self.size, side / 2);
        let at = |x: usize, y: usize, is_second: bool| {
            let other = (x < width && y < height).then(|| y * width + x)?;
            let takes_part = self.reached[other] || self.is_in_a_cell(other);
            let weight = self.weight([element, other]);
            // There is a second one where they are smaller.
            let counts = takes_part && (!is_second || half > 0 && self.level(other) < self.level(element));
            counts.then(|| (self.of(other), weight))
        };
        let both = |x: usize, y: usize, [along_x, along_y]: [usize; 2]| {
            [at(x, y, false), at(x + along_x * half, y + along_y * half, true)]
        };
        let sides = [
            both(x.wrapping_sub(1), y, [0, 1]),
            both(x + side, y, [0, 1]),
            both(x, y.wrapping_sub(1), [1, 0]),
            both(x, y + side, [1, 0]),
        ];
        std::array::from_fn(|k| sides[k / 2][k % 2])
    }

    fn level(&self, element: usize) -> u8 {
        if self.is_in_a_cell(element) { self.levels[element] } else { 0 }
    }

    /// How strongly two neighbours pull at each other.
    fn weight(&self, pair: [usize; 2]) -> f32 {
        let [a, b] = pair.map(|element| self.level(element));
        if a == b { 1.0 } else { 2.0 / 3.0 }
    }

    /// The same of pairs, in their order.
    pub(crate) fn weights<'a>(&'a self, pairs: &'a [Vec<[u32; 2]>; 2]) -> impl Iterator<Item = f32> + 'a {
        pairs.iter().flatten().map(|pair| self.weight(pair.map(|element| element as usize)))
    }
}

/// How many steps, along axes or diagonals, lead from each element out of the cells or of the lattice: 1 at their rim, 0 outside.
fn distances([width, height]: [usize; 2], levels: &[u8]) -> Vec<u32> {
    let mut distances: Vec<u32> =
        levels.iter().map(|&level| if level == OUTSIDE { 0 } else { u32::MAX / 2 }).collect();
    let mut pass = |order: &mut dyn Iterator<Item = usize>, back: isize| {
        for element in order {
            let (x, y) = ((element % width) as isize, (element / width) as isize);
            for [dx, dy] in [[-1, 0], [-1, -1], [0, -1], [1, -1]] {
                let (x, y) = (x + back * dx, y + back * dy);
                let is_inside = (0..width as isize).contains(&x) && (0..height as isize).contains(&y);
                let other = if is_inside { distances[y as usize * width + x as usize] } else { 0 };
                distances[element] = distances[element].min(other + 1);
            }
        }
    };
    pass(&mut (0..levels.len()), 1);
    pass(&mut (0..levels.len()).rev(), -1);
    distances
}

/// Numbers pairs of elements by the places of these among `columns`.
pub(crate) fn numbered(pairs: &[[u32; 2]], columns: &[u32], elements: usize) -> Vec<[u32; 2]> {
    let mut numbers = vec![NOWHERE; elements];
    (0..).zip(columns).for_each(|(number, &column)| numbers[column as usize] = number);
    pairs.iter().map(|pair| pair.map(|element| numbers[element as usize])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [96, 70];

    /// Reached elements in a strip, and shadow in a disc.
    fn cells() -> (Cells, Vec<bool>) {
        let of = |test: fn(usize, usize) -> bool| -> Vec<bool> {
            (0..SIZE[0] * SIZE[1]).map(|k| test(k % SIZE[0], k / SIZE[0])).collect()
        };
        let reached = of(|x, y| (20..26).contains(&x) && y > 9);
        let lit = of(|x, y| (x as f64 - 70.0).hypot(y as f64 - 20.0) > 9.0);
        let joined: Vec<u32> = (0..).zip(&lit).filter(|(_, lit)| **lit).map(|(k, _)| k).collect();
        (Cells::new(SIZE, reached.into(), &joined), lit)
    }

    #[test]
    fn cells_cover_what_is_joined_and_neighbours_differ_by_a_factor_of_two_at_most() {
        let (cells, lit) = cells();
        let of_cells: usize = cells.each().map(|(_, count)| count).sum();
        let free = (0..lit.len()).filter(|&k| lit[k] && !cells.reached[k]).count();
        assert_eq!(of_cells, free);
        let few = cells.each().count();
        assert!(3 * few < free, "{few} cells for {free} elements");
        for pair in cells.pairs().iter().flatten() {
            let levels =
                pair.map(|k| cells.levels[k as usize]).map(|level| if level == OUTSIDE { 0 } else { level });
            assert!(levels[0].abs_diff(levels[1]) <= 1, "{levels:?}");
        }
        // The fullest side of anything has two neighbours.
        for pairs in cells.pairs() {
            let mut counts = vec![[0; 2]; lit.len()];
            pairs.iter().for_each(|pair| (0..2).for_each(|end| counts[pair[end] as usize][end] += 1));
            assert!(counts.iter().flatten().all(|&count| count <= 2));
        }
    }

    /// The exact balance of every single element, by many sweeps.
    fn balanced(cells: &Cells, values: &[Rgb], start: Rgb, fade: f64) -> Vec<Rgb> {
        let single = Cells {
            levels: cells.levels.iter().map(|&l| if l == OUTSIDE { l } else { 0 }).collect(),
            ..cells.clone()
        };
        let mut values = values.to_vec();
        for _ in 0..4000 {
            single.balance(0, &mut values, start, fade);
        }
        values
    }

    #[test]
    fn what_is_spread_is_near_the_balance_of_single_elements() {
        let (cells, lit) = cells();
        let (start, fade) = ([1.0, 0.5, 2.0], 1.0 / 144.0);
        let colored = |k: usize| if k / SIZE[0] < 40 { [0.2, 0.5, 0.0] } else { [0.9, 0.1, 1.0] };
        let begin: Vec<Rgb> =
            (0..lit.len()).map(|k| if cells.reached[k] { colored(k) } else { start }).collect();
        let exact = balanced(&cells, &begin, start, fade);
        let mut values = begin.clone();
        for _ in 0..1000 {
            (0..MOST_LEVELS as u8).for_each(|level| cells.balance(level, &mut values, start, fade));
        }
        let from = values.clone();
        cells.clone().spread(&mut values, start, fade);
        let worst = |values: &[Rgb]| {
            let off = values.iter().zip(&exact).flat_map(|(a, b)| (0..3).map(move |c| (a[c] - b[c]).abs()));
            off.fold(0.0, f32::max)
        };
        assert!(worst(&values) < 0.03, "{}", worst(&values));
        assert!(worst(&from) > 0.3, "not spread it is far away");
        assert!((0..lit.len()).all(|k| lit[k] || values[k] == start), "shadow keeps its start");
    }
}
