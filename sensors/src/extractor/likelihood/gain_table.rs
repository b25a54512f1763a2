use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Vector3;

use super::{looks::Look, posterior::NODES};
use crate::Antenna;

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

/// Rows of half a degree: between them the gain is taken as linear, which errs by less than
/// 0.003 dB on a lobe of 30°.
pub(super) const ROWS: u16 = 720;

/// Rows from one node to the next.
const STEP: usize = (ROWS / NODES) as usize;
const _: () = assert!(ROWS.is_multiple_of(NODES), "a step is a whole number of rows");

/// Every fourth row, from each of the first four on: a loop over nodes reads a column.
fn by_node(rows: &[f64]) -> [Vec<f64>; STEP] {
    let turn = &rows[..usize::from(ROWS)];
    let from = |first| turn.iter().chain(turn).skip(first).step_by(STEP).copied().collect();
    core::array::from_fn(from)
}

impl GainTable {
    pub(super) fn new(antenna: &impl Antenna, elevation: f64) -> Self {
        let mean_db = antenna.mean_gain_db(elevation);
        let gain = |row| antenna.gain_dbi(TAU * f64::from(row) / f64::from(ROWS), elevation);
        let rows: Vec<f64> = (0..=ROWS).map(|row| gain(row) - mean_db).collect();
        Self { nodes: by_node(&rows), rows, mean_db, elevation }
    }

    /// Elevation of the beacons above the horizon, in radians.
    pub(super) fn elevation(&self) -> f64 {
        self.elevation
    }

    /// The rows of a turn.
    pub(super) fn rows(&self) -> &[f64] {
        &self.rows[..usize::from(ROWS)]
    }

    /// A table of the same kind with something made of each row.
    pub(super) fn map(&self, change: impl Fn(f64) -> f64) -> Self {
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
