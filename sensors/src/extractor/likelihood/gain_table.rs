use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Vector3;

use super::looks::Look;
use crate::Antenna;

/// An antenna's gain about its mean over a turn, tabulated for beacons at one elevation: a fit asks
/// for it some ten thousand times.
#[derive(Clone, Debug)]
pub(super) struct GainTable {
    /// The gain over its mean in dB, at equal steps counter-clockwise from boresight; the last is
    /// the first.
    rows: Vec<f64>,
    mean_db: f64,
    elevation: f64,
}

/// Rows of half a degree: between them the gain is taken as linear, which errs by less than
/// 0.003 dB on a lobe of 30°.
const ROWS: u16 = 720;

impl GainTable {
    pub(super) fn new(antenna: &impl Antenna, elevation: f64) -> Self {
        let mean_db = antenna.mean_gain_db(elevation);
        let gain = |row| antenna.gain_dbi(TAU * f64::from(row) / f64::from(ROWS), elevation);
        let rows = (0..=ROWS).map(|row| gain(row) - mean_db).collect();
        Self { rows, mean_db, elevation }
    }

    /// The rows of a turn.
    pub(super) fn rows(&self) -> &[f64] {
        &self.rows[..usize::from(ROWS)]
    }

    /// A table of the same kind with something made of each row.
    pub(super) fn map(&self, change: impl Fn(f64) -> f64) -> Self {
        Self { rows: self.rows.iter().map(|row| change(*row)).collect(), ..*self }
    }

    /// The value `azimuth` radians counter-clockwise of boresight.
    pub(super) fn at(&self, azimuth: f64) -> f64 {
        self.with_slope(azimuth).0
    }

    /// The value and its slope per radian.
    pub(super) fn with_slope(&self, azimuth: f64) -> (f64, f64) {
        let turns = azimuth / TAU;
        let place = (turns - libm::floor(turns)) * f64::from(ROWS);
        #[expect(clippy::cast_possible_truncation, reason = "it lies between 0 and ROWS")]
        #[expect(clippy::cast_sign_loss, reason = "as above")]
        let row = place as usize;
        // One more row than a turn has: the first again.
        let row = row.min(self.rows.len() - 2);
        let (from, to) = (self.rows[row], self.rows[row + 1]);
        #[expect(clippy::cast_precision_loss, reason = "there are fewer than 2^52 rows")]
        let share = place - row as f64;
        (from + (to - from) * share, (to - from) * (f64::from(ROWS) / TAU))
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
