use std::sync::Arc;

/// The order in which rows are kept and walked.
#[derive(Debug, Clone, Default)]
pub struct RowOrder {
    /// The row at each position, and the position of each row; both are empty where every row is at its own place.
    rows: Arc<[u32]>,
    positions: Arc<[u32]>,
}

impl RowOrder {
    /// An order in which each row comes once; none is that of their numbers.
    pub fn new(rows: Option<Vec<u32>>) -> Self {
        let rows = rows.unwrap_or_default();
        let mut positions = vec![0; rows.len()];
        rows.iter().zip(0..).for_each(|(&row, position)| positions[row as usize] = position);
        Self { rows: rows.into(), positions: positions.into() }
    }

    /// The row at each position; nothing where every row is at its own place.
    pub fn rows(&self) -> &[u32] {
        &self.rows
    }

    /// The row at a position.
    #[inline]
    pub fn row(&self, position: usize) -> usize {
        self.rows.get(position).map_or(position, |&row| row as usize)
    }

    /// The position of a row.
    #[inline]
    pub fn position(&self, row: usize) -> usize {
        self.positions.get(row).map_or(row, |&position| position as usize)
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.rows[..]) + size_of_val(&self.positions[..])
    }
}
