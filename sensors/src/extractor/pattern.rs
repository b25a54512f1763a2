//! A turn of the antenna in order, and how much it looks like one transmitter.

use core::{
    f64::consts::{FRAC_PI_4, LN_10, TAU},
    mem,
};

use foxhunt_core::{
    NoReading, Sample, Sweep,
    angle::{self, Resultant},
    elementary,
};

/// A window's mean this near to a half, in dB, is the half.
///
/// The mean of whole-dB readings is a fraction whose denominator is the window times the common
/// multiple of the counts: with the reference's six readings and seven positions it is a half or
/// at least 1/840 dB off. Floating-point sums err by some 1e-13 dB, in a way that hangs on the
/// order of summation; 1e-9 lies between, so the result is that of exact sums in any order.
const TIE: f64 = 1e-9;

/// Length of a mean resultant below which directions cancel, up to rounding.
pub(super) const LEAST_RESULTANT: f64 = 1e-9;

/// One position of a turn: its own mean, and the moving mean with its neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// Number of samples of the position.
    count: u32,
    /// Number of measured positions in the moving mean.
    window: u16,
    /// The mean of the samples in dBm, if there is one.
    mean_dbm: f64,
    /// The moving mean in dBm, if its window had anything.
    smoothed_dbm: f64,
    /// The moving mean in whole dBm, halves away from zero.
    rounded_dbm: f64,
    /// True if all samples have one boresight.
    steady: bool,
    /// The circular mean of the samples' boresights; without samples, nominal plus yaw.
    angle: f64,
    /// The samples' boresights.
    boresights: Resultant,
}

impl Cell {
    /// Number of samples of the position.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.count
    }

    /// The mean of its samples in dBm (Pritzl 2018, eq. 4.1).
    #[must_use]
    pub fn mean_dbm(&self) -> Option<f64> {
        (self.count > 0).then_some(self.mean_dbm)
    }

    /// The antenna's direction, in radians in the world frame: the circular mean of its samples'
    /// boresights (Pritzl 2018, eq. 4.2); without samples, the nominal angle plus the mean yaw.
    #[must_use]
    pub fn angle(&self) -> f64 {
        self.angle
    }

    /// The antenna's direction, with a weight.
    fn direction(&self, weight: f64) -> Resultant {
        if self.steady {
            return self.boresights.scaled(weight / f64::from(self.count));
        }
        self.boresights.with_weight(weight, LEAST_RESULTANT).unwrap_or_else(|| {
            let mut nominal = Resultant::default();
            nominal.add(self.angle, weight);
            nominal
        })
    }

    /// The moving mean about it, in dBm; `None` where the whole window is empty.
    #[must_use]
    pub fn smoothed_dbm(&self) -> Option<f64> {
        (self.window > 0).then_some(self.smoothed_dbm)
    }

    /// The moving mean in whole dBm, halves away from zero.
    #[must_use]
    pub fn rounded_dbm(&self) -> Option<f64> {
        (self.window > 0).then_some(self.rounded_dbm)
    }
}

/// A turn of the antenna in order (Pritzl 2018, §4.1): the mean of each position, and the moving
/// mean around the circle, which fills gaps from their neighbours.
///
/// Data only; an extractor reads it, and so may a plot. Kept in place, without an allocator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pattern {
    cells: [Cell; Pattern::CAPACITY as usize],
    positions: u16,
    measured: u16,
    rss_dbm: f64,
}

impl Pattern {
    /// Maximum number of positions of a turn: one for each degree.
    pub const CAPACITY: u16 = 360;

    /// Puts a sweep in order, with a moving mean over `window` positions: itself and as many on
    /// either side (an even window counts as the next odd one).
    ///
    /// # Errors
    ///
    /// [`NoReading`] when there are no samples, or names the first that is not finite or out of
    /// the turn, or the turn that is longer than [`CAPACITY`](Self::CAPACITY).
    pub fn new(sweep: &Sweep<'_>, window: u16) -> Result<Self, NoReading> {
        let mut pattern = Self::empty();
        pattern.fill(sweep, window)?;
        Ok(pattern)
    }

    /// A turn of no positions, to be filled.
    #[inline(always)]
    pub(super) fn empty() -> Self {
        let cells = [Cell::default(); Self::CAPACITY as usize];
        Self { cells, positions: 0, measured: 0, rss_dbm: 0.0 }
    }

    /// Puts a sweep in order where an empty pattern is: 20 kB are not moved.
    pub(super) fn fill(&mut self, sweep: &Sweep<'_>, window: u16) -> Result<(), NoReading> {
        check_turn(sweep)?;
        self.positions = sweep.positions;
        if !self.average(sweep) {
            check(sweep)?;
        }
        self.smooth(window / 2);
        Ok(())
    }

    /// The positions, in order round the circle.
    #[must_use]
    pub fn cells(&self) -> &[Cell] {
        self.cells.get(..usize::from(self.positions)).unwrap_or(&self.cells)
    }

    /// Number of positions with samples.
    #[must_use]
    pub fn measured(&self) -> u16 {
        self.measured
    }

    /// The mean power over the measured positions in dBm: before gaps are filled, in dB.
    #[must_use]
    pub fn rss_dbm(&self) -> f64 {
        self.rss_dbm
    }

    /// The largest rounded moving mean in dBm.
    #[must_use]
    pub fn maximum_dbm(&self) -> f64 {
        self.cells().iter().filter_map(Cell::rounded_dbm).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Per-position means of power and angle (Pritzl 2018, eqs. 4.1 and 4.2); returns true if all
    /// of them are finite and in the turn, so that the samples are as well.
    fn average(&mut self, sweep: &Sweep<'_>) -> bool {
        // An antenna that stands while it is sampled has one boresight for several samples.
        let same = |a: &Sample, b: &Sample| {
            a.position == b.position && a.boresight.to_bits() == b.boresight.to_bits()
        };
        for run in sweep.samples.chunk_by(same) {
            let Some(&Sample { position, boresight, .. }) = run.first() else { continue };
            if position >= sweep.positions || !boresight.is_finite() {
                return false;
            }
            let cell = &mut self.cells[usize::from(position)];
            if cell.count == 0 {
                (cell.angle, cell.steady) = (boresight, true);
            } else {
                cell.steady &= cell.angle.to_bits() == boresight.to_bits();
            }
            cell.mean_dbm = run.iter().fold(cell.mean_dbm, |sum, sample| sum + sample.rss_dbm);
            let count = u32::try_from(run.len()).unwrap_or(u32::MAX);
            cell.count = cell.count.saturating_add(count);
            cell.boresights.add(boresight, f64::from(count));
        }
        let mut sum = 0.0;
        for (i, cell) in (0..sweep.positions).zip(&mut self.cells) {
            let nominal = nominal(i, sweep.positions);
            if cell.count == 0 {
                cell.angle = nominal;
                continue;
            }
            cell.mean_dbm /= f64::from(cell.count);
            sum += cell.mean_dbm;
            self.measured += 1;
            cell.angle = if cell.steady {
                angle::wrap(cell.angle)
            } else {
                cell.boresights.direction(LEAST_RESULTANT).unwrap_or(nominal)
            };
        }
        self.rss_dbm = sum / f64::from(self.measured);
        if self.measured < self.positions {
            self.turn_unmeasured();
        }
        self.rss_dbm.is_finite()
    }

    /// Turns the positions without samples by the mean yaw of the others.
    fn turn_unmeasured(&mut self) {
        let cells = (0..self.positions).zip(&mut self.cells);
        let yaw: Resultant = (cells.filter(|(_, cell)| cell.boresights.length() > LEAST_RESULTANT))
            .map(|(i, cell)| cell.angle - nominal(i, self.positions))
            .collect();
        // Where the offsets cancel there is no yaw to speak of, and the nominal angle stands.
        let yaw = yaw.direction(LEAST_RESULTANT).unwrap_or(0.0);
        for cell in self.cells.iter_mut().filter(|cell| cell.count == 0) {
            cell.angle = angle::wrap(cell.angle + yaw);
        }
    }

    /// The moving mean over the measured ones of 2 `reach` + 1 positions.
    fn smooth(&mut self, reach: u16) {
        let turn = usize::from(self.positions);
        // A window longer than the turn would count positions twice.
        let reach = usize::from(reach).min((turn - 1) / 2);
        let width = 2 * reach + 1;
        // The turn, and its ends once more beyond the other ones. A gap adds nothing.
        let mut means = [0.0; 2 * Self::CAPACITY as usize];
        let mut measured = [0_u16; 2 * Self::CAPACITY as usize];
        for (i, cell) in self.cells().iter().enumerate() {
            let mean = cell.mean_dbm();
            means[reach + i] = mean.unwrap_or(0.0);
            measured[reach + i] = u16::from(mean.is_some());
        }
        means.copy_within(turn..turn + reach, 0);
        means.copy_within(reach..2 * reach, turn + reach);
        measured.copy_within(turn..turn + reach, 0);
        measured.copy_within(reach..2 * reach, turn + reach);
        let windows = means.windows(width).zip(measured.windows(width));
        for (cell, (means, measured)) in self.cells[..turn].iter_mut().zip(windows) {
            cell.window = measured.iter().sum();
            let sum = means.iter().fold(0.0, |sum, mean| sum + mean);
            cell.smoothed_dbm = if cell.window > 0 { sum / f64::from(cell.window) } else { 0.0 };
            cell.rounded_dbm = round_half_away(cell.smoothed_dbm);
        }
    }
}

/// Nominal direction of position `i` of a turn, in radians from the antenna's zero.
fn nominal(i: u16, positions: u16) -> f64 {
    TAU * f64::from(i) / f64::from(positions)
}

/// Refuses a turn that has no samples, or more than [`Pattern::CAPACITY`] positions.
fn check_turn(sweep: &Sweep<'_>) -> Result<(), NoReading> {
    let positions = sweep.positions;
    if !(1..=Pattern::CAPACITY).contains(&positions) {
        return Err(NoReading::Capacity { positions, capacity: Pattern::CAPACITY });
    }
    if sweep.samples.is_empty() { Err(NoReading::Empty) } else { Ok(()) }
}

/// Refuses a sweep that is not valid or has more than [`Pattern::CAPACITY`] positions.
pub(super) fn check(sweep: &Sweep<'_>) -> Result<(), NoReading> {
    check_turn(sweep)?;
    let positions = sweep.positions;
    let mut zero = 0.0;
    let mut last = 0;
    for sample in sweep.samples {
        // Zero times a number that is not finite is NaN.
        zero += 0.0 * sample.rss_dbm + 0.0 * sample.boresight;
        last = last.max(sample.position);
    }
    if f64::is_finite(zero) && last < positions {
        return Ok(());
    }
    for (index, sample) in sweep.samples.iter().enumerate() {
        for (field, value) in [("rss_dbm", sample.rss_dbm), ("boresight", sample.boresight)] {
            if !value.is_finite() {
                return Err(NoReading::NotFinite { index, field, value });
            }
        }
        if sample.position >= positions {
            return Err(NoReading::Position { index, position: sample.position, positions });
        }
    }
    Ok(())
}

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

/// `value` in whole numbers, halves away from zero; what is a half up to [`TIE`] is a half.
fn round_half_away(value: f64) -> f64 {
    libm::copysign(libm::floor(value.abs() + (0.5 + TIE)), value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn same(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-12
    }

    #[test]
    fn halves_go_away_from_zero_whatever_the_last_bits() {
        for near in [-1e-12, 0.0, 1e-12] {
            assert!(same(round_half_away(-48.5 + near), -49.0));
            assert!(same(round_half_away(48.5 + near), 49.0));
        }
        assert!(same(round_half_away(-48.5 + 1.0 / 840.0), -48.0));
        assert!(same(round_half_away(-48.5 - 1.0 / 840.0), -49.0));
        assert!(same(round_half_away(-0.2), 0.0));
    }
}
