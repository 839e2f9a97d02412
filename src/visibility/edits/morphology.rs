//! Flat dilation, erosion and closure of depths.

use glam::DVec2;
use rayon::prelude::*;

/// Which value of a neighbourhood stays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Extremum {
    /// Dilation of what casts shadows.
    Least,
    /// Erosion.
    Largest,
}

impl Extremum {
    #[inline(always)]
    pub(super) fn of<T: PartialOrd>(self, a: T, b: T) -> T {
        let keeps = match self {
            Self::Least => a <= b,
            Self::Largest => a >= b,
        };
        if keeps { a } else { b }
    }

    /// What takes no part: the value of places beside the map.
    #[inline(always)]
    pub(super) fn nothing(self) -> f64 {
        match self {
            Self::Least => f64::INFINITY,
            Self::Largest => f64::NEG_INFINITY,
        }
    }
}

/// The neighbours of a texel: how far they go to both sides in the row of the texel and in those above and below it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Window(Vec<usize>);

impl Window {
    /// Radii in texels along both axes.
    pub(super) fn square(radius: DVec2) -> Self {
        Self(vec![radius.x as usize; radius.y as usize + 1])
    }

    /// Texels whose centres lie within an ellipse about that of the texel.
    pub(super) fn disc(radius: DVec2) -> Self {
        let half = |row: usize| {
            let off = if radius.y > 0.0 { row as f64 / radius.y } else { 0.0 };
            // Just inside counts as inside, whatever the rounding.
            (radius.x * (1.0 - off * off).max(0.0).sqrt() + 1e-9) as usize
        };
        Self((0..=(radius.y + 1e-9) as usize).map(half).collect())
    }

    /// Whether all rows reach as far.
    fn is_square(&self) -> bool {
        self.0.iter().all(|&half| half == self.0[0])
    }
}

/// Dilates, then erodes.
pub(super) fn closed(depths: &mut [f32], size: [usize; 2], window: &Window) {
    filter(depths, size, window, Extremum::Least);
    filter(depths, size, window, Extremum::Largest);
}

/// The extremum of the window of every texel; what lies beside the map takes no part.
pub(super) fn filter(depths: &mut [f32], [width, height]: [usize; 2], window: &Window, of: Extremum) {
    if window.is_square() {
        along_rows(depths, width, window.0[0], of);
        let mut turned = transposed(depths, [width, height]);
        along_rows(&mut turned, height, window.0.len() - 1, of);
        depths.copy_from_slice(&transposed(&turned, [height, width]));
        return;
    }
    let mut found = vec![of.nothing() as f32; depths.len()];
    let mut halves: Vec<usize> = window.0.clone();
    halves.dedup();
    for half in halves {
        let mut row_wise = depths.to_vec();
        along_rows(&mut row_wise, width, half, of);
        let offs: Vec<isize> = (0..window.0.len())
            .filter(|&row| window.0[row] == half)
            .flat_map(|row| if row == 0 { vec![0] } else { vec![row as isize, -(row as isize)] })
            .collect();
        found.par_chunks_mut(width).enumerate().for_each(|(j, row)| {
            for from in offs.iter().filter_map(|&off| j.checked_add_signed(off)).filter(|&from| from < height)
            {
                let values = &row_wise[from * width..(from + 1) * width];
                row.iter_mut().zip(values).for_each(|(found, &value)| *found = of.of(*found, value));
            }
        });
    }
    depths.copy_from_slice(&found);
}

fn along_rows(depths: &mut [f32], width: usize, half: usize, of: Extremum) {
    if half > 0 {
        depths.par_chunks_mut(width).for_each_init(Room::default, |room, row| {
            room.slide(row, [half; 2], of.nothing() as f32, |a, b| of.of(a, b));
        });
    }
}

fn transposed(values: &[f32], [width, height]: [usize; 2]) -> Vec<f32> {
    /// Columns that are copied together, so that what is read stays near.
    const TOGETHER: usize = 32;
    let mut turned = vec![0.0; values.len()];
    turned.par_chunks_mut(height * TOGETHER).enumerate().for_each(|(part, columns)| {
        let first = part * TOGETHER;
        for (j, row) in values.chunks_exact(width).enumerate() {
            for (column, &value) in columns.chunks_exact_mut(height).zip(&row[first..]) {
                column[j] = value;
            }
        }
    });
    turned
}

/// Room for running extrema.
#[derive(Debug)]
pub(super) struct Room<T> {
    values: Vec<T>,
    behind: Vec<T>,
}

impl<T> Default for Room<T> {
    fn default() -> Self {
        Self { values: Vec::new(), behind: Vec::new() }
    }
}

impl<T: Copy> Room<T> {
    /// Each value becomes the extremum of those from `before` places before it to `after` behind it.
    ///
    /// Three comparisons a value for any window (van Herk 1992, Gil and Werman 1993).
    pub(super) fn slide(
        &mut self,
        line: &mut [T],
        [before, after]: [usize; 2],
        nothing: T,
        of: impl Fn(T, T) -> T,
    ) {
        let Self { values, behind } = self;
        // Beyond the ends there is nothing, however long the window.
        let [before, after] = [before, after].map(|side| side.min(line.len()));
        let window = before + after + 1;
        values.clear();
        values.resize(before, nothing);
        values.extend_from_slice(line);
        values.resize((before + line.len() + after).next_multiple_of(window), nothing);
        behind.clear();
        behind.extend_from_slice(values);
        for (ahead, behind) in values.chunks_exact_mut(window).zip(behind.chunks_exact_mut(window)) {
            for k in 1..window {
                ahead[k] = of(ahead[k], ahead[k - 1]);
                behind[window - 1 - k] = of(behind[window - 1 - k], behind[window - k]);
            }
        }
        for (k, value) in line.iter_mut().enumerate() {
            *value = of(behind[k], values[k + window - 1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depths([width, height]: [usize; 2], seed: usize) -> Vec<f32> {
        let value = |k: usize| match k * 7919 % 31 * (k + seed) % 17 {
            0 | 1 => f32::INFINITY,
            value => value as f32,
        };
        (0..width * height).map(value).collect()
    }

    /// Whether a texel that lies so far away belongs to a window.
    type Near<'a> = &'a dyn Fn(f64, f64) -> bool;

    /// By definition: all texels of a window, one by one.
    fn by_hand(depths: &[f32], [width, height]: [usize; 2], is_near: Near, of: Extremum) -> Vec<f32> {
        let texel = |k: usize| [(k % width) as f64, (k / width) as f64];
        let near = |k: usize| {
            let [x, y] = texel(k);
            let neighbours = (0..width * height).filter(move |&n| is_near(texel(n)[0] - x, texel(n)[1] - y));
            neighbours.map(|n| depths[n]).fold(of.nothing() as f32, |a, b| of.of(a, b))
        };
        (0..width * height).map(near).collect()
    }

    #[test]
    fn squares_and_discs_are_what_their_definitions_say() {
        for (seed, size) in [[1, 1], [7, 5], [40, 33], [3, 50]].into_iter().enumerate() {
            for radius in [0.0, 1.0, 2.5, 5.0, 60.0] {
                let radii = DVec2::new(radius, 0.6 * radius);
                let square = |x: f64, y: f64| x.abs() <= radii.x && y.abs() <= radii.y;
                let disc = |x: f64, y: f64| {
                    (if radius > 0.0 { (x / radii.x).hypot(y / radii.y) } else { x.hypot(y) })
                        <= 1e-9 + f64::from(radius > 0.0)
                };
                let kinds: [(Window, Near); 2] =
                    [(Window::square(radii), &square), (Window::disc(radii), &disc)];
                for (window, is_near) in kinds {
                    for of in [Extremum::Least, Extremum::Largest] {
                        let all = depths(size, seed);
                        let mut found = all.clone();
                        filter(&mut found, size, &window, of);
                        assert_eq!(found, by_hand(&all, size, is_near, of), "{size:?}, {radius}, {of:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn closing_fills_what_is_narrower_than_the_kernel_and_nothing_else() {
        let size = [64, 64];
        let hole = |width: usize| -> Vec<f32> {
            let is_hole =
                |k: usize| (20..20 + width).contains(&(k % 64)) && (20..20 + width).contains(&(k / 64));
            (0..64 * 64).map(|k| if is_hole(k) { f32::INFINITY } else { 3.0 }).collect()
        };
        for window in [Window::square(DVec2::splat(4.0)), Window::disc(DVec2::splat(4.0))] {
            let mut narrow = hole(6);
            closed(&mut narrow, size, &window);
            assert!(narrow.iter().all(|&depth| depth == 3.0));
            let mut once = hole(12);
            closed(&mut once, size, &window);
            assert!(once[26 * 64 + 26] == f32::INFINITY);
            let mut twice = once.clone();
            closed(&mut twice, size, &window);
            assert_eq!(once, twice);
        }
    }
}
