//! Sums of Gaussians, and the row of them along a first bearing.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use foxhunt_core::{
    Estimate, Estimator, MeasurementModel, Observation, OutlierMixture, Pose, RandomWalk, State,
    nalgebra::{Matrix1, Matrix2, Matrix4, Vector1, Vector2, Vector4},
};
use foxhunt_filters::{Ckf, Ekf, GaussianSum, RangeParameterised, split};
use rand::RngExt;
use rand_distr::StandardNormal;

use super::model::{Bearing, Part, bearing, evidence, mean_and_error, normal, rng, white};

#[test]
fn a_split_has_the_moments_of_the_whole() {
    // A velocity that goes with the place, so that the split takes it along.
    let l = Matrix4::new(
        3.0, 0.0, 0.0, 0.0, //
        1.0, 2.0, 0.0, 0.0, //
        0.5, -0.3, 0.7, 0.0, //
        -0.2, 0.4, 0.1, 0.2,
    );
    let whole = Estimate { mean: Vector4::new(1.0, 2.0, 3.0, 4.0), covariance: l * l.transpose() };
    for parts in [[1, 1], [2, 1], [7, 1], [1, 4], [5, 3], [12, 9]] {
        let mut total = 0.0;
        let mut mean = Vector4::zeros();
        let mut second = Matrix4::zeros();
        let grid = split(&whole, parts).expect("proper");
        assert_eq!(grid.len(), parts[0] * parts[1]);
        for (weight, part) in &grid {
            let d = part.mean - whole.mean;
            total += weight;
            mean += d * *weight;
            second += (part.covariance + d * d.transpose()) * *weight;
            assert!(part.covariance.cholesky().is_some());
        }
        assert!(abs_diff_eq!(total, 1.0, epsilon = 1e-12) && mean.norm() < 1e-12, "{parts:?}");
        assert!((second - whole.covariance).norm() < 1e-11, "{parts:?}: {second}");
    }
    assert!(split(&whole, [0, 1]).is_err() && split(&whole, [1, 65]).is_err());
    let flat = Estimate { covariance: Matrix4::zeros(), ..whole };
    assert!(split(&flat, [3, 3]).is_err());
}

/// The exact posterior's mean, covariance and evidence on a grid of 1/80 of a standard deviation.
fn exact(prior: &Estimate<2>, observed: &[Observation<1>]) -> (Estimate<2>, f64) {
    let root = prior.covariance.cholesky().expect("proper").unpack();
    let mut mass = 0.0;
    let mut mean = Vector2::zeros();
    let mut second = Matrix2::zeros();
    for i in -400..=400 {
        for j in -400..=400 {
            let white = Vector2::new(f64::from(i), f64::from(j)) / 80.0;
            let place = prior.mean + root * white;
            let log: f64 = observed.iter().map(|o| Bearing.log_likelihood(&place, o)).sum();
            let p = (log - 0.5 * white.norm_squared()).exp() / core::f64::consts::TAU / 6400.0;
            mass += p;
            mean += place * p;
            second += place * place.transpose() * p;
        }
    }
    mean /= mass;
    let covariance = second / mass - mean * mean.transpose();
    (Estimate { mean, covariance }, mass.ln())
}

/// A prior of 60 m next to the receivers, and three bearings with 3° noise: the posterior is a
/// wedge that no Gaussian fits.
fn wedge() -> (Estimate<2>, Vec<Observation<1>>) {
    let prior = Estimate::isotropic(Vector2::new(90.0, 20.0), 60.0);
    let at = [(0.0, 0.3), (6.0, 0.28), (12.0, 0.33)];
    (prior, at.map(|(north, value)| bearing(Vector2::new(0.0, north), value, 0.05)).to_vec())
}

#[test]
fn a_sum_reaches_the_exact_posterior_where_one_gaussian_does_not() {
    let (prior, observed) = wedge();
    let (posterior, log_evidence) = exact(&prior, &observed);
    let off = |estimate: Estimate<2>| {
        let root = posterior.covariance.cholesky().expect("proper").unpack();
        let white = root.solve_lower_triangular(&(estimate.mean - posterior.mean)).expect("proper");
        let ratio = root.solve_lower_triangular(&estimate.covariance).expect("proper");
        let ratio = root.solve_lower_triangular(&ratio.transpose()).expect("proper");
        (white.norm(), (ratio - Matrix2::identity()).norm())
    };
    let still = RandomWalk::uniform(0.0);
    let one = Ekf::new(still, Bearing, prior).expect("proper");
    let mut sum = GaussianSum::new(&one, split(&prior, [13, 13]).expect("proper")).expect("proper");
    let mut few = GaussianSum::new(&one, split(&prior, [3, 3]).expect("proper"))
        .and_then(|sum| sum.with_most_components(60))
        .and_then(|sum| sum.with_resplitting(0.03, 4))
        .expect("proper");
    let mut reported = 0.0;
    let mut reported_few = 0.0;
    let mut alone = one;
    for observation in &observed {
        reported += evidence(sum.update(observation).expect("proper"));
        reported_few += evidence(few.update(observation).expect("proper"));
        let _ = alone.update(observation).expect("proper");
    }
    let (mean, spread) = off(sum.estimate());
    // What 169 linearised pieces leave, in standard deviations and in shares of the covariance.
    assert!(mean < 0.05 && spread < 0.2, "off by {mean}, {spread}");
    assert_abs_diff_eq!(reported, log_evidence, epsilon = 0.05);
    let (mean, spread) = off(few.estimate());
    assert!(mean < 0.2 && spread < 0.1, "resplit: off by {mean}, {spread}");
    assert_abs_diff_eq!(reported_few, log_evidence, epsilon = 0.1);
    assert!(few.components().len() <= 60);
    let (mean, spread) = off(alone.estimate());
    assert!(mean > 0.3 || spread > 0.5, "off by {mean}, {spread}: too easy a problem");
}

#[test]
fn outliers_branch_into_the_exact_mixture() {
    // z is the place's East; each of four observations is one of N(x, 1) or, with 0.3, anywhere
    // with a density of 0.05: sixteen hypotheses, summed here one by one.
    let prior = Estimate::isotropic(Vector2::zeros(), 2.0);
    let one = Ekf::new(RandomWalk::uniform(0.0), Part, prior).expect("a proper prior");
    let mut sum = GaussianSum::new(&one, [(1.0, prior)])
        .and_then(|sum| sum.with_most_components(16))
        .and_then(|sum| sum.with_merging_below(0.0))
        .and_then(|sum| sum.with_pruning(0.0))
        .expect("in range")
        .with_outliers(OutlierMixture::new(0.3, [20.0]).expect("in range"));
    let values = [0.5, 4.0, 0.9, -1.5];
    let mut reported = 0.0;
    for value in values {
        let z = Vector1::new(value);
        let noise = Matrix1::new(1.0);
        let observed = Observation::new(0.0, Pose::default(), z, noise).expect("proper");
        reported += evidence(sum.update(&observed).expect("proper"));
    }
    let mut total = 0.0;
    let mut first = 0.0;
    let mut second = 0.0;
    for hypothesis in 0..16 {
        let mut weight = 1.0;
        let mut mean = 0.0;
        let mut variance = 4.0;
        for (i, z) in values.iter().enumerate() {
            if hypothesis >> i & 1 == 1 {
                weight *= 0.3 * 0.05;
            } else {
                weight *= 0.7 * normal(*z, mean, variance + 1.0);
                mean += variance / (variance + 1.0) * (z - mean);
                variance /= variance + 1.0;
            }
        }
        total += weight;
        first += weight * mean;
        second += weight * (variance + mean * mean);
    }
    assert_abs_diff_eq!(reported, total.ln(), epsilon = 1e-9);
    let estimate = sum.estimate();
    assert_abs_diff_eq!(estimate.mean[0], first / total, epsilon = 1e-5);
    let variance = second / total - (first / total).powi(2);
    // Hypotheses below a millionth are not kept.
    assert_abs_diff_eq!(estimate.covariance[(0, 0)], variance, epsilon = 1e-4);
}

#[test]
fn a_sum_that_has_become_one_gaussian_is_merged() {
    let prior = Estimate::isotropic(Vector2::new(40.0, 0.0), 20.0);
    let one = Ckf::new(RandomWalk::uniform(0.01), Bearing, prior).expect("proper");
    let mut sum = GaussianSum::new(&one, split(&prior, [5, 5]).expect("proper")).expect("proper");
    let target = Vector2::new(45.0, 5.0);
    for i in 0..40 {
        let angle = 0.7 * f64::from(i);
        let receiver = Vector2::new(angle.cos(), angle.sin()) * 30.0;
        let value = Bearing.expected(&target, &Pose::at(receiver.x, receiver.y, 0.0));
        sum.predict(1.0).expect("a proper step");
        let _ = sum.update(&bearing(receiver, value[0], 0.02)).expect("proper");
    }
    assert!(sum.components().len() <= 2, "{} of 25 are left", sum.components().len());
    assert!((sum.estimate().mean - target).norm() < 0.3, "{}", sum.estimate().mean);
}

/// Bearings only from a drone that flies across, the range anywhere between 20 and 1280 m and
/// log-uniform; 300 runs from seed 0.
fn ranging(make: impl Fn(&RangeParameterised) -> Box<dyn Estimator<2, 1>>) -> (Vec<f64>, f64) {
    let mut normalised = Vec::new();
    let mut squares = 0.0;
    for seed in 0..300 {
        let mut rng = rng(seed);
        let range = 20.0 * 64.0_f64.powf(rng.random());
        let sigma = 0.03;
        let mut noise = |sd: f64| sd * rng.sample::<f64, _>(StandardNormal);
        // The first bearing is what the prior is made of: the truth lies about it.
        let first = 0.4;
        let direction = first + noise(sigma);
        let target = Vector2::new(direction.cos(), direction.sin()) * range;
        let origin = Pose::default();
        let row = RangeParameterised::new(&origin, (first, sigma), (20.0, 1280.0), 8);
        let mut filter = make(&row.expect("proper"));
        for step in 1..=12 {
            let receiver = Vector2::new(0.0, -8.0 * f64::from(step));
            let d = target - receiver;
            let value = libm::atan2(d.y, d.x) + noise(sigma);
            filter.predict(1.0).expect("a proper step");
            let _ = filter.update(&bearing(receiver, value, sigma)).expect("proper");
        }
        let estimate = filter.estimate();
        normalised.push(estimate.nees(&target).expect("proper"));
        squares += ((estimate.mean - target).norm() / range).powi(2);
    }
    (normalised, (squares / 300.0).sqrt())
}

#[test]
fn a_range_parameterised_bank_finds_a_range_that_one_filter_does_not() {
    let still = RandomWalk::uniform(0.0);
    let (bank, error) = ranging(|row| {
        let places = row.places();
        let one = Ekf::new(still, Bearing, places[0].1).expect("proper");
        Box::new(GaussianSum::new(&one, places).expect("proper"))
    });
    // E[NEES] = 2 for the exact posterior whatever its shape; the bank approximates it by eight
    // Gaussians for intervals, so it may be off by a tenth besides 3.3 standard errors.
    let (mean, spread) = mean_and_error(&bank);
    let band = 0.2 + 3.3 * spread;
    assert!(abs_diff_eq!(mean, 2.0, epsilon = band), "ANEES {mean:.3}, not 2 ± {band:.3}");
    let (alone, one) = ranging(|row| {
        // One Gaussian with the moments of all of them.
        let places = row.places();
        let count = 8.0;
        let mean: Vector2<f64> = places.iter().map(|p| p.1.mean).sum::<Vector2<f64>>() / count;
        let covariance = places
            .iter()
            .map(|(_, p)| p.covariance + (p.mean - mean) * (p.mean - mean).transpose())
            .sum::<Matrix2<f64>>()
            / count;
        Box::new(Ekf::new(still, Bearing, Estimate { mean, covariance }).expect("proper"))
    });
    assert!(error < 0.7 * one, "{error} against {one}");
    assert!(mean_and_error(&alone).0 > 3.0, "too easy a problem");
}

#[test]
fn moving_targets_have_a_bank_too() {
    // Seed 7: the truth is drawn from the middle component of the bank.
    let mut rng = rng(7);
    let row = RangeParameterised::new(&Pose::default(), (0.0, 0.02), (100.0, 800.0), 3);
    let rest = Estimate::isotropic(State::<4>::zeros(), 1.0);
    let parts = row.expect("proper").states(&rest);
    let truth = parts[1].1.mean
        + parts[1].1.covariance.cholesky().expect("proper").l() * white::<4>(&mut rng);
    let motion = foxhunt_core::ConstantVelocity { spectral_density: 1e-6 };
    let one = Ekf::new(motion, Bearing, parts[0].1).expect("proper");
    let mut bank = GaussianSum::new(&one, parts).expect("proper");
    for second in 1_i32..=60 {
        let t = f64::from(second);
        let receiver = Vector2::new(0.0, if second < 30 { 6.0 * t } else { 360.0 - 6.0 * t });
        let d = truth.fixed_rows::<2>(0) + truth.fixed_rows::<2>(2) * t - receiver;
        let value = libm::atan2(d.y, d.x) + 0.02 * rng.sample::<f64, _>(StandardNormal);
        bank.predict(1.0).expect("a proper step");
        let _ = bank.update(&bearing(receiver, value, 0.02)).expect("proper");
    }
    let now =
        Vector4::new(truth[0] + 60.0 * truth[2], truth[1] + 60.0 * truth[3], truth[2], truth[3]);
    // χ²₄ is above 18.5 once in 1000 times.
    let nees = bank.estimate().nees(&now).expect("proper");
    assert!(nees < 18.5, "NEES {nees}");
}

#[test]
fn every_component_has_the_same_coefficient_of_variation() {
    let receiver = Pose::at(30.0, -20.0, 5.0);
    let bearing = 2.3;
    let sigma = 0.02;
    let row =
        RangeParameterised::new(&receiver, (bearing, sigma), (50.0, 3200.0), 6).expect("proper");
    let along = Vector2::new(bearing.cos(), bearing.sin());
    let mut ratios = Vec::new();
    let mut end = 50.0;
    for (weight, place) in row.places() {
        let d = place.mean - receiver.position.xy();
        // The intervals adjoin: each is twice as long as the one before.
        let range = 1.5 * end;
        end *= 2.0;
        // exp(−σ² / 2) shortens a mean by 2 in 10⁴.
        assert!(abs_diff_eq!(d.norm() / range, 1.0, epsilon = 3e-4), "{} {range}", d.norm());
        assert_abs_diff_eq!(d.dot(&along), d.norm(), epsilon = 1e-9);
        let spread = along.dot(&(place.covariance * along)).sqrt();
        let across = Vector2::new(-along.y, along.x);
        let fan = across.dot(&(place.covariance * across)).sqrt();
        // E r² is (1 + the squared coefficient of variation) of the mean's square.
        assert_abs_diff_eq!(
            fan / (sigma * range * (1.0_f64 + 1.0 / 27.0).sqrt()),
            1.0,
            epsilon = 1e-3
        );
        ratios.push(spread / range);
        assert_abs_diff_eq!(weight, 1.0, epsilon = 1e-15);
    }
    // (2 − 1) / (1.5 √12)
    assert!(ratios.iter().all(|r| abs_diff_eq!(*r, 0.19245, epsilon = 1e-3)), "{ratios:?}");
    assert_abs_diff_eq!(end, 3200.0, epsilon = 1e-9);
}

#[test]
fn a_prior_of_the_range_weighs_and_the_rest_of_the_state_stays() {
    let row = RangeParameterised::new(&Pose::default(), (0.0, 0.1), (1.0, 8.0), 3)
        .and_then(|row| row.with_prior(|a, b| b - a))
        .expect("proper");
    let mut rest = Estimate::isotropic(State::<4>::from([9.0, 9.0, 1.0, -2.0]), 7.0);
    rest.covariance.fixed_view_mut::<2, 2>(2, 2).copy_from(&Matrix2::new(2.0, 0.5, 0.5, 1.0));
    rest.covariance[(0, 3)] = 0.1;
    rest.covariance[(3, 0)] = 0.1;
    let states = row.states(&rest);
    let weights: Vec<f64> = states.iter().map(|s| s.0).collect();
    assert!(weights.iter().zip([1.0, 2.0, 4.0]).all(|(w, e)| (w - e).abs() < 1e-12), "{weights:?}");
    for ((_, state), (_, place)) in states.iter().zip(row.places()) {
        assert_eq!(state.position(), place);
        assert_eq!(state.mean.fixed_rows::<2>(2), rest.mean.fixed_rows::<2>(2));
        assert_eq!(
            state.covariance.fixed_view::<2, 2>(2, 2),
            rest.covariance.fixed_view::<2, 2>(2, 2)
        );
        assert!(state.covariance.fixed_view::<2, 2>(0, 2).norm() <= 0.0, "no correlation");
    }
}

#[test]
fn improper_rows_are_refused() {
    let make = |bearing, interval, parts| {
        RangeParameterised::new(&Pose::default(), bearing, interval, parts).is_ok()
    };
    let bearing = (0.1, 0.1);
    let interval = (1.0, 9.0);
    assert!(make(bearing, interval, 1));
    assert!(!make((f64::NAN, 0.1), interval, 1) && !make((0.1, 0.0), interval, 1));
    for bad in [(0.0, 9.0), (9.0, 9.0), (9.0, 1.0), (1.0, f64::INFINITY), (f64::NAN, 9.0)] {
        assert!(!make(bearing, bad, 3), "{bad:?}");
    }
    assert!(!make(bearing, interval, 0) && !make(bearing, interval, 1001));
    let row = RangeParameterised::new(&Pose::default(), bearing, interval, 3).expect("proper");
    assert!(row.clone().with_prior(|_, _| 0.0).is_err());
    assert!(row.with_prior(|_, _| f64::NAN).is_err());
}
