use std::f64::consts::TAU;

use foxhunt_core::{BeaconId, Pose};
use foxhunt_sensors::Antenna;
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
    /// From a request to its answer, in seconds.
    latency: f64,
    /// The present ones, of different beacons.
    patterns: Vec<Pattern>,
    /// The last ones, of different beacons.
    ways: Vec<Way>,
    answer: Option<Answer>,
}

/// The antenna that a signal comes in through.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Port<'a> {
    /// That of the channel.
    Directional,
    /// One with the same gain in all directions, the mean of that of the channel.
    Omnidirectional,
    /// A user's own.
    Own(&'a dyn Antenna),
}

impl Port<'_> {
    /// Whether it is one of the channel's own, and then the same as another one.
    fn is_same(self, other: Port<'_>) -> bool {
        use Port::{Directional, Omnidirectional};
        matches!((self, other), (Directional, Directional) | (Omnidirectional, Omnidirectional))
    }
}

/// A signal as it comes in at the antenna.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival<'a> {
    pub(super) beacon: BeaconId,
    pub(super) receiver: Pose,
    /// Where the beacon is.
    pub(super) to: Vector3<f64>,
    /// How far the antenna is turned from the nose, in radians.
    pub(super) turned: f64,
    /// How far the body has turned about up since the beginning, in radians.
    pub(super) spun: f64,
    /// Through which antenna.
    pub(super) port: Port<'a>,
    /// Whether the beacon transmits, its signal reaches the place, and the radio works when the
    /// answer comes.
    pub(super) transmitted: bool,
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

/// The path from a beacon, and the antenna's gain along it.
#[derive(Clone, Debug)]
struct Way {
    path: Path,
    look: Option<Look>,
}

/// The gain in one direction, which does not change while neither drone, beacon nor antenna moves.
#[derive(Clone, Copy, Debug)]
struct Look {
    receiver: Pose,
    turned: f64,
    port: Port<'static>,
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

    /// From a request to its answer, in seconds.
    pub(super) fn latency(&self) -> f64 {
        self.latency
    }

    /// Ends all patterns: the next sample of any beacon begins a new one.
    pub(crate) fn end_patterns(&mut self) {
        self.patterns.clear();
    }

    /// Draws the answer to a request at the time `now`; an older one that was not taken is given
    /// up.
    pub(super) fn request(&mut self, channel: &Channel, arrival: &Arrival<'_>, now: f64) {
        let time = now + self.latency;
        let reading = self.draw(channel, arrival);
        self.answer = reading.map(|rss_dbm| Answer { time, rss_dbm });
    }

    /// Draws what the receiver reads, in dBm; `None` for a sample that is lost, below the floor or
    /// not transmitted.
    pub(super) fn draw(&mut self, channel: &Channel, arrival: &Arrival<'_>) -> Option<f64> {
        let pattern = self.pattern_for(channel, arrival);
        // The pattern's error turns everything that the antenna receives.
        let turned = arrival.turned - pattern.bearing_error;
        let (level_dbm, gain_db) = self.level_and_gain(channel, arrival, turned);
        let noise: f64 = self.streams.sample.sample(StandardNormal);
        let power_dbm = level_dbm + gain_db + pattern.offset_db + channel.sample_sigma_db * noise;

        let lost = self.streams.loss.random::<f64>() < channel.loss_probability;
        channel.reading_dbm(power_dbm).filter(|_| !lost && arrival.transmitted)
    }

    /// The answer's power in dBm, once it has come.
    pub(crate) fn take_answer(&mut self, now: f64) -> Option<f64> {
        self.answer.take_if(|answer| is_due(answer.time, now)).map(|answer| answer.rss_dbm)
    }

    /// The level over a level turn, and the gain over its mean there. Samples in one place and
    /// direction have it from the last of them.
    fn level_and_gain(
        &mut self,
        channel: &Channel,
        arrival: &Arrival<'_>,
        turned: f64,
    ) -> (f64, f64) {
        let Arrival { receiver, port, .. } = *arrival;
        let (beacon, from) = (usize::from(arrival.beacon.0), receiver.position);
        let path = || Path::new(channel, beacon, from, arrival.to);
        let known = self.ways.iter().position(|way| way.path.beacon() == beacon);
        let index = known.unwrap_or_else(|| {
            self.ways.push(Way { path: path(), look: None });
            self.ways.len() - 1
        });
        let way = &mut self.ways[index];
        if !way.path.is_between(&from, &arrival.to) {
            *way = Way { path: path(), look: None };
        }
        let same = |look: &&Look| {
            look.turned.to_bits() == turned.to_bits()
                && look.receiver == receiver
                && look.port.is_same(port)
        };
        if let Some(look) = way.look.as_ref().filter(same) {
            return (way.path.level_dbm, look.gain_db);
        }
        let gain_db = way.path.gain_db(channel, &receiver, turned, port);
        let port = match port {
            Port::Directional => Some(Port::Directional),
            Port::Omnidirectional => Some(Port::Omnidirectional),
            Port::Own(_) => None,
        };
        way.look = port.map(|port| Look { receiver, turned, port, gain_db });
        (way.path.level_dbm, gain_db)
    }

    fn pattern_for(&mut self, channel: &Channel, arrival: &Arrival<'_>) -> Pattern {
        let known = self.patterns.iter().position(|p| p.beacon == arrival.beacon);
        if let Some(index) = known {
            let pattern = self.patterns[index];
            // A body that has been all the way round begins another one, as an antenna does.
            let round = (arrival.spun - pattern.spun).abs() > TAU - 1e-9;
            if (arrival.receiver.position - pattern.place).norm() <= SAME_PLACE && !round {
                return pattern;
            }
            self.patterns.swap_remove(index);
        }
        let offset: f64 = self.streams.pattern.sample(StandardNormal);
        let error: f64 = self.streams.pattern.sample(StandardNormal);
        let pattern = Pattern {
            beacon: arrival.beacon,
            place: arrival.receiver.position,
            spun: arrival.spun,
            offset_db: channel.pattern_sigma_db * offset,
            bearing_error: channel.bearing_sigma * error,
        };
        self.patterns.push(pattern);
        pattern
    }
}
