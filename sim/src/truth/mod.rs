//! The truth of a world, which its devices share: time, random streams, the antennas that turn, and
//! the channel between beacons and receivers.

mod body;
mod drone;
mod receiver;

pub(crate) use drone::{Drone, Truth, beacon_of};

use std::f64::consts::TAU;

use foxhunt_core::BeaconId;
use foxhunt_sensors::{
    Antenna, Friis, Isotropic, LogDistance, Propagation, ReflectedWave, SharedAntenna,
    SharedTerrain, TerrainLoss, multipath_gain_dbi,
};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use crate::{
    BeaconConfig, ChannelConfig, DeadZoneConfig, PathLossConfig, ReliefConfig, SPEED_OF_LIGHT,
    ScatteringConfig, ShadowingConfig, SimError, TwoRayConfig,
};

/// The number of waves that make a field. The correlation of one field about e^(−d/D) errs by
/// about the inverse root of this number.
const WAVES: usize = 256;

/// A time in which drones that rest are left alone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Free {
    /// End of the time, in seconds.
    pub until: f64,
    /// Time from one moment at which devices may be polled to the next, in seconds.
    pub step: f64,
}

/// Nobody goes ahead.
impl Default for Free {
    fn default() -> Self {
        Self { until: f64::NEG_INFINITY, step: 0.0 }
    }
}

impl Free {
    /// The step after a moment, if it is free.
    #[inline]
    fn step_from(&self, time: f64) -> Option<f64> {
        let next = time + self.step;
        // Not so for a step that is too small to be added, either.
        (next > time && next < self.until).then_some(next)
    }

    /// The first step from a moment on, itself included, at which `event` has come.
    #[inline]
    fn reach(&self, event: f64, mut time: f64) -> Option<f64> {
        while !is_due(event, time) {
            time = self.step_from(time)?;
        }
        Some(time)
    }
}

/// One drone's random streams, one for each purpose.
///
/// Every question draws from them alike, whatever the channel's parameters are: worlds that
/// differ in a parameter share their noise.
#[derive(Clone, Debug)]
struct Streams {
    pattern: Xoshiro256PlusPlus,
    sample: Xoshiro256PlusPlus,
    loss: Xoshiro256PlusPlus,
    gust: Xoshiro256PlusPlus,
}

impl Streams {
    /// The next drone's streams. A drone more, or a purpose more at the end of this list, leaves
    /// the streams before it as they are.
    fn fork(root: &mut Xoshiro256PlusPlus) -> Self {
        let mut own = root.fork();
        Self { pattern: own.fork(), sample: own.fork(), loss: own.fork(), gust: own.fork() }
    }
}

/// The antenna that a signal comes in through.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Port<'a> {
    /// The antenna of the channel.
    Directional,
    /// An antenna with the same gain in all directions, the mean of that of the channel.
    Omnidirectional,
    /// A user's own.
    Own(&'a dyn Antenna),
}

impl Port<'_> {
    /// Returns the port if its antenna is one of the channel's own.
    fn of_the_channel(self) -> Option<Port<'static>> {
        match self {
            Self::Directional => Some(Port::Directional),
            Self::Omnidirectional => Some(Port::Omnidirectional),
            Self::Own(_) => None,
        }
    }

    /// Returns true if both are the same antenna of the channel.
    fn is_same(self, other: Port<'_>) -> bool {
        use Port::{Directional, Omnidirectional};
        matches!((self, other), (Directional, Directional) | (Omnidirectional, Omnidirectional))
    }
}

/// The way that an antenna was ordered within one pattern.
#[derive(Clone, Copy, Debug)]
struct Course {
    start: f64,
    last: f64,
    /// Towards larger angles; not known before the second order.
    forwards: Option<bool>,
}

impl Course {
    /// An antenna that stands at `angle` radians.
    fn at(angle: f64) -> Self {
        Self { start: angle, last: angle, forwards: None }
    }

    /// Returns true if an order to `angle` leads nowhere.
    fn stays(&self, angle: f64) -> bool {
        angle.to_bits() == self.last.to_bits()
    }

    /// Takes an order; false when a new pattern begins with it: the antenna stays, goes back, or
    /// has been all the way round.
    ///
    /// The first order of a pattern does not show its direction, which may be the approach to
    /// the end that a turn starts from.
    fn follow(&mut self, angle: f64) -> bool {
        let stays = self.stays(angle);
        let forwards = angle > self.last;
        let turns_back = self.forwards.is_some_and(|before| before != forwards);
        // The last of many equal steps may fall short of a turn by rounding.
        let round = (angle - self.start).abs() > TAU - 1e-9;
        if stays || turns_back || round {
            *self = Self::at(angle);
            return false;
        }
        self.last = angle;
        self.forwards = Some(forwards);
        true
    }
}

/// An antenna's motor: it turns at constant speed to the last ordered angle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turntable {
    /// Speed of the motor in radians per second.
    speed: f64,
    from: f64,
    to: f64,
    departure: f64,
    arrival: f64,
}

impl Turntable {
    /// A motor that stands at 0.
    fn new(speed: f64) -> Self {
        Self { speed, from: 0.0, to: 0.0, departure: 0.0, arrival: 0.0 }
    }

    /// Turns to `angle` radians from the angle at `now`.
    fn order(&mut self, angle: f64, now: f64) {
        self.from = self.angle(now);
        self.to = angle;
        self.departure = now;
        self.arrival = now + (self.to - self.from).abs() / self.speed;
    }

    /// Stands at `angle` radians from now on: something else turns it.
    #[cfg(feature = "emulators")]
    fn hold_at(&mut self, angle: f64, now: f64) {
        (self.from, self.to, self.departure, self.arrival) = (angle, angle, now, now);
    }

    /// Returns the angle of the motor, in radians.
    fn angle(&self, now: f64) -> f64 {
        self.standing(now).unwrap_or_else(|| {
            let turned = (now - self.departure) * self.speed;
            self.from + turned.copysign(self.to - self.from)
        })
    }

    /// The time when it comes to a standstill; infinite if it stands.
    #[inline]
    pub(crate) fn stands_at(&self, now: f64) -> f64 {
        if is_due(self.arrival, now) { f64::INFINITY } else { self.arrival }
    }

    /// The angle at which it stands; `None` while it turns.
    #[inline]
    pub(crate) fn standing(&self, now: f64) -> Option<f64> {
        is_due(self.arrival, now).then_some(self.to)
    }
}

/// The radio channel: what every sample goes through. Its random numbers are drawn by the
/// receivers, but for the fields of shadowing.
#[derive(Clone, Debug)]
pub(crate) struct Channel {
    /// Number of beacons; transmitters on their frequencies are counted behind them.
    beacons: u16,
    law: Law,
    frequency_mhz: f64,
    /// The wavelength in metres.
    wavelength: f64,
    /// 2π over the wavelength.
    wave_number: f64,
    antenna: SharedAntenna,
    mean_gain_db: f64,
    /// Loss over the terrain; `None` if the ground is level.
    terrain: Option<TerrainLoss<SharedTerrain>>,
    /// The fields of shadowing, one for each transmitter; empty without shadowing.
    shadowing: Vec<ShadowingField>,
    reflectors: Vec<Reflector>,
    scattering: Option<ScatteringConfig>,
    dead_zones: Vec<DeadZoneConfig>,
    pattern_sigma_db: f64,
    sample_sigma_db: f64,
    /// σ of a pattern's bearing, in radians.
    bearing_sigma: f64,
    patterns_stay: bool,
    noise_dbm: Option<f64>,
    whole_db: bool,
    floor_dbm: Option<f64>,
    loss_probability: f64,
}

#[derive(Clone, Copy, Debug)]
enum Law {
    LogDistance(LogDistance),
    Friis(Friis),
    TwoRay(TwoRayConfig),
}

/// A reflector: its phase in radians.
#[derive(Clone, Copy, Debug)]
struct Reflector {
    place: Vector3<f64>,
    amplitude: f64,
    phase: f64,
}

impl Channel {
    /// The channel of a configuration that was checked but for its antenna and its law, over a
    /// terrain, for these beacons.
    fn new(
        config: &ChannelConfig,
        terrain: Option<&ReliefConfig>,
        beacons: &[BeaconConfig],
        rng: &mut Xoshiro256PlusPlus,
    ) -> Result<Self, SimError> {
        let antenna = config.antenna.build()?;
        let wavelength = SPEED_OF_LIGHT / (config.frequency_mhz * 1e6);
        let law = match config.path_loss {
            PathLossConfig::LogDistance(law) => Law::LogDistance(law),
            PathLossConfig::Friis { power_dbm } => {
                Law::Friis(Friis::new(power_dbm, 0.0, 0.0, wavelength).map_err(SimError::PathLoss)?)
            }
            PathLossConfig::TwoRay(config) => {
                // What holds at one height holds at all above it.
                config.law(wavelength, [0.0; 2]).map_err(SimError::PathLoss)?;
                Law::TwoRay(config)
            }
        };
        let build = |terrain: &ReliefConfig| terrain.build(config.frequency_mhz);
        let terrain = terrain.map(build).transpose().map_err(SimError::Terrain)?;
        let reflector = |reflector: &crate::ReflectorConfig| Reflector {
            place: Vector3::new(reflector.east_m, reflector.north_m, reflector.up_m),
            amplitude: reflector.amplitude,
            phase: reflector.phase_deg.to_radians(),
        };
        let others = beacons.iter().map(|beacon| beacon.others.len()).max().unwrap_or(0);
        let transmitters = beacons.len() * (1 + others);
        let fields = config.shadowing.iter().flat_map(|shadowing| vec![shadowing; transmitters]);
        Ok(Self {
            beacons: u16::try_from(beacons.len()).unwrap_or(u16::MAX),
            law,
            frequency_mhz: config.frequency_mhz,
            wavelength,
            wave_number: TAU / wavelength,
            mean_gain_db: antenna.mean_gain_db(0.0),
            antenna,
            terrain,
            shadowing: fields.map(|shadowing| ShadowingField::draw(shadowing, rng)).collect(),
            reflectors: config.reflectors.iter().map(reflector).collect(),
            scattering: config.scattering,
            dead_zones: config.dead_zones.clone(),
            pattern_sigma_db: config.pattern_sigma_db,
            sample_sigma_db: config.sample_sigma_db,
            bearing_sigma: config.bearing_sigma_deg.to_radians(),
            patterns_stay: config.patterns_stay,
            noise_dbm: config.noise_dbm,
            whole_db: config.whole_db,
            floor_dbm: config.floor_dbm,
            loss_probability: config.loss_probability,
        })
    }

    /// The number that stands for a transmitter on a beacon's frequency, which is no beacon's.
    fn other(&self, beacon: BeaconId, index: u16) -> BeaconId {
        BeaconId(beacon.0.saturating_add(self.beacons.saturating_mul(index.saturating_add(1))))
    }

    /// Returns the ground; `None` if it is level.
    fn terrain(&self) -> Option<&SharedTerrain> {
        self.terrain.as_ref().map(TerrainLoss::terrain)
    }

    /// The mean level of a beacon at `to` over a level turn at `from`, in dBm, behind what terrain
    /// there is between them.
    fn level_dbm(&self, beacon: usize, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        let range = (to - from).norm();
        let level = match &self.law {
            Law::LogDistance(law) => law.rss_dbm(range),
            Law::Friis(law) => law.rss_dbm(range),
            Law::TwoRay(config) => config
                .law(self.wavelength, [to.z, from.z])
                .expect("it was made at the least height, and vehicles' places are finite")
                .rss_dbm(range),
        };
        let level = level + self.shadowing.get(beacon).map_or(0.0, |field| field.at(from));
        match &self.terrain {
            Some(terrain) => level - terrain.loss_db(from, to),
            None => level,
        }
    }

    /// The gain over its mean in dB, for a direct wave and reflected ones, of the antenna at a
    /// port.
    fn relative_gain_db(
        &self,
        azimuth: f64,
        elevation: f64,
        reflected: &[ReflectedWave],
        port: Port<'_>,
    ) -> f64 {
        match port {
            Port::Directional => {
                multipath_gain_dbi(&self.antenna, azimuth, elevation, reflected) - self.mean_gain_db
            }
            Port::Omnidirectional => multipath_gain_dbi(&Isotropic, azimuth, elevation, reflected),
            Port::Own(antenna) => {
                multipath_gain_dbi(antenna, azimuth, elevation, reflected)
                    - antenna.mean_gain_db(0.0)
            }
        }
    }

    /// The receiver's reading of a power, both in dBm; `None` below its floor.
    fn reading_dbm(&self, power_dbm: f64) -> Option<f64> {
        let reading = if self.whole_db { libm::round(power_dbm) } else { power_dbm };
        self.floor_dbm.is_none_or(|floor| reading >= floor).then_some(reading)
    }

    /// Returns true if anything is received at a place.
    fn reaches(&self, place: &Vector3<f64>) -> bool {
        !self.dead_zones.iter().any(|zone| zone.contains(place))
    }

    /// The weakest reading, if there is one.
    pub(crate) fn floor_dbm(&self) -> Option<f64> {
        self.floor_dbm
    }
}

/// A Gaussian field over places with an exponential correlation, as a sum of plane waves (Cai &
/// Giannakis 2003).
///
/// Wave vectors are drawn from the correlation's spectral density, which in three dimensions is a
/// multivariate Cauchy density of scale 1/D, and the amplitudes of sines and cosines are Gaussian:
/// at every place, and over every two, the field has exactly the moments that are requested.
#[derive(Clone, Debug)]
struct ShadowingField {
    /// The wave vectors, in radians per metre.
    waves: Vec<Vector3<f64>>,
    /// Amplitudes of each wave's cosine and sine, in dB.
    amplitudes: Vec<[f64; 2]>,
}

impl ShadowingField {
    fn draw(config: &ShadowingConfig, rng: &mut Xoshiro256PlusPlus) -> Self {
        let mut normal = || -> f64 { rng.sample(StandardNormal) };
        #[expect(clippy::cast_precision_loss, reason = "a few hundred")]
        let scale = config.sigma_db / (WAVES as f64).sqrt();
        let mut waves = Vec::new();
        let mut amplitudes = Vec::new();
        for _ in 0..WAVES {
            let direction = Vector3::new(normal(), normal(), normal());
            // A normal vector over a normal number is a Cauchy vector; none is infinitely short.
            let wave = direction / (normal().abs().max(1e-9) * config.correlation_m);
            waves.push(wave);
            amplitudes.push([scale * normal(), scale * normal()]);
        }
        Self { waves, amplitudes }
    }

    /// The field at a place, in dB.
    fn at(&self, place: &Vector3<f64>) -> f64 {
        let wave = |(wave, [cos, sin]): (&Vector3<f64>, &[f64; 2])| {
            let phase = wave.dot(place);
            cos * libm::cos(phase) + sin * libm::sin(phase)
        };
        self.waves.iter().zip(&self.amplitudes).map(wave).sum()
    }
}

/// Returns true if the moment `at` has come. A nanosecond is forgiven: time is a sum of steps, and
/// its rounding must not cost a step more.
#[inline]
pub(crate) fn is_due(at: f64, now: f64) -> bool {
    now >= at - 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    /// The orders, by their number, with which a new pattern begins.
    fn breaks(orders: &[f64]) -> Vec<usize> {
        let mut course = Course::at(0.0);
        (0..orders.len()).filter(|&i| !course.follow(orders[i])).collect()
    }

    #[test]
    fn turns_to_and_fro_are_a_pattern_each() {
        assert_eq!(breaks(&[0.0, 1.0, 2.0, 2.0, 1.0, 0.0, 0.0, 1.0, 2.0]), [0, 3, 6]);
    }

    #[test]
    fn a_turn_that_was_given_up_ends_where_the_next_begins() {
        assert_eq!(breaks(&[0.0, 1.0, 2.0, 0.0, 1.0, 2.0, 3.0]), [0, 3]);
    }

    #[test]
    fn a_turn_without_a_cable_ends_after_all_its_positions() {
        let orders: Vec<f64> = (1..=20).map(|i| f64::from(i) * TAU / 10.0).collect();
        assert_eq!(breaks(&orders), [9, 19]);
    }

    #[test]
    fn it_turns_at_its_speed_and_may_be_sent_back() {
        let mut motor = Turntable::new(2.0);
        motor.order(3.0, 10.0);
        assert_eq!(motor.standing(11.499), None);
        assert_eq!(motor.standing(11.5), Some(3.0));
        assert_abs_diff_eq!(motor.angle(11.0), 2.0, epsilon = 1e-12);
        motor.order(-1.0, 11.0);
        assert_abs_diff_eq!(motor.angle(12.0), 0.0, epsilon = 1e-12);
        assert_eq!(motor.standing(12.499), None);
        assert_eq!(motor.standing(12.5), Some(-1.0));
    }

    /// 4000 fields of seeds 1 to 4000. The variance's standard error is √(2/4000) of it, the
    /// correlation's at most 1/√4000; four of them are a false-alarm rate of 6·10⁻⁵ each.
    #[test]
    fn its_moments_are_those_of_its_configuration() {
        let config = ShadowingConfig { sigma_db: 6.0, correlation_m: 25.0 };
        let place = Vector3::new(-40.0, 17.0, 30.0);
        let aside = [5.0, 25.0, 60.0].map(|d| (d, Vector3::new(0.6 * d, -0.64 * d, 0.48 * d)));
        let mut square = 0.0;
        let mut products = [0.0; 3];
        for seed in 1..=4000 {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let field = ShadowingField::draw(&config, &mut rng);
            let here = field.at(&place);
            square += here * here / 4000.0;
            for ((_, step), product) in aside.iter().zip(&mut products) {
                *product += here * field.at(&(place + step)) / 4000.0;
            }
        }
        assert_abs_diff_eq!(square / 36.0, 1.0, epsilon = 4.0 * (2.0_f64 / 4000.0).sqrt());
        for ((distance, _), product) in aside.iter().zip(products) {
            let expected = (-distance / 25.0_f64).exp();
            let error = product / 36.0 - expected;
            assert_abs_diff_eq!(
                error,
                0.0,
                epsilon = 4.0 * (1.0_f64 + expected.powi(2)).sqrt() / 4000.0_f64.sqrt()
            );
        }
    }

    /// A drone that comes back receives the same; one that moves a little nearly the same.
    #[test]
    fn it_belongs_to_places() {
        let config = ShadowingConfig { sigma_db: 6.0, correlation_m: 25.0 };
        let field = ShadowingField::draw(&config, &mut Xoshiro256PlusPlus::seed_from_u64(5));
        let here = field.at(&Vector3::new(3.0, 4.0, 5.0));
        assert_abs_diff_eq!(field.at(&Vector3::new(3.0, 4.0, 5.0)), here, epsilon = 1e-12);
        // σ of the difference over 1 cm: 6 √(2 · 0.0004) dB.
        let beside = field.at(&Vector3::new(3.01, 4.0, 5.0));
        assert!(abs_diff_eq!(beside, here, epsilon = 1.0) && (beside - here).abs() > 1e-9);
    }
}
