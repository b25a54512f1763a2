use foxhunt_core::{Pose, Radio, Sample, Unanswered, angle};

use crate::turn_recorder::{TurnRecorder, nearest_position};

/// Timing of interrogations, and attribution of answers to time and place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Timing {
    /// Least time from one request to the next, in seconds.
    pub(crate) spacing: f64,
    /// Maximum wait for an answer, in seconds.
    pub(crate) answer_timeout: f64,
    /// Time of the power's measurement between request (0) and answer (1).
    pub(crate) measured_at: f64,
    /// The antenna's direction, in radians from the nose.
    pub(crate) mount_offset: f64,
    /// Number of positions in a turn.
    pub(crate) positions: u16,
    /// Time from pulse to pulse of a beacon that sends by itself, in seconds.
    pub(crate) interval: Option<f64>,
}

/// Largest delay of a pulse that still counts as the one that was due, as a share of the interval.
const LATE: f64 = 0.02;

/// A round of requests to one beacon after the other, over and over again, each answer attributed
/// to where and when its power was measured.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Interrogation {
    /// Index of the next beacon.
    next: usize,
    /// Time of the last request.
    last: Option<f64>,
    /// The request without an answer yet: when and from where it was sent.
    pending: Option<(f64, Pose)>,
    /// Answers whose power or place was not finite.
    pub(crate) dropped: u32,
}

impl Interrogation {
    /// Returns true if an answer is waited for.
    pub(crate) fn is_pending(&self) -> bool {
        self.pending.is_some()
    }

    /// Sends a request to the next beacon if it is time to; returns true if it was.
    pub(crate) fn request<R: Radio>(
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
    pub(crate) fn poll<R: Radio>(
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
    pub(crate) fn give_up(&mut self, recorder: &mut TurnRecorder, timing: &Timing, now: f64) {
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
