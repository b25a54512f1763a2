use alloc::vec::Vec;

use nalgebra::Vector2;

/// Returns the highest maxima of square cells, row by row, `side` to a row: at most `most` of them,
/// the highest first.
///
/// A cell is a maximum if none of its up to eight neighbours is higher: of a plateau every cell is
/// one. Cells beyond the last whole row are left out.
#[must_use]
pub fn peaks(cells: &[(Vector2<f64>, f64)], side: usize, most: usize) -> Vec<(Vector2<f64>, f64)> {
    let rows: Vec<&[(Vector2<f64>, f64)]> = cells.chunks_exact(side.max(1)).collect();
    let mut maxima = Vec::new();
    for (row, own) in rows.iter().enumerate() {
        let near = rows.get(row.saturating_sub(1)..(row + 2).min(rows.len())).unwrap_or_default();
        for (column, cell) in own.iter().enumerate() {
            let columns = column.saturating_sub(1)..(column + 2).min(side);
            let mut about =
                near.iter().flat_map(|row| row.get(columns.clone()).unwrap_or_default());
            if about.all(|other| other.1 <= cell.1) {
                maxima.push(*cell);
            }
        }
    }
    maxima.sort_by(|a, b| b.1.total_cmp(&a.1));
    maxima.truncate(most);
    maxima
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_highest_of_their_neighbourhoods_are_found() {
        #[rustfmt::skip]
        let heights = [
            5.0, 1.0, 2.0,
            1.0, 1.0, 3.0,
            4.0, 1.0, 1.0,
        ];
        let place = |i: u8| Vector2::new(f64::from(i % 3), f64::from(i / 3));
        let cells: Vec<_> = (0..).zip(heights).map(|(i, height)| (place(i), height)).collect();
        let at = |x, y, height| (Vector2::new(x, y), height);
        let all = [at(0.0, 0.0, 5.0), at(0.0, 2.0, 4.0), at(2.0, 1.0, 3.0)];
        assert_eq!(peaks(&cells, 3, 9), all);
        assert_eq!(peaks(&cells, 3, 2), all[..2]);
        assert_eq!(peaks(&[], 3, 9), []);
        assert_eq!(peaks(&cells, 0, 1), [at(0.0, 0.0, 5.0)]);
    }
}
