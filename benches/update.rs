//! One predict and one update of each estimator on the reference's problem, beside what one
//! would use instead.

use std::hint::black_box;

use adskalman::{ObservationModel, StateAndCovariance};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use foxhunt_core::{
    Estimate, Estimator, MeasurementModel, Observation, Pose, Quantity, RandomWalk, State,
    angle::wrap,
    nalgebra::{Const, Matrix2, OMatrix, OVector, Vector2},
};
use foxhunt_filters::{Ekf, ParticleFilter, Ukf};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

mod beacon;

/// RSS and bearing (Pritzl 2018, eq. 3.7) with the field calibration.
#[derive(Clone, Copy)]
struct RssBearing;

impl MeasurementModel<2, 2> for RssBearing {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RSS, Quantity::BEARING]
    }
    fn expected(&self, beacon: &State<2>, receiver: &Pose) -> Vector2<f64> {
        let d = beacon - receiver.position.xy();
        let range = libm::hypot(d.norm(), receiver.position.z);
        Vector2::new(-29.06 - 27.65 * libm::log10(range), libm::atan2(d.y, d.x))
    }
    fn jacobian(&self, beacon: &State<2>, receiver: &Pose) -> Matrix2<f64> {
        let d = beacon - receiver.position.xy();
        let flat = d.norm_squared();
        let slope = -27.65 / core::f64::consts::LN_10 / (flat + receiver.position.z.powi(2));
        Matrix2::new(slope * d.x, slope * d.y, -d.y / flat, d.x / flat)
    }
    fn log_likelihoods(&self, columns: [&[f64]; 2], observation: &Observation<2>, out: &mut [f64]) {
        let (receiver, z, noise) =
            (observation.receiver(), observation.value(), observation.noise());
        let constant = observation.log_density(&Vector2::zeros());
        let [weight_rss, weight_bearing] = [0, 1].map(|i| -0.5 / noise[(i, i)]);
        for ((out, east), north) in out.iter_mut().zip(columns[0]).zip(columns[1]) {
            let expected = self.expected(&Vector2::new(*east, *north), receiver);
            let y = Vector2::new(z.x - expected.x, wrap(z.y - expected.y));
            *out = constant + weight_rss * y.x * y.x + weight_bearing * y.y * y.y;
        }
    }
}

/// Observation model of one step in adskalman: a linear Kalman filter, given the model's Jacobian
/// at the mean.
struct Linearised {
    h: Matrix2<f64>,
    h_transposed: Matrix2<f64>,
    r: Matrix2<f64>,
    expected: Vector2<f64>,
}

impl ObservationModel<f64, Const<2>, Const<2>> for Linearised {
    fn predict_observation(&self, _: &OVector<f64, Const<2>>) -> OVector<f64, Const<2>> {
        self.expected
    }
    fn H(&self) -> &OMatrix<f64, Const<2>, Const<2>> {
        &self.h
    }
    fn HT(&self) -> &OMatrix<f64, Const<2>, Const<2>> {
        &self.h_transposed
    }
    fn R(&self) -> &OMatrix<f64, Const<2>, Const<2>> {
        &self.r
    }
}

fn adskalman_step(prior: &Estimate<2>, observation: &Observation<2>) -> Estimate<2> {
    let drift = Matrix2::from_diagonal_element(0.1957 * 0.1957);
    let h = RssBearing.jacobian(&prior.mean, observation.receiver());
    let model = Linearised {
        h,
        h_transposed: h.transpose(),
        r: observation.noise(),
        expected: RssBearing.expected(&prior.mean, observation.receiver()),
    };
    let predicted = StateAndCovariance::new(prior.mean, prior.covariance + drift);
    let method = adskalman::CovarianceUpdateMethod::JosephForm;
    let posterior = model
        .update(&predicted, observation.value(), method)
        .expect("the innovation's covariance is positive definite");
    Estimate { mean: *posterior.state(), covariance: *posterior.covariance() }
}

fn updates(criterion: &mut Criterion) {
    let prior = Estimate::isotropic(Vector2::new(6.0, -3.0), 8.4);
    let noise = Matrix2::from_diagonal(&Vector2::new(62.4, 0.27));
    let observation =
        Observation::new(0.0, Pose::at(-9.0, 4.0, 4.0), Vector2::new(-62.0, -0.5), noise)
            .expect("finite, of positive variance");
    let still = RandomWalk::uniform(0.1957);

    let mut group = criterion.benchmark_group("predict and update, 2 states, RSS and bearing");
    macro_rules! step {
        ($name:literal, $filter:expr) => {
            let mut filter = $filter.expect("a proper prior");
            group.bench_function($name, |bencher| {
                bencher.iter(|| filter.predict(1.0).and_then(|()| filter.update(&observation)));
            });
        };
    }
    step!("EKF", Ekf::new(still, RssBearing, prior));
    step!("UKF", Ukf::new(still, RssBearing, prior));
    step!("UKF of the reference", Ukf::pritzl2018(RssBearing, prior));
    let rng = Xoshiro256PlusPlus::seed_from_u64(1);
    step!("2000 particles", ParticleFilter::new(still, RssBearing, prior, 2000, rng));
    // Linear in the number of particles.
    for particles in [100, 10_000, 1_000_000] {
        let rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let filter = ParticleFilter::new(still, RssBearing, prior, particles, rng);
        let mut filter = filter.expect("a proper prior");
        group.bench_function(format!("{particles} particles"), |bencher| {
            bencher.iter(|| filter.predict(1.0).and_then(|()| filter.update(&observation)));
        });
    }
    group.bench_function("adskalman 0.18, linearised, Joseph form", |bencher| {
        let mut belief = prior;
        bencher.iter(|| belief = adskalman_step(&belief, &observation));
    });
    group.finish();
}

/// A step by hand.
type ByHand = fn(&Estimate<2>, &Observation<2>) -> Option<Estimate<2>>;

/// 48 steps of a filter, owned and boxed, and of the same filter by hand over static matrices. Both
/// go on from one sweep to the next, as the ones do that count instructions (`examples/steps.rs`).
fn beacon_steps<E: Estimator<2, 2> + Clone + 'static>(
    criterion: &mut Criterion,
    name: &str,
    filter: &E,
    by_hand: ByHand,
) {
    let sweep = beacon::sweep();
    agree(filter.clone(), by_hand, &sweep);
    let mut group = criterion.benchmark_group(format!("48 steps, still beacon, {name}"));
    group.throughput(Throughput::Elements(48));
    let mut owned = filter.clone();
    group.bench_function("owned", |bencher| bencher.iter(|| run(&mut owned, &sweep)));
    let mut boxed: Box<dyn Estimator<2, 2>> = black_box(Box::new(filter.clone()));
    group.bench_function("boxed", |bencher| bencher.iter(|| run(&mut *boxed, &sweep)));
    group.bench_function("by hand", |bencher| {
        let mut belief = beacon::prior();
        bencher.iter(|| {
            for observation in &sweep {
                belief = by_hand(&belief, black_box(observation)).expect("positive definite");
            }
        });
    });
    group.finish();
}

fn run<E: Estimator<2, 2> + ?Sized>(filter: &mut E, sweep: &[Observation<2>]) {
    for observation in sweep {
        filter.predict(black_box(1.0)).expect("a proper step");
        let _ = black_box(filter.update(black_box(observation)).expect("possible"));
    }
}

/// Asserts that the compared filters agree.
fn agree(mut filter: impl Estimator<2, 2>, by_hand: ByHand, sweep: &[Observation<2>]) {
    let mut belief = beacon::prior();
    for (step, observation) in sweep.iter().enumerate() {
        belief = by_hand(&belief, observation).expect("positive definite");
        run(&mut filter, core::slice::from_ref(observation));
        let error = (filter.estimate().mean - belief.mean).amax();
        assert!(error < 1e-6, "step {step}: by hand {}, off by {error}", belief.mean);
    }
}

fn beacons(criterion: &mut Criterion) {
    beacon_steps(criterion, "UKF", &beacon::ukf(), beacon::hand_ukf);
    beacon_steps(criterion, "EKF", &beacon::ekf(), beacon::hand_ekf);
}

criterion_group!(benches, updates, beacons);
criterion_main!(benches);
