use foxhunt_core::{Bearing, Measured, MeasuredList, Pose, Quantity, Reception};
use nalgebra::{Vector2, Vector4};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::{BearingsConfig, DifferencesConfig, Trial, course, prior::Prior};

/// The draws of one run, the same for every estimator.
#[derive(Clone, Debug)]
pub(super) struct Draw {
    /// The target's state at each bearing.
    pub(super) truth: Vec<Vector4<f64>>,
    /// The bearings.
    pub(super) receptions: Vec<Reception>,
    /// The prior, before the first bearing.
    pub(super) prior: Prior,
}

impl Draw {
    pub(super) fn new(trial: &Trial, seed: u64) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let bearings = &trial.bearings;
        let receiver = course::receiver_at(&trial.receiver, bearings);
        // Where the target is drawn from the prior, that is a room and needs no first bearing.
        let room = |rng: &mut Xoshiro256PlusPlus| {
            let origin = Vector4::zeros();
            let none = (0.0, bearings.sigma_rad);
            Prior::new(&trial.prior, &origin, Vector2::zeros(), none, rng).draw(rng)
        };
        let truth = course::target_at(&trial.target, bearings, room, &mut rng);
        let receptions: Vec<Reception> = truth
            .iter()
            .zip(&receiver)
            .enumerate()
            .map(|(k, (target, at))| {
                let reception = Reception {
                    time: bearings.interval_s * f64::from(u32::try_from(k).unwrap_or(u32::MAX)),
                    receiver: Pose::at(at.x, at.y, 0.0),
                    ..Reception::default()
                };
                if let Some(config) = &trial.differences {
                    let measured = difference(config, target.xy(), *at, &mut rng);
                    return Reception { measured, ..reception };
                }
                let angle = bearing(bearings, target.xy() - at, &mut rng);
                let sigma = bearings.sigma_rad;
                Reception { bearing: Some(Bearing { angle, sigma, confidence: 1.0 }), ..reception }
            })
            .collect();
        let first = receptions.first().and_then(|reception| reception.bearing);
        let first = first.map_or(0.0, |bearing| bearing.angle) - bearings.bias_rad;
        let first = (first, bearings.sigma_rad);
        let prior = Prior::new(&trial.prior, &truth[0], receiver[0], first, &mut rng);
        Self { truth, receptions, prior }
    }
}

/// Range difference of a target between a receiver and the second one.
fn difference(
    config: &DifferencesConfig,
    target: Vector2<f64>,
    at: Vector2<f64>,
    rng: &mut Xoshiro256PlusPlus,
) -> MeasuredList {
    let DifferencesConfig { reference_m, sigma_m } = *config;
    let error: f64 = rng.sample(StandardNormal);
    let farther = (target - at).norm() - (target - Vector2::from(reference_m)).norm();
    let measured = Measured::new(Quantity::RANGE_DIFFERENCE, farther + sigma_m * error, sigma_m);
    let measured = measured.expect("the places of a trial are finite, and its sigma is positive");
    MeasuredList::new(&[measured]).expect("there is room for one")
}

/// A bearing of what lies at `offset` from the receiver.
fn bearing(config: &BearingsConfig, offset: Vector2<f64>, rng: &mut Xoshiro256PlusPlus) -> f64 {
    // Both are drawn whichever is used, so that a share of outliers moves no other draw.
    let (any, which): (f64, f64) = (rng.random(), rng.random());
    let error: f64 = rng.sample(StandardNormal);
    if which < config.outlier_share {
        return foxhunt_core::angle::wrap(core::f64::consts::TAU * any);
    }
    let value = offset.y.atan2(offset.x) + config.bias_rad + config.sigma_rad * error;
    foxhunt_core::angle::wrap(value)
}
