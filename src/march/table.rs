use std::sync::Arc;

use super::{Real, Traversal, Weight};

/// A pixel that looks its colour up in a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lookup {
    /// The texels around its place and their shares, which add up to 1; what has no share may be any texel.
    pub corners: [(usize, f64); 4],
    /// What it shows where the table is white: radiance, a number a channel.
    pub white: [f64; 3],
}

/// The traversal of pixels that look their colour up in a table: a transfer function that is looked for.
///
/// Row k holds for texel i the weight `wₖ vᵢ`, with wₖ what the pixel shows of white and vᵢ the bilinear share of the texel.
///
/// Shapes  rows: pixels; elements: texels of the table, row by row
/// Units   weights: radiance; elements: dimensionless
/// Cost    four weights a row
#[derive(Debug, Clone)]
pub struct TableTraversal {
    texels: usize,
    lookups: Arc<[Lookup]>,
}

impl TableTraversal {
    /// The rows of `lookups` in a table of so many texels.
    pub fn new(texels: usize, lookups: impl Into<Arc<[Lookup]>>) -> Self {
        Self { texels, lookups: lookups.into() }
    }

    /// What is looked up, a row each.
    pub fn lookups(&self) -> &[Lookup] {
        &self.lookups
    }

    /// Some of its rows.
    pub fn picked(&self, rows: &[usize]) -> Self {
        Self { lookups: rows.iter().map(|&row| self.lookups[row]).collect(), ..*self }
    }

    /// Whether one weight serves all channels.
    pub fn is_grey(&self) -> bool {
        self.lookups.iter().all(|lookup| lookup.white == [lookup.white[0]; 3])
    }
}

impl<F: Real, const C: usize> Traversal<F, C> for TableTraversal {
    fn rows(&self) -> usize {
        self.lookups.len()
    }

    fn elements(&self) -> usize {
        self.texels
    }

    #[inline]
    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<F, C>)) {
        let Lookup { corners, white } = self.lookups[row];
        for (texel, share) in corners.into_iter().filter(|(_, share)| *share > 0.0) {
            visit(texel, std::array::from_fn(|c| F::of(share * white[c])));
        }
    }
}
