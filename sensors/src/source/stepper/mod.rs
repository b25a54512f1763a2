//! An antenna on a stepper motor under the drone.

mod config;

pub use config::StepperConfig;

use alloc::{vec, vec::Vec};
use core::f64::consts::TAU;

use foxhunt_core::{
    BeaconId, Clock, PatternSource, Pose, Radio, Rotator, Sample, Sweep, Unanswered, Vehicle,
    angle::{self, nearest_position},
};

use super::{TurnGoal, TurnRecorder, between_steps};

/// Maximum number of samples of each beacon that a turn begins with room for; it may have more.
const MOST_RESERVED: usize = 4096;

type Failure<R, T, V> =
    StepperError<<R as Radio>::Error, <T as Rotator>::Error, <V as Vehicle>::Error>;

/// Failure of one of a stepper source's devices.
///
/// The source may be polled again; nothing that it has collected is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StepperError<R, T, V> {
    /// The radio.
    #[error("the radio failed: {0}")]
    Radio(#[source] R),
    /// The motor.
    #[error("the rotator failed: {0}")]
    Rotator(#[source] T),
    /// The aircraft that carries the antenna and reports its pose.
    #[error("the vehicle failed: {0}")]
    Vehicle(#[source] V),
}

/// A directional antenna that a motor steps through a turn, with a radio that requests
/// answers from a beacon at every step (Pritzl 2018, §4.1).
///
/// Turns go to and fro, 0 … 127 and 127 … 0, so that the cable does not wind up and the next turn
/// starts where the antenna stands. A position ends with its last sample or its time-out, which
/// runs from the order to turn there; it keeps what it has, possibly nothing. An answer that is
/// lost costs the rest of its position's time. Several beacons are interrogated one after the other
/// at each position, each with a time-out of its own, so that one that is silent costs the others
/// nothing but time.
///
/// Poll it several times per time-out: a position that is late sends no more requests. A device
/// that fails is an error of each poll, and is tried again at the next; time runs on, so that a
/// turn ends however many devices are dead. A power or a place that is not finite is
/// [counted](Self::dropped) and not kept. A request without an answer when its position's
/// time is up is lent as [unanswered](Sweep::unanswered), along the mean heading.
#[derive(Debug)]
pub struct StepperSource<R, T, V, C> {
    config: StepperConfig,
    radio: R,
    rotator: T,
    vehicle: V,
    clock: C,
    turn: Turn,
    /// The place to which the antenna was last sent, in the turn's positions.
    stands_at: f64,
    recorder: TurnRecorder,
    /// The present position's answers: when each came, and its power in dBm.
    answers: Vec<(f64, f64)>,
    dropped: u32,
    last_pose: Pose,
    aim: Option<Aim>,
    goal: Option<TurnGoal>,
}

/// Direction of the antenna: the same for all samples at a position of a drone that hovers.
#[derive(Clone, Copy, Debug)]
struct Aim {
    /// Angle from the nose, and the nose's heading, in radians.
    angle: f64,
    heading: f64,
    /// The boresight in the world frame, in radians.
    boresight: f64,
    position: u16,
}

/// Result of trying a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    Stepped,
    Waiting,
    Complete,
}

impl<R: Radio, T: Rotator, V: Vehicle, C: Clock> StepperSource<R, T, V, C> {
    /// A source made of its devices, with the antenna at the rotator's 0.
    #[must_use]
    pub fn new(config: StepperConfig, radio: R, rotator: T, vehicle: V, clock: C) -> Self {
        Self {
            config,
            radio,
            rotator,
            vehicle,
            clock,
            turn: Turn::new(0, false),
            stands_at: 0.0,
            recorder: TurnRecorder::default(),
            answers: vec![(0.0, 0.0); config.samples_per_position().into()],
            dropped: 0,
            last_pose: Pose::default(),
            aim: None,
            goal: None,
        }
    }

    /// Sets a goal: after a round of all positions it goes on to positions between them until its
    /// bearings are as certain as wanted or the goal's longest time is up.
    #[must_use]
    pub fn with_goal(self, goal: TurnGoal) -> Self {
        Self { goal: Some(goal), ..self }
    }

    /// Configuration of its turns.
    #[must_use]
    pub fn config(&self) -> &StepperConfig {
        &self.config
    }

    /// Number of answers of this turn, or of the last one, that were dropped because the power or
    /// the place was not finite, or the place not to be had in time; of all its beacons together.
    #[must_use]
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Takes every step that can be taken now; true when the turn is complete.
    fn advance(&mut self) -> Result<bool, Failure<R, T, V>> {
        loop {
            match self.step() {
                Ok(Progress::Complete) => return Ok(true),
                Ok(Progress::Stepped) => {}
                Ok(Progress::Waiting) if self.expire() => {}
                Ok(Progress::Waiting) => {
                    let ahead = self.event().is_some_and(|event| self.clock.go_ahead(event));
                    if !ahead {
                        return Ok(false);
                    }
                }
                // It is tried again, and fails, when it is time.
                Err(_) if self.clock.is_ahead() => return Ok(false),
                Err(error) => {
                    self.expire();
                    return Err(error);
                }
            }
        }
    }

    fn step(&mut self) -> Result<Progress, Failure<R, T, V>> {
        match self.turn.phase {
            Phase::Idle => return Ok(Progress::Waiting),
            Phase::Order => {
                // The first position's time runs from the first attempt: a motor that refuses
                // orders must not stop the turn.
                let first = self.config.first_timeout();
                let begun = *self.turn.begun.get_or_insert_with(|| self.clock.now());
                self.turn.deadline.get_or_insert(begun + first);
                let position = self.turn.position(self.config.positions());
                self.stands_at = position;
                let angle = TAU * position / f64::from(self.config.positions());
                self.rotator.turn_to(angle).map_err(StepperError::Rotator)?;
                self.turn.phase = Phase::Turn;
            }
            Phase::Turn => match self.rotator.poll().map_err(StepperError::Rotator)? {
                Some(angle) if angle.is_finite() => {
                    self.turn.phase = Phase::Request { angle, answers: 0 };
                }
                _ => return Ok(Progress::Waiting),
            },
            Phase::Request { answers, .. } if answers >= self.config.samples_per_position() => {
                self.turn.next(&self.config, self.clock.now());
            }
            Phase::Request { angle, answers } => {
                if !self.expire() {
                    let beacon = self.recorder.beacon(self.turn.beacon).beacon;
                    let until = self.turn.deadline.unwrap_or(f64::INFINITY);
                    let room = &mut self.answers[usize::from(answers)..];
                    let known = self.radio.interrogate(beacon, until, room);
                    let known = known.map_err(StepperError::Radio)?.min(room.len());
                    let awaits = known < room.len();
                    let new = u16::try_from(known).unwrap_or(u16::MAX);
                    self.turn.phase = if known == 0 {
                        Phase::Await { angle, answers }
                    } else {
                        Phase::Locate { angle, answers: answers + new, new, awaits }
                    };
                }
            }
            Phase::Await { angle, answers } => {
                let Some(rss_dbm) = self.radio.poll().map_err(StepperError::Radio)? else {
                    return Ok(Progress::Waiting);
                };
                let time = self.radio.measured_at().unwrap_or_else(|| self.clock.now());
                self.answers[usize::from(answers)] = (time, rss_dbm);
                let answers = answers + 1;
                self.turn.phase = if rss_dbm.is_finite() {
                    Phase::Locate { angle, answers, new: 1, awaits: false }
                } else {
                    self.dropped += 1;
                    Phase::Request { angle, answers }
                };
            }
            Phase::Locate { angle, answers, new, awaits } => {
                let receiver = self.vehicle.pose().map_err(StepperError::Vehicle)?;
                self.recorder.add_place_sigma(self.vehicle.position_sigma());
                let Aim { boresight, position, .. } = self.aim(angle, receiver.heading);
                let finite = receiver.is_finite();
                let samples = &mut self.recorder.beacon(self.turn.beacon).samples;
                let before = samples.len();
                let answers_here = &self.answers[usize::from(answers - new)..answers.into()];
                let sample =
                    |&(time, rss_dbm)| Sample { time, receiver, boresight, position, rss_dbm };
                if finite && answers_here.iter().all(|(_, rss_dbm)| rss_dbm.is_finite()) {
                    samples.extend(answers_here.iter().map(sample));
                } else if finite {
                    let kept = answers_here.iter().filter(|(_, rss_dbm)| rss_dbm.is_finite());
                    samples.extend(kept.map(sample));
                }
                let kept = u32::try_from(samples.len() - before).unwrap_or(u32::MAX);
                self.dropped += u32::from(new) - kept;
                self.last_pose = if finite { receiver } else { self.last_pose };
                self.turn.phase = if awaits {
                    Phase::Await { angle, answers }
                } else {
                    Phase::Request { angle, answers }
                };
            }
            Phase::Finish { time } => {
                if !self.goes_on(time) {
                    return self.finish();
                }
                self.turn.phase = Phase::Order;
            }
        }
        Ok(Progress::Stepped)
    }

    /// Time at which the device that is waited for, or the time-out, may next have it take a step.
    fn event(&self) -> Option<f64> {
        let device = match self.turn.phase {
            Phase::Turn => self.rotator.next_event(),
            Phase::Await { .. } => self.radio.next_event(),
            _ => None,
        };
        device.map(|event| self.turn.deadline.map_or(event, |deadline| deadline.min(event)))
    }

    /// Direction of an antenna that is turned by `angle` from a nose at `heading`.
    fn aim(&mut self, angle: f64, heading: f64) -> Aim {
        let bits = |angle: f64, heading: f64| [angle.to_bits(), heading.to_bits()];
        let same = |aim: &Aim| bits(aim.angle, aim.heading) == bits(angle, heading);
        if let Some(aim) = self.aim.filter(same) {
            return aim;
        }
        let boresight = angle::wrap(heading + angle + self.config.mount_offset());
        let position = nearest_position(angle, self.config.positions());
        *self.aim.insert(Aim { angle, heading, boresight, position })
    }

    /// Returns true if the goal is not reached, and there is time for another position.
    fn goes_on(&mut self, now: f64) -> bool {
        let (Some(goal), Some(begun)) = (&self.goal, self.turn.begun) else { return false };
        let position_s = self.turn.beacons() * self.config.position_timeout();
        let late = now + position_s > begun + goal.longest_s();
        let positions = self.config.positions();
        let floor_dbm = self.config.floor_dbm();
        !late && !self.recorder.reaches(goal, positions, floor_dbm, true)
    }

    /// Ends the turn; without samples only the vehicle knows where it took place.
    fn finish(&mut self) -> Result<Progress, Failure<R, T, V>> {
        if self.recorder.is_empty() {
            // A vehicle that does not answer holds the turn up for one more time-out at most.
            let late = self.turn.deadline.is_some_and(|deadline| self.clock.now() >= deadline);
            match self.vehicle.pose() {
                Ok(pose) if pose.is_finite() => {
                    self.recorder.add_place_sigma(self.vehicle.position_sigma());
                    self.last_pose = pose;
                }
                Err(error) if !late => return Err(StepperError::Vehicle(error)),
                _ => {}
            }
        }
        Ok(Progress::Complete)
    }

    /// Goes on to the next beacon or position if the present one's time is up.
    fn expire(&mut self) -> bool {
        let now = self.clock.now();
        let turn = &mut self.turn;
        let late = turn.deadline.is_some_and(|deadline| now >= deadline);
        if !late || matches!(turn.phase, Phase::Idle | Phase::Finish { .. }) {
            return false;
        }
        if let Phase::Locate { new, .. } = turn.phase {
            self.dropped += u32::from(new);
        }
        if let Phase::Await { angle, .. } = turn.phase {
            let position = nearest_position(angle, self.config.positions());
            let boresight = angle + self.config.mount_offset();
            let unanswered = Unanswered { time: now, boresight, position };
            self.recorder.beacon(turn.beacon).unanswered.push(unanswered);
        }
        turn.next(&self.config, now);
        true
    }
}

impl<R: Radio, T: Rotator, V: Vehicle, C: Clock> PatternSource for StepperSource<R, T, V, C> {
    type Error = Failure<R, T, V>;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), Self::Error> {
        // From the end that is nearer to where the antenna was last sent.
        let backwards = self.stands_at > f64::from((self.config.positions() - 1) / 2);
        self.turn = Turn::new(beacons.len(), backwards);
        self.recorder = TurnRecorder::new(beacons);
        let each = usize::from(self.config.samples_per_position());
        let samples = usize::from(self.config.positions()).saturating_mul(each);
        self.recorder.reserve(samples.min(MOST_RESERVED));
        self.dropped = 0;
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, Self::Error> {
        if self.turn.phase != Phase::Idle {
            // What was found out ahead of time is delivered when it is time.
            if self.clock.is_ahead() || !self.advance()? || self.clock.is_ahead() {
                return Ok(None);
            }
            let ended = match self.turn.phase {
                Phase::Finish { time } => time,
                _ => self.clock.now(),
            };
            self.turn.phase = Phase::Idle;
            self.recorder.end(ended);
            for sweep in self.recorder.beacons_mut().filter(|sweep| !sweep.unanswered.is_empty()) {
                // Until now they were from the nose, whose heading is not known where no answer
                // came.
                let heading = Pose::mean(sweep.samples.iter().map(|sample| &sample.receiver))
                    .unwrap_or(self.last_pose)
                    .heading;
                for unanswered in &mut sweep.unanswered {
                    unanswered.boresight = angle::wrap(heading + unanswered.boresight);
                }
            }
        } else {
            // Nothing is outstanding, but a radio that samples all the time is not left behind.
            let _ = self.radio.poll();
        }
        Ok(self.recorder.lend(self.config.positions(), self.config.floor_dbm(), self.last_pose))
    }

    fn next_event(&self) -> Option<f64> {
        match self.turn.phase {
            Phase::Idle => (!self.recorder.has_more()).then_some(f64::INFINITY),
            _ if self.clock.is_ahead() => Some(self.clock.now()),
            _ => self.event(),
        }
    }
}

/// A turn that is under way.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Turn {
    /// Number of beacons listened for at each position.
    beacons: usize,
    /// Index of the beacon interrogated at present, below `beacons`.
    beacon: usize,
    /// Number of positions done, of all rounds.
    done: u32,
    /// The antenna goes from the last position to the first, in the first round.
    backwards: bool,
    /// Time at which the first order was tried.
    begun: Option<f64>,
    /// End of this beacon's time at the present position; `None` until the first order.
    deadline: Option<f64>,
    /// Present phase of the turn.
    phase: Phase,
}

/// Next action of the source at a position.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// There is no turn, or it is over.
    Idle,
    /// Order the rotator to turn.
    Order,
    /// Wait until it stands.
    Turn,
    /// Send a request by the radio: the antenna stands at `angle`, `answers` have come.
    Request { angle: f64, answers: u16 },
    /// Wait for the radio's answer.
    Await { angle: f64, answers: u16 },
    /// Answers came, the last `new` ones; poll the vehicle for the place. `awaits` is true if the
    /// next one is already waited for.
    Locate { angle: f64, answers: u16, new: u16, awaits: bool },
    /// All positions are done; poll the vehicle for its pose if there is no sample.
    Finish { time: f64 },
}

impl Turn {
    /// A turn that begins, if there are any beacons.
    fn new(beacons: usize, backwards: bool) -> Self {
        let phase = if beacons > 0 { Phase::Order } else { Phase::Idle };
        Self { beacons, beacon: 0, done: 0, backwards, begun: None, deadline: None, phase }
    }

    /// The position that the antenna is at or on its way to, of `positions`; between them in all
    /// rounds but the first.
    fn position(&self, positions: u16) -> f64 {
        let positions = u32::from(positions.max(1));
        let round = self.done / positions;
        let done = self.done % positions;
        let backwards = self.backwards != (round % 2 == 1);
        f64::from(if backwards { positions - 1 - done } else { done }) + between_steps(round)
    }

    /// Number of beacons listened for, as a number to reckon with.
    #[expect(clippy::cast_precision_loss, reason = "there are a few")]
    fn beacons(&self) -> f64 {
        self.beacons as f64
    }

    /// Goes on to the next beacon, after the last to the next position, or ends the turn after the
    /// last of these. The next action follows at once, so its time begins now, whether the device
    /// takes it or not.
    fn next(&mut self, config: &StepperConfig, now: f64) {
        self.deadline = Some(now + config.position_timeout());
        self.beacon += 1;
        if let Some(angle) = self.standing()
            && self.beacon < self.beacons
        {
            self.phase = Phase::Request { angle, answers: 0 };
            return;
        }
        self.beacon = 0;
        self.done += 1;
        let more = self.done < u32::from(config.positions());
        self.phase = if more { Phase::Order } else { Phase::Finish { time: now } };
    }

    /// Angle at which the antenna stands, if it has come to a standstill.
    fn standing(&self) -> Option<f64> {
        match self.phase {
            Phase::Request { angle, .. }
            | Phase::Await { angle, .. }
            | Phase::Locate { angle, .. } => Some(angle),
            Phase::Idle | Phase::Order | Phase::Turn | Phase::Finish { .. } => None,
        }
    }
}
