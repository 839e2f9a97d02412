use super::adapter::{AdapterRecord, Choice};
use super::{Gpu, GpuVector, Kept, RowTable};
use crate::operator::{LinearOperator, Vector};
use crate::{Error, Result};

/// Elements of the vectors that are tried: several workgroups, and no multiple of one.
const ELEMENTS: usize = 10_007;

/// Lets an adapter compute what is known: sums of integers, and a product with a matrix of integers, which f32 holds
/// exactly.
///
/// Errors: [`Error::Adapter`] when it computes something else, or cannot.
pub fn known_answers(record: &AdapterRecord) -> Result<()> {
    let gpu = Gpu::open(&Choice { name: Some(record.name.clone()), ..Choice::default() })?;
    let (mut x, mut y) = (GpuVector::zeros(&gpu, ELEMENTS), GpuVector::zeros(&gpu, ELEMENTS));
    let counted: Vec<[f64; 3]> = (0..ELEMENTS).map(|k| [(k % 7) as f64, 1.0, -((k % 3) as f64)]).collect();
    x.set_from_host(&counted)?;
    y.fill([2.0, 3.0, 4.0]);
    y.axpby([1.0; 3], &x, [1.0, 2.0, 0.5]);
    let expected = counted.iter().fold([0.0; 3], |sum, [r, g, b]| {
        [sum[0] + r * (r + 2.0), sum[1] + g * (g + 6.0), sum[2] + b * (b + 2.0)]
    });
    agree(&gpu, "the sum of a product", x.dot(&y)?, expected)?;

    // Row k holds 1 at k and 2 at the element after it.
    let table = RowTable {
        offsets: (0..ELEMENTS).map(|row| 2 * row).collect(),
        elements: (0..ELEMENTS as u32 - 1).flat_map(|row| [row, row + 1]).collect(),
        weights: vec![[1.0, 2.0].repeat(ELEMENTS - 1)],
    };
    let kept = Kept::new(&gpu, table, ELEMENTS)?;
    let mut shown = kept.range();
    kept.apply(&x, &mut shown)?;
    let got = shown.to_host()?;
    let truth = |row: usize, c: usize| counted[row][c] + 2.0 * counted[row + 1][c];
    for row in [0, 1, 255, 256, ELEMENTS - 2] {
        agree(&gpu, "a product with a matrix", got[row], std::array::from_fn(|c| truth(row, c)))?;
    }
    Ok(())
}

fn agree(gpu: &Gpu, what: &str, got: [f64; 3], expected: [f64; 3]) -> Result<()> {
    if got == expected {
        return Ok(());
    }
    Err(Error::Adapter {
        adapter: gpu.record().name.clone(),
        problem: format!("computes {what} wrong: {got:?} instead of {expected:?}"),
        remedy: "update its driver, or use --backend cpu",
    })
}
