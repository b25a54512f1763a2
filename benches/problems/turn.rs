//! A turn of the antenna.

use std::f64::consts::TAU;

use foxhunt::{
    prelude::*,
    sensors::{Antenna, PatternTable},
};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, StandardNormal};

/// A turn with 2 dB of noise and a reflection of this share of the direct amplitude.
pub(crate) fn turn(reflected: f64) -> Vec<Sample> {
    let antenna = PatternTable::reference_patch();
    let amplitude = |off: f64| 10.0_f64.powf(antenna.gain_dbi(off, 0.0) / 20.0);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut samples = Vec::new();
    for position in 0..128_u16 {
        let boresight = TAU * f64::from(position) / 128.0;
        let level = amplitude(1.0 - boresight) + reflected * amplitude(2.5 - boresight);
        for _ in 0..6 {
            let noise: f64 = StandardNormal.sample(&mut rng);
            let rss_dbm = 20.0 * level.log10() - 60.0 + 2.0 * noise;
            let receiver = Pose::default();
            samples.push(Sample { time: 0.0, receiver, boresight, position, rss_dbm });
        }
    }
    samples
}
