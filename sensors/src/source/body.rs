//! An antenna that is fixed to a body, which turns as a whole.

use core::f64::consts::{FRAC_PI_2, TAU};

use foxhunt_core::{
    BeaconId, Clock, PatternSource, Pose, Radio, Spinner, Sweep, angle,
    parameter::{ParameterError, at_least_one, finite, in_range, not_negative, positive, require},
};

use super::{Interrogation, Timing, TurnGoal, TurnRecorder};

type Failure<R, V> = BodyError<<R as Radio>::Error, <V as foxhunt_core::Vehicle>::Error>;

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
    /// 2014, §III), at 90° per second, as the document prints no rate; 128 positions, 50 ms for
    /// an answer, 12 s for a turn, which takes 4 s; an antenna along the nose; a power that is
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

    fn timing(&self) -> Timing {
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

/// Failure of a turn of the whole body.
///
/// The source may be polled again; nothing that it has collected is lost.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BodyError<R, V> {
    /// The radio failed.
    #[error("the radio failed: {0}")]
    Radio(#[source] R),
    /// The aircraft failed that carries the antenna, turns it and reports its pose.
    #[error("the vehicle failed: {0}")]
    Vehicle(#[source] V),
    /// The body did not come round in the turn's time. Its sweeps are lent all the same.
    #[error("the body turned by {turned:.3} rad in {seconds:.1} s and not all the way round")]
    NotAround {
        /// Angle that it turned, by its own heading, in radians.
        turned: f64,
        /// The time that it had, in seconds.
        seconds: f64,
    },
}

/// A directional antenna that is fixed to an aircraft, which turns as a whole (Pritzl 2018, §5.1;
/// Isaacs et al. 2014, §III).
///
/// Answers come at whatever rate and heading they come, while the body drifts or flies: every
/// sample has the time, the pose and the boresight that its power was measured at. Several beacons
/// are interrogated one after the other, request by request. A turn ends when the *measured*
/// heading has gone all the way round, or its time is up; it keeps what it has, and a body that did
/// not come round is an [error](BodyError::NotAround).
///
/// Poll it often enough to follow the heading: several times a turn, and as often as samples are
/// wanted. A device that fails is an error of each poll and is tried again at the next; time runs
/// on. A power or a place that is not finite is [counted](Self::dropped) and not kept.
#[derive(Debug)]
pub struct BodySource<R, V, C> {
    config: BodyConfig,
    radio: R,
    vehicle: V,
    clock: C,
    turn: Option<Turn>,
    recorder: TurnRecorder,
    interrogation: Interrogation,
    /// True if it was ordered to turn, and not to stop since.
    turning: bool,
    last_pose: Pose,
    goal: Option<TurnGoal>,
}

/// A turn that is under way.
#[derive(Clone, Copy, Debug)]
struct Turn {
    /// Time of the first poll.
    begun: Option<f64>,
    /// The heading before, and the angle turned since the first.
    heading: Option<f64>,
    turned: f64,
    phase: Phase,
}

/// Next action of the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Order the body to turn.
    Spin,
    /// Send a request, and wait for its answer.
    Interrogate,
    /// The body has come round, or the time is up: order it to hold its heading, if it shall.
    Stop,
    /// A body that did not come round was reported.
    Reported,
}

impl<R: Radio, V: Spinner, C: Clock> BodySource<R, V, C> {
    /// A source made of its devices.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names what is out of range in the configuration.
    pub fn new(config: BodyConfig, radio: R, vehicle: V, clock: C) -> Result<Self, ParameterError> {
        config.check()?;
        Ok(Self {
            config,
            radio,
            vehicle,
            clock,
            turn: None,
            recorder: TurnRecorder::default(),
            interrogation: Interrogation::default(),
            turning: false,
            last_pose: Pose::default(),
            goal: None,
        })
    }

    /// Sets a goal: once it has come all the way round, it goes on turning until its bearings are
    /// as certain as wanted or the goal's longest time is up. Where the configuration has the
    /// interval of pulses, it turns no faster than some eight of them to a turn.
    #[must_use]
    pub fn with_goal(mut self, goal: TurnGoal) -> Self {
        if let Some(interval_s) = self.config.interval_s {
            self.config.rate_rad_s = TurnGoal::rate_rad_s(interval_s, self.config.rate_rad_s);
        }
        self.config.turn_timeout_s = goal.longest_s();
        self.goal = Some(goal);
        self
    }

    /// Configuration of its turns.
    #[must_use]
    pub fn config(&self) -> &BodyConfig {
        &self.config
    }

    /// Number of answers of this turn, or of the last one, that were dropped because the power or
    /// the place was not finite; of all its beacons together.
    #[must_use]
    pub fn dropped(&self) -> u32 {
        self.interrogation.dropped
    }

    /// Takes every step that can be taken now; true when the turn is complete.
    fn advance(&mut self, turn: &mut Turn) -> Result<bool, Failure<R, V>> {
        let now = self.clock.now();
        let begun = *turn.begun.get_or_insert(now);
        let late = now >= begun + self.config.turn_timeout_s;
        if late && matches!(turn.phase, Phase::Spin | Phase::Interrogate) {
            self.interrogation.give_up(&mut self.recorder, &self.config.timing(), now);
            turn.phase = Phase::Stop;
        }
        // Time is up whatever the devices do.
        let overdue = now >= begun + self.config.turn_timeout_s + self.config.answer_timeout_s;
        let here = match self.vehicle.pose() {
            Ok(pose) if pose.is_finite() => {
                self.recorder.add_place_sigma(self.vehicle.position_sigma());
                turn.follow(pose.heading);
                self.last_pose = pose;
                Some(pose)
            }
            Err(error) if !late => return Err(BodyError::Vehicle(error)),
            _ => None,
        };
        loop {
            match turn.phase {
                Phase::Spin => {
                    let rate = Some(self.config.rate_rad_s);
                    self.vehicle.spin(rate).map_err(BodyError::Vehicle)?;
                    self.turning = true;
                    turn.phase = Phase::Interrogate;
                }
                Phase::Interrogate => {
                    if !self.interrogate(turn, now, here).map_err(BodyError::Radio)? {
                        return Ok(false);
                    }
                }
                Phase::Stop => {
                    match self.stop() {
                        Err(error) if !overdue => return Err(BodyError::Vehicle(error)),
                        _ => {}
                    }
                    if turn.is_round() {
                        return Ok(true);
                    }
                    turn.phase = Phase::Reported;
                    let turned = turn.turned;
                    let seconds = now - begun;
                    return Err(BodyError::NotAround { turned, seconds });
                }
                Phase::Reported => return Ok(true),
            }
        }
    }

    /// Sends a request, or takes an answer; false while there is nothing to do but wait.
    fn interrogate(
        &mut self,
        turn: &mut Turn,
        now: f64,
        here: Option<Pose>,
    ) -> Result<bool, R::Error> {
        let timing = self.config.timing();
        let radio = &mut self.radio;
        let recorder = &mut self.recorder;
        if self.interrogation.is_pending() {
            return self.interrogation.poll(radio, recorder, &timing, now, here);
        }
        let BodyConfig { positions, floor_dbm, .. } = self.config;
        let reaches = |goal| recorder.reaches(goal, positions, floor_dbm, false);
        if turn.is_round() && self.goal.as_ref().is_none_or(reaches) {
            turn.phase = Phase::Stop;
            return Ok(true);
        }
        match here {
            Some(here) => self.interrogation.request(radio, recorder, &timing, now, here),
            None => Ok(false),
        }
    }

    /// Holds the heading, unless it shall be turned on.
    fn stop(&mut self) -> Result<(), V::Error> {
        if self.turning && !self.config.keeps_turning {
            self.vehicle.spin(None)?;
            self.turning = false;
        }
        Ok(())
    }
}

impl Turn {
    /// Takes the next heading.
    fn follow(&mut self, heading: f64) {
        if let Some(before) = self.heading.replace(heading) {
            self.turned += angle::wrap(heading - before);
        }
    }

    /// Returns true if it has come all the way round, but for rounding.
    fn is_round(&self) -> bool {
        self.turned.abs() >= TAU - 1e-9
    }
}

impl<R: Radio, V: Spinner, C: Clock> PatternSource for BodySource<R, V, C> {
    type Error = Failure<R, V>;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), Self::Error> {
        let turn = Turn { begun: None, heading: None, turned: 0.0, phase: Phase::Spin };
        self.turn = (!beacons.is_empty()).then_some(turn);
        self.recorder = TurnRecorder::new(beacons);
        self.interrogation = Interrogation::default();
        if beacons.is_empty() { self.stop().map_err(BodyError::Vehicle) } else { Ok(()) }
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, Self::Error> {
        if let Some(mut turn) = self.turn {
            let outcome = self.advance(&mut turn);
            self.turn = Some(turn);
            if !outcome? {
                return Ok(None);
            }
            self.turn = None;
            self.recorder.end(self.clock.now());
        } else {
            // Nothing is outstanding, but a radio that samples all the time is not left behind.
            let _ = self.radio.poll();
        }
        Ok(self.recorder.lend(self.config.positions, self.config.floor_dbm, self.last_pose))
    }
}
