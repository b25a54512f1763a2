use alloc::{vec, vec::Vec};

use super::area::Interval;

/// A part of a row, and where that is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Strip {
    pub(super) north: f64,
    pub(super) ends: Interval,
}

/// The cells of rows, from the South: within one of them each row is in one piece, so that it can
/// be swept back and forth (boustrophedon decomposition, Choset & Pignon 1998). A cell ends where a
/// row falls apart, or several become one.
pub(super) fn cells(rows: &[(f64, Vec<Interval>)]) -> Vec<Vec<Strip>> {
    let mut cells: Vec<Vec<Strip>> = Vec::new();
    // The intervals of the row before, and the cell that each is in.
    let mut before: Vec<(Interval, usize)> = Vec::new();
    for (north, intervals) in rows {
        let mut now = Vec::new();
        for &ends in intervals {
            let meets = |other: &Interval| other.0 <= ends.1 && ends.0 <= other.1;
            let mut below = before.iter().filter(|(other, _)| meets(other));
            let strip = Strip { north: *north, ends };
            let cell = match (below.next(), below.next()) {
                (Some(&(other, cell)), None) if one_above(&other, intervals) => {
                    cells[cell].push(strip);
                    cell
                }
                _ => {
                    cells.push(vec![strip]);
                    cells.len() - 1
                }
            };
            now.push((ends, cell));
        }
        before = now;
    }
    cells
}

/// Returns true if exactly one interval of a row meets one of the row before.
fn one_above(below: &Interval, row: &[Interval]) -> bool {
    row.iter().filter(|i| i.0 <= below.1 && below.0 <= i.1).count() == 1
}
