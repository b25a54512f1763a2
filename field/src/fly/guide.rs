//! Guidance for somebody who carries a receiver: a pitch that follows the level, and the answer
//! to whether a way leads nearer.

use std::collections::VecDeque;

use foxhunt_core::{
    Estimate,
    parameter::{FieldError, finite, positive},
};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// Speed below which a way has no direction, in metres per second.
const STANDS_MPS: f64 = 0.3;

/// Least length of the mean direction to a transmitter; below it the belief lies all around.
const LEAST_CERTAINTY: f64 = 0.25;

/// Directions of the points of a belief that are averaged over.
const DIRECTIONS: u32 = 16;

/// Settings of a [`Pitch`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PitchConfig {
    /// Level below which there is no tone, in dBm.
    pub floor_dbm: f64,
    /// Range above the floor in dB, after which the tone rises no more.
    pub span_db: f64,
    /// Tone at the floor, in Hz.
    pub lowest_hz: f64,
    /// Tone at the top, in Hz.
    pub highest_hz: f64,
    /// Time for which the highest level counts, in seconds.
    pub hold_s: f64,
}

impl Default for PitchConfig {
    /// From −100 dBm over 60 dB, 200 to 2000 Hz, held for 1.5 s.
    fn default() -> Self {
        Self { floor_dbm: -100.0, span_db: 60.0, lowest_hz: 200.0, highest_hz: 2000.0, hold_s: 1.5 }
    }
}

impl PitchConfig {
    /// Refuses what cannot be.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the field and its value.
    pub fn check(&self) -> Result<(), FieldError> {
        finite("floor_dbm", self.floor_dbm)?;
        positive("span_db", self.span_db)?;
        positive("lowest_hz", self.lowest_hz)?;
        positive("hold_s", self.hold_s)?;
        if self.highest_hz.is_finite() && self.highest_hz > self.lowest_hz {
            return Ok(());
        }
        Err(FieldError::new("highest_hz", self.highest_hz, "above lowest_hz"))
    }
}

/// Pitch of the received level for the ear: equal steps in dB are equal intervals.
///
/// The highest level of the last [`hold_s`](PitchConfig::hold_s) counts, so that a beacon that
/// pulses has a tone between its pulses, and fading does not make it flutter. Below the floor, and
/// without a level for so long, there is silence.
#[derive(Clone, Debug)]
pub struct Pitch {
    config: PitchConfig,
    /// Times and levels of the last while: times ascend, levels fall.
    held: VecDeque<(f64, f64)>,
    peak_dbm: Option<f64>,
}

impl Pitch {
    /// A pitch without a level.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the field that is out of range.
    pub fn new(config: PitchConfig) -> Result<Self, FieldError> {
        config.check()?;
        Ok(Self { config, held: VecDeque::new(), peak_dbm: None })
    }

    /// Takes a level in dBm of a time in seconds. Times need not ascend: several receivers may
    /// deliver into one pitch.
    pub fn received(&mut self, time: f64, level_dbm: f64) {
        if !(time.is_finite() && level_dbm.is_finite()) {
            return;
        }
        let later = self.held.partition_point(|(at, _)| *at <= time);
        // One that is followed by a stronger one never counts, nor do weaker ones before it.
        if self.held.get(later).is_none_or(|(_, level)| *level < level_dbm) {
            let before = self.held.iter().take(later).rev();
            let weaker = before.take_while(|(_, level)| *level <= level_dbm).count();
            self.held.drain(later - weaker..later);
            self.held.insert(later - weaker, (time, level_dbm));
        }
        self.peak_dbm = Some(self.peak_dbm.map_or(level_dbm, |peak| peak.max(level_dbm)));
    }

    /// The highest level of the last while, in dBm.
    pub fn level_dbm(&mut self, time: f64) -> Option<f64> {
        let hold_s = self.config.hold_s;
        while self.held.front().is_some_and(|(at, _)| time - at > hold_s) {
            self.held.pop_front();
        }
        self.held.front().map(|(_, level)| *level)
    }

    /// The highest level ever, in dBm.
    #[must_use]
    pub fn peak_dbm(&self) -> Option<f64> {
        self.peak_dbm
    }

    /// The tone at a time, in Hz; `None` for silence.
    pub fn hz(&mut self, time: f64) -> Option<f64> {
        let PitchConfig { floor_dbm, span_db, lowest_hz, highest_hz, .. } = self.config;
        let above = self.level_dbm(time)? - floor_dbm;
        let share = (above / span_db).min(1.0);
        (above >= 0.0).then(|| lowest_hz * (highest_hz / lowest_hz).powf(share))
    }
}

/// Answer to whether a way leads nearer to a transmitter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Warmth {
    /// The level is expected to rise.
    Warmer,
    /// The way leads past: the level is expected to stay.
    Aside,
    /// The level is expected to fall.
    Colder,
}

impl Warmth {
    /// Returns the word for the answer.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Warmer => "warmer",
            Self::Aside => "past it",
            Self::Colder => "colder",
        }
    }

    /// The answer for somebody at `place` who moves with `velocity`, by a belief about where the
    /// transmitter is; `None` for one who stands, and while the belief lies all around.
    ///
    /// Power falls with distance, so that its gradient points to the transmitter wherever that is.
    /// The mean of these directions over the belief is the direction in which the level is expected
    /// to rise. Within 60° of it the way is warmer, within 60° of the reverse colder.
    ///
    /// ```
    /// use foxhunt_core::Estimate;
    /// use foxhunt_field::fly::Warmth;
    /// use nalgebra::Vector2;
    ///
    /// let belief = Estimate::isotropic(Vector2::new(50.0, 0.0), 10.0);
    /// let walks = |east, north| Warmth::of(Vector2::zeros(), Vector2::new(east, north), &belief);
    /// assert_eq!(walks(1.4, 0.0), Some(Warmth::Warmer));
    /// assert_eq!(walks(0.0, 1.4), Some(Warmth::Aside));
    /// assert_eq!(walks(-1.4, 0.5), Some(Warmth::Colder));
    /// assert_eq!(walks(0.0, 0.1), None);
    /// ```
    #[must_use]
    pub fn of(place: Vector2<f64>, velocity: Vector2<f64>, belief: &Estimate<2>) -> Option<Self> {
        let way = velocity.try_normalize(STANDS_MPS)?;
        let root = belief.covariance.cholesky()?.l();
        let mut rises = Vector2::zeros();
        for step in 0..DIRECTIONS {
            let (sin, cos) =
                (f64::from(step) * std::f64::consts::TAU / f64::from(DIRECTIONS)).sin_cos();
            // Points of the ellipse whose mean square is the belief's covariance.
            let point = belief.mean + root * Vector2::new(cos, sin) * std::f64::consts::SQRT_2;
            rises += (point - place).try_normalize(f64::EPSILON).unwrap_or_default();
        }
        let rises = rises / f64::from(DIRECTIONS);
        let cosine = way.dot(&rises.try_normalize(LEAST_CERTAINTY)?);
        Some(if cosine >= 0.5 {
            Self::Warmer
        } else if cosine > -0.5 {
            Self::Aside
        } else {
            Self::Colder
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn the_pitch_has_equal_steps_a_floor_and_a_hold() {
        let mut pitch = Pitch::new(PitchConfig::default()).expect("in range");
        assert_eq!((pitch.hz(0.0), pitch.peak_dbm()), (None, None));
        pitch.received(0.0, -100.0);
        let lowest = pitch.hz(0.0).expect("at the floor");
        pitch.received(0.1, -70.0);
        let middle = pitch.hz(0.1).expect("above");
        assert_abs_diff_eq!(lowest, 200.0, epsilon = 1e-9);
        assert_abs_diff_eq!(middle, 200.0 * 10_f64.sqrt(), epsilon = 1e-9);
        // A fade does not count while the stronger level is held, and counts afterwards.
        pitch.received(0.5, -90.0);
        assert_abs_diff_eq!(pitch.hz(1.5).expect("held"), middle, epsilon = 1e-9);
        let faded = pitch.hz(1.7).expect("the later one");
        assert_abs_diff_eq!(faded, 200.0 * 10_f64.powf(1.0 / 6.0), epsilon = 1e-9);
        assert_eq!((pitch.hz(2.1), pitch.level_dbm(2.1)), (None, None));
        pitch.received(3.0, -100.1);
        assert_eq!(pitch.hz(3.0), None, "below the floor");
        pitch.received(4.0, 7.0);
        assert_abs_diff_eq!(pitch.hz(4.0).expect("beyond the top"), 2000.0, epsilon = 1e-9);
        pitch.received(4.0, f64::NAN);
        assert_eq!(pitch.peak_dbm(), Some(7.0));
        let wrong = PitchConfig { highest_hz: 100.0, ..PitchConfig::default() };
        let error = Pitch::new(wrong).expect_err("reversed").to_string();
        assert_eq!(error, "highest_hz is 100; it must be above lowest_hz");
    }

    #[test]
    fn levels_of_several_receivers_count_by_their_times() {
        let mut pitch = Pitch::new(PitchConfig::default()).expect("in range");
        pitch.received(10.0, -80.0);
        // An older and stronger one comes later, and one that is weaker than both.
        pitch.received(9.0, -60.0);
        pitch.received(8.9, -90.0);
        assert_eq!(pitch.level_dbm(10.0), Some(-60.0));
        assert_eq!(pitch.level_dbm(10.6), Some(-80.0), "the older one expires first");
        pitch.received(9.5, -85.0);
        assert_eq!(pitch.level_dbm(11.2), Some(-80.0));
        assert_eq!((pitch.level_dbm(11.6), pitch.peak_dbm()), (None, Some(-60.0)));
        pitch.received(f64::NAN, -50.0);
        assert_eq!((pitch.level_dbm(12.0), pitch.peak_dbm()), (None, Some(-60.0)));
    }

    #[test]
    fn a_belief_that_lies_all_around_has_no_warmer_way() {
        let around = Estimate::isotropic(Vector2::new(5.0, 0.0), 40.0);
        let walks = Vector2::new(1.0, 0.0);
        assert_eq!(Warmth::of(Vector2::zeros(), walks, &around), None);
        let sharper = Estimate::isotropic(Vector2::new(50.0, 0.0), 40.0);
        assert_eq!(Warmth::of(Vector2::zeros(), walks, &sharper), Some(Warmth::Warmer));
        let beyond = Vector2::new(200.0, 0.0);
        assert_eq!(Warmth::of(beyond, walks, &sharper), Some(Warmth::Colder));
    }
}
