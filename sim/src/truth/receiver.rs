use std::{
    f64::consts::{FRAC_1_SQRT_2, TAU},
    rc::Rc,
};

use foxhunt_core::{BeaconId, Pose};
use nalgebra::Vector3;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use super::{
    Channel, Port,
    path::{Arrivals, Path, Wave},
    scattering,
    streams::Streams,
    time::is_due,
};

/// A drone that moves farther than this begins a new pattern, in metres: fading is another one
/// there.
const SAME_PLACE: f64 = 0.5;

/// The radio of a drone, and what is drawn for it.
#[derive(Debug)]
pub(crate) struct Receiver {
    streams: Streams,
    /// Time from a request to its answer, in seconds.
    latency: f64,
    /// The present ones, of different beacons.
    patterns: Vec<Pattern>,
    /// The last ones, of different beacons.
    ways: Vec<Way>,
    /// The last sample's, of a drone that has not moved since.
    last: Option<Look>,
    answer: Option<Answer>,
}

/// A signal as it comes in at the antenna.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival<'a> {
    pub(super) beacon: BeaconId,
    pub(super) receiver: Pose,
    /// The beacon's place.
    pub(super) to: Vector3<f64>,
    /// Angle of the antenna from the nose, in radians.
    pub(super) turned: f64,
    /// The angle by which the body has turned about up since the beginning, in radians.
    pub(super) spun: f64,
    /// The antenna that it comes in through.
    pub(super) port: Port<'a>,
}

/// The signal of a beacon at a place, but for each sample's own noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct Signal {
    pub(super) power_dbm: f64,
    /// True if anything is received at the place.
    pub(super) reaches: bool,
}

/// The draws that the samples of one pattern share.
#[derive(Clone, Debug)]
struct Pattern {
    beacon: BeaconId,
    place: Vector3<f64>,
    /// The angle by which the body had turned when it began.
    spun: f64,
    offset_db: f64,
    bearing_error: f64,
    /// The scattered waves; `None` where nothing scatters.
    scattered: Option<Rc<[Wave]>>,
    /// Its turn is over.
    ended: bool,
}

/// The path from a beacon, and where its waves come from.
#[derive(Clone, Debug)]
struct Way {
    path: Path,
    arrivals: Arrivals,
}

/// The signal in one direction, which does not change while neither drone, beacon nor antenna
/// moves; while the antenna alone does, all but the gain stays.
#[derive(Clone, Debug)]
struct Look {
    beacon: BeaconId,
    turned: f64,
    port: Port<'static>,
    signal: Signal,
    /// The index of the signal's way, and its pattern.
    way: usize,
    pattern: Pattern,
}

/// The answer to a request.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    /// The time when it comes.
    pub(super) time: f64,
    pub(super) rss_dbm: f64,
}

impl Way {
    /// The power that comes in, in dBm, through an antenna that is turned by `turned` from the
    /// nose.
    fn power_dbm(&self, channel: &Channel, pattern: &Pattern, turned: f64, port: Port<'_>) -> f64 {
        // The pattern's error turns everything that the antenna receives.
        let turned = turned - pattern.bearing_error;
        let scattered = pattern.scattered.as_deref().unwrap_or_default();
        let gain_db = self.arrivals.gain_db(channel, scattered, turned, port);
        self.path.level_dbm + gain_db + pattern.offset_db
    }
}

impl Receiver {
    pub(super) fn new(streams: Streams, latency: f64) -> Self {
        Self { streams, latency, patterns: Vec::new(), ways: Vec::new(), last: None, answer: None }
    }

    /// Time from a request to its answer, in seconds.
    pub(crate) fn latency(&self) -> f64 {
        self.latency
    }

    /// Noise of mean square 1 on each of three axes, and a sign by chance.
    pub(super) fn field_noise(&mut self) -> (Vector3<f64>, f64) {
        let sample = &mut self.streams.sample;
        let noise = Vector3::from_fn(|_, _| StandardNormal.sample(sample));
        (noise, if sample.random::<bool>() { 1.0 } else { -1.0 })
    }

    /// Ends all patterns: unless they stay, the next sample of any beacon begins a new one.
    pub(crate) fn end_patterns(&mut self) {
        self.patterns.iter_mut().for_each(|pattern| pattern.ended = true);
        self.last = None;
    }

    /// The drone has moved: nothing is as it was.
    pub(super) fn forget_last(&mut self) {
        self.last = None;
    }

    /// The signal of the beacon of the last sample through the same antenna, whichever way that
    /// looks now, if the drone has not moved since.
    pub(super) fn last(
        &mut self,
        channel: &Channel,
        beacon: BeaconId,
        port: Port<'_>,
        turned: f64,
    ) -> Option<Signal> {
        let same = |look: &&mut Look| look.beacon == beacon && look.port.is_same(port);
        let look = self.last.as_mut().filter(same)?;
        if look.turned.to_bits() != turned.to_bits() {
            look.turned = turned;
            look.signal.power_dbm =
                self.ways.get(look.way)?.power_dbm(channel, &look.pattern, turned, port);
        }
        Some(look.signal)
    }

    /// Keeps a sample's signal for the next one.
    fn keep_last(&mut self, arrival: &Arrival<'_>, signal: Signal, way: usize, pattern: Pattern) {
        let Arrival { beacon, turned, port, .. } = *arrival;
        let look = |port| Look { beacon, turned, port, signal, way, pattern };
        self.last = port.of_the_channel().map(look);
    }

    /// Awaits this answer, if there is one; an older one that was not taken is given up.
    pub(super) fn await_answer(&mut self, answer: Option<Answer>) {
        self.answer = answer;
    }

    /// Draws what the receiver reads of a signal, in dBm; `None` for a sample that is lost, below
    /// the floor or not transmitted.
    #[inline(always)]
    pub(super) fn draw(
        &mut self,
        channel: &Channel,
        power_dbm: f64,
        transmitted: bool,
    ) -> Option<f64> {
        let faded = self.faded(channel, power_dbm);
        let noisy = faded.map(|power_dbm| match channel.noise_dbm {
            Some(noise_dbm) => self.noisy(power_dbm, noise_dbm),
            None => power_dbm,
        });
        noisy.and_then(|power_dbm| channel.reading_dbm(power_dbm)).filter(|_| transmitted)
    }

    /// A power with the receiver's noise added in phase and quadrature, its mean taken off again;
    /// 30 dB below the noise at least.
    #[inline(never)]
    fn noisy(&mut self, power_dbm: f64, noise_dbm: f64) -> f64 {
        let amplitude = libm::exp10((power_dbm - noise_dbm) / 20.0);
        let [in_phase, quadrature]: [f64; 2] =
            std::array::from_fn(|_| self.streams.sample.sample(StandardNormal));
        let noise = [in_phase, quadrature].map(|part| part * FRAC_1_SQRT_2);
        let wave = amplitude + noise[0];
        let power = wave * wave + noise[1] * noise[1];
        noise_dbm + 10.0 * libm::log10((power - 1.0).max(1e-3))
    }

    /// Draws a sample's own noise and whether it is lost: its power in dBm, unless it is.
    #[inline(always)]
    pub(super) fn faded(&mut self, channel: &Channel, power_dbm: f64) -> Option<f64> {
        let noise: f64 = self.streams.sample.sample(StandardNormal);
        // Losses have a stream of their own: nobody misses what is not drawn from it.
        let lost = channel.loss_probability > 0.0
            && self.streams.loss.random::<f64>() < channel.loss_probability;
        (!lost).then_some(power_dbm + channel.sample_sigma_db * noise)
    }

    /// The signal that comes in but for each sample's own noise; kept for the next sample of a
    /// drone that stays.
    pub(super) fn signal(
        &mut self,
        channel: &Channel,
        arrival: &Arrival<'_>,
        stays: bool,
    ) -> Signal {
        let pattern = self.pattern_for(channel, arrival);
        let way = self.way(channel, arrival);
        let power_dbm = self.ways[way].power_dbm(channel, &pattern, arrival.turned, arrival.port);
        let signal = Signal { power_dbm, reaches: channel.reaches(&arrival.receiver.position) };
        if stays {
            self.keep_last(arrival, signal, way, pattern);
        }
        signal
    }

    /// The time of the answer that is on its way; infinite if there is no such answer.
    pub(crate) fn answers_at(&self) -> f64 {
        self.answer.map_or(f64::INFINITY, |answer| answer.time)
    }

    /// The answer's power in dBm, once it has come.
    pub(crate) fn take_answer(&mut self, now: f64) -> Option<f64> {
        self.answer.take_if(|answer| is_due(answer.time, now)).map(|answer| answer.rss_dbm)
    }

    /// The index of a signal's way.
    fn way(&mut self, channel: &Channel, arrival: &Arrival<'_>) -> usize {
        let beacon = usize::from(arrival.beacon.0);
        let receiver = &arrival.receiver;
        let way = || {
            let path = Path::new(channel, beacon, receiver.position, arrival.to);
            let arrivals = path.arrivals(receiver);
            Way { path, arrivals }
        };
        let known = self.ways.iter().position(|way| way.path.beacon() == beacon);
        let index = known.unwrap_or_else(|| {
            self.ways.push(way());
            self.ways.len() - 1
        });
        let known = &mut self.ways[index];
        if !known.path.is_between(&receiver.position, &arrival.to) {
            *known = way();
        } else if !known.arrivals.are_at(receiver) {
            known.arrivals = known.path.arrivals(receiver);
        }
        index
    }

    fn pattern_for(&mut self, channel: &Channel, arrival: &Arrival<'_>) -> Pattern {
        let known = self.patterns.iter().position(|p| p.beacon == arrival.beacon);
        if let Some(index) = known {
            let pattern = &self.patterns[index];
            // A body that has been all the way round begins another one, as an antenna does.
            let ended = pattern.ended || (arrival.spun - pattern.spun).abs() > TAU - 1e-9;
            let stays = channel.patterns_stay || !ended;
            if (arrival.receiver.position - pattern.place).norm() <= SAME_PLACE && stays {
                return pattern.clone();
            }
            self.patterns.swap_remove(index);
        }
        let offset: f64 = self.streams.pattern.sample(StandardNormal);
        let error: f64 = self.streams.pattern.sample(StandardNormal);
        let draw = |scattering: &_| scattering::draw(scattering, &mut self.streams.pattern);
        let (share_db, scattered) = channel.scattering.as_ref().map(draw).unzip();
        let pattern = Pattern {
            beacon: arrival.beacon,
            place: arrival.receiver.position,
            spun: arrival.spun,
            offset_db: channel.pattern_sigma_db * offset + share_db.unwrap_or(0.0),
            bearing_error: channel.bearing_sigma * error,
            scattered,
            ended: false,
        };
        self.patterns.push(pattern.clone());
        pattern
    }
}
