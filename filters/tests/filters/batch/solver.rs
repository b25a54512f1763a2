//! Maximum likelihood and maximum a posteriori against bounds and closed forms, with missing
//! observations too.

use approx::assert_abs_diff_eq;
use foxhunt_core::{
    Axis, Correction, Covariance, Estimate, Estimator, MeasurementModel, Observation, Pose,
    Quantity, RandomWalk, State, gaussian_log_likelihood, numeric_jacobian,
};
use foxhunt_filters::{BatchError, BatchEstimator, BatchSolver, Loss};
use nalgebra::{Matrix1, Matrix3, RowVector2, Vector1, Vector2, Vector3};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{ChiSquared as DrawChiSquared, Distribution, StandardNormal};
use statrs::distribution::{ChiSquared, Continuous, ContinuousCDF, Normal};

use super::model::{MODEL, observed, round};

const SIGMA: Vector2<f64> = Vector2::new(3.0, 0.15);

/// z = A x: least squares has a closed form.
struct Plane;

impl MeasurementModel<2, 1> for Plane {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::linear("x_m")]
    }
    fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector1<f64> {
        Vector1::new(receiver.position.x * state[0] + receiver.position.y * state[1])
    }
    fn jacobian(&self, _state: &State<2>, receiver: &Pose) -> RowVector2<f64> {
        RowVector2::new(receiver.position.x, receiver.position.y)
    }
}

/// A dent in the cost, on a hill that falls off to all sides.
struct Hill;

impl MeasurementModel<2, 3> for Hill {
    fn quantities(&self) -> [Quantity; 3] {
        [Quantity::linear("x_m"); 3]
    }
    fn expected(&self, state: &State<2>, _receiver: &Pose) -> Vector3<f64> {
        let square = state.norm_squared();
        let near = state * (-square / 50.0).exp();
        Vector3::new(near.x, near.y, (-square / 1000.0).exp())
    }
}

/// z = East; silence has the probability that it lies below the limit.
struct East;

impl MeasurementModel<2, 1> for East {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::linear("x_m")]
    }
    fn expected(&self, state: &State<2>, _receiver: &Pose) -> Vector1<f64> {
        Vector1::new(state[0])
    }
    fn log_likelihood(&self, state: &State<2>, observation: &Observation<1>) -> f64 {
        let Some((limit, sigma)) = observation.upper_limit(0) else {
            return gaussian_log_likelihood(self, state, observation);
        };
        standard().cdf((limit - state[0]) / sigma).ln()
    }
}

/// Levels, and bearings where `bearings` is set, of a transmitter of unknown power.
fn flight(
    rng: &mut Xoshiro256PlusPlus,
    truth: &State<3>,
    receivers: &[Pose],
    bearings: bool,
    noise: impl Fn(&mut Xoshiro256PlusPlus) -> f64,
) -> Vec<Observation<2>> {
    let observe = |receiver: &Pose| {
        let white = Vector2::new(noise(rng), noise(rng));
        let z = MODEL.expected(truth, receiver) + SIGMA.component_mul(&white);
        let whole = observed(*receiver, z, SIGMA);
        if bearings { whole } else { whole.without(1) }
    };
    receivers.iter().map(observe).collect()
}

/// Seeds 0 to 99: the target is drawn from the prior, every level is taken at one place. The
/// likelihood is a ring, whose optimum does not show where on it the target is.
#[test]
fn levels_from_one_place_leave_the_prior_in_doubt() {
    let at = Pose::at(20.0, -10.0, 15.0);
    let sigmas = Vector2::new(1.0, 1.0);
    let prior = Estimate::isotropic(Vector2::new(50.0, 40.0), 60.0);
    let runs = 100_u16;
    let mut sums = [0.0, 0.0];
    let mut worst = 0.0_f64;
    for seed in 0..u64::from(runs) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let truth = prior.mean + Vector2::new(gaussian(&mut rng), gaussian(&mut rng)) * 60.0;
        let observe = |_| {
            let z = MODEL.expected(&truth, &at) + Vector2::new(gaussian(&mut rng), 0.0);
            observed(at, z, sigmas).without(1)
        };
        let levels: Vec<_> = (0..12).map(observe).collect();
        let alone = BatchSolver::new(MODEL).solve(&levels, &[prior.mean, Vector2::zeros()]);
        assert!(matches!(alone, Err(BatchError::Flat { .. })), "seed {seed}: {alone:?}");
        let solver = BatchSolver::new(MODEL).with_prior(prior).expect("proper");
        let fix = solver.solve(&levels, &[]).expect("the prior has an optimum");
        let mut recursive =
            BatchEstimator::new(RandomWalk::uniform(0.0), MODEL, prior).expect("proper");
        for level in &levels {
            let _ = recursive.update(level).expect("possible");
        }
        for (sum, reported) in sums.iter_mut().zip([fix.estimate, recursive.estimate()]) {
            let nees = reported.nees(&truth).expect("definite");
            *sum += nees;
            worst = worst.max(nees);
        }
    }
    // Wider than need be, but never sure of a point: that had a NEES of up to 1e9.
    println!("ANEES {:?}, worst {worst}", sums.map(|sum| sum / f64::from(runs)));
    assert!(sums.iter().all(|sum| sum / f64::from(runs) < 4.0), "{sums:?} of {runs} runs");
    assert!(worst < 150.0, "{worst}");
}

fn gaussian(rng: &mut Xoshiro256PlusPlus) -> f64 {
    rng.sample(StandardNormal)
}

/// The information that `observations` hold about a state.
fn information(truth: &State<3>, observations: &[Observation<2>]) -> Covariance<3> {
    let mut information = Matrix3::zeros();
    for o in observations {
        let h = |x: &State<3>| MODEL.expected(x, o.receiver());
        let slope =
            numeric_jacobian(truth, h, |a, b| Axis::difference(&[Axis::Linear, Axis::Angle], a, b));
        for i in (0..2).filter(|i| o.has(*i)) {
            information += slope.row(i).transpose() * slope.row(i) / SIGMA[i].powi(2);
        }
    }
    information
}

/// Seed 5, 500 runs, levels with unknown power, bearings with them in half of the runs: the errors
/// over the bound, and the NEES, a χ² of 3 degrees; a false alarm in 1000 each.
#[test]
fn maximum_likelihood_reaches_the_bound() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    for bearings in [false, true] {
        let runs = 500_u16;
        let mut nees = 0.0;
        let mut over_bound = 0.0;
        let mut misfit = 0.0;
        for _ in 0..runs {
            let place = [rng.random::<f64>() * 160.0 + 20.0, rng.random::<f64>() * 80.0 + 20.0];
            let truth = Vector3::new(place[0], place[1], -30.0 + 10.0 * gaussian(&mut rng));
            let observations = flight(&mut rng, &truth, &round(80), bearings, gaussian);
            let start = Vector3::new(100.0, 60.0, -30.0);
            let fix = BatchSolver::new(MODEL).solve(&observations, &[start]).expect("an optimum");
            nees += fix.estimate.nees(&truth).expect("definite");
            let error = fix.estimate.mean - truth;
            over_bound += error.dot(&(information(&truth, &observations) * error));
            misfit += fix.reduced_chi_squared.expect("many to spare");
        }
        let n = f64::from(runs);
        let law = ChiSquared::new(3.0 * n).expect("positive");
        let [low, high] = [0.0005, 0.9995].map(|p| law.inverse_cdf(p) / n);
        println!("ANEES {:.3}, over the bound {:.3} of 3", nees / n, over_bound / n);
        assert!((low..high).contains(&(nees / n)), "{} is not in {low}..{high}", nees / n);
        assert!(over_bound / n < 1.15 * 3.0);
        assert_abs_diff_eq!(misfit / n, 1.0, epsilon = 0.02);
    }
}

fn plane(coefficients: [f64; 2], z: f64, variance: f64) -> Observation<1> {
    let receiver = Pose::at(coefficients[0], coefficients[1], 0.0);
    Observation::new(0.0, receiver, Vector1::new(z), Matrix1::new(variance)).expect("proper")
}

#[test]
fn a_linear_model_is_solved_exactly() {
    let observed =
        [plane([1.0, 2.0], 5.0, 0.5), plane([3.0, -1.0], 1.0, 2.0), plane([0.5, 0.5], 1.7, 0.1)];
    let prior = Estimate {
        mean: Vector2::new(1.0, 1.0),
        covariance: nalgebra::Matrix2::new(4.0, 1.0, 1.0, 3.0),
    };
    let fix = BatchSolver::new(Plane).with_prior(prior).expect("proper").solve(&observed, &[]);
    let fix = fix.expect("an optimum");
    // The same by the information form.
    let inverse = prior.covariance.try_inverse().expect("definite");
    let mut information = inverse;
    let mut right = inverse * prior.mean;
    for o in &observed {
        let a = o.receiver().position.xy();
        information += a * a.transpose() / o.noise()[0];
        right += a * o.value()[0] / o.noise()[0];
    }
    let covariance = information.try_inverse().expect("definite");
    assert!((fix.estimate.mean - covariance * right).norm() < 1e-12);
    assert!((fix.estimate.covariance - covariance).norm() < 1e-12);
    let at = fix.estimate.mean;
    let log: f64 = observed.iter().map(|o| Plane.log_likelihood(&at, o)).sum();
    let apart = at - prior.mean;
    let of_prior = -0.5 * apart.dot(&(inverse * apart))
        - 0.5 * (std::f64::consts::TAU.powi(2) * prior.covariance.determinant()).ln();
    assert_abs_diff_eq!(fix.log_posterior - log, of_prior, epsilon = 1e-12);
    // Residuals three times their sigmas multiply all covariances by nine.
    let far =
        [plane([1.0, 0.0], 3.0, 1.0), plane([1.0, 0.0], -3.0, 1.0), plane([0.0, 1.0], 0.0, 1.0)];
    let wide = BatchSolver::new(Plane).with_inflation().solve(&far, &[Vector2::zeros()]);
    let wide = wide.expect("an optimum");
    assert_abs_diff_eq!(wide.estimate.covariance[(0, 0)], 18.0 / 2.0, epsilon = 1e-9);
    let near =
        [plane([1.0, 0.0], 0.3, 1.0), plane([1.0, 0.0], -0.3, 1.0), plane([0.0, 1.0], 0.0, 1.0)];
    let near = BatchSolver::new(Plane).with_inflation().solve(&near, &[Vector2::zeros()]);
    let near = near.expect("an optimum").estimate.covariance[(0, 0)];
    assert_abs_diff_eq!(near, 0.5, epsilon = 1e-9);
}

/// Seed 6, 200 runs with a tenth of wild levels and bearings: each robust loss has less than a half
/// of the Gaussian's squared error; with Student's noise its own loss is best.
#[test]
fn robust_losses_stand_outliers() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(6);
    let losses = [
        Loss::Gaussian,
        Loss::Huber { k: 1.345 },
        Loss::Cauchy { c: 2.385 },
        Loss::StudentT { degrees: 4.0 },
    ];
    let wild = |rng: &mut Xoshiro256PlusPlus| {
        let strays = if rng.random::<f64>() < 0.1 { 10.0 } else { 1.0 };
        strays * gaussian(rng)
    };
    let mut squares = [0.0; 4];
    for _ in 0..200 {
        let truth = Vector3::new(rng.random::<f64>() * 200.0, rng.random::<f64>() * 120.0, -30.0);
        let observations = flight(&mut rng, &truth, &round(60), true, wild);
        let starts = [Vector3::new(100.0, 60.0, -30.0), Vector3::new(100.0, 20.0, -30.0)];
        for (loss, square) in losses.into_iter().zip(&mut squares) {
            let solver = BatchSolver::new(MODEL).with_loss(loss).expect("in range");
            let fix = solver.solve(&observations, &starts).expect("an optimum");
            *square += (fix.estimate.mean - truth).xy().norm_squared() / 200.0;
        }
    }
    println!("mean squared errors {squares:.2?} m²");
    assert!(squares[1..].iter().all(|square| *square < 0.5 * squares[0]), "{squares:?}");
    let degrees = 3.0;
    let student = |rng: &mut Xoshiro256PlusPlus| {
        let scale: f64 = DrawChiSquared::new(degrees).expect("positive").sample(rng);
        gaussian(rng) / (scale / degrees).sqrt()
    };
    let truth = Vector3::new(60.0, 80.0, -30.0);
    let observations = flight(&mut rng, &truth, &round(60), true, student);
    let solver = BatchSolver::new(MODEL).with_loss(Loss::StudentT { degrees }).expect("in range");
    let fix = solver.solve(&observations, &[truth]).expect("an optimum");
    // A weight is that of its residual.
    for (o, weight) in observations.iter().zip(&fix.weights) {
        let expected = MODEL.expected(&fix.estimate.mean, o.receiver());
        let residual = MeasurementModel::<3, 2>::residual(&MODEL, o.value(), &expected);
        let q = residual.component_div(&SIGMA).norm_squared();
        assert_abs_diff_eq!(*weight, (degrees + 2.0) / (degrees + q), epsilon = 1e-9);
    }
}

#[test]
fn the_best_of_two_optima_is_found_from_several_starts() {
    // Levels along a straight leg: a target on either side would be observed alike; one poor
    // bearing decides.
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
    let leg: Vec<_> = (0..40).map(|i| Pose::at(5.0 * f64::from(i), 0.0, 30.0)).collect();
    let truth = Vector3::new(90.0, 60.0, -30.0);
    let mut observations = flight(&mut rng, &truth, &leg, false, gaussian);
    let towards = MODEL.expected(&truth, &leg[5]);
    observations.push(observed(leg[5], towards, Vector2::new(3.0, 0.5)));
    let north = Vector3::new(100.0, 30.0, -30.0);
    let south = Vector3::new(100.0, -30.0, -30.0);
    let solver = BatchSolver::new(MODEL);
    let wrong = solver.solve(&observations, &[south]).expect("an optimum");
    assert!(wrong.estimate.mean.y < -20.0, "{wrong:?}");
    let right = solver.solve(&observations, &[south, north]).expect("an optimum");
    assert!((right.estimate.mean - truth).xy().norm() < 20.0, "{right:?}");
    assert!(right.log_posterior > wrong.log_posterior);
    assert_eq!(right.agreeing_starts, (1, 2));
}

#[test]
fn inflation_is_a_common_factor_on_all_covariances() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
    let truth = Vector3::new(60.0, 80.0, -30.0);
    let rough = |rng: &mut Xoshiro256PlusPlus| 3.0 * gaussian(rng);
    let observations = flight(&mut rng, &truth, &round(60), true, rough);
    let prior = Estimate::isotropic(Vector3::new(70.0, 70.0, -33.0), 12.0);
    let solver = || BatchSolver::new(MODEL).with_prior(prior).expect("proper");
    let plain = solver().solve(&observations, &[]).expect("an optimum");
    let factor = plain.reduced_chi_squared.expect("many to spare");
    assert_abs_diff_eq!(factor, 9.0, epsilon = 3.0);
    let wide: Vec<_> = observations
        .iter()
        .map(|o| observed(*o.receiver(), *o.value(), SIGMA * factor.sqrt()))
        .collect();
    let wide = solver().solve(&wide, &[]).expect("an optimum");
    let inflated = solver().with_inflation().solve(&observations, &[]).expect("an optimum");
    assert!((inflated.estimate.mean - wide.estimate.mean).norm() < 1e-6);
    assert!((inflated.estimate.covariance - wide.estimate.covariance).norm() < 1e-6);
    assert_abs_diff_eq!(inflated.log_posterior, wide.log_posterior, epsilon = 1e-9);
}

/// The line that the receivers fly along is a saddle of the levels' misfit.
#[test]
fn a_saddle_is_left() {
    let leg: Vec<_> = (0..40).map(|i| Pose::at(5.0 * f64::from(i), 0.0, 30.0)).collect();
    let truth = Vector3::new(90.0, 60.0, -30.0);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(10);
    let observations = flight(&mut rng, &truth, &leg, false, gaussian);
    let prior = Estimate::isotropic(Vector3::new(100.0, 0.0, -30.0), 80.0);
    let solver = BatchSolver::new(MODEL).with_prior(prior).expect("proper");
    let fix = solver.solve(&observations, &[]).expect("an optimum");
    assert_abs_diff_eq!(fix.estimate.mean.y.abs(), 60.0, epsilon = 20.0);
}

#[test]
fn an_optimum_above_the_supremum_is_none() {
    let noise = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 1.0));
    let z = Observation::new(0.0, Pose::default(), Vector3::zeros(), noise);
    let observed = [z.expect("proper")];
    let dent = BatchSolver::new(Hill).solve(&observed, &[Vector2::new(0.3, -0.2)]);
    assert!(dent.expect("an optimum").estimate.mean.norm() < 1e-6);
    let both = [Vector2::new(0.3, -0.2), Vector2::new(12.0, 5.0)];
    let away = BatchSolver::new(Hill).solve(&observed, &both);
    assert!(matches!(away, Err(BatchError::RanAway { .. } | BatchError::Flat { .. })), "{away:?}");
    // A place that is less certain than the region is wide is none either.
    let vague = [plane([1.0, 0.0], 0.0, 100.0), plane([0.0, 1.0], 0.0, 100.0)];
    let solver = BatchSolver::new(Plane).with_reach(13.0).expect("positive");
    let flat = solver.solve(&vague, &[Vector2::zeros()]);
    assert!(matches!(flat, Err(BatchError::Flat { .. })), "{flat:?}");
    let solver = BatchSolver::new(Plane).with_reach(15.0).expect("positive");
    assert!(solver.solve(&vague, &[Vector2::zeros()]).is_ok());
}

#[test]
fn a_likelihood_without_an_optimum_is_refused() {
    let start = Vector3::new(10.0, 20.0, -30.0);
    let solver = BatchSolver::new(MODEL);
    // Four levels at one place: a ring of places for each power.
    let one_place: Vec<_> = (0..4)
        .map(|i| observed(Pose::at(0.0, 0.0, 30.0), Vector2::new(-70.0 + f64::from(i), 0.0), SIGMA))
        .map(|o| o.without(1))
        .collect();
    let flat = solver.solve(&one_place, &[start]);
    assert!(matches!(flat, Err(BatchError::Flat { .. })), "{flat:?}");
    // Levels that are all alike along a leg fit best at infinity, with infinite power.
    let leg: Vec<_> = (0..20).map(|i| Pose::at(10.0 * f64::from(i), 0.0, 30.0)).collect();
    let alike: Vec<_> =
        leg.iter().map(|r| observed(*r, Vector2::new(-80.0, 0.0), SIGMA).without(1)).collect();
    let away = solver.solve(&alike, &[Vector3::new(100.0, 50.0, -30.0)]);
    let lost = matches!(away, Err(BatchError::RanAway { .. } | BatchError::Flat { .. }));
    assert!(lost, "{away:?}");
    let near = BatchSolver::new(MODEL).with_reach(300.0).expect("positive");
    let near = near.solve(&alike, &[Vector3::new(100.0, 50.0, -30.0)]);
    assert!(
        matches!(near, Err(BatchError::RanAway { limit_m, .. }) if limit_m < 301.0),
        "{near:?}"
    );
    // Bearings that spread have no place where they meet; far away each is as good.
    let spreading: Vec<_> = [(0.0, 2.0), (50.0, 1.6), (100.0, 1.1), (150.0, 0.9)]
        .map(|(east, bearing)| {
            observed(Pose::at(east, 0.0, 30.0), Vector2::new(0.0, bearing), SIGMA).without(0)
        })
        .to_vec();
    let known = BatchSolver::<_, 2>::new(MODEL);
    let away = known.solve(&spreading, &[Vector2::new(70.0, 50.0)]);
    assert!(away.is_err(), "{away:?}");
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(8);
    let good = flight(&mut rng, &Vector3::new(60.0, 80.0, -30.0), &round(30), true, gaussian);
    let hasty = BatchSolver::new(MODEL).with_most_iterations(1).solve(&good, &[start]);
    assert_eq!(hasty, Err(BatchError::NotConverged { iterations: 1 }));
}

fn standard() -> Normal {
    Normal::new(0.0, 1.0).expect("proper")
}

fn observation(z: f64) -> Observation<1> {
    Observation::new(0.0, Pose::default(), Vector1::new(z), Matrix1::new(1.0)).expect("proper")
}

/// A prior N(0, 4), a level of 0.5 and one that lay below −1, both of σ 1: the mode by
/// bisection.
#[test]
fn silence_moves_the_optimum() {
    let prior = Estimate::isotropic(Vector2::zeros(), 2.0);
    let observed = observation(0.5);
    let silent = observation(-1.0).below(0);
    let ratio = |x: f64| standard().pdf(-1.0 - x) / standard().cdf(-1.0 - x);
    let slope = |x: f64| x / 4.0 + (x - 0.5) + ratio(x);
    let mut low = -5.0;
    let mut high = 5.0;
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if slope(middle) > 0.0 { high = middle } else { low = middle }
    }
    let curvature = 1.25 + ratio(low) * (ratio(low) - 1.0 - low);
    let solver = BatchSolver::new(East).with_prior(prior).expect("proper");
    let fix = solver.solve(&[observed, silent], &[]).expect("an optimum").estimate;
    assert_abs_diff_eq!(fix.mean[0], low, epsilon = 1e-6);
    assert_abs_diff_eq!(fix.covariance[(0, 0)], 1.0 / curvature, epsilon = 1e-4);
    assert_abs_diff_eq!(fix.mean[1], 0.0, epsilon = 1e-6);
    assert_abs_diff_eq!(fix.covariance[(1, 1)], 4.0, epsilon = 1e-6);

    let still = RandomWalk::uniform(0.0);
    let mut estimator = BatchEstimator::new(still, East, prior).expect("proper");
    let reported = estimator.update(&silent);
    let Ok(Correction::Fused { nis: None, log_evidence, .. }) = reported else {
        panic!("{reported:?}")
    };
    // P(z < −1) of N(0, 1 + 4), which Laplace comes near to.
    let exact = standard().cdf(-1.0 / 5.0_f64.sqrt()).ln();
    assert_abs_diff_eq!(log_evidence, exact, epsilon = 0.05);
    let _ = estimator.update(&observed).expect("possible");
    assert!((estimator.estimate().mean - fix.mean).norm() < 1e-6);
}
