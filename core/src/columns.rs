//! Columns of numbers as slices.
//!
//! Plain functions of the kind of a column and of their number. A closure within `map` would be
//! compiled for each model, filter and kernel that has one: a twentieth of what a program of many
//! of them hands to the optimiser.

use core::{array, ops::Range};

/// Columns as slices.
///
/// ```
/// let columns = [vec![1.0, 2.0], vec![3.0, 4.0]];
/// assert_eq!(foxhunt_core::columns::slices(&columns), [&[1.0, 2.0], &[3.0, 4.0]]);
/// ```
#[inline(always)]
pub fn slices<C: AsRef<[f64]>, const K: usize>(columns: &[C; K]) -> [&[f64]; K] {
    array::from_fn(|k| columns[k].as_ref())
}

/// Columns as slices that can be written to.
#[inline(always)]
pub fn slices_mut<C: AsMut<[f64]>, const K: usize>(columns: &mut [C; K]) -> [&mut [f64]; K] {
    columns.each_mut().map(AsMut::as_mut)
}

/// The numbers of some rows.
///
/// # Panics
///
/// If a column is shorter.
///
/// ```
/// let columns = [vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0]];
/// assert_eq!(foxhunt_core::columns::rows(&columns, 1..3), [&[2.0, 3.0], &[5.0, 6.0]]);
/// ```
#[inline(always)]
pub fn rows<C: AsRef<[f64]>, const K: usize>(columns: &[C; K], rows: Range<usize>) -> [&[f64]; K] {
    let mut slices = slices(columns);
    for column in &mut slices {
        *column = &column[rows.start..rows.end];
    }
    slices
}

/// The numbers of some rows, which can be written to.
///
/// # Panics
///
/// If a column is shorter.
#[inline(always)]
pub fn rows_mut<C: AsMut<[f64]>, const K: usize>(
    columns: &mut [C; K],
    rows: Range<usize>,
) -> [&mut [f64]; K] {
    columns.each_mut().map(|column| &mut column.as_mut()[rows.start..rows.end])
}

/// One row.
///
/// # Panics
///
/// If a column is shorter.
#[inline(always)]
pub fn row<C: AsRef<[f64]>, const K: usize>(columns: &[C; K], i: usize) -> [f64; K] {
    let mut row = [0.0; K];
    for (number, column) in row.iter_mut().zip(columns) {
        *number = column.as_ref()[i];
    }
    row
}
