//! A user's own parts work like the library's: a model, an estimator, a source, a planner, a
//! vehicle.

use std::{cell::Cell, fmt, rc::Rc};

use foxhunt::{
    core::laws,
    filters::{Ekf, ParticleFilter, Ukf},
    formation::{FollowConfig, FollowEstimate},
    hunt::BoxedDrone,
    prelude::*,
    sensors::{LogDistance, Pritzl2018, RssBearing},
};
use nalgebra::{Matrix2, SMatrix, Vector1, Vector2, Vector3};
use proptest::prelude::*;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::support::{Cardioid, Health, LAW, Teleport, Time};

/// Slant range, from a round trip: no Jacobian and no likelihood of its own.
#[derive(Clone, Copy, Debug)]
struct RoundTrip;

impl MeasurementModel<2, 1> for RoundTrip {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::RANGE]
    }

    fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector1<f64> {
        Vector1::new((Vector3::new(state.x, state.y, 0.0) - receiver.position).norm())
    }
}

proptest! {
    #[test]
    fn two_methods_make_a_model(e in -300.0..300.0, n in -300.0..300.0, u in 5.0..100.0) {
        let receiver = Pose::at(10.0, 20.0, u);
        let noise = SMatrix::<f64, 1, 1>::new(25.0);
        let range = Observation::new(0.0, receiver, Vector1::new(90.0), noise).expect("finite");
        laws::measurement_model(&RoundTrip, &Vector2::new(e, n), &range);

        let prior = Estimate::isotropic(Vector2::new(e, n), 20.0);
        let still = RandomWalk::uniform(0.1);
        // Near the receiver a range is far from linear: these hold at any place.
        let checks = laws::Checks::AT_ONE_OBSERVATION;
        let ekf = || Ekf::new(still, RoundTrip, prior).expect("a proper prior");
        laws::estimator_with(ekf, &range, checks);
        let ukf = || Ukf::new(still, RoundTrip, prior).expect("a proper prior");
        laws::estimator_with(ukf, &range, checks);
        let cloud = || {
            let rng = Xoshiro256PlusPlus::seed_from_u64(1);
            ParticleFilter::new(still, RoundTrip, prior, 300, rng).expect("a proper prior")
        };
        laws::estimator_with(cloud, &range, checks);
    }
}

/// All laws, at a place from which the range is nearly linear.
#[test]
fn two_methods_make_a_model_of_all_estimators() {
    let noise = SMatrix::<f64, 1, 1>::new(25.0);
    let receiver = Pose::at(10.0, 20.0, 30.0);
    let range = Observation::new(0.0, receiver, Vector1::new(240.0), noise).expect("finite");
    let prior = Estimate::isotropic(Vector2::new(200.0, 160.0), 5.0);
    let still = RandomWalk::uniform(0.1);
    laws::estimator(|| Ekf::new(still, RoundTrip, prior).expect("a proper prior"), &range);
    laws::estimator(|| Ukf::new(still, RoundTrip, prior).expect("a proper prior"), &range);
}

/// A user's own estimator: weights on a fixed lattice of places, for a target that stays.
#[derive(Clone, Debug)]
struct Lattice {
    model: RssBearing<LogDistance>,
    places: Vec<(Vector2<f64>, f64)>,
}

impl Lattice {
    const STEP: f64 = 1.0;

    fn new(model: RssBearing<LogDistance>, prior: &Estimate<2>) -> Self {
        let mean = prior.mean;
        let precision = 1.0 / prior.covariance[(0, 0)];
        let lattice = (-30..=30).flat_map(|i| (-30..=30).map(move |j| (i, j)));
        let places = lattice
            .map(|(i, j)| {
                let place = mean + Vector2::new(f64::from(i), f64::from(j)) * Self::STEP;
                (place, (-0.5 * precision * (place - mean).norm_squared()).exp())
            })
            .collect();
        let mut lattice = Self { model, places };
        lattice.normalise();
        lattice
    }

    fn normalise(&mut self) -> f64 {
        let total: f64 = self.places.iter().map(|(_, w)| w).sum();
        self.places.iter_mut().for_each(|(_, w)| *w /= total);
        total
    }
}

impl Estimator<2, 2> for Lattice {
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)
    }

    fn update(&mut self, observation: &Observation<2>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        for (place, weight) in &mut self.places {
            *weight *= self.model.log_likelihood(place, observation).exp();
        }
        let log_evidence = self.normalise().ln();
        Ok(Correction::Fused { nis: None, log_evidence, effective_sample_size: None })
    }

    fn estimate(&self) -> Estimate<2> {
        let mean: Vector2<f64> = self.places.iter().map(|(x, w)| x * *w).sum();
        let cell = Matrix2::identity() * (Self::STEP * Self::STEP / 12.0);
        let spread = |(x, w): &(Vector2<f64>, f64)| (x - mean) * (x - mean).transpose() * *w;
        Estimate { mean, covariance: self.places.iter().map(spread).sum::<Matrix2<f64>>() + cell }
    }

    fn quantities(&self) -> [Quantity; 2] {
        MeasurementModel::<2, 2>::quantities(&self.model)
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<2>, f64)) {
        for (place, weight) in &self.places {
            visit(place, *weight);
        }
    }
}

fn model() -> RssBearing<LogDistance> {
    RssBearing::new(LogDistance::new(LAW.0, LAW.1).expect("in range"))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn an_estimator_of_ones_own_keeps_the_laws(bearing in -3.0..3.0, rss in -80.0..-50.0) {
        let (lattice, turn) = lattice_and_turn(rss, bearing);
        laws::estimator_with(lattice, &turn, laws::Checks::AT_ONE_OBSERVATION);
    }
}

/// All laws: seconds for each observation, with so many places.
#[test]
fn an_estimator_of_ones_own_keeps_all_laws() {
    let (lattice, turn) = lattice_and_turn(-62.0, -1.2);
    laws::estimator(lattice, &turn);
}

fn lattice_and_turn(rss: f64, bearing: f64) -> (impl Fn() -> Lattice, Observation<2>) {
    let prior = Estimate::isotropic(Vector2::new(3.0, -2.0), 8.0);
    let noise = Matrix2::from_diagonal(&Vector2::new(36.0, 0.25));
    let turn = Observation::new(0.0, Pose::at(0.0, 9.0, 4.0), Vector2::new(rss, bearing), noise);
    (move || Lattice::new(model(), &prior), turn.expect("finite"))
}

/// A user's own planner: everybody on a ring that shrinks with the belief.
#[derive(Clone, Copy, Debug)]
struct ShrinkingRing;

impl FormationPlanner for ShrinkingRing {
    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let target = belief.position();
        if !target.mean.iter().all(|c| c.is_finite()) {
            let [east, north] = [target.mean.x, target.mean.y];
            return Err(PlanError::NotFinite { east, north });
        }
        // The samples, not only the moments: the farthest place that the belief holds.
        let mut reach: f64 = 0.0;
        belief.visit_positions(&mut |place, weight| {
            if weight > 1e-3 {
                reach = reach.max((place - target.mean).norm());
            }
        });
        for (angle, station) in [0.0_f64, 2.1, 4.2].into_iter().zip(stations) {
            let offset = Vector2::new(angle.cos(), angle.sin()) * reach.max(5.0);
            station.goal = Waypoint { position: (target.mean + offset).push(4.0) };
        }
        Ok(if reach < 3.0 {
            Decision::Finish(Outcome::Converged)
        } else {
            Decision::Listen(Stage::Searching)
        })
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        to.write_str("a ring as wide as the belief")
    }
}

#[test]
fn a_planner_of_ones_own_keeps_the_laws() {
    let belief = Estimate::isotropic(Vector2::new(3.0, -2.0), 8.0);
    let mut stations =
        [(0.0, 0.0), (5.0, 0.0), (0.0, 5.0)].map(|(e, n)| Station::holding(Pose::at(e, n, 4.0)));
    laws::formation_planner(|| ShrinkingRing, &belief, &mut stations);
}

#[test]
fn a_source_of_ones_own_keeps_the_laws() {
    let time: Time = Rc::new(Cell::new(0.0));
    let vehicle = Teleport::at(0.0, 0.0);
    let mut source = Cardioid::new(&time, &vehicle, &[Vector2::new(20.0, 5.0)], Health::Good);
    let tick = time.clone();
    laws::pattern_source(&mut source, &[BeaconId(0)], 20, move || tick.set(tick.get() + 0.1));
}

/// Every part is the user's own, and every part is boxed.
#[test]
fn everything_of_ones_own_and_boxed() {
    let target = Vector2::new(12.0, -7.0);
    let time: Time = Rc::new(Cell::new(0.0));
    let mut drones = [(0.0, 0.0), (5.0, 0.0), (0.0, 5.0)].map(|(e, n)| {
        let vehicle = Teleport::at(e, n);
        Drone::boxed(Cardioid::new(&time, &vehicle, &[target], Health::Good), vehicle)
    });
    let planners: [Box<dyn FormationPlanner>; 2] = [
        Box::new(ShrinkingRing),
        Box::new(FollowEstimate::new(FollowConfig::pritzl2018()).expect("the preset is in range")),
    ];
    for planner in planners {
        let extractor: Box<dyn BearingExtractor> = Box::new(Pritzl2018::default());
        let parts = Parts::new(extractor, planner, |search: &Search<'_>| {
            let lattice: Box<dyn Estimator<2, 2>> = Box::new(Lattice::new(model(), &search.prior));
            Ok(Track::new::<2, 2>(lattice, TrackConfig::default()))
        });
        let mut hunt =
            Hunt::new(parts, vec!["mine".to_owned()], HuntConfig::default()).expect("one beacon");
        let station = |drone: &mut BoxedDrone| {
            Station::holding(drone.vehicle.pose().expect("it is not broken"))
        };
        let stations = drones.iter_mut().map(station).collect();
        hunt.start(time.get(), stations).expect("three drones");
        while !hunt.is_finished() {
            drive(&mut hunt, &mut drones, time.get()).expect("a calm sky");
            time.set(time.get() + 0.25);
            assert!(time.get() < 10_000.0, "the hunt does not end");
        }
        let fix = &hunt.fixes()[0];
        assert_eq!(fix.outcome, Outcome::Converged);
        // Whole-dB rounding and 64 positions: the readings themselves are good to a few degrees.
        let miss = (fix.estimate.mean - target).norm();
        assert!(miss < 1.5, "missed by {miss} m");
    }
}
