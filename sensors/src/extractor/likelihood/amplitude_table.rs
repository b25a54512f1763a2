use alloc::boxed::Box;
use core::f64::consts::TAU;

use super::{
    gain_table::{GainTable, ROWS},
    two_paths::DB,
};

/// An antenna's amplitude over that of its mean gain, tabulated like the gain, so that a loop over
/// looks is vectorised.
#[derive(Clone, Debug)]
pub(super) struct AmplitudeTable {
    /// The amplitude at equal steps counter-clockwise from boresight, and what the next one is
    /// larger by. The second half goes on from the other end of the turn.
    rows: Box<[[f64; 2]; LENGTH]>,
}

/// A power of two above [`ROWS`]: the lowest bits of a number of either sign are its row.
const LENGTH: usize = 1024;

/// Adding it rounds a number to a whole one, which then stands in the lowest bits.
const ROUND: f64 = 6_755_399_441_055_744.0;

impl AmplitudeTable {
    pub(super) fn new(gain: &GainTable) -> Self {
        let half = LENGTH as i32 / 2;
        let rows = gain.rows();
        let amplitude = |row: i32| libm::exp(rows[row.rem_euclid(i32::from(ROWS)) as usize] / DB);
        let mut table = Box::new([[0.0; 2]; LENGTH]);
        for (row, out) in (0..half).chain(-half..0).zip(table.iter_mut()) {
            *out = [amplitude(row), amplitude(row + 1) - amplitude(row)];
        }
        Self { rows: table }
    }

    /// The amplitude so many turns counter-clockwise of boresight, and its slope per radian.
    #[inline(always)]
    pub(super) fn with_slope(&self, turns: f64) -> (f64, f64) {
        let within = turns - ((turns + ROUND) - ROUND);
        let place = within * f64::from(ROWS);
        let before = (place - 0.5) + ROUND;
        let share = place - (before - ROUND);
        #[expect(clippy::cast_possible_truncation, reason = "the lowest bits count")]
        let [from, rise] = self.rows[before.to_bits() as usize % LENGTH];
        (from + rise * share, rise * (f64::from(ROWS) / TAU))
    }
}
