//! A still beacon of the field calibration (Pritzl 2018, §4.4 and §7.1), measured 48 times, and
//! what one would write by hand for it over nalgebra's static matrices: the textbook's formulas,
//! without factors of the covariance, gates, missing components, evidence or errors.

use std::f64::consts::{LN_10, PI, TAU};

use foxhunt_core::{
    Estimate, MeasurementModel, Observation, Pose, RandomWalk,
    nalgebra::{Matrix2, Vector2, Vector3},
};
use foxhunt_filters::{Ekf, Ukf, Unscented};
use foxhunt_sensors::{LogDistance, RssBearing};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

pub(crate) const REFERENCE_DBM: f64 = -29.06;
pub(crate) const EXPONENT: f64 = 2.765;
pub(crate) const DRIFT: f64 = 0.1957;
pub(crate) const SIGMAS: [f64; 2] = [7.9, 0.5];
/// Spread of the sigma points.
pub(crate) const ALPHA: f64 = 1e-3;

/// One round of a receiver on a circle of 10 m, 4 m up, the beacon 20 m from its centre. No bearing
/// and none that is expected comes near ±π, so that filters agree that know nothing of angles.
pub(crate) fn sweep() -> Vec<Observation<2>> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let beacon = Vector2::new(16.0, -12.0);
    let noise = Matrix2::from_diagonal(&Vector2::from(SIGMAS.map(|sigma| sigma * sigma)));
    let measured = (0..48_u8).map(|step| {
        let around = TAU * f64::from(step) / 48.0;
        let receiver = Vector3::new(-10.0 * around.cos(), -10.0 * around.sin(), 4.0);
        let errors = SIGMAS.map(|sigma| sigma * rng.sample::<f64, _>(StandardNormal));
        let value = expected(&beacon, &receiver) + Vector2::from(errors);
        Observation::new(f64::from(step), Pose::level(receiver, 0.0), value, noise)
            .expect("finite, of positive variance")
    });
    measured.collect()
}

pub(crate) fn prior() -> Estimate<2> {
    Estimate { mean: Vector2::zeros(), covariance: Matrix2::from_diagonal_element(70.0) }
}

type Model = RssBearing<LogDistance>;

fn model() -> Model {
    RssBearing::new(LogDistance::new(REFERENCE_DBM, EXPONENT).expect("in range"))
}

/// The unscented filter of the reference, without its gate.
pub(crate) fn ukf() -> Ukf<RandomWalk<2>, Model, 2, 2> {
    Ukf::new(RandomWalk::uniform(DRIFT), model(), prior())
        .and_then(|ukf| ukf.with_transform(Unscented::pritzl2018()))
        .expect("a proper prior")
}

pub(crate) fn ekf() -> Ekf<RandomWalk<2>, Model, 2, 2> {
    ekf_of(model())
}

pub(crate) fn ekf_of<H: MeasurementModel<2, 2>>(model: H) -> Ekf<RandomWalk<2>, H, 2, 2> {
    Ekf::new(RandomWalk::uniform(DRIFT), model, prior()).expect("a proper prior")
}

fn expected(beacon: &Vector2<f64>, receiver: &Vector3<f64>) -> Vector2<f64> {
    let d = beacon - receiver.xy();
    let range = (d.norm_squared() + receiver.z * receiver.z).sqrt();
    Vector2::new(REFERENCE_DBM - 10.0 * EXPONENT * range.log10(), d.y.atan2(d.x))
}

fn difference(a: &Vector2<f64>, b: &Vector2<f64>) -> Vector2<f64> {
    let turn = a.y - b.y;
    let wrapped = if turn >= PI {
        turn - TAU
    } else if turn < -PI {
        turn + TAU
    } else {
        turn
    };
    Vector2::new(a.x - b.x, wrapped)
}

fn noise() -> Matrix2<f64> {
    Matrix2::new(SIGMAS[0] * SIGMAS[0], 0.0, 0.0, SIGMAS[1] * SIGMAS[1])
}

fn drift() -> Matrix2<f64> {
    Matrix2::from_diagonal_element(DRIFT * DRIFT)
}

/// A step of the extended filter by hand.
pub(crate) fn hand_ekf(belief: &Estimate<2>, observation: &Observation<2>) -> Option<Estimate<2>> {
    let Estimate { mean, covariance } = belief;
    let covariance = covariance + drift();
    let receiver = &observation.receiver().position;
    let d = mean - receiver.xy();
    let flat = d.norm_squared();
    let slope = -10.0 * EXPONENT / LN_10 / (flat + receiver.z * receiver.z);
    let h = Matrix2::new(slope * d.x, slope * d.y, -d.y / flat, d.x / flat);
    let cross = covariance * h.transpose();
    let gain = cross * (h * cross + noise()).try_inverse()?;
    let innovation = difference(observation.value(), &expected(mean, receiver));
    let covariance = covariance - gain * cross.transpose();
    Some(Estimate {
        mean: mean + gain * innovation,
        covariance: (covariance + covariance.transpose()) * 0.5,
    })
}

/// A step of the scaled unscented filter by hand: α = 10⁻³, β = 2, κ = 3 − n. As the beacon is
/// still, no sigma points are drawn to predict.
pub(crate) fn hand_ukf(belief: &Estimate<2>, observation: &Observation<2>) -> Option<Estimate<2>> {
    const SPREAD: f64 = ALPHA * ALPHA * 3.0;
    const SIDE: f64 = 0.5 / SPREAD;
    const CENTRE: f64 = 1.0 - 2.0 / SPREAD;
    const MEAN_WEIGHTS: [f64; 5] = [CENTRE, SIDE, SIDE, SIDE, SIDE];
    const WEIGHTS: [f64; 5] = [CENTRE + 3.0 - ALPHA * ALPHA, SIDE, SIDE, SIDE, SIDE];

    let Estimate { mean, covariance } = belief;
    let covariance = covariance + drift();
    let root = covariance.cholesky()?.unpack() * SPREAD.sqrt();
    let first = root.column(0);
    let second = root.column(1);
    let points = [*mean, mean + first, mean - first, mean + second, mean - second];
    let receiver = &observation.receiver().position;
    let images = points.map(|point| expected(&point, receiver));
    // About the centre, so that no bearing is averaged across ±π.
    let deviations = images.map(|image| difference(&image, &images[0]));
    let mut shift = Vector2::zeros();
    for (deviation, weight) in deviations.iter().zip(MEAN_WEIGHTS) {
        shift += deviation * weight;
    }
    let mut innovation = noise();
    let mut cross = Matrix2::zeros();
    for ((deviation, point), weight) in deviations.iter().zip(&points).zip(WEIGHTS) {
        let deviation = deviation - shift;
        innovation += deviation * deviation.transpose() * weight;
        cross += (point - mean) * deviation.transpose() * weight;
    }
    let gain = cross * innovation.try_inverse()?;
    let residual = difference(observation.value(), &(images[0] + shift));
    let covariance = covariance - gain * innovation * gain.transpose();
    Some(Estimate {
        mean: mean + gain * residual,
        covariance: (covariance + covariance.transpose()) * 0.5,
    })
}
