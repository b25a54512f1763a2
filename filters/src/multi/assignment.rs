//! The cheapest assignment of rows to columns.

use alloc::{vec, vec::Vec};

use nalgebra::DMatrix;

/// An assignment of each row of a cost matrix to a column of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Assignment {
    /// Column of each row.
    pub columns: Vec<usize>,
    /// Sum of the costs.
    pub cost: f64,
}

/// Returns the assignment of each row to a column of its own with the least sum of costs; a cost
/// of +∞ forbids a pair.
///
/// Shortest augmenting paths over reduced costs (Jonker & Volgenant 1987; the rectangular form is
/// that of Crouse 2016), O(rows² columns).
///
/// `None` if there are more rows than columns, if a cost is NaN or −∞, or if the forbidden
/// pairs leave no complete assignment.
///
/// ```
/// use foxhunt_core::nalgebra::DMatrix;
/// use foxhunt_filters::multi::assign;
///
/// let costs = DMatrix::from_row_slice(2, 3, &[1.0, 2.0, 9.0, 1.0, 5.0, 9.0]);
/// let cheapest = assign(&costs).expect("finite costs");
/// assert_eq!(cheapest.columns, [1, 0]);
/// assert!((cheapest.cost - 3.0).abs() < 1e-12);
/// ```
#[must_use]
pub fn assign(costs: &DMatrix<f64>) -> Option<Assignment> {
    let (rows, columns) = costs.shape();
    let unusable = |cost: &f64| cost.is_nan() || *cost < f64::MIN;
    if rows > columns || costs.iter().any(unusable) {
        return None;
    }
    // Dual variables: the reduced costs c − u − v are not negative.
    let mut row_price = vec![0.0; rows];
    let mut column_price = vec![0.0; columns];
    let mut row_of: Vec<Option<usize>> = vec![None; columns];
    for first in 0..rows {
        let mut shortest = vec![f64::INFINITY; columns];
        let mut before: Vec<Option<usize>> = vec![None; columns];
        let mut done = vec![false; columns];
        let mut row = first;
        let mut column_before = None;
        let mut length = 0.0;
        let free = loop {
            let mut nearest: Option<usize> = None;
            for column in (0..columns).filter(|column| !done[*column]) {
                let reduced = costs[(row, column)] - row_price[row] - column_price[column];
                if length + reduced < shortest[column] {
                    shortest[column] = length + reduced;
                    before[column] = column_before;
                }
                if nearest.is_none_or(|best| shortest[column] < shortest[best]) {
                    nearest = Some(column);
                }
            }
            let column = nearest.filter(|column| shortest[*column] < f64::INFINITY)?;
            length = shortest[column];
            done[column] = true;
            match row_of[column] {
                Some(taken) => row = taken,
                None => break column,
            }
            column_before = Some(column);
        };
        row_price[first] += length;
        for column in (0..columns).filter(|column| done[*column] && *column != free) {
            let gap = length - shortest[column];
            column_price[column] -= gap;
            if let Some(row) = row_of[column] {
                row_price[row] += gap;
            }
        }
        // Turns the pairs along the path around.
        let mut column = free;
        while let Some(earlier) = before[column] {
            row_of[column] = row_of[earlier];
            column = earlier;
        }
        row_of[column] = Some(first);
    }
    let mut assigned = vec![0; rows];
    for (column, row) in row_of.iter().enumerate() {
        if let Some(row) = row {
            assigned[*row] = column;
        }
    }
    let cost = assigned.iter().enumerate().map(|(row, column)| costs[(row, *column)]).sum();
    Some(Assignment { columns: assigned, cost })
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use proptest::prelude::*;

    use super::*;

    /// The least cost over all assignments, one by one.
    fn by_enumeration(costs: &DMatrix<f64>, row: usize, taken: &mut Vec<usize>) -> f64 {
        if row == costs.nrows() {
            return 0.0;
        }
        let mut least = f64::INFINITY;
        for column in 0..costs.ncols() {
            if !taken.contains(&column) {
                taken.push(column);
                least = least.min(costs[(row, column)] + by_enumeration(costs, row + 1, taken));
                taken.pop();
            }
        }
        least
    }

    proptest! {
        #[test]
        fn the_cheapest_of_all_assignments_is_found(
            rows in 0..5_usize,
            more in 0..3_usize,
            values in proptest::collection::vec(
                prop_oneof![4 => -9.0..9.0_f64, 1 => Just(f64::INFINITY)], 35),
        ) {
            let costs = DMatrix::from_fn(rows, rows + more, |i, j| values[i * 7 + j]);
            let least = by_enumeration(&costs, 0, &mut Vec::new());
            match assign(&costs) {
                Some(found) => {
                    prop_assert!(abs_diff_eq!(found.cost, least, epsilon = 1e-9), "{costs}");
                    let mut columns = found.columns;
                    columns.sort_unstable();
                    columns.dedup();
                    prop_assert_eq!(columns.len(), rows);
                }
                None => prop_assert!(least.is_infinite(), "{}", costs),
            }
        }
    }

    #[test]
    fn unusable_costs_are_refused() {
        assert_eq!(assign(&DMatrix::from_element(1, 1, f64::NAN)), None);
        assert_eq!(assign(&DMatrix::from_element(1, 1, f64::NEG_INFINITY)), None);
        assert_eq!(assign(&DMatrix::from_element(1, 2, f64::INFINITY)), None);
        assert_eq!(assign(&DMatrix::from_element(3, 2, 1.0)), None, "more rows than columns");
        let nothing = assign(&DMatrix::zeros(0, 4)).expect("empty");
        assert_abs_diff_eq!(nothing.cost, 0.0, epsilon = 0.0);
    }
}
