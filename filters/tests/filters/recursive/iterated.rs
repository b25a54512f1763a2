//! Updates that are linearised about their own posterior, against the textbook's formulas and
//! against searches and grids that know nothing of linearisation.

use approx::assert_abs_diff_eq;
use foxhunt_core::{
    Correction, Covariance, Estimate, Estimator, MeasurementModel, Observation, Pose, Quantity,
    RandomWalk, State,
    nalgebra::{Matrix2, Vector2},
};
use foxhunt_filters::{Ckf, Cubature, Iterations, Kalman, Taylor, Transform};
use proptest::prelude::*;
use rand::RngExt;
use rand_distr::StandardNormal;

use super::{
    edges::rng,
    model::{FIELD, RssBearing, observed},
    textbook,
};

fn filter<T: Transform + Default>(
    prior: Estimate<2>,
    iterations: Iterations,
) -> Kalman<T, RandomWalk<2>, RssBearing, 2, 2> {
    Kalman::new(RandomWalk::uniform(0.0), FIELD, prior)
        .expect("a proper prior")
        .with_iterations(iterations)
}

fn at_most(max: u32, tolerance: f64) -> Iterations {
    Iterations::at_most(max).and_then(|i| i.with_tolerance(tolerance)).expect("in range")
}

fn fused(reported: Result<Correction, foxhunt_core::EstimatorError>) -> (f64, f64) {
    match reported {
        Ok(Correction::Fused { nis: Some(nis), log_evidence, .. }) => (nis, log_evidence),
        other => panic!("not fused: {other:?}"),
    }
}

/// The update of a prior by z = A x + b + e, regressed at the cubature points of `about`
/// (García-Fernández et al. 2015, eqs. 8-10), by its covariances and inverses.
fn regressed(
    prior: &Estimate<2>,
    about: &Estimate<2>,
    observation: &Observation<2>,
) -> textbook::Posterior<2> {
    let root = (about.covariance * 2.0).cholesky().expect("positive definite").unpack();
    let points = [root.column(0) * 1.0, root.column(1) * 1.0, -root.column(0), -root.column(1)];
    let image = |x: &State<2>| FIELD.expected(x, observation.receiver());
    let centre = image(&about.mean);
    let deviations = points.map(|p| FIELD.residual(&image(&(about.mean + p)), &centre));
    let shift = deviations.iter().sum::<Vector2<f64>>() / 4.0;
    let mut phi = Matrix2::zeros();
    let mut psi = Matrix2::zeros();
    for (p, d) in points.iter().zip(&deviations) {
        phi += (d - shift) * (d - shift).transpose() / 4.0;
        psi += p * (d - shift).transpose() / 4.0;
    }
    let slope = psi.transpose() * about.covariance.try_inverse().expect("positive definite");
    let omega = phi - slope * about.covariance * slope.transpose();
    let residual =
        FIELD.residual(observation.value(), &(centre + shift)) - slope * (prior.mean - about.mean);
    let cross = prior.covariance * slope.transpose();
    let spread: Covariance<2> = slope * cross + omega;
    textbook::condition(prior, &spread, &cross, &residual, observation)
}

/// −ln p(x, z), up to a constant.
fn cost(prior: &Estimate<2>, observation: &Observation<2>, x: &State<2>) -> f64 {
    0.5 * prior.nees(x).expect("a proper prior") - FIELD.log_likelihood(x, observation)
}

/// The least point of a function, by a grid that closes in on it; knows no derivative.
fn least(of: impl Fn(&State<2>) -> f64, centre: State<2>, half: f64) -> State<2> {
    let mut best = centre;
    let mut half = half;
    while half > 1e-9 {
        let about = best;
        for i in -30..=30 {
            for j in -30..=30 {
                let x = about + Vector2::new(f64::from(i), f64::from(j)) * (half / 30.0);
                if of(&x) < of(&best) {
                    best = x;
                }
            }
        }
        half *= 0.2;
    }
    best
}

proptest! {
    #[test]
    fn two_iterations_are_the_textbook_regressed_twice(
        east in -6.0..6.0, north in -6.0..6.0, tilt in -0.8..0.8, rss in -78.0..-66.0,
        bearing in -0.3..0.3, lost in 0..3_usize,
    ) {
        // Mild enough that no step is damped and no posterior preferred to the last.
        let covariance = Matrix2::new(16.0, 16.0 * tilt, 16.0 * tilt, 16.0);
        let prior = Estimate { mean: Vector2::new(east, north), covariance };
        let whole = observed(Pose::at(-40.0, 3.0, 4.0), Vector2::new(rss, bearing), 4.0, 0.1);
        let observation = if lost < 2 { whole.without(lost) } else { whole };
        let first = regressed(&prior, &prior, &observation);
        let mut about = first.clone();
        for max in [1, 2, 3] {
            let mut ckf = filter::<Cubature>(prior, at_most(max, 0.0));
            let (nis, log_evidence) = fused(ckf.update(&observation));
            // The gate judges the first linearisation; the evidence is the last one's.
            prop_assert!((nis - first.nis).abs() < 1e-8 * (1.0 + nis));
            prop_assert!((log_evidence - about.log_evidence).abs() < 1e-8 * (1.0 + nis));
            let estimate = ckf.estimate();
            prop_assert!((estimate.mean - about.estimate.mean).norm() < 1e-8, "{max}");
            prop_assert!((estimate.covariance - about.estimate.covariance).norm() < 1e-8, "{max}");
            about = regressed(&prior, &about.estimate, &observation);
        }
    }

    #[test]
    fn the_iterated_ekf_never_ends_where_it_is_less_probable(
        east in -30.0..30.0, north in -30.0..30.0, up in 0.0..5.0, sigma in 1.0..20.0,
        rss in -90.0..-35.0, bearing in -3.2..3.2, sigma_rss in 0.5..6.0,
        sigma_bearing in 0.01..0.6, max in 2..12_u32,
    ) {
        let prior = Estimate::isotropic(Vector2::new(east, north), sigma);
        let observation =
            observed(Pose::at(0.0, 0.0, up), Vector2::new(rss, bearing), sigma_rss, sigma_bearing);
        let mut ekf = filter::<Taylor>(prior, at_most(max, 1e-3));
        fused(ekf.update(&observation));
        let (end, start) = (
            cost(&prior, &observation, &ekf.estimate().mean),
            cost(&prior, &observation, &prior.mean),
        );
// A step may lose a twentieth of a nat.
        let room = 0.05 * f64::from(max);
        prop_assert!(end <= start + room, "{end}, from {start}");
    }
}

/// A problem drawn from its prior, observed from a place `range` metres from the prior mean.
fn drawn(seed: u64, sigma: f64, range: f64, noise: Vector2<f64>) -> (Estimate<2>, Observation<2>) {
    let mut rng = rng(seed);
    let mut white = || -> State<2> { State::from_fn(|_, _| rng.sample(StandardNormal)) };
    let prior = Estimate::isotropic(Vector2::new(6.0, -3.0), sigma);
    let truth = prior.mean + white() * sigma;
    let place = prior.mean + white().normalize() * range;
    let receiver = Pose::at(place.x, place.y, 4.0);
    let z = FIELD.expected(&truth, &receiver) + noise.component_mul(&white());
    (prior, observed(receiver, z, noise[0], noise[1]))
}

#[test]
fn the_iterated_ekf_converges_to_the_most_probable_place() {
    for seed in 0..60 {
        let (prior, observation) = drawn(seed, 8.0, 30.0, Vector2::new(4.0, 0.05));
        let mut ekf = filter::<Taylor>(prior, at_most(500, 1e-15));
        fused(ekf.update(&observation));
        let best = least(|x| cost(&prior, &observation, x), prior.mean, 40.0);
        // A search by values finds its least to the root of their last digit, 1e-7 of σ; the
        // iteration stops at 4e-8 of σ.
        let error = (ekf.estimate().mean - best).norm();
        assert!(error < 1e-5, "seed {seed}: {error} m from {best}");
        let mut once = filter::<Taylor>(prior, Iterations::once());
        fused(once.update(&observation));
        let other = (once.estimate().mean - best).norm();
        assert!(other > 1e-2, "seed {seed}: the plain filter is there too");
    }
}

#[test]
fn iterated_sigma_points_come_to_rest_where_the_regression_returns_them() {
    for seed in 0..60 {
        let (prior, observation) = drawn(seed, 8.0, 40.0, Vector2::new(4.0, 0.05));
        let mut ckf = filter::<Cubature>(prior, at_most(500, 1e-15));
        fused(ckf.update(&observation));
        let rest = ckf.estimate();
        let again = regressed(&prior, &rest, &observation).estimate;
        assert!((again.mean - rest.mean).norm() < 1e-5, "seed {seed}");
        assert!((again.covariance - rest.covariance).norm() < 1e-5, "seed {seed}");
    }
}

#[test]
fn an_iteration_that_has_settled_ends() {
    struct Counted(std::rc::Rc<std::cell::Cell<u32>>);
    impl MeasurementModel<2, 2> for Counted {
        fn quantities(&self) -> [Quantity; 2] {
            FIELD.quantities()
        }
        fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector2<f64> {
            self.0.set(self.0.get() + 1);
            FIELD.expected(state, receiver)
        }
    }
    let requested = |iterations: Iterations| {
        let (prior, observation) = drawn(3, 4.0, 40.0, Vector2::new(4.0, 0.1));
        let count = std::rc::Rc::default();
        let still = RandomWalk::uniform(0.0);
        let ckf = Ckf::new(still, Counted(std::rc::Rc::clone(&count)), prior);
        fused(ckf.expect("a proper prior").with_iterations(iterations).update(&observation));
        count.get()
    };
    // Five evaluations for an image; an iteration takes at least two more for its guard, and one
    // of its own.
    assert_eq!(requested(Iterations::once()), 5);
    let loose = requested(at_most(400, 1e-3));
    let tight = requested(at_most(400, 1e-12));
    assert!((20..=80).contains(&loose) && loose < tight && tight < 400, "{loose}, {tight}");
}

/// The moments of the exact posterior and its log-evidence, summed over a fine grid.
pub(super) fn exact(prior: &Estimate<2>, observations: &[Observation<2>]) -> (Estimate<2>, f64) {
    let sigma = prior.covariance[(0, 0)].sqrt();
    let pitch = sigma / 16.0;
    let cell = |i: i32, j: i32| {
        let x = prior.mean + Vector2::new(f64::from(i), f64::from(j)) * pitch;
        let likelihood: f64 = observations.iter().map(|z| FIELD.log_likelihood(&x, z)).sum();
        (x, likelihood - 0.5 * (x - prior.mean).norm_squared() / sigma.powi(2))
    };
    let cells: Vec<_> = (-70..=70).flat_map(|i| (-70..=70).map(move |j| cell(i, j))).collect();
    let most = cells.iter().fold(f64::NEG_INFINITY, |most, c| most.max(c.1));
    let weighted = || cells.iter().map(|(x, log)| (x, (log - most).exp()));
    let total: f64 = weighted().map(|(_, w)| w).sum();
    let mean = weighted().map(|(x, w)| x * w).sum::<State<2>>() / total;
    let square = |(x, w): (&State<2>, f64)| (x - mean) * (x - mean).transpose() * w;
    let covariance = weighted().map(square).sum::<Matrix2<f64>>() / total;
    let volume = (pitch / sigma).powi(2) / core::f64::consts::TAU;
    (Estimate { mean, covariance }, most + (total * volume).ln())
}

#[test]
fn the_evidence_of_the_last_linearisation_is_the_better() {
    // The mean absolute error in nats over 100 problems, seeds 0..100.
    let mut error = [0.0; 4];
    for seed in 0..100 {
        let (prior, observation) = drawn(seed, 8.0, 25.0, Vector2::new(4.0, 0.1));
        let (_, exactly) = exact(&prior, &[observation]);
        let reported = [
            fused(filter::<Taylor>(prior, Iterations::once()).update(&observation)).1,
            fused(filter::<Cubature>(prior, Iterations::once()).update(&observation)).1,
            fused(filter::<Taylor>(prior, at_most(20, 1e-6)).update(&observation)).1,
            fused(filter::<Cubature>(prior, at_most(20, 1e-6)).update(&observation)).1,
        ];
        for (sum, reported) in error.iter_mut().zip(reported) {
            *sum += (reported - exactly).abs() / 100.0;
        }
    }
    let [ekf, ckf, iterated_ekf, iterated_ckf] = error;
    assert!(iterated_ekf < 0.15 && iterated_ckf < 0.15, "{error:?}");
    assert!(ekf > 2.0 * iterated_ekf && ckf > 2.0 * iterated_ckf, "{error:?}");
}

#[test]
fn a_bearing_across_the_cut_lands_on_the_grids_mean() {
    let prior = Estimate::isotropic(Vector2::new(-100.0, 0.5), 10.0);
    let z = Vector2::new(-80.0, -core::f64::consts::PI + 0.02);
    let bearing = observed(Pose::default(), z, 1.0, 0.05).without(0);
    let (grid, _) = exact(&prior, &[bearing]);
    let (mut ekf, mut ckf) =
        (filter::<Taylor>(prior, at_most(20, 1e-9)), filter::<Cubature>(prior, at_most(20, 1e-9)));
    fused(ekf.update(&bearing));
    fused(ckf.update(&bearing));
    // Across the bearing, to a hundredth of σ. Along it the exact mean lies 0.77 m farther than
    // the prior's, as a wedge holds more the farther out: no linear regression sees that.
    for estimate in [ekf.estimate(), ckf.estimate()] {
        let error = estimate.mean - grid.mean;
        assert!(error.y.abs() < 0.05 && error.x.abs() < 1.0, "{}", estimate.mean);
        assert_abs_diff_eq!(estimate.covariance[(1, 1)].sqrt(), 4.47, epsilon = 0.1);
    }
    assert!((grid.mean - Vector2::new(-100.8, -1.5)).amax() < 0.05, "{}", grid.mean);
}
