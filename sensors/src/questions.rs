use foxhunt_core::{Pose, Radio, Sample, Unheard, angle};

use crate::heard_turn::{HeardTurn, nearest};

/// How the questions of a turn are asked, and what their answers are taken for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Manner {
    /// From one question to the next, at least, in seconds.
    pub(crate) spacing: f64,
    /// How long an answer is waited for, in seconds.
    pub(crate) answer_timeout: f64,
    /// When between question (0) and answer (1) the power was measured.
    pub(crate) measured_at: f64,
    /// Where the antenna looks, in radians from the nose.
    pub(crate) mount_offset: f64,
    /// How many positions make a turn.
    pub(crate) positions: u16,
}

/// Questions to one beacon after the other, over and over again, each answer attributed to where
/// and when its power was measured.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Questions {
    /// Which beacon is next.
    next: usize,
    /// When the last question was asked.
    last: Option<f64>,
    /// The one that is waited for: when and from where it was asked.
    pending: Option<(f64, Pose)>,
    /// Answers whose power or place was not finite.
    pub(crate) dropped: u32,
}

impl Questions {
    /// Whether an answer is waited for.
    pub(crate) fn is_pending(&self) -> bool {
        self.pending.is_some()
    }

    /// Asks the next beacon if it is time to; whether it was.
    pub(crate) fn ask<R: Radio>(
        &mut self,
        radio: &mut R,
        heard: &mut HeardTurn,
        manner: &Manner,
        now: f64,
        here: Pose,
    ) -> Result<bool, R::Error> {
        // A question at a time, however quick the radio: a poll ends. Sums of steps are forgiven a
        // nanosecond.
        let early = |last: f64| now <= last || now < last + manner.spacing - 1e-9;
        if self.last.is_some_and(early) {
            return Ok(false);
        }
        radio.request(heard.beacon(self.next).id)?;
        (self.last, self.pending) = (Some(now), Some((now, here)));
        Ok(true)
    }

    /// Takes the answer if it has come, and gives up one that is late; whether the question is
    /// settled.
    pub(crate) fn listen<R: Radio>(
        &mut self,
        radio: &mut R,
        heard: &mut HeardTurn,
        manner: &Manner,
        now: f64,
        here: Option<Pose>,
    ) -> Result<bool, R::Error> {
        let Some((asked, from)) = self.pending else { return Ok(true) };
        let answer = radio.poll();
        if !matches!(answer, Ok(Some(_))) && now >= asked + manner.answer_timeout {
            self.give_up(heard, manner);
            return answer.map(|_| true);
        }
        let Some(rss_dbm) = answer? else { return Ok(false) };
        match here {
            Some(here) if rss_dbm.is_finite() => {
                let share = manner.measured_at;
                let receiver = between(&from, &here, share);
                let boresight = angle::wrap(receiver.heading + manner.mount_offset);
                heard.beacon(self.next).samples.push(Sample {
                    time: asked + (now - asked) * share,
                    receiver,
                    boresight,
                    position: nearest(boresight, manner.positions),
                    rss_dbm,
                });
            }
            _ => self.dropped += 1,
        }
        self.settle(heard);
        Ok(true)
    }

    /// The question that is waited for stays without an answer.
    pub(crate) fn give_up(&mut self, heard: &mut HeardTurn, manner: &Manner) {
        let Some((_, from)) = self.pending else { return };
        let boresight = angle::wrap(from.heading + manner.mount_offset);
        let position = nearest(boresight, manner.positions);
        heard.beacon(self.next).unheard.push(Unheard { boresight, position });
        self.settle(heard);
    }

    fn settle(&mut self, heard: &HeardTurn) {
        self.pending = None;
        self.next = (self.next + 1) % heard.count().max(1);
    }
}

/// The pose a share of the way from one to another, the short way round.
fn between(from: &Pose, to: &Pose, share: f64) -> Pose {
    let turned = |from: f64, to: f64| from + angle::wrap(to - from) * share;
    Pose {
        position: from.position + (to.position - from.position) * share,
        heading: angle::wrap(turned(from.heading, to.heading)),
        pitch: turned(from.pitch, to.pitch),
        roll: turned(from.roll, to.roll),
    }
}
