//! A joint state of n stations: each measures the arrival of a transmitter's signals by a clock of
//! its own, and nobody knows when the transmitter sends. The filter estimates place, the bias that
//! all have in common and each station's offset together. One that takes the offsets for noise is
//! overconfident, because they do not average out.
//!
//! `cargo run --example joint_stations`

#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use foxhunt::{
    core::{DynamicEstimate, On},
    filters::{
        DynamicEkf, Ekf, JointMotion,
        consistency::{ChiSquaredAverage, Verdict},
    },
    nalgebra::{Matrix1, Vector1, Vector2, Vector3, Vector4},
    prelude::*,
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

const RUNS: u64 = 200;
const ROUNDS: u8 = 20;
/// Standard deviations, in metres: of place and common bias before the first arrival, of a
/// station's offset, of an arrival.
const PLACE: f64 = 10.0;
const COMMON: f64 = 100.0;
const OFFSET: f64 = 5.0;
const ARRIVAL: f64 = 1.0;

// ANCHOR: model
/// The arrival in metres of way: distance, common bias and the station's own offset.
/// x = (East, North, common bias, own offset).
struct Arrival;

impl MeasurementModel<4, 1> for Arrival {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::linear("arrival_m")]
    }

    fn expected(&self, state: &Vector4<f64>, station: &Pose) -> Vector1<f64> {
        let distance = (state.xy() - station.position.xy()).norm();
        Vector1::new(distance + state[2] + state[3])
    }
}

/// A joint filter of the place, the common bias and an offset of each station.
fn joint(stations: usize) -> Result<DynamicEkf, EstimatorError> {
    let still = RandomWalk::uniform(0.0);
    let mut motion = JointMotion::new().with::<2>(RandomWalk::uniform(0.0)).with::<1>(still);
    let mut parts = vec![
        DynamicEstimate::from(Estimate::isotropic(Vector2::zeros(), PLACE)),
        Estimate::isotropic(Vector1::zeros(), COMMON).into(),
    ];
    for _ in 0..stations {
        motion = motion.with::<1>(still);
        parts.push(Estimate::isotropic(Vector1::zeros(), OFFSET).into());
    }
    DynamicEkf::new(motion, DynamicEstimate::independent(parts))
}

/// The model of one station: over place, common bias and the offset of this station.
fn by(station: usize) -> On<Arrival, 4, 1> {
    On::new(Arrival, [0, 1, 2, 3 + station])
}
// ANCHOR_END: model

/// The arrival without an offset, for the filter that takes offsets for noise.
struct Plain;

impl MeasurementModel<3, 1> for Plain {
    fn quantities(&self) -> [Quantity; 1] {
        Arrival.quantities()
    }

    fn expected(&self, state: &Vector3<f64>, station: &Pose) -> Vector1<f64> {
        Arrival.expected(&state.push(0.0), station)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for stations in [6_u8, 12] {
        let mut joint_nees = ChiSquaredAverage::new(0.999)?;
        let mut plain_nees = ChiSquaredAverage::new(0.999)?;
        for seed in 0..RUNS {
            let [joint, plain] = run(seed, stations)?;
            joint_nees.add(joint, 2);
            plain_nees.add(plain, 2);
        }
        println!(
            "{stations} stations: NEES of the place {:.2} with offsets in the state ({}), {:.2} \
             with offsets as noise ({})",
            joint_nees.average().ok_or("no run")?,
            joint_nees.verdict(),
            plain_nees.average().ok_or("no run")?,
            plain_nees.verdict(),
        );
        assert_eq!(joint_nees.verdict(), Verdict::Consistent);
        assert_eq!(plain_nees.verdict(), Verdict::OverConfident);
    }
    Ok(())
}

/// Returns the NEES of the place by the joint filter and by the plain one, after one run whose
/// truth is drawn from the prior.
fn run(seed: u64, stations: u8) -> Result<[f64; 2], Box<dyn std::error::Error>> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    let place = Vector2::new(PLACE * normal(), PLACE * normal());
    let common = COMMON * normal();
    let offsets: Vec<f64> = (0..stations).map(|_| OFFSET * normal()).collect();
    let poses: Vec<Pose> = (0..stations)
        .map(|station| {
            let around = std::f64::consts::TAU * f64::from(station) / f64::from(stations);
            Pose::at(1000.0 * around.cos(), 1000.0 * around.sin(), 0.0)
        })
        .collect();

    let mut joint = joint(poses.len())?;
    let prior = DynamicEstimate::independent([
        Estimate::isotropic(Vector2::zeros(), PLACE).into(),
        Estimate::isotropic(Vector1::zeros(), COMMON).into(),
    ]);
    let prior = prior.at([0, 1, 2]).ok_or("three components")?;
    let mut plain = Ekf::new(RandomWalk::uniform(0.0), Plain, prior)?;
    for round in 0..ROUNDS {
        for (station, pose) in poses.iter().enumerate() {
            let truth = Vector4::new(place.x, place.y, common, offsets[station]);
            let z = Arrival.expected(&truth, pose).add_scalar(ARRIVAL * normal());
            let noise = Matrix1::new(ARRIVAL * ARRIVAL);
            let observation = Observation::new(f64::from(round), *pose, z, noise)?;
            let _ = joint.update(&by(station), &observation.into())?;
            let noise = Matrix1::new(ARRIVAL * ARRIVAL + OFFSET * OFFSET);
            let _ = plain.update(&Observation::new(f64::from(round), *pose, z, noise)?)?;
        }
    }
    let estimate = joint.estimate().at([0, 1]).ok_or("two components")?;
    let joint = estimate.nees(&place).ok_or("not definite")?;
    let plain = plain.estimate().position().nees(&place).ok_or("not definite")?;
    Ok([joint, plain])
}
