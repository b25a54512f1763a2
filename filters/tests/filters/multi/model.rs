//! Models and draws that the tests of this folder share.

use core::f64::consts::TAU;

use foxhunt_core::{
    ConstantVelocity, Estimate, MeasurementModel, Observation, Pose, Quantity, State,
    nalgebra::{Matrix2, SMatrix, SVector, Vector2, Vector4},
};
use foxhunt_filters::{Ekf, Gate, multi::Detection};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, Poisson, StandardNormal};

/// The first `M` components of the state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part;

impl<const N: usize, const M: usize> MeasurementModel<N, M> for Part {
    fn quantities(&self) -> [Quantity; M] {
        [Quantity::linear("x_m"); M]
    }
    fn expected(&self, state: &State<N>, _: &Pose) -> SVector<f64, M> {
        state.fixed_rows::<M>(0).into_owned()
    }
    fn jacobian(&self, _: &State<N>, _: &Pose) -> SMatrix<f64, M, N> {
        SMatrix::identity()
    }
}

pub(super) fn rng(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed)
}

pub(super) fn white<const N: usize>(rng: &mut Xoshiro256PlusPlus) -> State<N> {
    State::from_fn(|_, _| rng.sample(StandardNormal))
}

/// Half of a side of the square that is observed, in metres.
pub(super) const HALF_SIDE: f64 = 100.0;

/// σ of an observed place on each axis, in metres.
pub(super) const SIGMA: f64 = 2.0;

/// An observation of a place.
pub(super) fn seen(place: Vector2<f64>) -> Observation<2> {
    let noise = Matrix2::identity() * (SIGMA * SIGMA);
    Observation::new(0.0, Pose::default(), place, noise).expect("proper")
}

/// Detections and clutter over the square.
pub(super) fn detection(probability: f64, clutter: f64) -> Detection<2> {
    Detection::new(probability, clutter, [2.0 * HALF_SIDE; 2]).expect("proper")
}

/// One scan of transmitters at these places, with clutter, in a random order.
pub(super) fn scan(
    places: &[Vector2<f64>],
    detected: f64,
    clutter: f64,
    rng: &mut Xoshiro256PlusPlus,
) -> Vec<Observation<2>> {
    let mut all: Vec<Vector2<f64>> = Vec::new();
    for place in places {
        if rng.random::<f64>() < detected {
            all.push(place + white::<2>(rng) * SIGMA);
        }
    }
    let false_ones = Poisson::new(clutter).expect("positive").sample(rng);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small count")]
    for _ in 0..false_ones as usize {
        let mut coordinate = || (2.0 * rng.random::<f64>() - 1.0) * HALF_SIDE;
        all.push(Vector2::new(coordinate(), coordinate()));
    }
    // Fisher & Yates.
    for last in (1..all.len()).rev() {
        all.swap(last, rng.random_range(0..=last));
    }
    all.into_iter().map(seen).collect()
}

pub(super) type Moving = Ekf<ConstantVelocity, Part, 4, 2>;

pub(super) const MOTION: ConstantVelocity = ConstantVelocity { spectral_density: 0.2 };

/// A prior of place (σ 10 m) and velocity (σ 2 m/s).
pub(super) fn moving_prior(east: f64, north: f64) -> Estimate<4> {
    Estimate {
        mean: Vector4::new(east, north, 0.0, 0.0),
        covariance: SMatrix::from_diagonal(&Vector4::new(100.0, 100.0, 4.0, 4.0)),
    }
}

/// A Kalman filter of a moving transmitter, with a gate of 99.9999 %.
pub(super) fn moving(prior: Estimate<4>) -> Moving {
    let gate = Gate::probability(0.999_999).expect("a probability");
    Ekf::new(MOTION, Part, prior).expect("proper").with_gate(gate)
}

/// A bearing with σ of 0.05 rad from a receiver.
pub(super) fn bearing(receiver: Vector2<f64>, value: f64) -> Observation<1> {
    let pose = Pose::at(receiver.x, receiver.y, 0.0);
    let value = SVector::<f64, 1>::new(value.rem_euclid(TAU));
    Observation::new(0.0, pose, value, SMatrix::<f64, 1, 1>::new(0.0025)).expect("proper")
}

/// The bearing of the target, in radians counter-clockwise from East.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bearing;

impl MeasurementModel<2, 1> for Bearing {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::BEARING]
    }
    fn expected(&self, target: &State<2>, receiver: &Pose) -> SVector<f64, 1> {
        let d = target - receiver.position.xy();
        SVector::<f64, 1>::new(libm::atan2(d.y, d.x))
    }
}
