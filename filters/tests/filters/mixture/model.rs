//! Small models: filters know no sensors.

use foxhunt_core::{
    Correction, Estimate, MeasurementModel, Observation, Pose, Quantity, RandomWalk, State,
    nalgebra::{Matrix1, SMatrix, Vector1, Vector2},
};
use foxhunt_filters::Ekf;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

/// The bearing of the target, in radians counter-clockwise from East.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bearing;

impl<const N: usize> MeasurementModel<N, 1> for Bearing {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::BEARING]
    }
    fn expected(&self, target: &State<N>, receiver: &Pose) -> Vector1<f64> {
        let d = target.fixed_rows::<2>(0) - receiver.position.xy();
        Vector1::new(libm::atan2(d.y, d.x))
    }
}

/// The first M components of the state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part;

impl<const N: usize, const M: usize> MeasurementModel<N, M> for Part {
    fn quantities(&self) -> [Quantity; M] {
        [Quantity::linear("x_m"); M]
    }
    fn expected(&self, state: &State<N>, _: &Pose) -> foxhunt_core::nalgebra::SVector<f64, M> {
        state.fixed_rows::<M>(0).into_owned()
    }
    fn jacobian(&self, _: &State<N>, _: &Pose) -> SMatrix<f64, M, N> {
        SMatrix::identity()
    }
}

pub(super) fn bearing(receiver: Vector2<f64>, value: f64, sigma: f64) -> Observation<1> {
    let pose = Pose::at(receiver.x, receiver.y, 0.0);
    Observation::new(0.0, pose, Vector1::new(value), Matrix1::new(sigma * sigma)).expect("proper")
}

/// A filter on the line, z = x with a still target: every mixture of these is exact.
pub(super) fn on_a_line(mean: f64, sigma: f64) -> Ekf<RandomWalk<1>, Part, 1, 1> {
    let prior = Estimate::isotropic(Vector1::new(mean), sigma);
    Ekf::new(RandomWalk::uniform(0.3), Part, prior).expect("a proper prior")
}

pub(super) fn rng(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed)
}

pub(super) fn white<const N: usize>(rng: &mut Xoshiro256PlusPlus) -> State<N> {
    State::from_fn(|_, _| rng.sample(StandardNormal))
}

pub(super) fn evidence(reported: Correction) -> f64 {
    match reported {
        Correction::Fused { log_evidence, .. } => log_evidence,
        other => panic!("not fused: {other:?}"),
    }
}

pub(super) fn normal(x: f64, mean: f64, variance: f64) -> f64 {
    let square = (x - mean) * (x - mean) / variance;
    (-0.5 * square).exp() / (core::f64::consts::TAU * variance).sqrt()
}

/// The mean of some values and its standard error.
pub(super) fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = f64::from(u32::try_from(values.len()).expect("few"));
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}
