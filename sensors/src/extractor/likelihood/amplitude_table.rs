use alloc::{boxed::Box, vec::Vec};
use core::f64::consts::TAU;

use super::gain_table::{GainTable, ROWS};

/// Decibels to one natural logarithm of an amplitude: 20 log₁₀ e.
pub(super) const DB: f64 = 20.0 * core::f64::consts::LOG10_E;

/// An antenna's amplitude over that of its mean gain, tabulated like the gain, so that a loop over
/// looks is vectorised.
#[derive(Clone, Debug)]
pub(super) struct AmplitudeTable {
    /// The amplitude at equal steps counter-clockwise from boresight, and the rise to the next one.
    /// The second half goes on from the other end of the turn.
    rows: Box<[[f64; 2]; LENGTH]>,
}

/// A power of two above [`ROWS`]: the lowest bits of a number of either sign are its row.
const LENGTH: usize = 1024;

/// Adding it rounds a number to a whole one, which then stands in the lowest bits.
const ROUND: f64 = 6_755_399_441_055_744.0;

impl AmplitudeTable {
    pub(super) fn new(gain: &GainTable) -> Self {
        let turn: Vec<f64> = gain.rows().iter().map(|row| libm::exp(row / DB)).collect();
        let rows = core::array::from_fn(|i| {
            let row = if i < LENGTH / 2 { i } else { i + turn.len() - LENGTH };
            let from = turn[row];
            let to = turn[(row + 1) % turn.len()];
            [from, to - from]
        });
        Self { rows: Box::new(rows) }
    }

    /// The amplitude at `turns` counter-clockwise of boresight, and its slope per radian.
    #[inline(always)]
    pub(super) fn with_slope(&self, turns: f64) -> (f64, f64) {
        let within = turns - ((turns + ROUND) - ROUND);
        let place = within * f64::from(ROWS);
        // Half a row lower, the nearest row is the one before.
        let before = (place - 0.5) + ROUND;
        let share = place - (before - ROUND);
        #[expect(clippy::cast_possible_truncation, reason = "the lowest bits count")]
        let [from, rise] = self.rows[before.to_bits() as usize % LENGTH];
        (from + rise * share, rise * (f64::from(ROWS) / TAU))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PatternTable;

    #[test]
    fn it_is_that_of_the_gain_any_number_of_turns_on() {
        let gain = GainTable::new(&PatternTable::reference_patch(), 0.0);
        let table = AmplitudeTable::new(&gain);
        let amplitude = |row: f64| libm::exp(gain.at(row * TAU / f64::from(ROWS)) / DB);
        for row in -2160..2160_i32 {
            let row = f64::from(row);
            let from = amplitude(row);
            let to = amplitude(row + 1.0);
            let (value, slope) = table.with_slope((row + 0.25) / f64::from(ROWS));
            assert!((value - (0.75 * from + 0.25 * to)).abs() < 1e-9, "row {row}: {value}");
            let rise = slope * TAU / f64::from(ROWS);
            assert!((rise - (to - from)).abs() < 1e-9, "row {row}: {rise}");
        }
    }
}
