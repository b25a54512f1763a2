//! Sources of turns: requests to beacons, the record of their answers, and the goal of a turn.

mod body;
mod omnidirectional;
mod stepper;

pub use body::{BodyConfig, BodyError, BodySource};
pub use omnidirectional::{OmnidirectionalConfig, OmnidirectionalError, OmnidirectionalSource};
pub use stepper::{StepperConfig, StepperError, StepperSource};

use alloc::{sync::Arc, vec::Vec};
use core::{f64::consts::TAU, fmt};

use foxhunt_core::{
    BeaconId, BearingExtractor, OwnedSweep, Pose, Radio, Sample, Sweep, Unanswered,
    angle::{self, nearest_position},
    parameter::{FieldError, in_range, positive},
};
use nalgebra::Vector3;

use crate::Antenna;

/// Largest delay of a pulse that still counts as the due pulse, as a share of the interval.
const LATE: f64 = 0.02;

/// Timing of interrogations, and attribution of answers to time and place.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Timing {
    /// Least time from one request to the next, in seconds.
    spacing: f64,
    /// Maximum wait for an answer, in seconds.
    answer_timeout: f64,
    /// Time of the power's measurement between request (0) and answer (1).
    measured_at: f64,
    /// The antenna's direction, in radians from the nose.
    mount_offset: f64,
    /// Number of positions in a turn.
    positions: u16,
    /// Time from pulse to pulse of a beacon that sends by itself, in seconds.
    interval: Option<f64>,
}

/// A round of requests to one beacon after the other, over and over again, each answer attributed
/// to where and when its power was measured.
#[derive(Clone, Copy, Debug, Default)]
struct Interrogation {
    /// Index of the next beacon.
    next: usize,
    /// Time of the last request.
    last: Option<f64>,
    /// The request without an answer yet: when and from where it was sent.
    pending: Option<(f64, Pose)>,
    /// Answers whose power or place was not finite.
    dropped: u32,
}

impl Interrogation {
    /// Returns true if an answer is waited for.
    fn is_pending(&self) -> bool {
        self.pending.is_some()
    }

    /// Sends a request to the next beacon if it is time to; returns true if it was.
    fn request<R: Radio>(
        &mut self,
        radio: &mut R,
        recorder: &mut TurnRecorder,
        timing: &Timing,
        now: f64,
        here: Pose,
    ) -> Result<bool, R::Error> {
        // One request at a time, however quick the radio: a poll ends. Sums of steps are forgiven a
        // nanosecond.
        let early = |last: f64| now <= last || now < last + timing.spacing - 1e-9;
        if self.last.is_some_and(early) {
            return Ok(false);
        }
        radio.request(recorder.beacon(self.next).beacon)?;
        self.last = Some(now);
        self.pending = Some((now, here));
        Ok(true)
    }

    /// Takes the answer if it has come, and gives up one that is late; returns true if the request
    /// is settled.
    fn poll<R: Radio>(
        &mut self,
        radio: &mut R,
        recorder: &mut TurnRecorder,
        timing: &Timing,
        now: f64,
        here: Option<Pose>,
    ) -> Result<bool, R::Error> {
        let Some((requested, from)) = self.pending else { return Ok(true) };
        let answer = radio.poll();
        if !matches!(answer, Ok(Some(_))) && now >= requested + timing.answer_timeout {
            self.give_up(recorder, timing, now);
            return answer.map(|_| true);
        }
        let Some(rss_dbm) = answer? else { return Ok(false) };
        match here {
            Some(here) if rss_dbm.is_finite() => {
                let known = radio.measured_at().filter(|_| now > requested);
                let share = known.map_or(timing.measured_at, |time| {
                    ((time - requested) / (now - requested)).clamp(0.0, 1.0)
                });
                let receiver = between(&from, &here, share);
                let boresight = angle::wrap(receiver.heading + timing.mount_offset);
                recorder.beacon(self.next).samples.push(Sample {
                    time: requested + (now - requested) * share,
                    receiver,
                    boresight,
                    position: nearest_position(boresight, timing.positions),
                    rss_dbm,
                });
            }
            _ => self.dropped += 1,
        }
        self.settle(recorder);
        Ok(true)
    }

    /// Records the pending request as unanswered, if there is one, and an answer was due.
    fn give_up(&mut self, recorder: &mut TurnRecorder, timing: &Timing, now: f64) {
        let Some((requested, from)) = self.pending else { return };
        let beacon = recorder.beacon(self.next);
        if timing.was_due(beacon.samples.last(), requested, now) {
            let boresight = angle::wrap(from.heading + timing.mount_offset);
            let position = nearest_position(boresight, timing.positions);
            beacon.unanswered.push(Unanswered { time: now, boresight, position });
        }
        self.settle(recorder);
    }

    fn settle(&mut self, recorder: &TurnRecorder) {
        self.pending = None;
        self.next = (self.next + 1) % recorder.count().max(1);
    }
}

impl Timing {
    /// Returns true if an answer should have come between two times: always of a beacon that
    /// answers; of one that sends by itself where the next pulse after the last one that came was
    /// due, or the one after that, and so on. Before the first pulse of a turn nothing is known.
    fn was_due(&self, last: Option<&Sample>, from: f64, to: f64) -> bool {
        let Some(interval) = self.interval else { return true };
        // The last one may have come when its request's time was nearly up.
        let late = self.answer_timeout + LATE * interval;
        let pulses = |time: f64, last: &Sample| {
            libm::fmax(libm::floor((time - last.time - late) / interval), 0.0)
        };
        last.is_some_and(|last| pulses(to, last) > pulses(from, last))
    }
}

/// A recorder of one turn for several beacons: it collects their samples, and lends a sweep for
/// each once the turn is over.
#[derive(Clone, Debug, Default)]
struct TurnRecorder {
    /// One for each beacon; time, place and limits are filled in when it is lent.
    sweeps: Vec<OwnedSweep>,
    /// Time of the turn's end, if it is over.
    ended: Option<f64>,
    lent: usize,
    /// The worst σ of the vehicle's places so far, each coordinate by itself.
    place_sigma: Option<Vector3<f64>>,
    /// Each beacon's number of samples when it was last held against a goal, and true if it reached
    /// it.
    judged: Vec<(usize, bool)>,
}

impl TurnRecorder {
    /// A turn that begins for `beacons`.
    fn new(beacons: &[BeaconId]) -> Self {
        let empty = |&beacon| OwnedSweep { beacon, ..OwnedSweep::default() };
        Self { sweeps: beacons.iter().map(empty).collect(), ..Self::default() }
    }

    /// Makes room for `samples` samples of each beacon.
    fn reserve(&mut self, samples: usize) {
        for sweep in &mut self.sweeps {
            sweep.samples.reserve_exact(samples);
        }
    }

    /// The record of one of the beacons, by its index in the turn.
    fn beacon(&mut self, index: usize) -> &mut OwnedSweep {
        &mut self.sweeps[index]
    }

    /// Number of beacons.
    fn count(&self) -> usize {
        self.sweeps.len()
    }

    /// Takes the σ of a place that the vehicle reported.
    fn add_place_sigma(&mut self, sigma: Option<Vector3<f64>>) {
        let worst = |sigma: Vector3<f64>| self.place_sigma.map_or(sigma, |worst| worst.sup(&sigma));
        self.place_sigma = sigma.map(worst).or(self.place_sigma);
    }

    /// Returns true if the turn is over.
    fn has_ended(&self) -> bool {
        self.ended.is_some()
    }

    /// The records of all beacons.
    fn beacons_mut(&mut self) -> impl Iterator<Item = &mut OwnedSweep> {
        self.sweeps.iter_mut()
    }

    /// Returns true if no sample was taken at all.
    fn is_empty(&self) -> bool {
        self.sweeps.iter().all(|sweep| sweep.samples.is_empty())
    }

    /// Returns true if the records of all beacons that were received at all reach a goal.
    /// `from_nose`: boresights of unanswered questions are still counted from the nose.
    fn reaches(
        &mut self,
        goal: &TurnGoal,
        positions: u16,
        floor_dbm: Option<f64>,
        from_nose: bool,
    ) -> bool {
        self.judged.resize(self.sweeps.len(), (0, true));
        self.sweeps.iter().zip(&mut self.judged).all(|(sweep, judged)| {
            // What did not come teaches too little to be worth a fit of its own.
            if judged.0 != sweep.samples.len() {
                let receiver = Pose::mean(sweep.samples.iter().map(|sample| &sample.receiver))
                    .unwrap_or_default();
                let mut record = sweep.clone();
                for unanswered in record.unanswered.iter_mut().filter(|_| from_nose) {
                    unanswered.boresight = angle::wrap(receiver.heading + unanswered.boresight);
                }
                let sweep = Sweep { receiver, positions, floor_dbm, ..record.as_sweep() };
                *judged = (sweep.samples.len(), goal.is_reached(&sweep));
            }
            judged.1
        })
    }

    /// Ends the turn: its sweeps may be lent.
    fn end(&mut self, time: f64) {
        self.ended = Some(time);
    }

    /// Returns true if there is a sweep that was not lent yet, of a turn that is over or not.
    fn has_more(&self) -> bool {
        self.lent < self.sweeps.len()
    }

    /// The next sweep of a turn that is over, each once; `fallback` is where the receiver was if
    /// there is no sample.
    fn lend(
        &mut self,
        positions: u16,
        floor_dbm: Option<f64>,
        fallback: Pose,
    ) -> Option<Sweep<'_>> {
        let time = self.ended?;
        let sweep = self.sweeps.get(self.lent)?;
        self.lent += 1;
        Some(Sweep {
            time,
            receiver: Pose::mean(sweep.samples.iter().map(|sample| &sample.receiver))
                .unwrap_or(fallback),
            positions,
            floor_dbm,
            receiver_sigma_m: self.place_sigma,
            ..sweep.as_sweep()
        })
    }
}

/// Goal of a turn: it goes on until its bearings are as certain as wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct TurnGoalConfig {
    /// σ in degrees that a bearing is wanted with.
    pub bearing_sigma_deg: f64,
    /// A turn ends after this long, in seconds, however uncertain its bearings are.
    pub longest_s: f64,
}

impl TurnGoalConfig {
    /// Checks the ranges of all numbers.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the first that is out of its range.
    pub fn check(&self) -> Result<(), FieldError> {
        let wanted = "from 0.01 to 57, the widest bearing that is used";
        in_range("bearing_sigma_deg", self.bearing_sigma_deg, 0.01..=57.0, wanted)?;
        positive("longest_s", self.longest_s)?;
        Ok(())
    }
}

/// A goal of turns, and the extractor that tells how near a turn is to it.
#[derive(Clone)]
pub struct TurnGoal {
    /// Largest wanted σ of a bearing, in radians.
    sigma: f64,
    longest_s: f64,
    extractor: Arc<dyn BearingExtractor + Send + Sync>,
}

impl fmt::Debug for TurnGoal {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { sigma, longest_s, .. } = self;
        to.debug_struct("TurnGoal")
            .field("sigma", sigma)
            .field("longest_s", longest_s)
            .finish_non_exhaustive()
    }
}

impl TurnGoal {
    /// A goal for the bearings of an extractor, by its
    /// [expected σ](BearingExtractor::expected_sigma).
    ///
    /// # Errors
    ///
    /// [`FieldError`] names what is out of range in the configuration.
    pub fn new(
        config: TurnGoalConfig,
        extractor: Arc<dyn BearingExtractor + Send + Sync>,
    ) -> Result<Self, FieldError> {
        config.check()?;
        let TurnGoalConfig { bearing_sigma_deg, longest_s } = config;
        Ok(Self { sigma: bearing_sigma_deg.to_radians(), longest_s, extractor })
    }

    /// The longest that a turn goes on, in seconds.
    #[must_use]
    pub fn longest_s(&self) -> f64 {
        self.longest_s
    }

    /// Returns true if the bearing from such samples is expected to be as certain as wanted.
    fn is_reached(&self, sweep: &Sweep<'_>) -> bool {
        self.extractor.expected_sigma(sweep).is_some_and(|sigma| sigma <= self.sigma)
    }

    /// Number of questions, `least` to `most`, that a turn through `antenna` is expected to take if
    /// they are spread evenly over the circle: with that many a turn without noise reaches the
    /// goal. `over_floor_db` is how far the mean level lies above the receiver's floor, infinite
    /// where all are answered. Where it is not reached, `most`.
    #[must_use]
    pub fn expected_questions(
        &self,
        antenna: &dyn Antenna,
        elevation: f64,
        over_floor_db: f64,
        (least, most): (u16, u16),
    ) -> u16 {
        let mean_db = antenna.mean_gain_db(elevation);
        let floor_dbm = over_floor_db.is_finite().then_some(-over_floor_db);
        let reached = |count: u16| {
            let receiver = Pose::at(0.0, 0.0, 0.0);
            let mut samples = Vec::new();
            let mut unanswered = Vec::new();
            for position in 0..count {
                // A third of a step off the axis: neither the best nor the worst of places.
                let boresight = angle::wrap(TAU * (f64::from(position) + 0.33) / f64::from(count));
                let rss_dbm = antenna.gain_dbi(-boresight, elevation) - mean_db;
                let time = f64::from(position);
                if floor_dbm.is_some_and(|floor| rss_dbm < floor) {
                    unanswered.push(Unanswered { time, boresight, position });
                } else {
                    samples.push(Sample { time, receiver, boresight, position, rss_dbm });
                }
            }
            self.is_reached(&Sweep {
                time: f64::from(count),
                receiver,
                positions: count,
                samples: &samples,
                unanswered: &unanswered,
                floor_dbm,
                ..Sweep::default()
            })
        };
        let mut below = least.max(1) - 1;
        let mut count = least.max(1);
        while count < most && !reached(count) {
            (below, count) = (count, count.saturating_mul(2).min(most));
        }
        // Between one that was too few and one that is enough.
        while count - below > 1 {
            let middle = below + (count - below) / 2;
            if reached(middle) {
                count = middle;
            } else {
                below = middle;
            }
        }
        count
    }

    /// The speed in radians per second, `fastest` at most, at which a body turns so that pulses
    /// that come each `interval_s` spread over the circle: some eight in a turn, the next turn's
    /// between them by the golden section.
    #[must_use]
    fn rate_rad_s(interval_s: f64, fastest: f64) -> f64 {
        const PULSES: f64 = 8.618_033_988_749_895;
        (TAU / (PULSES * interval_s)).min(fastest.abs()).copysign(fastest)
    }
}

/// The pose a share of the way from one to another, the short way round; with a velocity where both
/// have one.
fn between(from: &Pose, to: &Pose, share: f64) -> Pose {
    let turned = |from: f64, to: f64| from + angle::wrap(to - from) * share;
    Pose {
        position: from.position + (to.position - from.position) * share,
        heading: angle::wrap(turned(from.heading, to.heading)),
        pitch: turned(from.pitch, to.pitch),
        roll: turned(from.roll, to.roll),
        velocity: from.velocity.zip(to.velocity).map(|(from, to)| from + (to - from) * share),
    }
}

/// Offset of the boresights of a stepper's round from the first round's, as a share of a step:
/// halves, then quarters, then eighths (van der Corput 1935), and after eight rounds again.
fn between_steps(round: u32) -> f64 {
    f64::from((round % 8).reverse_bits() >> 29) / 8.0
}
