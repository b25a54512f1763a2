//! An antenna's gain and what follows from it, tabulated so that loops over looks are fast.

use alloc::{boxed::Box, vec::Vec};
use core::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::super::{Look, NODES};
use crate::Antenna;

/// Rows of half a degree: between them the gain is taken as linear, which errs by less than
/// 0.003 dB on a lobe of 30°.
const ROWS: u16 = 720;

/// Rows from one node to the next.
const STEP: usize = (ROWS / NODES) as usize;
const _: () = assert!(ROWS.is_multiple_of(NODES), "a step is a whole number of rows");

/// Decibels to one natural logarithm of an amplitude: 20 log₁₀ e.
pub(super) const DB: f64 = 20.0 * core::f64::consts::LOG10_E;

/// A power of two above [`ROWS`]: the lowest bits of a number of either sign are its row.
const LENGTH: usize = 1024;

/// Adding it rounds a number to a whole one, which then stands in the lowest bits.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// 10 log₁₀ e.
const POWER_DB: f64 = 10.0 * core::f64::consts::LOG10_E;

/// An antenna's gain about its mean over a turn, tabulated for beacons at one elevation: a fit
/// evaluates it some ten thousand times.
#[derive(Clone, Debug)]
pub(super) struct GainTable {
    /// The gain over its mean in dB, at equal steps counter-clockwise from boresight; the last is
    /// the first.
    rows: Vec<f64>,
    /// The gains by their place within a node's step, each over two turns of nodes.
    nodes: [Vec<f64>; STEP],
    mean_db: f64,
    elevation: f64,
}

impl GainTable {
    pub(super) fn new(antenna: &impl Antenna, elevation: f64) -> Self {
        let mean_db = antenna.mean_gain_db(elevation);
        let gain = |row| antenna.gain_dbi(TAU * f64::from(row) / f64::from(ROWS), elevation);
        let rows: Vec<f64> = (0..=ROWS).map(|row| gain(row) - mean_db).collect();
        Self { nodes: by_node(&rows), rows, mean_db, elevation }
    }

    /// The rows of a turn.
    fn rows(&self) -> &[f64] {
        &self.rows[..usize::from(ROWS)]
    }

    /// A table of the same kind with something made of each row.
    fn map(&self, change: impl Fn(f64) -> f64) -> Self {
        let rows: Vec<f64> = self.rows.iter().map(|row| change(*row)).collect();
        Self { nodes: by_node(&rows), rows, ..*self }
    }

    /// The value `azimuth` radians counter-clockwise of boresight.
    pub(super) fn at(&self, azimuth: f64) -> f64 {
        self.with_slope(azimuth).0
    }

    /// The value and its slope per radian.
    #[inline]
    pub(super) fn with_slope(&self, azimuth: f64) -> (f64, f64) {
        let (row, share) = row_of(azimuth);
        // One more row than a turn has: the first again.
        let from = self.rows[row];
        let to = self.rows[row + 1];
        (from + (to - from) * share, (to - from) * (f64::from(ROWS) / TAU))
    }

    /// The values for bearings at equal steps over a turn, from `azimuth` on. A step is a whole
    /// number of rows, so that all of them lie at one place between two rows.
    #[inline(always)]
    pub(super) fn around(&self, azimuth: f64, out: &mut [f64; NODES as usize]) {
        let (first, share) = row_of(azimuth);
        let rows = |row: usize| &self.nodes[row % STEP][row / STEP..];
        for ((out, from), to) in out.iter_mut().zip(rows(first)).zip(rows(first + 1)) {
            *out = from + (to - from) * share;
        }
    }

    /// The gain over its mean through a tilted antenna, for a beacon in the world direction
    /// `bearing`: not from the table.
    pub(super) fn tilted(&self, antenna: &impl Antenna, look: &Look, bearing: f64) -> f64 {
        let flat = libm::cos(self.elevation);
        let world = Vector3::new(
            flat * libm::cos(bearing),
            flat * libm::sin(bearing),
            libm::sin(self.elevation),
        );
        let body = look.receiver.to_body(&world);
        let azimuth = libm::atan2(body.y, body.x) - look.mount;
        antenna.gain_dbi(azimuth, libm::asin(body.z.clamp(-1.0, 1.0))) - self.mean_db
    }
}

/// An antenna's amplitude over that of its mean gain, tabulated like the gain, so that a loop over
/// looks is vectorised.
#[derive(Clone, Debug)]
pub(super) struct AmplitudeTable {
    /// The amplitude at equal steps counter-clockwise from boresight, and the rise to the next one.
    /// The second half goes on from the other end of the turn.
    rows: Box<[[f64; 2]; LENGTH]>,
}

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

/// Effect of diffuse reflections on a pattern: along every boresight a signal's direct wave meets
/// the sum of many weaker ones from all around, so that its power is Rician (Rice 1945).
///
/// For a reflected amplitude `ratio` times the direct one, the reflected power is `ratio`² times
/// the mean gain along every boresight; K is the direct power over it. The back of a pattern is all
/// reflections, its main lobe hardly.
#[derive(Clone, Debug)]
pub(super) struct Fading {
    /// The variance of the logarithm in dB² by the angle off boresight.
    variance: GainTable,
}

impl Fading {
    pub(super) fn new(gain: &GainTable, ratio: f64) -> Self {
        let count: f64 = gain.rows().iter().map(|_| 1.0).sum();
        let mean = gain.rows().iter().map(|row| libm::exp(row / POWER_DB)).sum::<f64>() / count;
        let variance = |row: f64| {
            let factor = libm::exp(row / POWER_DB) / (ratio * ratio * mean);
            POWER_DB * POWER_DB * log_power_variance(factor)
        };
        Self { variance: gain.map(variance) }
    }

    /// The variance in dB² that a boresight `azimuth` radians clockwise of the signal has.
    pub(super) fn variance(&self, azimuth: f64) -> f64 {
        self.variance.at(azimuth)
    }
}

/// Every fourth row, from each of the first four on: a loop over nodes reads a column.
fn by_node(rows: &[f64]) -> [Vec<f64>; STEP] {
    let turn = &rows[..usize::from(ROWS)];
    let from = |first| turn.iter().chain(turn).skip(first).step_by(STEP).copied().collect();
    core::array::from_fn(from)
}

/// The row before an azimuth, and the share of the step from there to the azimuth.
#[inline]
fn row_of(azimuth: f64) -> (usize, f64) {
    const ROW: i32 = ROWS as i32;
    let place = azimuth * (f64::from(ROWS) / TAU);
    #[expect(clippy::cast_possible_truncation, reason = "a few turns at most")]
    let whole = place as i32;
    let below = whole - i32::from(f64::from(whole) > place);
    let row = below.rem_euclid(ROW) as usize;
    (row, place - f64::from(below))
}

/// The variance of the logarithm of a Rician power: π²/6 without a direct wave, 2/K with a strong
/// one (the delta method); between them a formula that has both limits.
fn log_power_variance(factor: f64) -> f64 {
    1.0 / (6.0 / (PI * PI) + 0.5 * factor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PatternTable;
    use approx::abs_diff_eq;

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
            assert!(abs_diff_eq!(rise, to - from, epsilon = 1e-9), "row {row}: {rise}");
        }
    }
}
