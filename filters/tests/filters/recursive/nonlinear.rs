//! Losses of the Kalman family against the exact posterior where the model is far from linear over
//! the prior; truth is drawn from the prior, run `i` from seed `i`.

use foxhunt_core::{
    Estimate, Estimator, MeasurementModel, Observation, Pose, RandomWalk, State, nalgebra::Vector2,
};
use foxhunt_filters::{Ckf, Ekf, Iterations, Ukf};
use rand::RngExt;
use rand_distr::StandardNormal;

use super::{
    edges::rng,
    iterated::exact,
    model::{FIELD, observed},
};

struct Problem {
    /// Distance of the listening drone from the prior mean, in metres.
    radius: f64,
    steps: u32,
    sigma_bearing: f64,
    rss: bool,
}

const NAMES: [&str; 6] = ["exact", "EKF", "UKF", "CKF", "iterated EKF", "iterated CKF"];
const RUNS: u32 = 300;
const SIGMA_RSS_DB: f64 = 4.0;
/// The reference's prior, √70 m.
const SIGMA: f64 = 8.4;

fn all(prior: Estimate<2>) -> [Box<dyn Estimator<2, 2>>; 5] {
    let still = RandomWalk::uniform(0.0);
    let proper = "a proper prior";
    let ten = Iterations::at_most(10).expect("at least one");
    [
        Box::new(Ekf::new(still, FIELD, prior).expect(proper)),
        Box::new(Ukf::new(still, FIELD, prior).expect(proper)),
        Box::new(Ckf::new(still, FIELD, prior).expect(proper)),
        Box::new(Ekf::new(still, FIELD, prior).expect(proper).with_iterations(ten)),
        Box::new(Ckf::new(still, FIELD, prior).expect(proper).with_iterations(ten)),
    ]
}

/// Returns each estimator's rms error over the one of the exact posterior's mean, and its ANEES.
fn report(problem: &Problem) -> [(f64, f64); 6] {
    let mut squares = [0.0; 6];
    let mut nees = [0.0; 6];
    for seed in 0..u64::from(RUNS) {
        let mut rng = rng(seed);
        let mut white = || -> State<2> { State::from_fn(|_, _| rng.sample(StandardNormal)) };
        let prior = Estimate::isotropic(Vector2::new(6.0, -3.0), SIGMA);
        let truth = prior.mean + white() * SIGMA;
        let mut filters = all(prior);
        let observe = |step: u32| -> Observation<2> {
            let around = 2.1 * f64::from(step);
            let place = prior.mean + Vector2::new(around.cos(), around.sin()) * problem.radius;
            let receiver = Pose::at(place.x, place.y, 4.0);
            let noise = Vector2::new(SIGMA_RSS_DB, problem.sigma_bearing).component_mul(&white());
            let z = FIELD.expected(&truth, &receiver) + noise;
            let whole = observed(receiver, z, SIGMA_RSS_DB, problem.sigma_bearing);
            if problem.rss { whole } else { whole.without(0) }
        };
        let observations: Vec<_> = (0..problem.steps).map(observe).collect();
        let mut reported = vec![exact(&prior, &observations).0];
        for filter in &mut filters {
            for observation in &observations {
                let _ = filter.update(observation).expect("possible");
            }
            reported.push(filter.estimate());
        }
        for (i, estimate) in reported.iter().enumerate() {
            squares[i] += (estimate.mean - truth).norm_squared();
            nees[i] += estimate.nees(&truth).expect("positive definite") / f64::from(RUNS);
        }
    }
    core::array::from_fn(|i| ((squares[i] / squares[0]).sqrt(), nees[i]))
}

/// Limits for a problem: at most of the iterated CKF, its error over the exact posterior's, and its
/// ANEES; at least of every filter that linearises once.
struct Band {
    iterated: (f64, f64),
    once: (f64, f64),
}

/// The bands leave the seeded figures, which are fixed, a tenth or more; another stream would
/// move an rms of `RUNS` runs by 3 to 4 % and an ANEES by 0.2, one standard error.
fn assert_within(problem: &Problem, band: &Band) -> [(f64, f64); 6] {
    let reported = report(problem);
    let [(_, exact), once @ .., _, (error, anees)] = &reported;
    // E[NEES] = 2 for the exact posterior: three standard errors.
    assert!((exact - 2.0).abs() < 0.4, "the grid's ANEES is {exact}");
    assert!(*error < band.iterated.0 && *anees < band.iterated.1, "{NAMES:?}: {reported:?}");
    for (error, anees) in once {
        assert!(*error > band.once.0 && *anees > band.once.1, "{NAMES:?}: {reported:?}");
    }
    reported
}

#[test]
fn precise_bearings_and_power_from_near_by() {
    let near = Problem { radius: 20.0, steps: 3, sigma_bearing: 0.05, rss: true };
    let reported = assert_within(&near, &Band { iterated: (1.25, 3.0), once: (4.0, 20.0) });
    let (error, anees) = reported[4];
    assert!(error < 1.15 && anees < 3.5, "iterated EKF: {error}, ANEES {anees}");
}

#[test]
fn three_precise_bearings() {
    let bearings = Problem { radius: 30.0, steps: 3, sigma_bearing: 0.05, rss: false };
    let reported = assert_within(&bearings, &Band { iterated: (1.1, 2.7), once: (1.3, 4.0) });
    let (error, anees) = reported[4];
    assert!(error < 1.1 && anees < 2.7, "iterated EKF: {error}, ANEES {anees}");
}

#[test]
fn a_flight_through_the_prior() {
    let wild = Problem { radius: 8.0, steps: 20, sigma_bearing: 0.52, rss: true };
    let reported = assert_within(&wild, &Band { iterated: (1.18, 3.0), once: (1.4, 4.0) });
    // Close by, the most probable place is on the receiver, and a tangent there claims that it is
    // known to the centimetre: only points show that it is not. The place itself is good.
    let (error, anees) = reported[4];
    assert!(error < 1.25 && anees > 10.0, "iterated EKF: {error}, ANEES {anees}");
}
