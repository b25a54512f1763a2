//! Smoothers: their laws, the exact posterior, and their consistency over 500 runs.

use foxhunt_core::{
    ConstantVelocity, Correction, Estimate, Estimator, EstimatorError, MeasurementModel,
    MotionModel, Observation, Pose, Quantity, RandomWalk, Smooth, State, laws,
    nalgebra::{Matrix2, Vector2, Vector4},
};
use foxhunt_filters::{
    BatchEstimator, Ckf, Ekf, FirstBearing, GaussianSum, GridConfig, GridFilter, Handover, Imm,
    Leading, OutOfOrder, ParticleFilter, RaoBlackwellised, Remembering, Transition, Ukf,
    consistency::Monitored, fixed_interval, rauch_tung_striebel, split,
};
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{
    edges::rng,
    model::{FIELD, observed},
};

const WALK: RandomWalk<2> = RandomWalk { drift: Vector2::new(0.5, 0.5) };

const STRAIGHT: ConstantVelocity = ConstantVelocity { spectral_density: 0.09 };

/// The place itself.
#[derive(Clone, Copy, Debug)]
struct First;

impl<const N: usize> MeasurementModel<N, 2> for First {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::linear("east_m"), Quantity::linear("north_m")]
    }

    fn expected(&self, state: &State<N>, _: &Pose) -> Vector2<f64> {
        state.fixed_rows::<2>(0).into_owned()
    }
}

fn seen(place: Vector2<f64>) -> Observation<2> {
    Observation::new(0.0, Pose::default(), place, Matrix2::identity()).expect("proper")
}

fn place() -> Estimate<2> {
    Estimate::isotropic(Vector2::new(1.0, -2.0), 4.0)
}

fn moving() -> Estimate<4> {
    let mut prior = Estimate::isotropic(Vector4::new(1.0, -2.0, 0.0, 0.0), 1.0);
    (0..2).for_each(|i| prior.covariance[(i, i)] = 16.0);
    prior
}

fn cloud<F: MotionModel<N>, const N: usize>(
    motion: F,
    prior: Estimate<N>,
    count: usize,
    seed: u64,
) -> ParticleFilter<F, First, Xoshiro256PlusPlus, N, 2> {
    ParticleFilter::new(motion, First, prior, count, rng(seed)).expect("a proper prior")
}

fn imm() -> Imm<Ckf<&'static dyn MotionModel<4>, First, 4, 2>, 4, 2> {
    static STILL: RandomWalk<4> = RandomWalk { drift: Vector4::new(0.3, 0.3, 0.02, 0.02) };
    let modes: [&'static dyn MotionModel<4>; 2] = [&STILL, &STRAIGHT];
    let filter = |motion| Ckf::new(motion, First, moving()).expect("a proper prior");
    let chain = Transition::sojourn(&[8.0, 8.0]).expect("positive");
    Imm::new(modes.map(|motion| (0.5, filter(motion))), chain).expect("proper")
}

fn grid() -> GridFilter<RandomWalk<2>, First, 2, 2> {
    let config = GridConfig { side: 32, most_per_side: 32, ..GridConfig::default() };
    GridFilter::new(WALK, First, place(), config).expect("proper")
}

#[test]
fn a_later_belief_without_news_changes_nothing() {
    let z = seen(Vector2::new(2.0, 0.5));
    laws::smoother(|| Ekf::new(STRAIGHT, First, moving()).expect("proper"), &z, 1.0, 1e-9);
    laws::smoother(|| Ukf::new(STRAIGHT, First, moving()).expect("proper"), &z, 1.0, 1e-9);
    let leading = || Leading::<_, 4>::new(Ckf::new(STRAIGHT, First, moving()).expect("proper"));
    laws::smoother::<_, 2, 2>(leading, &z, 1.0, 1e-9);
    let watched = || Monitored::new(Ekf::new(WALK, First, place()).expect("proper"), First);
    laws::smoother(watched, &z, 1.0, 1e-9);
    laws::smoother(imm, &z, 1.0, 1e-9);
    let ekf = Ekf::new(WALK, First, place()).expect("proper");
    let parts = split(&place(), [3, 2]).expect("proper");
    laws::smoother(|| GaussianSum::new(&ekf, parts.clone()).expect("proper"), &z, 1.0, 1e-9);
    // 500 draws: four standard errors.
    laws::smoother(|| cloud(STRAIGHT, moving(), 2000, 1), &z, 1.0, 0.26);
    // A cell is a third of a σ.
    laws::smoother(grid, &z, 1.0, 0.05);
    let by_bearing = Ekf::new(WALK, FIELD, place()).expect("proper");
    let first = || FirstBearing::new(by_bearing.clone(), 5).expect("proper");
    let turn = observed(Pose::at(30.0, 8.0, 5.0), Vector2::new(-70.0, -2.8), 3.0, 0.1);
    laws::smoother(first, &turn, 1.0, 1e-6);
    laws::smoother(first, &turn.without(1), 1.0, 1e-9);
}

#[test]
fn estimators_without_a_smoother_are_refused_by_name() {
    fn refusal<E: Smooth<N, M> + Clone, const N: usize, const M: usize>(mut one: E) -> String {
        let later = one.clone();
        let before = one.estimate();
        let refused = one.smooth(&later, 1.0).expect_err("no smoother").to_string();
        assert_eq!(one.estimate(), before);
        refused
    }
    let ekf = Ekf::new(WALK, First, place()).expect("proper");
    let late = OutOfOrder::new(ekf, 0.0, 5.0).expect("proper");
    assert_eq!(refusal(late), "smoothing with a lag for late observations is not supported");
    let batch = BatchEstimator::new(WALK, FIELD, place()).expect("proper");
    assert_eq!(refusal(batch), "smoothing a batch is not supported");
    let walk = RandomWalk { drift: State::<3>::new(0.2, 0.2, 0.0) };
    let prior = Estimate::isotropic(State::<3>::zeros(), 1.0);
    let marginal = RaoBlackwellised::<_, _, _, 3, 2, 1>::new(walk, First, prior, 50, rng(1));
    assert!(refusal(marginal.expect("proper")).starts_with("smoothing a Rao-Blackwellised cloud"));
    let config = GridConfig { side: 32, ..GridConfig::default() };
    let power = GridFilter::new(walk, First, prior, config).expect("proper");
    assert!(refusal(power).starts_with("smoothing cells whose state holds more than a place"));
    let frozen = cloud(RandomWalk::<2>::uniform(0.0), place(), 50, 1).with_kernel_bandwidth(0.0);
    let frozen = refusal(frozen.expect("in range"));
    assert!(frozen.starts_with("smoothing a plain cloud whose motion has no noise"));
}

/// A Kalman filter, a mixture of one part or mode, cells and a cloud have one smoothed belief.
#[test]
fn every_family_has_the_exact_posterior_of_a_linear_problem() {
    let mut generator = rng(3);
    let mut at = place().mean;
    let mut draw = || {
        at += white::<2>(&mut generator) * 0.5;
        at + white::<2>(&mut generator)
    };
    let truth: Vec<_> = (0..6).map(|_| draw()).collect();
    fn run<E: Smooth<2, 2> + Clone>(estimator: E, seen_at: &[Vector2<f64>]) -> Vec<Estimate<2>> {
        let mut kept = Remembering::new(estimator);
        for place in seen_at {
            kept.predict(1.0).expect("a proper step");
            let _ = kept.update(&seen(*place)).expect("proper");
        }
        let smoothed = kept.smoothed::<2, 2>().expect("a smoother");
        smoothed.iter().map(|(_, copy)| copy.estimate()).collect()
    }
    let ekf = Ekf::new(WALK, First, place()).expect("proper");
    let exact = run(ekf.clone(), &truth);

    // By hand: the filter's beliefs through the function over moments.
    let mut filter = ekf.clone();
    let mut filtered = Vec::new();
    for (second, z) in truth.iter().enumerate() {
        filter.predict(1.0).expect("a proper step");
        let _ = filter.update(&seen(*z)).expect("proper");
        filtered.push((f64::from(u8::try_from(second).expect("few")), filter.estimate()));
    }
    let by_hand = rauch_tung_striebel(&WALK, &filtered).expect("times ascend");
    for (one, (_, other)) in exact.iter().zip(&by_hand) {
        assert!((one.mean - other.mean).norm() < 1e-12);
        assert!((one.covariance - other.covariance).norm() < 1e-12);
    }

    let alike = |family: &str, others: &[Estimate<2>], tolerance: f64| {
        for (one, other) in exact.iter().zip(others) {
            let sigma = one.covariance[(0, 0)].sqrt();
            let mean = (one.mean - other.mean).norm() / sigma;
            let covariance = (one.covariance - other.covariance).norm() / (sigma * sigma);
            assert!(
                mean < tolerance && covariance < 2.0 * tolerance,
                "{family}: {mean} {covariance}"
            );
        }
    };
    let chain = Transition::sojourn(&[5.0, 5.0]).expect("positive");
    let modes = [(0.4, ekf.clone()), (0.6, ekf.clone())];
    alike("imm", &run(Imm::new(modes, chain).expect("proper"), &truth), 1e-9);
    let sum = GaussianSum::new(&ekf, [(1.0, place())]).expect("proper");
    alike("sum", &run(sum, &truth), 1e-9);
    let halves = GaussianSum::new(&ekf, split(&place(), [2, 1]).expect("proper")).expect("proper");
    alike("halves", &run(halves, &truth), 0.05);
    alike("grid", &run(grid(), &truth), 0.05);
    alike("cloud", &run(cloud(WALK, place(), 4000, 5), &truth), 0.2);
    let second = |first| Ekf::new(WALK, First, first);
    alike("handover", &run(Handover::new(grid(), 3, second), &truth), 0.05);
}

fn white<const N: usize>(generator: &mut Xoshiro256PlusPlus) -> State<N> {
    State::from_fn(|_, _| generator.sample(StandardNormal))
}

/// Sums over 500 runs of ten seconds, of the filter and of the smoother in the middle of the run:
/// the NEES of the place and the squares of the errors. Run i is of seed i, the truth drawn from
/// the prior and by `walk`.
fn judged<E, const N: usize>(
    make: impl Fn(u64) -> E,
    prior: &Estimate<N>,
    mut walk: impl FnMut(&State<N>, &mut Xoshiro256PlusPlus) -> State<N>,
) -> [[f64; 2]; 2]
where
    E: Smooth<N, 2> + Clone,
{
    const SECONDS: usize = 10;
    let root = prior.covariance.cholesky().expect("proper").unpack();
    let mut sums = [[0.0; 2]; 2];
    for seed in 0..500 {
        let mut generator = rng(seed);
        let mut truth = prior.mean + root * white(&mut generator);
        let mut estimator = make(seed);
        let mut run = Vec::new();
        let mut middle = truth;
        for second in 0..SECONDS {
            truth = walk(&truth, &mut generator);
            if second == SECONDS / 2 {
                middle = truth;
            }
            estimator.predict(1.0).expect("a proper step");
            let z = truth.fixed_rows::<2>(0) + white::<2>(&mut generator);
            let correction = estimator.update(&seen(z)).expect("proper");
            assert!(matches!(correction, Correction::Fused { .. }));
            run.push((f64::from(u8::try_from(second).expect("few")), estimator.clone()));
        }
        let filtered = run[SECONDS / 2].1.estimate().position();
        fixed_interval(&mut run).expect("a smoother");
        let smoothed = run[SECONDS / 2].1.estimate().position();
        let place = middle.fixed_rows::<2>(0).into_owned();
        for (sums, estimate) in sums.iter_mut().zip([filtered, smoothed]) {
            sums[0] += estimate.nees(&place).expect("definite");
            sums[1] += (estimate.mean - place).norm_squared();
        }
    }
    sums
}

/// The smoother's NEES lies in the band of χ² with 1000 degrees of freedom, and its error is
/// below the filter's by at least `gain`. `room` is what the estimator's own draws add, as a share.
fn consistent([filtered, smoothed]: [[f64; 2]; 2], gain: f64, room: f64) {
    let chi = ChiSquared::new(1000.0).expect("positive");
    let band = [chi.inverse_cdf(0.005), chi.inverse_cdf(0.995) * (1.0 + room)];
    let rms = |sums: [f64; 2]| (sums[1] / 500.0).sqrt();
    let measured = format!(
        "ANEES filtered {:.3}, smoothed {:.3} (band {:.3} to {:.3}); rms {:.3} m, {:.3} m",
        filtered[0] / 500.0,
        smoothed[0] / 500.0,
        band[0] / 500.0,
        band[1] / 500.0,
        rms(filtered),
        rms(smoothed)
    );
    assert!((band[0]..band[1]).contains(&smoothed[0]), "{measured}");
    assert!(rms(smoothed) < (1.0 - gain) * rms(filtered), "{measured}");
}

fn straight(truth: &State<4>, generator: &mut Xoshiro256PlusPlus) -> State<4> {
    STRAIGHT.propagate(truth, 1.0) + STRAIGHT.noise_factor(truth, 1.0) * white(generator)
}

#[test]
fn smoothed_kalman_filters_are_consistent() {
    let make = |_| Ckf::new(STRAIGHT, First, moving()).expect("proper");
    consistent(judged(make, &moving(), straight), 0.2, 0.0);
}

#[test]
fn smoothed_clouds_are_consistent() {
    let walk =
        |truth: &State<2>, generator: &mut Xoshiro256PlusPlus| truth + white::<2>(generator) * 0.5;
    // Draws of 1000 particles: an error of 0.05 σ besides.
    let make = |seed| cloud(WALK, place(), 1000, seed);
    consistent(judged(make, &place(), walk), 0.1, 0.02);
}

#[test]
fn smoothed_cells_are_consistent() {
    let walk =
        |truth: &State<2>, generator: &mut Xoshiro256PlusPlus| truth + white::<2>(generator) * 0.5;
    consistent(judged(|_| grid(), &place(), walk), 0.1, 0.0);
}

#[test]
fn smoothed_sums_are_consistent() {
    let walk =
        |truth: &State<2>, generator: &mut Xoshiro256PlusPlus| truth + white::<2>(generator) * 0.5;
    let ekf = Ekf::new(WALK, First, place()).expect("proper");
    let parts = split(&place(), [3, 3]).expect("proper");
    let make = |_| GaussianSum::new(&ekf, parts.clone()).expect("proper");
    consistent(judged(make, &place(), walk), 0.1, 0.0);
}

/// The later belief lies 200 σ off: each part is all but impossible, and one of them is likeliest.
#[test]
fn a_sum_is_smoothed_by_a_later_one_far_off() {
    let sum = |place: Estimate<2>| {
        let ekf = Ekf::new(WALK, First, place).expect("proper");
        GaussianSum::new(&ekf, split(&place, [3, 3]).expect("proper")).expect("proper")
    };
    let mut earlier = sum(place());
    let far = Estimate::isotropic(Vector2::new(800.0, 0.0), 1.0);
    earlier.smooth(&sum(far), 1.0).expect("a sum of possible parts");
    let total: f64 = earlier.components().map(|(weight, _)| weight).sum();
    assert!((total - 1.0).abs() < 1e-12, "{total}");
    assert!(earlier.estimate().mean.x > 400.0, "{}", earlier.estimate().mean);
}

#[test]
fn smoothed_interacting_models_are_consistent() {
    // The two-state chain of a mean sojourn of 8 s: after a second it has changed with
    // (1 − e^(−1/4)) / 2.
    let changed = 0.5 * (1.0 - (-0.25_f64).exp());
    let mut moves = false;
    let walk = |truth: &State<4>, generator: &mut Xoshiro256PlusPlus| {
        if generator.random::<f64>() < changed {
            moves = !moves;
        }
        let still = Vector4::new(0.3, 0.3, 0.02, 0.02);
        match moves {
            true => straight(truth, generator),
            false => truth + white::<4>(generator).component_mul(&still),
        }
    };
    consistent(judged(|_| imm(), &moving(), walk), 0.1, 0.0);
}

#[test]
fn a_smoothed_run_whose_time_goes_back_is_refused() {
    let filter = Ekf::new(WALK, First, place()).expect("proper");
    let mut run = [(1.0, filter.clone()), (0.5, filter)];
    assert_eq!(fixed_interval(&mut run), Err(EstimatorError::TimeStep { dt: -0.5 }));
}
