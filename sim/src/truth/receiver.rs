//! The radio of a drone, the paths that signals take to it, and what is drawn for each pattern and
//! sample.

use std::{
    f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, PI, TAU},
    rc::Rc,
};

use foxhunt_core::{BeaconId, Pose};
use foxhunt_sensors::ReflectedWave;
use nalgebra::Vector3;
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, StandardNormal};

use super::{Channel, Port, Streams, is_due};
use crate::{DroneConfig, ScatteringConfig};

/// A drone that moves farther than this begins a new pattern, in metres: fading is another one
/// there.
const SAME_PLACE: f64 = 0.5;

/// The way from a beacon to a receiver: what does not change while neither moves.
#[derive(Clone, Debug)]
struct Path {
    beacon: usize,
    from: Vector3<f64>,
    to: Vector3<f64>,
    /// The level over a level turn of the antenna.
    level_dbm: f64,
    reflected: Vec<Wave>,
}

/// A wave beside the direct one.
#[derive(Clone, Copy, Debug)]
struct Wave {
    /// The direction that it comes from, of any length.
    sight: Vector3<f64>,
    /// Amplitude over the direct wave's, before the antenna.
    amplitude: f64,
    /// The phase by which it leads the direct wave, in radians.
    phase: f64,
}

/// The directions that the waves of a path come from in the body's own frame: what does not change
/// while neither moves nor the body turns, whatever its antenna does.
#[derive(Clone, Debug)]
struct Arrivals {
    pose: Pose,
    /// The azimuth from the nose and the elevation of the direct wave.
    direct: (f64, f64),
    /// The reflected ones; their azimuths are from the nose.
    reflected: Vec<ReflectedWave>,
}

impl Path {
    /// The path from the receiver at `from` to the beacon at `to`.
    fn new(channel: &Channel, beacon: usize, from: Vector3<f64>, to: Vector3<f64>) -> Self {
        let level_dbm = channel.level_dbm(beacon, &from, &to);
        let direct = (to - from).norm();
        let reflected = channel.reflectors.iter().map(|reflector| {
            let sight = reflector.place - from;
            let excess = sight.norm() + (to - reflector.place).norm() - direct;
            let phase = reflector.phase - channel.wave_number * excess;
            Wave { sight, amplitude: reflector.amplitude, phase }
        });
        Self { beacon, from, to, level_dbm, reflected: reflected.collect() }
    }

    fn beacon(&self) -> usize {
        self.beacon
    }

    /// Returns true if receiver and beacon are still there.
    fn is_between(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        self.from == *from && self.to == *to
    }

    /// The arrivals of its waves at a receiver in a pose.
    fn arrivals(&self, pose: &Pose) -> Arrivals {
        let reflected = self.reflected.iter().map(|wave| wave.arrival(pose)).collect();
        Arrivals { pose: *pose, direct: arrival(pose, &(self.to - self.from)), reflected }
    }
}

impl Wave {
    /// The wave as it arrives at a body in a pose, its azimuth from the nose.
    fn arrival(&self, pose: &Pose) -> ReflectedWave {
        let Self { amplitude, phase, .. } = *self;
        let (azimuth, elevation) = arrival(pose, &self.sight);
        ReflectedWave { azimuth, elevation, amplitude, phase }
    }
}

impl Arrivals {
    /// Returns true if the arrivals belong to a receiver in a pose.
    fn are_at(&self, pose: &Pose) -> bool {
        self.pose == *pose
    }

    /// The antenna's gain over its mean, in dB; the antenna is turned by `turned` from the nose. An
    /// omnidirectional one has only the gain that reflected and scattered waves add.
    fn gain_db(&self, channel: &Channel, scattered: &[Wave], turned: f64, port: Port<'_>) -> f64 {
        let aimed = |wave: ReflectedWave| ReflectedWave { azimuth: wave.azimuth - turned, ..wave };
        let scattered = scattered.iter().map(|wave| wave.arrival(&self.pose));
        let reflected: Vec<_> =
            self.reflected.iter().copied().chain(scattered).map(aimed).collect();
        let (azimuth, elevation) = self.direct;
        channel.relative_gain_db(azimuth - turned, elevation, &reflected, port)
    }
}

/// The radio of a drone, and what is drawn for it.
#[derive(Debug)]
pub(crate) struct Receiver {
    streams: Streams,
    /// Time from a request to its answer, in seconds.
    latency: f64,
    /// Offsets of all levels in dB, and of all bearings in radians counter-clockwise.
    level_offset_db: f64,
    bearing_offset: f64,
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
    pub beacon: BeaconId,
    pub receiver: Pose,
    /// The beacon's place.
    pub to: Vector3<f64>,
    /// Angle of the antenna from the nose, in radians.
    pub turned: f64,
    /// The angle by which the body has turned about up since the beginning, in radians.
    pub spun: f64,
    /// The antenna that it comes in through.
    pub port: Port<'a>,
}

/// The signal of a beacon at a place, but for each sample's own noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct Signal {
    pub power_dbm: f64,
    /// True if anything is received at the place.
    pub reaches: bool,
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
    /// True if the turn of the pattern is over.
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
    pub time: f64,
    pub rss_dbm: f64,
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
    pub(super) fn new(streams: Streams, latency: f64, drone: &DroneConfig) -> Self {
        Self {
            streams,
            latency,
            level_offset_db: drone.level_offset_db,
            bearing_offset: -drone.compass_offset_deg.to_radians(),
            patterns: Vec::new(),
            ways: Vec::new(),
            last: None,
            answer: None,
        }
    }

    /// Offset of all bearings, in radians counter-clockwise.
    #[cfg(feature = "emulators")]
    pub(crate) fn bearing_offset(&self) -> f64 {
        self.bearing_offset
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
        let draw = |scattering: &_| scatter(scattering, &mut self.streams.pattern);
        let (share_db, scattered) = channel.scattering.as_ref().map(draw).unzip();
        let pattern = Pattern {
            beacon: arrival.beacon,
            place: arrival.receiver.position,
            spun: arrival.spun,
            offset_db: channel.pattern_sigma_db * offset
                + share_db.unwrap_or(0.0)
                + self.level_offset_db,
            bearing_error: channel.bearing_sigma * error + self.bearing_offset,
            scattered,
            ended: false,
        };
        self.patterns.push(pattern.clone());
        pattern
    }
}

/// Azimuth from the nose and elevation of a direction, for a body in a pose.
fn arrival(pose: &Pose, sight: &Vector3<f64>) -> (f64, f64) {
    let body = pose.to_body(sight);
    let azimuth = libm::atan2(body.y, body.x);
    (azimuth, libm::atan2(body.z, libm::hypot(body.x, body.y)))
}

/// Draws the scattered waves of a pattern: the direct wave's share of the power in dB, and the
/// waves.
fn scatter(config: &ScatteringConfig, random: &mut Xoshiro256PlusPlus) -> (f64, Rc<[Wave]>) {
    let normal: f64 = random.sample(StandardNormal);
    let k = libm::exp10((config.k_db + config.k_sigma_db * normal) / 10.0);
    // The mean square of a Rayleigh variable is twice the square of its scale.
    let scale = libm::sqrt(0.5 / (k * f64::from(config.waves)));
    let elevation_sigma = config.elevation_sigma_deg.to_radians();
    let wave = |_| {
        let [x, y, tilt]: [f64; 3] = std::array::from_fn(|_| random.sample(StandardNormal));
        let azimuth = random.random_range(-PI..PI);
        let elevation = (elevation_sigma * tilt).clamp(-FRAC_PI_2, FRAC_PI_2);
        let level = libm::cos(elevation);
        let east = level * libm::cos(azimuth);
        let north = level * libm::sin(azimuth);
        let sight = Vector3::new(east, north, libm::sin(elevation));
        Wave { sight, amplitude: scale * libm::hypot(x, y), phase: libm::atan2(y, x) }
    };
    let waves = (0..config.waves).map(wave).collect();
    (10.0 * libm::log10(k / (k + 1.0)), waves)
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_sensors::{Antenna, AntennaConfig, Dipole};
    use rand::SeedableRng;

    use super::*;
    use crate::{BeaconConfig, ChannelConfig};

    fn gain(antenna: AntennaConfig, pose: &Pose, to: Vector3<f64>, turned: f64) -> f64 {
        let config = ChannelConfig { antenna, ..ChannelConfig::default() };
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let channel =
            Channel::new(&config, None, &[BeaconConfig::default()], &mut rng).expect("in order");
        let path = Path::new(&channel, 0, pose.position, to);
        path.arrivals(pose).gain_db(&channel, &[], turned, Port::Directional)
    }

    const URBAN: ScatteringConfig =
        ScatteringConfig { k_db: 3.0, k_sigma_db: 0.0, waves: 6, elevation_sigma_deg: 15.0 };

    #[test]
    fn a_body_that_leans_tips_its_antenna() {
        let far_north = Vector3::new(0.0, 1000.0, 0.0);
        let level = Pose::level(Vector3::zeros(), std::f64::consts::FRAC_PI_2);
        let dipole = |pose: &Pose| gain(AntennaConfig::Dipole, pose, far_north, 0.3);
        assert_abs_diff_eq!(dipole(&level), 0.0, epsilon = 1e-9);
        // Nose down by 0.4 rad, the beacon ahead is 0.4 rad above the body's own horizon.
        let leaning = Dipole.gain_dbi(0.0, 0.4) - Dipole.gain_dbi(0.0, 0.0);
        assert_abs_diff_eq!(dipole(&Pose { pitch: -0.4, ..level }), leaning, epsilon = 1e-9);
        assert!(dipole(&Pose { roll: 0.4, ..level }).abs() < 1e-9, "about the line of sight");
        let above = Pose { position: Vector3::new(0.0, 1000.0, 1000.0), ..level };
        let below = gain(AntennaConfig::Dipole, &above, Vector3::new(1e3, 1e3, 0.0), 0.0);
        let at_45 = Dipole.gain_dbi(0.0, std::f64::consts::FRAC_PI_4) - Dipole.gain_dbi(0.0, 0.0);
        assert_abs_diff_eq!(below, at_45, epsilon = 1e-9);
    }

    #[test]
    fn heading_and_rotator_turn_it_alike() {
        let to = Vector3::new(30.0, 40.0, 0.0);
        let of = |heading: f64, turned: f64| {
            let pose = Pose { heading, ..Pose::default() };
            gain(AntennaConfig::ReferencePatch, &pose, to, turned)
        };
        assert_abs_diff_eq!(of(0.7, 0.2), of(0.0, 0.9), epsilon = 1e-9);
        let best = of(0.5, 40.0_f64.atan2(30.0) - 0.5);
        assert!(best > of(0.5, 0.0) && best > of(0.5, 1.0));
    }

    /// The direct wave and the scattered ones together have the power of the law, and K is their
    /// ratio; 4000 patterns of six waves, whose mean power has a standard error of 0.7 %.
    #[test]
    fn the_power_is_that_of_the_law() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
        let mut power = 0.0;
        let mut shares = Vec::new();
        for _ in 0..4000 {
            let (share_db, waves) = scatter(&URBAN, &mut random);
            power += waves.iter().map(|wave| wave.amplitude * wave.amplitude).sum::<f64>() / 4000.0;
            shares.push(libm::exp10(share_db / 10.0));
        }
        let k = libm::exp10(0.3);
        assert_abs_diff_eq!(power * k, 1.0, epsilon = 0.03);
        assert!(shares.iter().all(|share| (share * (1.0 + power) - 1.0).abs() < 0.01));
    }

    /// The logarithms of K over 4000 patterns have their median and their σ.
    #[test]
    fn k_is_log_normal() {
        let config = ScatteringConfig { k_sigma_db: 5.0, ..URBAN };
        let mut random = Xoshiro256PlusPlus::seed_from_u64(8);
        let mut k_db: Vec<f64> = (0..4000)
            .map(|_| {
                let share = libm::exp10(scatter(&config, &mut random).0 / 10.0);
                10.0 * libm::log10(share / (1.0 - share))
            })
            .collect();
        k_db.sort_by(f64::total_cmp);
        assert_abs_diff_eq!(k_db[2000], 3.0, epsilon = 0.4);
        // 84 % of a Gaussian lie below the median and one σ.
        assert_abs_diff_eq!(k_db[3365], 8.0, epsilon = 0.5);
    }
}
