use std::f64::consts::TAU;

use foxhunt_core::BeaconId;
use nalgebra::Vector3;
use rand::RngExt;
use rand_distr::StandardNormal;

use super::{Channel, is_due, streams::Streams};

/// A drone that moves farther than this begins a new pattern, in metres: fading is another one
/// there.
const SAME_PLACE: f64 = 0.5;

/// The radio of a drone, and what is drawn for it.
#[derive(Debug)]
pub(crate) struct Receiver {
    streams: Streams,
    /// From a question to its answer, in seconds.
    latency: f64,
    /// No answer comes at this time or later.
    silent_after: f64,
    /// The present ones, of different beacons.
    patterns: Vec<Pattern>,
    path: Path,
    look: Look,
    answer: Option<Answer>,
}

/// A question as it leaves the antenna.
#[derive(Clone, Copy, Debug)]
pub(super) struct Question {
    pub(super) time: f64,
    pub(super) beacon: BeaconId,
    pub(super) from: Vector3<f64>,
    pub(super) to: Vector3<f64>,
    /// In radians counter-clockwise from East.
    pub(super) boresight: f64,
    /// How far the body has turned about up since the beginning, in radians.
    pub(super) turned: f64,
    /// Whether it goes through the antenna; otherwise through one that hears alike from everywhere.
    pub(super) directional: bool,
}

/// What the samples of one pattern share.
#[derive(Clone, Copy, Debug)]
struct Pattern {
    beacon: BeaconId,
    place: Vector3<f64>,
    /// How far the body had turned when it began.
    turned: f64,
    offset_db: f64,
    bearing_error: f64,
}

/// What does not change while neither drone nor beacon moves.
#[derive(Clone, Copy, Debug)]
struct Path {
    sight: Vector3<f64>,
    level_dbm: f64,
    bearing: f64,
}

/// What does not change, besides, while the antenna stands.
#[derive(Clone, Copy, Debug)]
struct Look {
    arrival: f64,
    gain_db: f64,
}

#[derive(Clone, Copy, Debug)]
struct Answer {
    time: f64,
    rss_dbm: f64,
}

impl Receiver {
    pub(super) fn new(
        channel: &Channel,
        streams: Streams,
        latency: f64,
        silent_after: Option<f64>,
    ) -> Self {
        Self {
            streams,
            latency,
            silent_after: silent_after.unwrap_or(f64::INFINITY),
            patterns: Vec::new(),
            path: Path::new(channel, Vector3::zeros()),
            look: Look::new(channel, 0.0),
            answer: None,
        }
    }

    /// The next question, whomever it asks, begins a new pattern.
    pub(super) fn end_patterns(&mut self) {
        self.patterns.clear();
    }

    /// Draws the answer; an older one that was not taken is given up.
    pub(super) fn ask(&mut self, channel: &Channel, question: &Question) {
        let pattern = self.pattern_for(channel, question);
        let sight = question.to - question.from;
        if self.path.sight != sight {
            self.path = Path::new(channel, sight);
        }
        // The pattern's error turns everything that the antenna sees.
        let arrival = self.path.bearing + pattern.bearing_error - question.boresight;
        if self.look.arrival.to_bits() != arrival.to_bits() {
            self.look = Look::new(channel, arrival);
        }
        let noise: f64 = self.streams.sample.sample(StandardNormal);
        let gain_db = if question.directional { self.look.gain_db } else { 0.0 };
        let power_dbm =
            self.path.level_dbm + gain_db + pattern.offset_db + channel.sample_sigma_db * noise;

        let lost = self.streams.loss.random::<f64>() < channel.loss_probability;
        let time = question.time + self.latency;
        self.answer = channel
            .reading_dbm(power_dbm)
            .filter(|_| !lost && time < self.silent_after)
            .map(|rss_dbm| Answer { time, rss_dbm });
    }

    /// The answer's power in dBm, once it has come.
    pub(crate) fn take_answer(&mut self, now: f64) -> Option<f64> {
        self.answer.take_if(|answer| is_due(answer.time, now)).map(|answer| answer.rss_dbm)
    }

    fn pattern_for(&mut self, channel: &Channel, question: &Question) -> Pattern {
        let known = self.patterns.iter().position(|p| p.beacon == question.beacon);
        if let Some(index) = known {
            let pattern = self.patterns[index];
            // A body that has been all the way round begins another one, as an antenna does.
            let round = (question.turned - pattern.turned).abs() > TAU - 1e-9;
            if (question.from - pattern.place).norm() <= SAME_PLACE && !round {
                return pattern;
            }
            self.patterns.swap_remove(index);
        }
        let offset: f64 = self.streams.pattern.sample(StandardNormal);
        let error: f64 = self.streams.pattern.sample(StandardNormal);
        let pattern = Pattern {
            beacon: question.beacon,
            place: question.from,
            turned: question.turned,
            offset_db: channel.pattern_sigma_db * offset,
            bearing_error: channel.bearing_sigma * error,
        };
        self.patterns.push(pattern);
        pattern
    }
}

impl Path {
    fn new(channel: &Channel, sight: Vector3<f64>) -> Self {
        let bearing = libm::atan2(sight.y, sight.x);
        Self { sight, level_dbm: channel.level_dbm(sight.norm()), bearing }
    }
}

impl Look {
    fn new(channel: &Channel, arrival: f64) -> Self {
        Self { arrival, gain_db: channel.relative_gain_db(arrival) }
    }
}
