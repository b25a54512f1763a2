use core::f64::consts::{FRAC_PI_2, TAU};

use foxhunt_core::parameter::{
    ParameterError, at_least_one, finite, in_range, not_negative, positive, require,
};

use crate::interrogation::Timing;

/// A turn of a body with an antenna fixed to it, which interrogates beacons all the while.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct BodyConfig {
    /// Rate of turn, in radians per second; counter-clockwise from above where positive.
    pub rate_rad_s: f64,
    /// It goes on turning between turns, also while it flies elsewhere; otherwise it holds its
    /// heading then.
    pub keeps_turning: bool,
    /// Number of positions that the samples are sorted into; each keeps its own boresight, too.
    pub positions: u16,
    /// Least time from one request to the next, in seconds.
    pub spacing_s: f64,
    /// A request without an answer after this long, in seconds, is given up.
    pub answer_timeout_s: f64,
    /// A turn that has not come round after this long, in seconds, ends with what it has.
    pub turn_timeout_s: f64,
    /// The antenna's direction, in radians counter-clockwise of the nose.
    pub mount_offset_rad: f64,
    /// Time of the radio's measurement of the power between request (0) and answer (1).
    pub measured_at: f64,
    /// The receiver's weakest reading in dBm, where that is known.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub floor_dbm: Option<f64>,
    /// Time from pulse to pulse of beacons that send by themselves, in seconds: then a request
    /// counts as unanswered only where a pulse was due. `None` for beacons that answer.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub interval_s: Option<f64>,
}

/// The configuration of [`isaacs2014`](BodyConfig::isaacs2014).
impl Default for BodyConfig {
    fn default() -> Self {
        Self::isaacs2014()
    }
}

impl BodyConfig {
    /// A steady turn in flight, too, with a request as soon as the last is settled (Isaacs et al.
    /// 2014, §III), at 90° per second, as the document prints no rate; 128 positions, 50 ms for an
    /// answer, 12 s for a turn, which takes 4 s; an antenna along the nose; a power that is
    /// measured at the request.
    #[must_use]
    pub const fn isaacs2014() -> Self {
        Self {
            rate_rad_s: FRAC_PI_2,
            keeps_turning: true,
            positions: 128,
            spacing_s: 0.0,
            answer_timeout_s: 0.05,
            turn_timeout_s: 12.0,
            mount_offset_rad: 0.0,
            measured_at: 0.0,
            floor_dbm: None,
            interval_s: None,
        }
    }

    /// A turn in 12.8 s, sorted into 128 positions; the heading is held in between (Pritzl 2018,
    /// §5.1). Six requests in the 0.2 s from one of its 64 headings to the next, as many as a
    /// stepper sends at a position; 40 s for a turn.
    #[must_use]
    pub const fn pritzl2018() -> Self {
        Self {
            rate_rad_s: TAU / 12.8,
            keeps_turning: false,
            spacing_s: 0.2 / 6.0,
            answer_timeout_s: 0.2 / 6.0,
            turn_timeout_s: 40.0,
            ..Self::isaacs2014()
        }
    }

    /// Checks the ranges of all numbers.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first that is out of its range.
    pub fn check(&self) -> Result<(), ParameterError> {
        let turns = self.rate_rad_s.is_finite() && self.rate_rad_s.abs() > 0.0;
        require(turns, "rate_rad_s", self.rate_rad_s, "finite and not zero")?;
        at_least_one("positions", self.positions.into())?;
        not_negative("spacing_s", self.spacing_s)?;
        positive("answer_timeout_s", self.answer_timeout_s)?;
        positive("turn_timeout_s", self.turn_timeout_s)?;
        finite("mount_offset_rad", self.mount_offset_rad)?;
        in_range("measured_at", self.measured_at, 0.0..=1.0, "from 0 to 1")?;
        self.interval_s.map_or(Ok(()), |interval| positive("interval_s", interval).map(|_| ()))?;
        self.floor_dbm.map_or(Ok(()), |floor| finite("floor_dbm", floor).map(|_| ()))
    }

    pub(super) fn timing(&self) -> Timing {
        Timing {
            spacing: self.spacing_s,
            answer_timeout: self.answer_timeout_s,
            measured_at: self.measured_at,
            mount_offset: self.mount_offset_rad,
            positions: self.positions,
            interval: self.interval_s,
        }
    }
}
