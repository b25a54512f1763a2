//! Estimators of differences, recursive and batch, over drawn problems.

use foxhunt_core::{
    Estimate, Measured, MeasuredList, MeasurementModel, Observation, Pose, Quantity, Reception,
    nalgebra::{SMatrix, SVector},
};
use foxhunt_filters::BatchSolver;
use foxhunt_hunt::{
    locate::{LocateConfig, Located, Power},
    registry::Registry,
};
use foxhunt_sensors::{BearingOnly, DifferentialRss, RangeDifference, Stacked};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

const RANGE_SIGMA_M: f64 = 3.0;
const LEVEL_SIGMA_DB: f64 = 4.0;
const BEARING_SIGMA: f64 = 0.1;
const EXPONENT: f64 = 2.3;
const MARGIN_M: f64 = 200.0;

/// Receivers, and where transmitters are drawn.
struct Geometry {
    receivers: Vec<Vector3<f64>>,
    reference: Vector3<f64>,
    /// Distances of the transmitter from the reference, in metres.
    off_m: [f64; 2],
}

/// Eight receivers on a ring about a reference receiver at its centre.
fn ring() -> Geometry {
    let place = |i: i32| {
        let angle = std::f64::consts::FRAC_PI_4 * f64::from(i);
        Vector3::new(300.0 * angle.cos(), 300.0 * angle.sin(), 20.0)
    };
    let reference = Vector3::new(0.0, 0.0, 2.0);
    Geometry { receivers: (0..8).map(place).collect(), reference, off_m: [100.0, 300.0] }
}

/// Three receivers on one side of a reference that is not at the origin: two places often fit.
fn three() -> Geometry {
    let at = |x: f64, y: f64| Vector3::new(x, y, 30.0);
    let receivers = vec![at(-240.0, 130.0), at(60.0, 330.0), at(330.0, 60.0)];
    Geometry { receivers, reference: Vector3::new(80.0, 40.0, 2.0), off_m: [50.0, 300.0] }
}

/// An estimator's name and the quantities that it takes.
#[derive(Clone, Copy)]
struct Kind {
    name: &'static str,
    ranges: bool,
    bearings: bool,
}

const KINDS: [Kind; 4] = [
    Kind { name: "range-difference", ranges: true, bearings: false },
    Kind { name: "level-difference", ranges: false, bearings: false },
    Kind { name: "range-difference-bearing", ranges: true, bearings: true },
    Kind { name: "level-difference-bearing", ranges: false, bearings: true },
];

/// Error of an estimator over drawn problems.
#[derive(Debug, Default)]
struct Score {
    /// Distances from the truth, in metres.
    errors: Vec<f64>,
    batch_errors: Vec<f64>,
    nees: Vec<f64>,
    /// Number of ellipses that hold the truth.
    held: u32,
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.iter().map(|_| 1.0).sum::<f64>()
}

fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn normal(rng: &mut Xoshiro256PlusPlus) -> f64 {
    rng.sample(StandardNormal)
}

impl Geometry {
    /// A transmitter, evenly drawn over directions and distances.
    fn transmitter(&self, rng: &mut Xoshiro256PlusPlus) -> Vector2<f64> {
        let angle = std::f64::consts::TAU * rng.random::<f64>();
        let off = self.off_m[0] + (self.off_m[1] - self.off_m[0]) * rng.random::<f64>();
        self.reference.xy() + Vector2::new(angle.cos(), angle.sin()) * off
    }

    /// Measurements of a transmitter by each receiver.
    fn receptions(
        &self,
        kind: Kind,
        truth: &Vector2<f64>,
        rng: &mut Xoshiro256PlusPlus,
    ) -> Vec<Reception> {
        let range = |from: &Vector3<f64>| (truth.push(0.0) - from).norm();
        let own = range(&self.reference);
        let mut receptions = Vec::new();
        for (number, receiver) in (0..).zip(&self.receivers) {
            let mut reception = Reception {
                time: f64::from(number),
                receiver: Pose::at(receiver.x, receiver.y, receiver.z),
                ..Reception::default()
            };
            let far = range(receiver);
            let (quantity, value, sigma) = if kind.ranges {
                (Quantity::RANGE_DIFFERENCE, far - own, RANGE_SIGMA_M)
            } else {
                let level = -10.0 * EXPONENT * (far / own).log10();
                (Quantity::RSS_DIFFERENCE, level, LEVEL_SIGMA_DB)
            };
            let value = value + sigma * normal(rng);
            let measured = Measured::new(quantity, value, sigma).expect("finite");
            reception.measured = MeasuredList::new(&[measured]).expect("one fits");
            if kind.bearings {
                let way = truth - receiver.xy();
                let angle = way.y.atan2(way.x) + BEARING_SIGMA * normal(rng);
                let bearing =
                    foxhunt_core::Bearing { angle, sigma: BEARING_SIGMA, confidence: 1.0 };
                reception.bearing = Some(bearing);
            }
            receptions.push(reception);
        }
        receptions
    }

    fn locate(&self, kind: Kind, receptions: &[Reception]) -> Located {
        let registry = Registry::builtin();
        let config = LocateConfig {
            reference_m: Some(self.reference),
            power: Power::FreeReference { exponent: EXPONENT },
            margin_m: MARGIN_M,
            ..LocateConfig::default()
        };
        let entry = registry.estimator(kind.name).expect("it has a name");
        entry.locate(&receptions.into(), &config).expect("it is located")
    }

    /// The moments of the square that `locate` searches.
    fn prior(&self) -> Estimate<2> {
        let mut low = Vector2::repeat(f64::MAX);
        let mut high = Vector2::repeat(f64::MIN);
        for receiver in &self.receivers {
            (low, high) = (low.inf(&receiver.xy()), high.sup(&receiver.xy()));
        }
        let half = (high - low).max() / 2.0 + MARGIN_M;
        Estimate::isotropic((low + high) / 2.0, half / 3.0_f64.sqrt())
    }

    /// The most probable place, from starts all over.
    fn batch(&self, kind: Kind, receptions: &[Reception]) -> Vector2<f64> {
        let range = RangeDifference::new(self.reference).expect("finite");
        let level = DifferentialRss::new(self.reference, EXPONENT).expect("finite");
        let bearing = BearingOnly::new();
        match (kind.ranges, kind.bearings) {
            (true, false) => self.solve::<_, 1>(range, receptions),
            (false, false) => self.solve::<_, 1>(level, receptions),
            (true, true) => {
                self.solve::<_, 2>(Stacked::<_, _, 1, 1>::new(range, bearing), receptions)
            }
            (false, true) => {
                self.solve::<_, 2>(Stacked::<_, _, 1, 1>::new(level, bearing), receptions)
            }
        }
    }

    fn solve<H, const M: usize>(&self, model: H, receptions: &[Reception]) -> Vector2<f64>
    where
        H: MeasurementModel<2, M> + Clone,
    {
        let prior = self.prior();
        let half = prior.covariance[(0, 0)].sqrt() * 1.5;
        let along = |i: i32| half * f64::from(i) / 3.0;
        let starts: Vec<_> = (-3..=3)
            .flat_map(|i| (-3..=3).map(move |j| Vector2::new(along(i), along(j))))
            .map(|away| prior.mean + away)
            .collect();
        let observation = |r: &Reception| {
            let measured = r.measured.iter().next().expect("a difference");
            let values =
                [Some((measured.value, measured.sigma)), r.bearing.map(|b| (b.angle, b.sigma))];
            let of = |i: usize| values[i].expect("as the model has it");
            let value = SVector::<f64, M>::from_fn(|i, _| of(i).0);
            let variances = SVector::<f64, M>::from_fn(|i, _| of(i).1.powi(2));
            let noise = SMatrix::<f64, M, M>::from_diagonal(&variances);
            Observation::new(r.time, r.receiver, value, noise).expect("finite")
        };
        let observations: Vec<_> = receptions.iter().map(observation).collect();
        let solver = BatchSolver::new(model).with_prior(prior).expect("proper");
        solver.solve(&observations, &starts).expect("an optimum").estimate.mean
    }

    fn score(&self, kind: Kind, problems: u32, seed: u64) -> Score {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut score = Score::default();
        for _ in 0..problems {
            let truth = self.transmitter(&mut rng);
            let receptions = self.receptions(kind, &truth, &mut rng);
            let located = self.locate(kind, &receptions);
            let batch = self.batch(kind, &receptions);
            score.errors.push((located.estimate.mean - truth).norm());
            score.batch_errors.push((batch - truth).norm());
            score.nees.push(located.estimate.nees(&truth).expect("definite"));
            score.held += u32::from(located.ellipse_95_holds(&truth) == Some(true));
        }
        score
    }
}

impl Score {
    /// Asserts errors within 1.2 of the batch's, and the number of ellipses that hold.
    fn assert(&self, kind: Kind, held: std::ops::RangeInclusive<u32>) {
        let name = kind.name;
        let own = median(&self.errors);
        let batch = median(&self.batch_errors);
        assert!(own < 1.2 * batch, "{name}: {own} m, and a batch {batch} m");
        assert!(held.contains(&self.held), "{name}: {} hold", self.held);
    }
}

/// Seed 38, 25 problems of each estimator. Fewer than 20 of 25 consistent ellipses hold in one set
/// of 800.
#[test]
fn recursive_estimators_of_differences_reach_a_batch() {
    for kind in KINDS {
        ring().score(kind, 25, 38).assert(kind, 20..=25);
    }
}

/// Seed 38, 300 problems of each estimator, about a ring and from three receivers on one side. In
/// 19 sets of 20, 93 % or more of 300 consistent ellipses hold.
#[test]
#[ignore = "takes minutes"]
fn recursive_estimators_of_differences_reach_a_batch_over_many_problems() {
    for kind in KINDS {
        for geometry in [ring(), three()] {
            let score = geometry.score(kind, 300, 38);
            let [own, batch] = [&score.errors, &score.batch_errors].map(|errors| median(errors));
            let nees = mean(&score.nees);
            println!(
                "{}: {own:.2} m, batch {batch:.2} m, NEES {nees:.2}, {} hold",
                kind.name, score.held
            );
            score.assert(kind, 279..=300);
        }
    }
}

/// Receivers on a line with the reference measure alike what is on either side of it. Both places
/// are listed; the batch refuses such receivers.
#[test]
fn both_places_of_a_straight_line_are_listed() {
    let at = |east: f64| Vector3::new(east, 0.0, 10.0);
    let receivers = [-200.0, -80.0, 90.0, 210.0].map(at).to_vec();
    let line = Geometry { receivers, reference: Vector3::new(0.0, 0.0, 2.0), off_m: [0.0, 0.0] };
    let truth = Vector2::new(40.0, 150.0);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
    let kind = KINDS[0];
    let located = line.locate(kind, &line.receptions(kind, &truth, &mut rng));
    let [rival] = &located.rivals[..] else { panic!("{located:?}") };
    let place = located.estimate.mean;
    let mirrored = Vector2::new(place.x, -place.y);
    assert!((rival.place - mirrored).norm() < 5.0, "{located:?}");
    assert!(rival.relative_density > 0.5, "{located:?}");
    let error = (place - truth).norm().min((mirrored - truth).norm());
    assert!(error < 25.0, "{located:?}");
}
