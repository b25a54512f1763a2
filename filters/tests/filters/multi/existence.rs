//! The Bernoulli filter.

use approx::assert_abs_diff_eq;
use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, MeasurementModel, Observation, Pose, Quantity,
    RandomWalk, State,
    nalgebra::{Matrix1, SMatrix, SVector, Vector1, Vector2},
};
use foxhunt_filters::{
    Ekf, GridConfig, GridFilter, ParticleFilter,
    multi::{BernoulliFilter, Detection, Lifetime, Reduction},
};
use rand::RngExt;

use super::model::{
    Bearing, MOTION, Part, bearing, detection, moving, moving_prior, rng, scan, seen, white,
};

fn still(sigma: f64) -> Ekf<RandomWalk<2>, Part, 2, 2> {
    let prior = Estimate::isotropic(Vector2::zeros(), sigma);
    Ekf::new(RandomWalk::uniform(0.0), Part, prior).expect("proper")
}

#[test]
fn one_scan_is_the_formula_of_ristic_by_hand() {
    let prior = still(10.0);
    let mut filter = BernoulliFilter::new(0.3, prior.clone(), detection(0.8, 2.0)).expect("proper");
    let observations = [seen(Vector2::new(3.0, -4.0)), seen(Vector2::new(-20.0, 9.0))];
    let associations = filter.update(&observations).expect("proper");
    // Ristic, Vo, Vo & Farina 2013, eq. 32 and 33, with κ = 2 / 200² m⁻².
    let clutter = 2.0 / 40_000.0;
    let mut weights = vec![0.2];
    let mut means = vec![Vector2::zeros()];
    for observation in &observations {
        let mut alone = prior.clone();
        let Correction::Fused { log_evidence, .. } = alone.update(observation).expect("proper")
        else {
            panic!("the filter has no gate");
        };
        weights.push(0.8 * log_evidence.exp() / clutter);
        means.push(alone.estimate().mean);
    }
    let total: f64 = weights.iter().sum();
    let existence = 0.3 * total / (0.7 + 0.3 * total);
    assert_abs_diff_eq!(filter.existence(), existence, epsilon = 1e-12);
    let mut mean = Vector2::zeros();
    for (index, (weight, own)) in weights.iter().zip(&means).enumerate() {
        mean += own * (weight / total);
        if index > 0 {
            let expected = existence * weight / total;
            assert_abs_diff_eq!(associations.of(0, index - 1), expected, epsilon = 1e-12);
        }
    }
    assert!((filter.estimate().mean - mean).norm() < 1e-10, "{mean}");
    // An empty scan: r (1 − p_D) / (1 − r p_D).
    let mut empty = BernoulliFilter::new(0.3, prior, detection(0.8, 2.0)).expect("proper");
    empty.update(&[]).expect("proper");
    assert_abs_diff_eq!(empty.existence(), 0.06 / 0.76, epsilon = 1e-15);
}

/// 300 searches, seeds from 1, each with a transmitter with the probability 0.5 that moves as the
/// filter has it, over 8 scans with p_D = 0.5 and 3 false observations each.
///
/// Given all scans, existence is a coin of the probability that the filter states. So Σ (e − r)
/// has mean 0 and variance Σ r (1 − r); three of its standard deviations are exceeded in one of
/// 370 such tests. The squared error over all present ones has the mean that the filter states.
#[test]
fn existence_is_as_frequent_as_stated() {
    const DETECTED: f64 = 0.5;
    const CLUTTER: f64 = 3.0;
    let mut off = 0.0;
    let mut variance = 0.0;
    let mut decided = 0;
    let mut right = 0;
    let mut nees = 0.0;
    let mut squares = 0.0;
    let mut present = 0.0;
    for seed in 1..=300 {
        let mut rng = rng(seed);
        let prior = moving_prior(0.0, 0.0);
        let is_there = rng.random::<f64>() < 0.5;
        let root = prior.covariance.cholesky().expect("definite").unpack();
        let mut state: State<4> = prior.mean + root * white::<4>(&mut rng);
        let mut filter =
            BernoulliFilter::new(0.5, moving(prior), detection(DETECTED, CLUTTER)).expect("proper");
        let reduction = Reduction::new(1e-6, 60).expect("proper");
        let merged = reduction.with_merging(1e-4, foxhunt_filters::Reinitialise::reinitialise);
        filter = filter.with_reduction(merged.expect("proper"));
        for _ in 0..8 {
            use foxhunt_core::MotionModel;
            state = MOTION.propagate(&state, 1.0)
                + MOTION.noise_factor(&state, 1.0) * white::<4>(&mut rng);
            filter.predict(1.0).expect("proper");
            let place = state.fixed_rows::<2>(0).into_owned();
            let places = if is_there { vec![place] } else { Vec::new() };
            filter.update(&scan(&places, DETECTED, CLUTTER, &mut rng)).expect("proper");
        }
        let existence = filter.existence();
        off += f64::from(u8::from(is_there)) - existence;
        variance += existence * (1.0 - existence);
        if (existence - 0.5).abs() > 0.4 {
            decided += 1;
            right += usize::from((existence > 0.5) == is_there);
        }
        if is_there {
            let own = filter.estimate().nees(&state).expect("definite");
            nees += own;
            squares += own * own;
            present += 1.0;
        }
    }
    let sigmas = off / f64::sqrt(variance);
    assert!(sigmas.abs() < 3.0, "{sigmas} standard deviations");
    // The filter does not hedge: most searches end decided, and nine of ten of them right.
    assert!(decided > 200 && right * 10 > decided * 9, "{right} of {decided}");
    // E[NEES] is 4 for a posterior whose mean and covariance are right, whatever its shape; given
    // existence the densities of both hypotheses are the same. Three standard errors by the
    // sample's own scatter.
    let mean = nees / present;
    let error = f64::sqrt((squares / present - mean * mean) / present);
    assert!((mean - 4.0).abs() < 3.0 * error, "{mean} ± {error}");
}

#[test]
fn a_transmitter_that_is_switched_off_fades_from_the_belief() {
    let lifetime = Lifetime::new(0.01, 0.02).expect("proper");
    let mut filter = BernoulliFilter::new(0.5, still(10.0), detection(0.9, 1.0))
        .expect("proper")
        .with_lifetime(lifetime);
    let mut rng = rng(1);
    for _ in 0..10 {
        filter.predict(1.0).expect("proper");
        filter.update(&scan(&[Vector2::new(5.0, 5.0)], 0.9, 1.0, &mut rng)).expect("proper");
    }
    assert!(filter.existence() > 0.99, "{}", filter.existence());
    for _ in 0..10 {
        filter.predict(1.0).expect("proper");
        filter.update(&scan(&[], 0.9, 1.0, &mut rng)).expect("proper");
    }
    assert!(filter.existence() < 0.05, "{}", filter.existence());
}

/// A bearing-only search over cells, particles and a Gaussian sum of histories: three families of
/// estimators that have nothing in common but the trait.
#[test]
fn cells_and_clouds_agree_on_existence_and_place() {
    let prior = Estimate::isotropic(Vector2::zeros(), 60.0);
    let truth = Vector2::new(40.0, 70.0);
    let detection = Detection::new(0.8, 0.5, [core::f64::consts::TAU]).expect("proper");
    let walk = RandomWalk::uniform(0.0);
    let grid = GridFilter::new(walk, Bearing, prior, GridConfig::default()).expect("proper");
    let cloud = ParticleFilter::new(walk, Bearing, prior, 20_000, rng(7)).expect("proper");
    let reduction = Reduction::new(1e-4, 4).expect("proper");
    let mut by_cells =
        BernoulliFilter::new(0.5, grid, detection).expect("proper").with_reduction(reduction);
    let reduction = Reduction::new(1e-4, 4).expect("proper");
    let mut by_cloud =
        BernoulliFilter::new(0.5, cloud, detection).expect("proper").with_reduction(reduction);
    let mut rng = rng(3);
    for step in 0..6_u8 {
        let receiver = Vector2::new(-60.0 + 20.0 * f64::from(step), -50.0);
        let d = truth - receiver;
        let mut observations = Vec::new();
        if rng.random::<f64>() < 0.8 {
            let error: SVector<f64, 1> = white(&mut rng);
            observations.push(bearing(receiver, libm::atan2(d.y, d.x) + 0.05 * error[0]));
        }
        if rng.random::<f64>() < 0.5 {
            observations.push(bearing(receiver, 6.0 * rng.random::<f64>()));
        }
        by_cells.update(&observations).expect("proper");
        by_cloud.update(&observations).expect("proper");
    }
    assert_abs_diff_eq!(by_cells.existence(), by_cloud.existence(), epsilon = 0.02);
    assert!(by_cells.existence() > 0.95, "{}", by_cells.existence());
    let apart = (by_cells.estimate().mean - by_cloud.estimate().mean).norm();
    assert!(apart < 4.0, "{apart} m");
    let nees = by_cells.estimate().nees(&truth).expect("definite");
    assert!(nees < 13.8, "the truth is outside of 99.9 %: {nees}");
    let mut total = 0.0;
    by_cells.visit_samples(&mut |_, weight| total += weight);
    assert_abs_diff_eq!(total, 1.0, epsilon = 1e-9);
}

/// Power in dBm at a place, with silence as a measurement.
#[derive(Clone, Copy)]
struct Level;

impl MeasurementModel<2, 1> for Level {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::RSS]
    }
    fn expected(&self, target: &State<2>, receiver: &Pose) -> SVector<f64, 1> {
        let range = (target - receiver.position.xy()).norm().max(1.0);
        Vector1::new(-30.0 - 25.0 * libm::log10(range))
    }
    fn log_likelihood(&self, target: &State<2>, observation: &Observation<1>) -> f64 {
        let expected = self.expected(target, observation.receiver())[0];
        match observation.upper_limit(0) {
            Some((limit, sigma)) => foxhunt_core::noise::log_normal_cdf((limit - expected) / sigma),
            None => foxhunt_core::gaussian_log_likelihood(self, target, observation),
        }
    }
}

#[test]
fn silence_everywhere_makes_a_transmitter_improbable() {
    let config = GridConfig {
        area: Some([Vector2::new(-100.0, -100.0), Vector2::new(100.0, 100.0)]),
        ..GridConfig::default()
    };
    let prior = Estimate::isotropic(Vector2::zeros(), 58.0);
    let grid = GridFilter::new(RandomWalk::uniform(0.0), Level, prior, config).expect("proper");
    let detection = Detection::new(0.5, 0.1, [100.0]).expect("proper");
    let mut filter = BernoulliFilter::new(0.5, grid, detection).expect("proper");
    let silence = |east: f64, north: f64, floor: f64| {
        let pose = Pose::at(east, north, 0.0);
        Observation::new(0.0, pose, Vector1::new(floor), Matrix1::new(16.0))
            .expect("proper")
            .below(0)
    };
    // By hand: the mean over the area of the probability of silence.
    let mut mean = 0.0;
    let cells = 400;
    for i in 0..cells * cells {
        let at = |index: i32| (f64::from(index) + 0.5) * 200.0 / f64::from(cells) - 100.0;
        let range = Vector2::new(at(i % cells), at(i / cells)).norm().max(1.0);
        let level = -30.0 - 25.0 * libm::log10(range);
        mean += foxhunt_core::noise::log_normal_cdf((-75.0 - level) / 4.0).exp();
    }
    mean /= f64::from(cells * cells);
    filter.update_silent(&silence(0.0, 0.0, -75.0)).expect("proper");
    let expected = mean / (mean + 1.0);
    assert_abs_diff_eq!(filter.existence(), expected, epsilon = 0.01);
    // A receiver that hears everything everywhere, and hears nothing.
    for east in [-60.0, 0.0, 60.0] {
        filter.update_silent(&silence(east, 0.0, -120.0)).expect("proper");
    }
    assert!(filter.existence() < 1e-4, "{}", filter.existence());
}

#[test]
fn improper_steps_and_settings_are_refused_and_change_nothing() {
    let mut filter = BernoulliFilter::new(0.5, still(10.0), detection(0.9, 1.0)).expect("proper");
    let before = (filter.existence(), filter.estimate());
    for dt in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(filter.predict(dt), Err(EstimatorError::TimeStep { .. })), "{dt}");
    }
    assert_eq!(before, (filter.existence(), filter.estimate()));
    for existence in [-0.1, 1.1, f64::NAN] {
        let refused = BernoulliFilter::new(existence, still(10.0), detection(0.9, 1.0));
        assert!(refused.is_err(), "{existence}");
    }
    assert!(Reduction::<(), 2>::new(1.0, 3).is_err() && Reduction::<(), 2>::new(0.1, 0).is_err());
    let _: SMatrix<f64, 2, 2> = filter.estimate().covariance;
}
