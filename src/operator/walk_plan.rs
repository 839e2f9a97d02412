use super::parallel;
use crate::march::Traversal;

/// Rows that are walked to foresee how long the others are.
const SAMPLES: usize = 4096;

/// What walking the rows of a traversal will take, foreseen from a sample of them.
#[derive(Debug, Clone)]
pub struct WalkPlan {
    /// The number of rows.
    pub rows: usize,
    /// The number of elements.
    pub elements: usize,
    /// Rows of the sample.
    pub sampled: usize,
    /// How often the sample visits each block of [`WalkPlan::BLOCK`] elements; the last block may have fewer.
    pub visits: Vec<u64>,
    /// Foreseen number of non-zeros.
    pub nonzeros: u64,
}

impl WalkPlan {
    /// Elements a block.
    pub const BLOCK: usize = 64;

    /// Walks every few rows of a traversal, at most 4096 of them.
    pub fn new<const C: usize>(traversal: &impl Traversal<f64, C>) -> Self {
        let (rows, elements) = (traversal.rows(), traversal.elements());
        let stride = rows.div_ceil(SAMPLES).max(1);
        let sampled: Vec<usize> = (0..rows).step_by(stride).collect();
        let blocks = elements.div_ceil(Self::BLOCK);
        let pieces: Vec<&[usize]> = sampled.chunks(256).collect();
        let counts = parallel::map(pieces.len(), &|piece| {
            let mut visits = vec![0u64; blocks];
            for &row in pieces[piece] {
                traversal.walk_shared(row, &mut |element, _| visits[element / Self::BLOCK] += 1);
            }
            visits
        });
        let mut visits = vec![0u64; blocks];
        counts
            .iter()
            .flat_map(|count| count.iter().enumerate())
            .for_each(|(block, count)| visits[block] += count);
        let mut plan = Self { rows, elements, sampled: sampled.len(), visits, nonzeros: 0 };
        plan.nonzeros = (plan.nonzeros_a_row() * rows as f64).ceil() as u64;
        plan
    }

    /// The same with one weight for all channels of grey rows, and with one a channel of others.
    pub fn of(traversal: &(impl Traversal<f64, 1> + Traversal<f64, 3>), is_grey: bool) -> Self {
        if is_grey { Self::new::<1>(traversal) } else { Self::new::<3>(traversal) }
    }

    /// The mean number of non-zeros of a sampled row.
    pub fn nonzeros_a_row(&self) -> f64 {
        self.visits.iter().sum::<u64>() as f64 / self.sampled.max(1) as f64
    }
}
