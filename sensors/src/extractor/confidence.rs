use core::{
    f64::consts::{FRAC_PI_4, LN_10, TAU},
    mem,
};

use foxhunt_core::{angle::Resultant, elementary};

use super::{Cell, Pattern};

/// Similarity of a turn to one transmitter received through one main lobe: the mean resultant
/// length of the received power over the circle (Mardia & Jupp 2000, §2.3), times the share of the
/// circle that was received.
///
/// Each measured position weighs its mean power in milliwatt times its arc, half the way to either
/// measured neighbour and at most 45° in all, so that unevenly spaced positions count for the part
/// of the circle that they stand for. In [0, 1]: 0.8 for the reference patch whatever the number of
/// positions, 0 for a flat pattern. It grows with the antenna's directivity, and it does not know
/// of reflections: a second path of half the amplitude costs it a fifth.
#[must_use]
pub fn resultant_confidence(pattern: &Pattern) -> f64 {
    let cells = pattern.cells();
    let maximum_dbm = pattern.maximum_dbm();
    #[expect(clippy::cast_precision_loss, reason = "a turn has at most 360 positions")]
    let half_step = 0.5 * TAU / cells.len() as f64;
    let mut resultant = Resultant::default();
    let mut measured = 0.0;
    let is_empty = |cell: &&Cell| cell.count() == 0;
    let first = cells.iter().take_while(is_empty).count();
    let mut before = first + cells.iter().rev().take_while(is_empty).count();
    for (index, cell) in cells.iter().enumerate() {
        let Some(mean_dbm) = cell.mean_dbm() else { continue };
        let next = cells.iter().skip(index + 1);
        let empty = next.take_while(is_empty).count();
        let after = if index + 1 + empty < cells.len() { empty } else { empty + first };
        let steps = mem::replace(&mut before, after) + after + 2;
        #[expect(clippy::cast_precision_loss, reason = "as above")]
        let arc = (half_step * steps as f64).min(FRAC_PI_4);
        measured += arc;
        // Relative to the strongest, so that no power underflows.
        let relative_db = mean_dbm - maximum_dbm;
        resultant += cell.direction(arc * elementary::exp(0.1 * LN_10 * relative_db));
    }
    (resultant.length() * (measured / TAU)).clamp(0.0, 1.0)
}
