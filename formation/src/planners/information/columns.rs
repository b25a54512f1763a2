use alloc::vec::Vec;

use super::TARGETS;

/// A number for each of [`TARGETS`] cells.
pub(super) type Column = [f64; TARGETS];

/// Some numbers of each cell in columns. The last cell fills up the last block, so that no loop has
/// a rest.
pub(super) fn blocks<T, const N: usize>(
    cells: &[T],
    numbers: impl Fn(&T) -> [f64; N],
) -> Vec<[Column; N]> {
    let block = |cells: &[T]| {
        let mut block = [[0.0; TARGETS]; N];
        for row in 0..TARGETS {
            let numbers = numbers(&cells[row.min(cells.len() - 1)]);
            block.iter_mut().zip(numbers).for_each(|(column, number)| column[row] = number);
        }
        block
    };
    cells.chunks(TARGETS).map(block).collect()
}

/// Σ aᵢ bᵢ, in the same order everywhere.
#[inline(always)]
pub(super) fn dot(a: &Column, b: &Column) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum()
}
