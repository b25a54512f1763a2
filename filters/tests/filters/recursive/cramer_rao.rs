//! The posterior Cramér-Rao bound against what is known exactly.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use core::f64::consts::TAU;

use foxhunt_core::{
    ConstantVelocity, Estimate, Estimator, EstimatorError, MeasurementModel, MotionModel,
    Observation, Pose, Quantity, RandomWalk, State, angle,
    nalgebra::{Matrix1, Matrix2, Matrix4, Vector1, Vector2, Vector4},
};
use foxhunt_filters::{CramerRaoError, Ekf, FisherQuadrature, PosteriorCramerRao};
use rand::RngExt;
use rand_distr::StandardNormal;

use super::{
    edges::rng,
    model::{FIELD, observed},
};

/// The position of a moving target.
struct Place;

impl MeasurementModel<4, 2> for Place {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::linear("east_m"), Quantity::linear("north_m")]
    }
    fn expected(&self, state: &State<4>, _receiver: &Pose) -> Vector2<f64> {
        state.fixed_rows::<2>(0).into_owned()
    }
}

#[test]
fn the_linear_bound_is_the_kalman_covariance() {
    // No noise at all, noise on some components, and on all of them.
    let prior = Estimate::isotropic(Vector4::new(1.0, 2.0, 0.5, 0.0), 3.0);
    for density in [0.0, 1e-18, 0.09] {
        let motion = ConstantVelocity { spectral_density: density };
        let mut kalman = Ekf::new(motion, Place, prior).expect("a proper prior");
        let mut bound = PosteriorCramerRao::new(&prior).expect("a proper prior");
        let states = [prior.mean, prior.mean * -3.0];
        for step in 0..20 {
            kalman.predict(0.7).expect("a proper step");
            bound.predict(&motion, states, 0.7).expect("linear");
            let whole = observed(Pose::default(), Vector2::zeros(), 2.0, 0.5);
            let observation = if step % 3 == 0 { whole.without(1) } else { whole };
            let _ = kalman.update(&observation).expect("proper");
            bound.update(&Place, states.map(|x| (x, observation))).expect("finite");
            let (exact, reported) =
                (kalman.estimate().covariance, bound.covariance().expect("definite"));
            let error = (reported - exact).norm() / exact.norm();
            assert!(error < 1e-8, "density {density}, step {step}: off by {error}");
        }
    }
}

#[test]
fn a_motion_that_turns_with_the_state_is_the_source_s() {
    /// x' = x + sin(x) Δt/5 with noise on both components.
    struct Bent(f64);
    impl MotionModel<2> for Bent {
        fn propagate(&self, x: &State<2>, dt: f64) -> State<2> {
            x + x.map(f64::sin) * (0.2 * dt)
        }
        fn noise_factor(&self, _x: &State<2>, dt: f64) -> Matrix2<f64> {
            Matrix2::new(self.0, 0.0, 0.2, 0.4) * dt.sqrt()
        }
    }
    let prior = Estimate::isotropic(Vector2::new(0.3, -1.0), 1.5);
    let mut bound = PosteriorCramerRao::new(&prior).expect("a proper prior");
    let states = [[0.1, 2.0], [-1.0, 0.4], [3.0, -2.0]].map(Vector2::from);
    bound.predict(&Bent(0.5), states, 1.0).expect("additive noise");
    // Tichavský, Muravchik & Nehorai 1998, eqs. 21 to 24, with Q inverted.
    let l = Bent(0.5).noise_factor(&states[0], 1.0);
    let q = (l * l.transpose()).try_inverse().expect("regular");
    let jacobians = states.map(|x| Bent(0.5).jacobian(&x, 1.0));
    let d11: Matrix2<f64> =
        jacobians.iter().map(|f| f.transpose() * q * f).sum::<Matrix2<f64>>() / 3.0;
    let d12 = -jacobians.iter().map(|f| f.transpose()).sum::<Matrix2<f64>>() / 3.0 * q;
    let j = Matrix2::identity() / 2.25;
    let exact = q - d12.transpose() * (j + d11).try_inverse().expect("regular") * d12;
    assert!((bound.information() - exact).norm() < 1e-8 * exact.norm());

    let before = bound;
    let flat = bound.predict(&Bent(0.0), states, 1.0);
    assert!(matches!(flat, Err(CramerRaoError::Noiseless { .. })), "{flat:?}");
    let none: [State<2>; 0] = [];
    assert_eq!(bound.predict(&Bent(0.5), none, 1.0), Err(CramerRaoError::NoTrajectories));
    let dt = -1.0;
    let refused = Err(CramerRaoError::Estimator(EstimatorError::TimeStep { dt }));
    assert_eq!(bound.predict(&Bent(0.5), states, dt), refused);
    assert_eq!(bound, before);
}

/// Bearings with outliers (Isaacs et al. 2014, eq. 30).
struct Indoor {
    turn: bool,
}

impl MeasurementModel<2, 1> for Indoor {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::BEARING]
    }
    fn expected(&self, x: &State<2>, receiver: &Pose) -> Vector1<f64> {
        let d = x - receiver.position.xy();
        Vector1::new(libm::atan2(d.y, d.x))
    }
    fn log_likelihood(&self, x: &State<2>, observation: &Observation<1>) -> f64 {
        let share = 0.19;
        let bias = 0.0929;
        let sigma = 0.2468;
        let expected = self.expected(x, observation.receiver());
        let e = (observation.value() - expected)[0];
        let e = if self.turn { angle::wrap(e - bias) / sigma } else { f64::INFINITY };
        libm::log((1.0 - share) * libm::exp(-0.5 * e * e) / (sigma * libm::sqrt(TAU)) + share / TAU)
    }
}

#[test]
fn the_mixture_has_the_information_of_the_reference() {
    // 5 m off, at every direction; across the line of sight 11.451 / 25 and along it nothing.
    let bearing = Observation::new(0.0, Pose::default(), Vector1::zeros(), Matrix1::new(0.06));
    let bearing = bearing.expect("proper");
    for direction in 0..7_u8 {
        let (sin, cos) = (f64::from(direction) - 3.0).sin_cos();
        let x = Vector2::new(cos, sin) * 5.0;
        let information = FisherQuadrature::default()
            .information(&Indoor { turn: true }, &x, &bearing)
            .expect("a density");
        let along = Vector2::new(cos, sin);
        let across = Vector2::new(-sin, cos);
        let reported = 25.0 * across.dot(&(information * across));
        assert_abs_diff_eq!(reported, 11.451, epsilon = 1e-3);
        assert!((information * along).norm() < 1e-7);
    }
    let half =
        FisherQuadrature::default().information(&Indoor { turn: false }, &Vector2::x(), &bearing);
    let Err(CramerRaoError::NotADensity { mass }) = half else { panic!("{half:?}") };
    assert_abs_diff_eq!(mass, 0.19, epsilon = 1e-6);
}

#[test]
fn numerical_information_of_gaussian_noise_is_that_of_its_jacobian() {
    let x = Vector2::new(12.0, -7.0);
    let whole = observed(Pose::at(1.0, 2.0, 4.0), Vector2::zeros(), 4.0, 0.2);
    for observation in [whole, whole.without(0), whole.without(1)] {
        let mut exact = PosteriorCramerRao::from_information(Matrix2::zeros()).expect("none");
        let mut numerical = exact;
        let quadrature = FisherQuadrature::new(256, 10.0).expect("in range");
        exact.update(&FIELD, [(x, observation)]).expect("finite");
        numerical.update_numerically(&FIELD, [(x, observation)], quadrature).expect("a density");
        let error = (exact.information() - numerical.information()).norm();
        assert!(error < 1e-7 * exact.information().norm(), "{error}");
    }
    assert!(FisherQuadrature::new(7, 10.0).is_err());
    assert!(FisherQuadrature::new(64, f64::NAN).is_err());
    assert!(PosteriorCramerRao::from_information(-Matrix2::<f64>::identity()).is_err());
    let unknown = PosteriorCramerRao::from_information(Matrix4::zeros()).expect("none");
    assert!(unknown.covariance().is_err());
}

#[test]
fn no_filter_beats_the_bound_and_a_good_one_comes_near() {
    // 500 hunts of 12 observations at 40 m with a prior of 2 m, truth drawn from it; seeds 0 to
    // 499. Nearly linear: the EKF's mean square error is the bound's, to 3.3 standard errors of a
    // χ² average, √(2 / 1000), and a hundredth for what is not linear.
    const RUNS: u64 = 500;
    let prior = Estimate::isotropic(Vector2::new(6.0, -3.0), 2.0);
    let drift = 0.05;
    let walk = RandomWalk::uniform(drift);
    let pose = |step: u32| {
        let around = 2.1 * f64::from(step);
        Pose::at(6.0 + 40.0 * around.cos(), -3.0 + 40.0 * around.sin(), 4.0)
    };
    let mut runs: Vec<_> = (0..RUNS)
        .map(|seed| {
            let mut rng = rng(seed);
            let truth = prior.mean + State::<2>::from_fn(|_, _| rng.sample(StandardNormal)) * 2.0;
            (rng, truth, Ekf::new(walk, FIELD, prior).expect("a proper prior"))
        })
        .collect();
    let mut bound = PosteriorCramerRao::new(&prior).expect("a proper prior");
    for step in 0..12 {
        let truths: Vec<_> = runs.iter().map(|(_, truth, _)| *truth).collect();
        bound.predict(&walk, &truths, 1.0).expect("linear");
        for (rng, truth, filter) in &mut runs {
            let mut white = || -> State<2> { State::from_fn(|_, _| rng.sample(StandardNormal)) };
            *truth += white() * drift;
            let noise = Vector2::new(4.0, 0.1).component_mul(&white());
            let z = FIELD.expected(truth, &pose(step)) + noise;
            filter.predict(1.0).expect("a proper step");
            let _ = filter.update(&observed(pose(step), z, 4.0, 0.1)).expect("proper");
        }
        let observation = observed(pose(step), Vector2::zeros(), 4.0, 0.1);
        let observed = runs.iter().map(|(_, truth, _)| (*truth, observation));
        bound.update(&FIELD, observed).expect("finite");
    }
    // The error in the bound's metric: 2 on average where the bound is reached.
    let root = bound.information().cholesky().expect("definite").unpack().transpose();
    let square = |(_, truth, filter): &(_, State<2>, Ekf<_, _, 2, 2>)| {
        (root * (truth - filter.estimate().mean)).norm_squared()
    };
    let mean = runs.iter().map(square).sum::<f64>() / 500.0;
    let band = 2.0 * (3.3 * (2.0_f64 / 1000.0).sqrt() + 0.01);
    assert!(abs_diff_eq!(mean, 2.0, epsilon = band), "{mean}, not 2 ± {band}");
}
