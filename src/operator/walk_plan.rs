use super::{RowOrder, parallel};
use crate::march::Traversal;

/// Rows that are walked to foresee how long the others are.
const SAMPLES: usize = 4096;
/// Rows of the sample that one task walks.
const ROWS_AT_ONCE: usize = 256;
/// Groups of neighbours of each of them in which is counted what they share.
const COMPARED: usize = 4;

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
    /// In which order rows are kept, so that neighbours meet the same elements.
    pub order: RowOrder,
    /// Non-zeros for each element that any of so many neighbours meets, as [`WalkPlan::NEIGHBOURS`] has them.
    pub shared: [f64; 2],
}

/// What a task has seen of its rows.
#[derive(Debug, Clone)]
struct Sampled {
    visits: Vec<u64>,
    /// Non-zeros of the groups that were compared, and the elements that any of so many neighbours has met.
    compared: u64,
    met: [u64; 2],
}

impl WalkPlan {
    /// Elements a block.
    pub const BLOCK: usize = 64;
    /// Neighbours that may be kept together.
    pub const NEIGHBOURS: [usize; 2] = [4, 8];

    /// Walks groups of neighbouring rows, every few groups, at most 4096 rows.
    pub fn new<const C: usize>(traversal: &impl Traversal<f64, C>) -> Self {
        const GROUP: usize = WalkPlan::NEIGHBOURS[1];
        let (rows, elements) = (traversal.rows(), traversal.elements());
        let order = RowOrder::new(traversal.row_order());
        let stride = rows.div_ceil(SAMPLES).max(1);
        let groups: Vec<usize> = (0..rows).step_by(GROUP * stride).collect();
        let tasks: Vec<&[usize]> = groups.chunks(ROWS_AT_ONCE / GROUP).collect();
        let sampled = parallel::map(tasks.len(), &|task| {
            let visits = vec![0; elements.div_ceil(Self::BLOCK)];
            let mut sampled = Sampled { visits, compared: 0, met: [0; 2] };
            for (number, &first) in tasks[task].iter().enumerate() {
                let group = first..(first + GROUP).min(rows);
                sampled.walk(traversal, group.map(|position| order.row(position)), number < COMPARED);
            }
            sampled
        });
        let mut visits = vec![0u64; elements.div_ceil(Self::BLOCK)];
        let (mut compared, mut met) = (0, [0; 2]);
        for sampled in &sampled {
            visits.iter_mut().zip(&sampled.visits).for_each(|(all, visits)| *all += visits);
            compared += sampled.compared;
            met.iter_mut().zip(sampled.met).for_each(|(all, met)| *all += met);
        }
        let shared = met.map(|met| if met == 0 { 1.0 } else { compared as f64 / met as f64 });
        let sampled = groups.iter().map(|&first| GROUP.min(rows - first)).sum();
        let mut plan = Self { rows, elements, sampled, visits, nonzeros: 0, order, shared };
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

impl Sampled {
    /// Walks neighbouring rows; `compares` says whether to count what they share.
    fn walk<const C: usize>(
        &mut self,
        traversal: &impl Traversal<f64, C>,
        rows: impl Iterator<Item = usize>,
        compares: bool,
    ) {
        // Elements, and which row of the group has met them.
        let mut met: Vec<(u32, u32)> = Vec::new();
        for (number, row) in rows.enumerate() {
            traversal.walk_shared(row, &mut |element, _| {
                self.visits[element / WalkPlan::BLOCK] += 1;
                if compares {
                    met.push((element as u32, number as u32));
                }
            });
        }
        self.compared += met.len() as u64;
        for (all, neighbours) in self.met.iter_mut().zip(WalkPlan::NEIGHBOURS) {
            met.iter_mut().for_each(|(_, number)| *number /= neighbours as u32);
            met.sort_unstable();
            met.dedup();
            *all += met.len() as u64;
        }
    }
}
