//! A source with an omnidirectional antenna, which needs no turn.

use foxhunt_core::{
    BeaconId, Clock, PatternSource, Pose, Radio, Sweep, Vehicle,
    parameter::{ParameterError, at_least_one, finite, in_range, not_negative, positive},
};

use super::{Interrogation, Timing, TurnRecorder};

type Failure<R, V> = OmnidirectionalError<<R as Radio>::Error, <V as Vehicle>::Error>;

/// Sampling of an omnidirectional source at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct OmnidirectionalConfig {
    /// Number of requests to each beacon.
    pub questions: u16,
    /// Least time from one request to the next, in seconds.
    pub spacing_s: f64,
    /// A request without an answer after this long, in seconds, is given up.
    pub answer_timeout_s: f64,
    /// Time of the radio's measurement of the power between request (0) and answer (1).
    pub measured_at: f64,
    /// The receiver's weakest reading in dBm, where that is known.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub floor_dbm: Option<f64>,
}

impl Default for OmnidirectionalConfig {
    /// 768 requests, as many as in a stepped turn of the reference, each as soon as the last is
    /// settled; 50 ms for an answer; a power that is measured at the request.
    fn default() -> Self {
        Self {
            questions: 768,
            spacing_s: 0.0,
            answer_timeout_s: 0.05,
            measured_at: 0.0,
            floor_dbm: None,
        }
    }
}

impl OmnidirectionalConfig {
    /// Checks the ranges of all numbers.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first that is out of its range.
    pub fn check(&self) -> Result<(), ParameterError> {
        at_least_one("questions", self.questions.into())?;
        not_negative("spacing_s", self.spacing_s)?;
        positive("answer_timeout_s", self.answer_timeout_s)?;
        in_range("measured_at", self.measured_at, 0.0..=1.0, "from 0 to 1")?;
        self.floor_dbm.map_or(Ok(()), |floor| finite("floor_dbm", floor).map(|_| ()))
    }

    fn timing(&self) -> Timing {
        Timing {
            spacing: self.spacing_s,
            answer_timeout: self.answer_timeout_s,
            measured_at: self.measured_at,
            mount_offset: 0.0,
            positions: 1,
            interval: None,
        }
    }
}

/// Failure of one of an omnidirectional source's devices.
///
/// The source may be polled again; nothing that it has collected is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OmnidirectionalError<R, V> {
    /// The radio.
    #[error("the radio failed: {0}")]
    Radio(#[source] R),
    /// The aircraft that carries the antenna and reports its pose.
    #[error("the vehicle failed: {0}")]
    Vehicle(#[source] V),
}

/// A source with an omnidirectional antenna: its sweeps have one position, which holds all
/// samples, so that extractors find a level and no bearing.
///
/// Several beacons are interrogated one after the other, request by request. A sweep ends when each
/// was sent as many as it shall be; a request that stays without an answer counts, so that a sweep
/// ends even if the radio receives nothing. A device that fails is an error of each poll and is
/// tried again at the next; a request that it prevents counts after its time-out, too.
#[derive(Debug)]
pub struct OmnidirectionalSource<R, V, C> {
    config: OmnidirectionalConfig,
    radio: R,
    vehicle: V,
    clock: C,
    /// Number of requests left of the sweep that is under way.
    left: usize,
    /// Since when the present request is due.
    since: Option<f64>,
    recorder: TurnRecorder,
    interrogation: Interrogation,
    last_pose: Pose,
}

impl<R: Radio, V: Vehicle, C: Clock> OmnidirectionalSource<R, V, C> {
    /// A source made of its devices.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names what is out of range in the configuration.
    pub fn new(
        config: OmnidirectionalConfig,
        radio: R,
        vehicle: V,
        clock: C,
    ) -> Result<Self, ParameterError> {
        config.check()?;
        Ok(Self {
            config,
            radio,
            vehicle,
            clock,
            left: 0,
            since: None,
            recorder: TurnRecorder::default(),
            interrogation: Interrogation::default(),
            last_pose: Pose::default(),
        })
    }

    /// Number of answers of this sweep, or of the last one, that were dropped because the power or
    /// the place was not finite; of all its beacons together.
    #[must_use]
    pub fn dropped(&self) -> u32 {
        self.interrogation.dropped
    }

    /// Takes every step that can be taken now; true when the sweep is complete.
    fn advance(&mut self) -> Result<bool, Failure<R, V>> {
        let now = self.clock.now();
        let timing = self.config.timing();
        let due = *self.since.get_or_insert(now);
        if now >= due + timing.spacing + 2.0 * timing.answer_timeout {
            // A device prevented the request, or its answer.
            self.interrogation.give_up(&mut self.recorder, &timing, now);
            self.settled(now);
        }
        let here = match self.vehicle.pose() {
            Ok(pose) if pose.is_finite() => {
                self.recorder.add_place_sigma(self.vehicle.position_sigma());
                self.last_pose = pose;
                Some(pose)
            }
            Err(error) if self.left > 0 => return Err(OmnidirectionalError::Vehicle(error)),
            _ => None,
        };
        while self.left > 0 {
            let radio = &mut self.radio;
            let recorder = &mut self.recorder;
            let stepped = if self.interrogation.is_pending() {
                let settled = self.interrogation.poll(radio, recorder, &timing, now, here);
                // One that is given up is settled even where the radio has failed.
                if !self.interrogation.is_pending() {
                    self.settled(now);
                }
                settled
            } else if let Some(here) = here {
                self.interrogation.request(radio, recorder, &timing, now, here)
            } else {
                Ok(false)
            };
            if !stepped.map_err(OmnidirectionalError::Radio)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn settled(&mut self, now: f64) {
        self.left = self.left.saturating_sub(1);
        self.since = Some(now);
    }
}

impl<R: Radio, V: Vehicle, C: Clock> PatternSource for OmnidirectionalSource<R, V, C> {
    type Error = Failure<R, V>;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), Self::Error> {
        self.left = usize::from(self.config.questions) * beacons.len();
        self.since = None;
        self.recorder = TurnRecorder::new(beacons);
        self.interrogation = Interrogation::default();
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, Self::Error> {
        if self.recorder.count() == 0 || self.recorder.has_ended() {
            // Nothing is outstanding, but a radio that samples all the time is not left behind.
            let _ = self.radio.poll();
        } else if self.advance()? {
            self.recorder.end(self.clock.now());
        }
        if !self.recorder.has_ended() {
            return Ok(None);
        }
        Ok(self.recorder.lend(1, self.config.floor_dbm, self.last_pose))
    }
}
