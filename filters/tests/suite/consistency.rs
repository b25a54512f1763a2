use foxhunt_core::{
    Estimate, Estimator, MeasurementModel, Pose, RandomWalk, State, nalgebra::Vector2,
};
use foxhunt_filters::{
    Ekf, ParticleFilter, Ukf,
    consistency::{ChiSquaredAverage, Verdict},
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use crate::model::{FIELD, RssBearing, heard};

const RUNS: u32 = 400;

/// A hunt whose truth is drawn from the prior and drifts as the filter thinks.
struct Hunt {
    prior_sigma: f64,
    drift: f64,
    /// How far the drone flies from the prior mean, in metres.
    radius: f64,
    steps: u32,
    sigma_rss_db: f64,
    sigma_bearing: f64,
}

/// A good prior and a drone at a distance: next to linear over the prior, and nearly still.
const MILD: Hunt = Hunt {
    prior_sigma: 2.0,
    drift: 0.05,
    radius: 40.0,
    steps: 15,
    sigma_rss_db: 4.0,
    sigma_bearing: 0.1,
};

/// The reference's prior under a drone that flies through it: far from linear.
const WILD: Hunt =
    Hunt { prior_sigma: 8.4, radius: 8.0, steps: 20, sigma_bearing: 0.52, drift: 0.01, ..MILD };

/// The NEES at the end of each run and the NIS there, run `i` from seed `i`.
fn normalised<E: Estimator<2, 2>>(
    hunt: &Hunt,
    make: impl Fn(RandomWalk<2>, RssBearing, Estimate<2>, u64) -> E,
) -> Vec<[f64; 2]> {
    let run = |seed: u64| {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut white = || -> State<2> { State::from_fn(|_, _| rng.sample(StandardNormal)) };
        let prior = Estimate::isotropic(Vector2::new(6.0, -3.0), hunt.prior_sigma);
        let mut truth = prior.mean + white() * hunt.prior_sigma;
        let mut filter = make(RandomWalk::uniform(hunt.drift), FIELD, prior, seed);
        let mut nis = f64::NAN;
        for step in 0..hunt.steps {
            truth += white() * hunt.drift;
            let around = 2.1 * f64::from(step);
            let place = prior.mean + Vector2::new(around.cos(), around.sin()) * hunt.radius;
            let receiver = Pose::at(place.x, place.y, 4.0);
            let noise = Vector2::new(hunt.sigma_rss_db, hunt.sigma_bearing).component_mul(&white());
            let z = FIELD.expected(&truth, &receiver) + noise;
            filter.predict(1.0).expect("a proper step");
            let observation = heard(receiver, z, hunt.sigma_rss_db, hunt.sigma_bearing);
            nis = filter.update(&observation).expect("possible").nis().expect("told");
        }
        [filter.estimate().nees(&truth).expect("positive definite"), nis]
    };
    (0..u64::from(RUNS)).map(run).collect()
}

/// The average of each over the runs, at 99.9 %.
fn averages(normalised: &[[f64; 2]]) -> [ChiSquaredAverage; 2] {
    [0, 1].map(|i| {
        let mut average = ChiSquaredAverage::new(0.999).expect("in (0, 1)");
        average.extend(normalised.iter().map(|pair| (pair[i], 2)));
        average
    })
}

/// The averages lie in the interval that a consistent filter leaves once in 1000 times.
fn assert_consistent(name: &str, normalised: &[[f64; 2]]) {
    for (what, told) in ["ANEES", "ANIS"].iter().zip(averages(normalised)) {
        let (mean, interval) = (told.average(), told.interval());
        assert_eq!(told.verdict(), Verdict::Consistent, "{name}: {what} {mean:?}, {interval:?}");
    }
}

fn particles(
    motion: RandomWalk<2>,
    model: RssBearing,
    prior: Estimate<2>,
    seed: u64,
) -> ParticleFilter<RandomWalk<2>, RssBearing, Xoshiro256PlusPlus, 2, 2> {
    // Another stream than the truth's.
    let rng = Xoshiro256PlusPlus::seed_from_u64(seed + 1_000_000);
    ParticleFilter::new(motion, model, prior, 2000, rng).expect("a proper prior")
}

#[test]
fn every_estimator_is_consistent_where_the_model_is_nearly_linear() {
    let ekf = normalised(&MILD, |f, h, prior, _| Ekf::new(f, h, prior).expect("a proper prior"));
    assert_consistent("EKF", &ekf);
    let ukf = normalised(&MILD, |f, h, prior, _| Ukf::new(f, h, prior).expect("a proper prior"));
    assert_consistent("UKF", &ukf);
    assert_consistent("particle filter", &normalised(&MILD, particles));
}

#[test]
fn particles_are_consistent_where_a_gaussian_is_not() {
    // E[NEES] = 2 for the exact posterior whatever its shape, but it is not χ²: the band is the
    // sample's own, 3.3 standard errors for a false alarm in 1000.
    let mean_and_error = |normalised: &[[f64; 2]]| {
        let [anees, _] = averages(normalised);
        (anees.average().expect("runs"), anees.standard_error().expect("runs"))
    };
    let (cloud, error) = mean_and_error(&normalised(&WILD, particles));
    assert!((cloud - 2.0).abs() < 3.3 * error, "ANEES {cloud:.3} ± {error:.3}");
    let ekf = normalised(&WILD, |f, h, prior, _| Ekf::new(f, h, prior).expect("a proper prior"));
    let (linearised, _) = mean_and_error(&ekf);
    assert!(linearised > 2.5, "ANEES {linearised:.3}: this problem is too easy to tell");
}
