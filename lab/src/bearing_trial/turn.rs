use std::f64::consts::{PI, TAU};

use foxhunt_core::{BeaconId, Pose, Sample, Sweep, angle};
use foxhunt_sensors::{Antenna, LogDistance, SharedAntenna};
use foxhunt_sim::{BeaconConfig, ChannelConfig, DroneConfig, ScatteringConfig, World, WorldConfig};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, StandardNormal};

use super::BearingCase;

/// A simulated turn.
#[derive(Clone, Debug)]
pub(super) struct Turn {
    pub(super) samples: Vec<Sample>,
    /// The transmitter's true bearing, in radians.
    pub(super) bearing: f64,
    /// The Cramér-Rao bound on the variance of its bearing with a known antenna, an unknown level
    /// and no reflection, in rad².
    pub(super) bound: f64,
}

/// Half a degree: what the gain's slope is computed over, in radians.
const SLOPE_STEP: f64 = 0.0087;

impl Turn {
    /// The mean level of a turn without a reflection, in dBm.
    pub(super) const LEVEL_DBM: f64 = -60.0;

    /// The turn of a case that a seed draws.
    pub(super) fn draw(case: &BearingCase, antenna: &SharedAntenna, seed: u64) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut any = || rng.random_range(-PI..PI);
        let bearing = any();
        let heading = any();
        let mirror = any();
        let phase = any();
        let block = any();
        let mean_db = antenna.mean_gain_db(0.0);
        let gain_db = |off: f64| antenna.gain_dbi(off, 0.0) - mean_db;
        let amplitude = |off: f64| 10.0_f64.powf(gain_db(off) / 20.0);
        let step = TAU / f64::from(case.boresights);
        let world = case.scattering.map(|scattering| scattered(scattering, seed));
        let mut samples = Vec::new();
        let mut slopes = Vec::new();
        for index in 0..case.boresights {
            let turned = step * f64::from(index);
            let boresight = angle::wrap(heading + turned);
            let is_blocked = (turned - block).rem_euclid(TAU) < case.blocked * TAU;
            let is_lost = rng.random::<f64>() < case.lost;
            let direct = amplitude(bearing - boresight);
            let reflected = case.reflected * amplitude(mirror - boresight);
            let in_phase = direct + reflected * phase.cos();
            let power = in_phase * in_phase + (reflected * phase.sin()).powi(2);
            let power_dbm = Self::LEVEL_DBM
                + match &world {
                    Some(world) => through(world, antenna, boresight - bearing),
                    None => 10.0 * power.log10(),
                };
            for _ in 0..BearingCase::READINGS {
                // Drawn whether it is received or not: a turn with losses is the clean one with
                // gaps.
                let noise: f64 = StandardNormal.sample(&mut rng);
                if is_lost || is_blocked {
                    continue;
                }
                samples.push(Sample {
                    time: f64::from(index),
                    receiver: Pose { heading, ..Pose::default() },
                    boresight,
                    position: nearest(turned),
                    rss_dbm: power_dbm + BearingCase::SIGMA_DB * noise,
                });
            }
            if !(is_lost || is_blocked) {
                let off = bearing - boresight;
                slopes.push(
                    (gain_db(off + SLOPE_STEP) - gain_db(off - SLOPE_STEP)) / (2.0 * SLOPE_STEP),
                );
            }
        }
        Self { samples, bearing, bound: bound(&slopes) }
    }

    pub(super) fn as_sweep(&self) -> Sweep<'_> {
        Sweep {
            beacon: BeaconId(0),
            time: f64::from(BearingCase::POSITIONS),
            positions: BearingCase::POSITIONS,
            samples: &self.samples,
            ..Sweep::default()
        }
    }
}

/// A world without noise whose beacon is a metre to the East, at 0 dBm there: all that a seed draws
/// are the scattered waves.
fn scattered(scattering: ScatteringConfig, seed: u64) -> World {
    let law = LogDistance::new(0.0, 2.0).expect("the exponent is positive");
    let channel = ChannelConfig {
        path_loss: law.into(),
        scattering: Some(scattering),
        pattern_sigma_db: 0.0,
        sample_sigma_db: 0.0,
        bearing_sigma_deg: 0.0,
        ..ChannelConfig::default()
    };
    let beacons = vec![BeaconConfig { east_m: 1.0, ..BeaconConfig::default() }];
    let drones = vec![DroneConfig::default()];
    let config = WorldConfig { beacons, drones, channel, ..WorldConfig::default() };
    World::new(&config, seed).expect("its scattering is in order, and nothing else is unusual")
}

/// The gain over its mean of an antenna that looks `off` to the left of the direct wave, in dB.
fn through(world: &World, antenna: &SharedAntenna, off: f64) -> f64 {
    let read = world.receive(0, BeaconId(0), antenna, off).expect("drone and beacon are there");
    read.unwrap_or(f64::NEG_INFINITY)
}

/// σ² over Σ n (sᵢ − s̄)²: the mean slope goes into the level.
fn bound(slopes: &[f64]) -> f64 {
    let count = slopes.iter().map(|_| 1.0).sum::<f64>();
    let mean = slopes.iter().sum::<f64>() / count;
    let squares: f64 = slopes.iter().map(|slope| (slope - mean) * (slope - mean)).sum();
    BearingCase::SIGMA_DB.powi(2) / (f64::from(BearingCase::READINGS) * squares)
}

/// The position that a boresight is sorted into, by its angle from the nose.
fn nearest(turned: f64) -> u16 {
    let place = turned / TAU * f64::from(BearingCase::POSITIONS);
    #[expect(clippy::cast_possible_truncation, reason = "it lies between 0 and 128")]
    #[expect(clippy::cast_sign_loss, reason = "as above")]
    let position = place.round() as u16;
    position % BearingCase::POSITIONS
}
