//! Simulated turns of the reference patch.

use core::f64::consts::TAU;

use foxhunt_core::{BeaconId, Pose, Sample, Sweep, angle};
use foxhunt_sensors::{Antenna, PatternTable};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, Normal};

pub(crate) const POSITIONS: u16 = 128;

/// Conditions of a simulated turn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Conditions {
    /// The transmitter's direction in radians.
    pub(crate) bearing: f64,
    /// The standard deviation of a sample in dB.
    pub(crate) noise_db: f64,
    /// The share of positions that receive nothing.
    pub(crate) lost: f64,
    /// Readings come in whole dB.
    pub(crate) whole_db: bool,
    /// The drone's heading in radians.
    pub(crate) heading: f64,
}

impl Default for Conditions {
    fn default() -> Self {
        Self { bearing: 0.0, noise_db: 2.0, lost: 0.0, whole_db: false, heading: 0.0 }
    }
}

/// One turn: 128 positions of 6 samples each, with a mean of −60 dBm.
pub(crate) fn simulate(conditions: &Conditions, patch: &PatternTable, seed: u64) -> Vec<Sample> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let noise = Normal::new(0.0, conditions.noise_db).expect("a standard deviation");
    let level = -60.0 - patch.mean_gain_db(0.0);
    let mut samples = Vec::new();
    for position in 0..POSITIONS {
        let received = rng.random::<f64>() >= conditions.lost;
        let turned = TAU * f64::from(position) / f64::from(POSITIONS);
        let boresight = angle::wrap(conditions.heading + turned);
        let clean = level + patch.gain_db(boresight - conditions.bearing);
        for reading in 0..6_u16 {
            let dbm = clean + noise.sample(&mut rng);
            let rss_dbm = if conditions.whole_db { dbm.round() } else { dbm };
            let time = f64::from(position) + 0.1 * f64::from(reading);
            let receiver = Pose { heading: conditions.heading, ..Pose::at(1.0, 2.0, 4.0) };
            if received {
                samples.push(Sample { time, receiver, boresight, position, rss_dbm });
            }
        }
    }
    samples
}

pub(crate) fn sweep_of(samples: &[Sample]) -> Sweep<'_> {
    Sweep {
        beacon: BeaconId(0),
        time: f64::from(POSITIONS),
        receiver: Pose::at(1.0, 2.0, 4.0),
        positions: POSITIONS,
        samples,
        ..Sweep::default()
    }
}
