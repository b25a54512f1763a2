use foxhunt_core::angle::Resultant;

use super::rounding::LEAST_RESULTANT;

/// One position of a turn: its own mean, and the moving mean with its neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// Number of samples of the position.
    pub(super) count: u32,
    /// Number of measured positions in the moving mean.
    pub(super) window: u16,
    /// The mean of the samples in dBm, if there is one.
    pub(super) mean_dbm: f64,
    /// The moving mean in dBm, if its window had anything.
    pub(super) smoothed_dbm: f64,
    /// The moving mean in whole dBm, halves away from zero.
    pub(super) rounded_dbm: f64,
    /// True if all samples have one boresight.
    pub(super) steady: bool,
    /// The circular mean of the samples' boresights; without samples, nominal plus yaw.
    pub(super) angle: f64,
    /// The samples' boresights.
    pub(super) boresights: Resultant,
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
    pub(super) fn direction(&self, weight: f64) -> Resultant {
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
