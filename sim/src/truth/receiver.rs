use std::f64::consts::TAU;

use foxhunt_core::{BeaconId, Pose};
use nalgebra::Vector3;
use rand::RngExt;
use rand_distr::StandardNormal;

use super::{Channel, is_due, path::Path, streams::Streams};

/// A drone that moves farther than this begins a new pattern, in metres: fading is another one
/// there.
const SAME_PLACE: f64 = 0.5;

/// The radio of a drone, and what is drawn for it.
#[derive(Debug)]
pub(crate) struct Receiver {
    streams: Streams,
    /// From a question to its answer, in seconds.
    latency: f64,
    /// The present ones, of different beacons.
    patterns: Vec<Pattern>,
    /// The last ones, of different beacons.
    ways: Vec<Way>,
    answer: Option<Answer>,
}

/// A question as it leaves the antenna.
#[derive(Clone, Copy, Debug)]
pub(super) struct Question {
    pub(super) time: f64,
    pub(super) beacon: BeaconId,
    pub(super) receiver: Pose,
    /// Where the beacon is.
    pub(super) to: Vector3<f64>,
    /// How far the antenna is turned from the nose, in radians.
    pub(super) turned: f64,
    /// How far the body has turned about up since the beginning, in radians.
    pub(super) spun: f64,
    /// Whether it goes through the antenna; otherwise through one that hears alike from everywhere.
    pub(super) directional: bool,
    /// Whether anyone answers, and the radio works when the answer comes.
    pub(super) answered: bool,
}

/// What the samples of one pattern share.
#[derive(Clone, Copy, Debug)]
struct Pattern {
    beacon: BeaconId,
    place: Vector3<f64>,
    /// How far the body had turned when it began.
    spun: f64,
    offset_db: f64,
    bearing_error: f64,
}

/// The way from a beacon, and how the antenna looks at it.
#[derive(Clone, Debug)]
struct Way {
    path: Path,
    look: Look,
}

/// What does not change while neither drone, beacon nor antenna moves.
#[derive(Clone, Copy, Debug)]
struct Look {
    receiver: Pose,
    turned: f64,
    directional: bool,
    gain_db: f64,
}

#[derive(Clone, Copy, Debug)]
struct Answer {
    time: f64,
    rss_dbm: f64,
}

impl Receiver {
    pub(super) fn new(streams: Streams, latency: f64) -> Self {
        Self { streams, latency, patterns: Vec::new(), ways: Vec::new(), answer: None }
    }

    /// From a question to its answer, in seconds.
    pub(super) fn latency(&self) -> f64 {
        self.latency
    }

    /// The next question, whomever it asks, begins a new pattern.
    pub(super) fn end_patterns(&mut self) {
        self.patterns.clear();
    }

    /// Draws the answer; an older one that was not taken is given up.
    pub(super) fn ask(&mut self, channel: &Channel, question: &Question) {
        let pattern = self.pattern_for(channel, question);
        // The pattern's error turns everything that the antenna sees.
        let turned = question.turned - pattern.bearing_error;
        let (level_dbm, gain_db) = self.heard(channel, question, turned);
        let noise: f64 = self.streams.sample.sample(StandardNormal);
        let power_dbm = level_dbm + gain_db + pattern.offset_db + channel.sample_sigma_db * noise;

        let lost = self.streams.loss.random::<f64>() < channel.loss_probability;
        let time = question.time + self.latency;
        self.answer = channel
            .reading_dbm(power_dbm)
            .filter(|_| !lost && question.answered)
            .map(|rss_dbm| Answer { time, rss_dbm });
    }

    /// The answer's power in dBm, once it has come.
    pub(crate) fn take_answer(&mut self, now: f64) -> Option<f64> {
        self.answer.take_if(|answer| is_due(answer.time, now)).map(|answer| answer.rss_dbm)
    }

    /// The level over a level turn, and the gain over its mean there. Samples in one place and
    /// direction have it from the last of them.
    fn heard(&mut self, channel: &Channel, question: &Question, turned: f64) -> (f64, f64) {
        let (beacon, from) = (usize::from(question.beacon.0), question.receiver.position);
        let known = self.ways.iter().position(|way| way.path.beacon() == beacon);
        let known = known.map(|index| self.ways.swap_remove(index));
        let way = known.filter(|way| way.path.is_between(&from, &question.to));
        let (path, look) = match way {
            Some(way) => (way.path, Some(way.look)),
            None => (Path::new(channel, beacon, from, question.to), None),
        };
        let (receiver, directional) = (question.receiver, question.directional);
        let same = |look: &Look| {
            look.receiver == receiver
                && look.turned.to_bits() == turned.to_bits()
                && look.directional == directional
        };
        let look = look.filter(same).unwrap_or_else(|| Look {
            receiver,
            turned,
            directional,
            gain_db: path.gain_db(channel, &receiver, turned, directional),
        });
        let heard = (path.level_dbm, look.gain_db);
        self.ways.push(Way { path, look });
        heard
    }

    fn pattern_for(&mut self, channel: &Channel, question: &Question) -> Pattern {
        let known = self.patterns.iter().position(|p| p.beacon == question.beacon);
        if let Some(index) = known {
            let pattern = self.patterns[index];
            // A body that has been all the way round begins another one, as an antenna does.
            let round = (question.spun - pattern.spun).abs() > TAU - 1e-9;
            if (question.receiver.position - pattern.place).norm() <= SAME_PLACE && !round {
                return pattern;
            }
            self.patterns.swap_remove(index);
        }
        let offset: f64 = self.streams.pattern.sample(StandardNormal);
        let error: f64 = self.streams.pattern.sample(StandardNormal);
        let pattern = Pattern {
            beacon: question.beacon,
            place: question.receiver.position,
            spun: question.spun,
            offset_db: channel.pattern_sigma_db * offset,
            bearing_error: channel.bearing_sigma * error,
        };
        self.patterns.push(pattern);
        pattern
    }
}
