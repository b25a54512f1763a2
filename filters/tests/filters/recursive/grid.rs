//! The grid against exact posteriors, brute force and statistics.

use approx::assert_abs_diff_eq;
use foxhunt_core::{
    BearingMode, BearingModes, ConstantVelocity, Correction, Estimate, Estimator, EstimatorError,
    MeasurementModel, Observation, OutlierMixture, Pose, Quantity, RandomWalk, State, laws,
    nalgebra::{Matrix1, Matrix2, Matrix3, Vector1, Vector2, Vector3},
};
use foxhunt_filters::{
    Ekf, GridConfig, GridFilter, Handover, Kalman, NoiseScales, Taylor,
    consistency::ChiSquaredAverage,
};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;
use serde_json::Value;

use super::{
    laws::problem,
    model::{FIELD, RssBearing, cases, matrix, number, observations, observed, vector},
};

fn cells(side: usize) -> GridConfig {
    GridConfig { side, most_per_side: side.max(256), ..GridConfig::default() }
}

/// The largest errors of mean, covariance and log-evidence, as shares of what is allowed: twice
/// the vectors' own error, or 5·10⁻⁴ of a standard deviation (10⁻³ of a variance) where that is
/// more, as it is where beliefs read between cells were sharp at a receiver.
fn excess<F, H, const M: usize>(
    mut grid: GridFilter<F, H, 2, M>,
    observations: &[Observation<M>],
    case: &Value,
) -> [f64; 3]
where
    GridFilter<F, H, 2, M>: Estimator<2, M>,
{
    let allowed = |key, least: f64| (2.0 * number(&case["grid_error"][key])).max(least);
    let mut worst = [0.0_f64; 3];
    let mut log_evidence = 0.0;
    let exact = case["posterior"].as_array().expect("a list");
    for (observation, exact) in observations.iter().zip(exact) {
        grid.predict(1.0).expect("a proper step");
        let Ok(Correction::Fused { log_evidence: reported, .. }) = grid.update(observation) else {
            panic!("not fused");
        };
        log_evidence += reported;
        let estimate = grid.estimate();
        let variance = matrix(&exact["cov"]).trace() / 2.0;
        let errors = [
            (estimate.mean - vector(&exact["mean"])).amax()
                / allowed("mean", 5e-4 * variance.sqrt()),
            (estimate.covariance - matrix(&exact["cov"])).amax() / allowed("cov", 1e-3 * variance),
            (log_evidence - number(&exact["log_evidence"])).abs() / allowed("log_evidence", 1e-4),
        ];
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error);
        }
    }
    worst
}

#[test]
fn levels_and_bearings_come_out_as_exact_bayes() {
    let cases = cases("posterior_rss_aoa.json", "sequences");
    for case in cases {
        let prior = Estimate {
            mean: vector(&case["prior"]["mean"]),
            covariance: Matrix2::from_diagonal_element(number(&case["prior"]["var"])),
        };
        let walk = RandomWalk::uniform(case["process_noise_std_per_step"].as_f64().unwrap_or(0.0));
        let grid = GridFilter::new(walk, RssBearing::of(&case), prior, self::cells(512));
        let worst = excess(grid.expect("a proper prior"), &observations(&case), &case);
        assert!(worst.iter().all(|w| *w < 1.0), "{}: {worst:?} of the limit", case["name"]);
    }
}

/// Bearings of which a share points anywhere (Isaacs et al. 2014, eq. 30).
struct Mixed {
    bias: f64,
    outliers: OutlierMixture<1>,
}

impl MeasurementModel<2, 1> for Mixed {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::BEARING]
    }
    fn expected(&self, target: &State<2>, receiver: &Pose) -> Vector1<f64> {
        let d = target - receiver.position.xy();
        Vector1::new(d.y.atan2(d.x) + self.bias)
    }
    fn log_likelihood(&self, target: &State<2>, observation: &Observation<1>) -> f64 {
        let expected = self.expected(target, observation.receiver());
        let residual = self.residual(observation.value(), &expected);
        self.outliers.log_density(observation.log_density(&residual), observation)
    }
}

#[test]
fn bearings_with_outliers_in_a_room_come_out_as_exact_bayes() {
    let cases = cases("posterior_bearing_mixture.json", "sequences");
    for case in cases {
        let outliers = OutlierMixture::new(number(&case["p_o"]), [core::f64::consts::TAU]);
        let model =
            Mixed { bias: number(&case["mu"]), outliers: outliers.expect("a share and a turn") };
        let half = number(&case["prior"]["half"]);
        let variance = Matrix1::new(number(&case["sig"]).powi(2));
        let observed: Vec<Observation<1>> = case["bearing"]
            .as_array()
            .expect("a list")
            .iter()
            .enumerate()
            .map(|(i, bearing)| {
                let at = vector(&case["quad"][i]);
                let bearing = Vector1::new(number(bearing));
                Observation::new(0.0, Pose::at(at.x, at.y, 0.0), bearing, variance)
                    .expect("finite, of positive variance")
            })
            .collect();
        let area = Some([Vector2::repeat(-half), Vector2::repeat(half)]);
        let config = GridConfig { area, ..self::cells(1024) };
        let prior = Estimate::isotropic(Vector2::zeros(), half);
        let grid = GridFilter::new(RandomWalk::uniform(0.0), model, prior, config);
        let worst = excess(grid.expect("a proper area"), &observed, &case);
        assert!(worst.iter().all(|w| *w < 1.0), "{}: {worst:?} of the limit", case["name"]);
    }
}

/// A level whose reference power is the third component of the state.
#[derive(Clone, Copy, Debug)]
struct FreePower;

impl MeasurementModel<3, 2> for FreePower {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RSS, Quantity::BEARING]
    }
    fn expected(&self, state: &State<3>, receiver: &Pose) -> Vector2<f64> {
        let mut expected = FIELD.expected(&state.xy(), receiver);
        expected.x += state.z - FIELD.p0_dbm;
        expected
    }
}

/// The receivers of a square flown about the prior.
fn around() -> impl Iterator<Item = Pose> + Clone {
    [(12.0, 0.0), (0.0, 12.0), (-12.0, 0.0), (0.0, -12.0)]
        .into_iter()
        .map(|(east, north)| Pose::at(east, north, 4.0))
}

#[test]
fn an_unknown_power_is_integrated_out_exactly() {
    let sigma_power = 6.0;
    let mut prior = Estimate::isotropic(Vector3::new(3.0, -2.0, FIELD.p0_dbm), 5.0);
    prior.covariance[(2, 2)] = sigma_power * sigma_power;
    // East and power are not independent before anything was observed.
    prior.covariance[(0, 2)] = 12.0;
    prior.covariance[(2, 0)] = 12.0;
    let still = RandomWalk::<3>::uniform(0.0);
    let mut grid = GridFilter::new(still, FreePower, prior, self::cells(64)).expect("proper");
    let mut log_evidence = 0.0;
    let observed: Vec<_> = around()
        .zip([-61.0, -67.0, -64.0, -59.0])
        .zip([2.9, -1.4, 0.3, 1.2])
        .map(|((at, rss), bearing)| observed(at, Vector2::new(rss, bearing), 4.0, 0.3))
        .collect();
    for observation in &observed {
        let Ok(Correction::Fused { log_evidence: reported, nis: Some(nis), .. }) =
            grid.update(observation)
        else {
            panic!("not fused");
        };
        assert!(nis >= 0.0);
        log_evidence += reported;
    }
    // By brute force: the trapezoidal rule over all three.
    let root = prior.covariance.cholesky().expect("definite").unpack();
    let density = |x: &State<3>| {
        let white = root.solve_lower_triangular_unchecked(&(x - prior.mean));
        let log = -0.5 * white.norm_squared()
            - 1.5 * core::f64::consts::TAU.ln()
            - root.diagonal().map(f64::ln).sum();
        (log + observed.iter().map(|o| FreePower.log_likelihood(x, o)).sum::<f64>()).exp()
    };
    let step = Vector3::new(0.5, 0.5, 1.0);
    let mut total = 0.0;
    let mut mean = State::<3>::zeros();
    let mut square = Matrix3::zeros();
    for i in -60..=60 {
        for j in -60..=60 {
            for k in -36..=36 {
                let at = Vector3::new(f64::from(i), f64::from(j), f64::from(k));
                let x = prior.mean + at.component_mul(&step);
                let mass = density(&x) * step.product();
                total += mass;
                mean += (x - prior.mean) * mass;
                square += (x - prior.mean) * (x - prior.mean).transpose() * mass;
            }
        }
    }
    mean /= total;
    let covariance = square / total - mean * mean.transpose();
    let estimate = grid.estimate();
    assert_abs_diff_eq!(log_evidence, total.ln(), epsilon = 2e-3);
    let away = (estimate.mean - prior.mean - mean).amax();
    assert!(away < 5e-3, "the mean is off by {away}");
    let off = (estimate.covariance - covariance).amax();
    assert!(off < 2e-2 * covariance.amax(), "the covariance is off by {off}");
}

#[test]
fn a_power_that_is_all_but_known_changes_nothing() {
    // Receivers that know their place to some metres, and bearings that two directions compete for:
    // the one grid takes likelihoods, the other one completes squares in every cell. Not both at
    // once, as an uncertain place makes level and bearing one noise, which directions do not share.
    let place = Estimate::isotropic(Vector2::new(3.0, -2.0), 5.0);
    let mut prior = Estimate::isotropic(place.mean.push(FIELD.p0_dbm), 5.0);
    prior.covariance[(2, 2)] = 1e-8;
    let walk = RandomWalk { drift: Vector2::repeat(0.2) };
    let mut known = GridFilter::new(walk, FIELD, place, self::cells(64)).expect("proper");
    let walk = RandomWalk { drift: Vector3::new(0.2, 0.2, 0.0) };
    let mut free = GridFilter::new(walk, FreePower, prior, self::cells(64)).expect("proper");
    let mode = |weight, angle, sigma| BearingMode { weight, angle, sigma };
    for (at, bearing) in around().zip([2.9, -1.4, 0.3, 1.2]) {
        let plain = observed(at, Vector2::new(-62.0, bearing), 4.0, 0.3);
        let vague = plain.with_receiver_sigma(Vector3::new(2.0, 1.0, 3.0)).expect("proper");
        let modes = BearingModes::new(&[mode(0.7, bearing, 0.2), mode(0.3, bearing + 1.0, 0.4)]);
        let several =
            |observation: Observation<2>| observation.with_bearing_modes(1, modes.expect("proper"));
        for observation in [vague, several(plain), several(vague).without(0)] {
            known.predict(1.0).expect("a proper step");
            free.predict(1.0).expect("a proper step");
            let reported = (known.update(&observation), free.update(&observation));
            let (
                Ok(Correction::Fused { log_evidence: one, nis: Some(one_nis), .. }),
                Ok(Correction::Fused { log_evidence: other, nis: Some(other_nis), .. }),
            ) = reported
            else {
                panic!("not fused: {reported:?}");
            };
            // The power's own variance is 10⁻⁸ dB².
            assert!((one - other).abs() < 1e-6, "at {at:?}: evidence {one}, not {other}");
            assert_abs_diff_eq!(one_nis, other_nis, epsilon = 1e-6 * (1.0 + one_nis));
            let one = known.estimate();
            let other = free.estimate();
            assert!((one.mean - other.mean.xy()).norm() < 1e-6, "{} {}", one.mean, other.mean);
            let within: Matrix2<f64> = other.covariance.fixed_view::<2, 2>(0, 0).into_owned();
            assert!((one.covariance - within).norm() < 1e-5, "{}", one.covariance - within);
        }
    }
}

#[test]
fn a_doubted_noise_is_learnt() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
    let factors = vec![(0.5, 1.0), (1.0, 1.0), (2.0, 1.0)];
    let noise_scales = Some(NoiseScales { component: 0, factors });
    let config = GridConfig { noise_scales, ..GridConfig::default() };
    let prior = Estimate::isotropic(Vector2::new(3.0, -2.0), 5.0);
    let truth = Vector2::new(5.0, 1.0);
    let still = RandomWalk::uniform(0.0);
    let mut grid = GridFilter::new(still, FIELD, prior, config).expect("in range");
    assert!(grid.noise_scale_probabilities().iter().all(|p| (p - 1.0 / 3.0).abs() < 1e-12));
    for receiver in around().cycle().take(60) {
        // The observation's σ is 6 dB, the true one 3.
        let noise = Vector2::new(3.0 * rng.sample::<f64, _>(StandardNormal), 0.0);
        let z = FIELD.expected(&truth, &receiver) + noise;
        assert!(grid.update(&observed(receiver, z, 6.0, 0.3)).is_ok());
    }
    let probabilities = grid.noise_scale_probabilities();
    assert!(probabilities[0] > 0.99, "{probabilities:?}");
}

/// A wall hides targets East of it, behind which the level of an unknown power is 30 dB lower.
/// Seeds 1 to 60, so that the mean NEES is from 1.26 to 2.96 (99.9 %) where cells that disagree are
/// not read between; otherwise it is more than five times that.
#[test]
fn a_level_that_falls_off_a_cliff_stays_honest() {
    #[derive(Clone, Copy)]
    struct Walled;
    impl MeasurementModel<3, 2> for Walled {
        fn quantities(&self) -> [Quantity; 2] {
            [Quantity::RSS, Quantity::BEARING]
        }
        fn expected(&self, target: &State<3>, receiver: &Pose) -> Vector2<f64> {
            let way = target.fixed_rows::<2>(0) - receiver.position.xy();
            let hidden = if target[0] > 0.3 * target[1] + 4.0 { 30.0 } else { 0.0 };
            let level = target[2] - 27.0 * way.norm().max(0.1).log10() - hidden;
            Vector2::new(level, way.y.atan2(way.x))
        }
    }
    let prior = Estimate::isotropic(Vector2::zeros(), 15.0).with_rest::<3>(-30.0, 5.0);
    let anees = |cliffs: bool| {
        let mut nees = ChiSquaredAverage::new(0.999).expect("a probability");
        for seed in 1..=60 {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let mut normal = || rng.sample::<f64, _>(StandardNormal);
            let truth = Vector3::new(15.0 * normal(), 15.0 * normal(), -30.0 + 5.0 * normal());
            let config = GridConfig { cliffs, ..GridConfig::default() };
            let still = RandomWalk::uniform(0.0);
            let mut grid = GridFilter::new(still, Walled, prior, config).expect("proper");
            for (east, north) in [(-50.0, -20.0), (-40.0, 10.0), (-30.0, -40.0), (-60.0, 0.0)] {
                let receiver = Pose::at(east, north, 0.0);
                let noise = Vector2::new(3.0 * normal(), 0.15 * normal());
                let z = Walled.expected(&truth, &receiver) + noise;
                assert!(grid.update(&observed(receiver, z, 3.0, 0.15)).is_ok());
            }
            let place = grid.estimate().position();
            nees.add(place.nees(&truth.xy()).expect("definite"), 2);
        }
        (nees.average().expect("some"), nees.interval().expect("some"))
    };
    let (with, [low, high]) = anees(true);
    assert!((low..high).contains(&with), "ANEES {with}, not {low:.2} to {high:.2}");
    let (without, _) = anees(false);
    assert!(without > 5.0 * high, "ANEES {without}");
}

#[test]
fn cells_follow_a_belief_from_a_kilometre_to_a_metre() {
    let prior = Estimate::isotropic(Vector2::zeros(), 1000.0);
    let truth = Vector2::new(830.0, -640.0);
    let mut grid = GridFilter::new(RandomWalk::uniform(0.0), FIELD, prior, GridConfig::default())
        .expect("proper");
    let places = [(700.0, -600.0), (900.0, -700.0), (820.0, -500.0), (830.0, -660.0)];
    for (east, north) in places {
        let receiver = Pose::at(east, north, 30.0);
        let z = FIELD.expected(&truth, &receiver);
        // Half a degree: a first bearing far thinner than the first cells.
        assert!(grid.update(&observed(receiver, z, 3.0, 0.009)).is_ok());
    }
    let estimate = grid.estimate();
    let spread = estimate.covariance.trace().sqrt();
    assert!(spread < 2.0, "{spread}");
    assert!((estimate.mean - truth).norm() < 1.0, "{}", estimate.mean);
    let total: f64 = grid.cells().map(|(_, mass)| mass).sum();
    assert_abs_diff_eq!(total, 1.0, epsilon = 1e-9);
    let fewest = spread * spread / 2.0 / grid.cell_area();
    assert!(fewest > 1.0, "a standard deviation has {fewest} cells");
}

#[test]
fn a_motion_that_a_grid_has_no_cells_for_is_refused_when_it_is_made() {
    /// The place of a target with a velocity.
    #[derive(Clone, Copy)]
    struct Moving;
    impl MeasurementModel<4, 1> for Moving {
        fn quantities(&self) -> [Quantity; 1] {
            [Quantity::linear("east_m")]
        }
        fn expected(&self, target: &State<4>, _: &Pose) -> Vector1<f64> {
            Vector1::new(target[0])
        }
    }
    let prior = Estimate::isotropic(Vector2::zeros(), 10.0).with_rest::<4>(0.0, 2.0);
    let motion = ConstantVelocity { spectral_density: 0.01 };
    let refused = GridFilter::new(motion, Moving, prior, self::cells(32)).err();
    assert!(matches!(refused, Some(EstimatorError::Parameter(_))), "{refused:?}");
    let walk = RandomWalk::uniform(0.1);
    let mut grid = GridFilter::new(walk, Moving, prior, self::cells(32)).expect("a random walk");
    grid.predict(1.0).expect("as it was made");
}

#[test]
fn a_linear_problem_comes_out_as_the_kalman_filter() {
    /// Both coordinates, with noise that is not the same in each.
    #[derive(Clone, Copy)]
    struct Place;
    impl MeasurementModel<2, 2> for Place {
        fn quantities(&self) -> [Quantity; 2] {
            [Quantity::linear("east_m"), Quantity::linear("north_m")]
        }
        fn expected(&self, target: &State<2>, _: &Pose) -> Vector2<f64> {
            *target
        }
    }
    let prior = Estimate {
        mean: Vector2::new(10.0, -4.0),
        covariance: Matrix2::new(30.0, 12.0, 12.0, 20.0),
    };
    // A walk that is wider to the North, and at times much wider than the belief.
    let walk = RandomWalk { drift: Vector2::new(0.3, 1.5) };
    let mut grid = GridFilter::new(walk, Place, prior, GridConfig::default()).expect("proper");
    let mut exact: Kalman<Taylor, _, _, 2, 2> = Kalman::new(walk, Place, prior).expect("proper");
    for (step, dt) in [0.1, 1.0, 40.0, 2.0, 0.0, 900.0, 3.0].into_iter().enumerate() {
        let step = f64::from(u8::try_from(step).expect("a few"));
        let z = Vector2::new(8.0 + 3.0 * step, -6.0 * step);
        let observation = observed(Pose::default(), z, 2.0, 3.0);
        let log_evidence = |reported| match reported {
            Ok(Correction::Fused { log_evidence, .. }) => log_evidence,
            other => panic!("{other:?}"),
        };
        for filter in [&mut grid as &mut dyn Estimator<2, 2>, &mut exact] {
            filter.predict(dt).expect("a proper step");
        }
        let apart = grid.estimate().covariance - exact.estimate().covariance;
        assert!(apart.norm() < 2e-3 * exact.estimate().covariance.norm(), "after {dt} s: {apart}");
        let [reported, known] =
            [grid.update(&observation), exact.update(&observation)].map(log_evidence);
        assert_abs_diff_eq!(reported, known, epsilon = 1e-2);
        let grid = grid.estimate();
        let exact = exact.estimate();
        assert!((grid.mean - exact.mean).norm() < 2e-3 * exact.covariance.norm().sqrt());
        let apart = (grid.covariance - exact.covariance).norm();
        assert!(apart < 2e-3 * exact.covariance.norm(), "the covariance is off by {apart}");
    }
}

#[test]
fn a_bearing_across_the_cut_moves_to_the_published_place() {
    // Prior (−100, 0.5) m with σ 10 m, bearing −π + 0.02 rad with σ 0.05.
    let prior = Estimate::isotropic(Vector2::new(-100.0, 0.5), 10.0);
    let bearing = Vector2::new(0.0, -core::f64::consts::PI + 0.02);
    let still = RandomWalk::uniform(0.0);
    let mut grid = GridFilter::new(still, FIELD, prior, GridConfig::default()).expect("proper");
    assert!(grid.update(&observed(Pose::default(), bearing, 1.0, 0.05).without(0)).is_ok());
    assert!((grid.estimate().mean - Vector2::new(-100.8, -1.5)).norm() < 0.1);
}

#[test]
fn the_target_stays_within_its_area() {
    let area = Some([Vector2::new(-10.0, 0.0), Vector2::new(10.0, 5.0)]);
    let config = GridConfig { area, ..GridConfig::default() };
    let prior = Estimate::isotropic(Vector2::zeros(), 1.0);
    let walk = RandomWalk::uniform(1.0);
    let mut grid = GridFilter::new(walk, FIELD, prior, config.clone()).expect("proper");
    let uniform = grid.estimate();
    // Midpoints of 64 cells miss the 64²-th part of a uniform's variance.
    assert!((uniform.mean - Vector2::new(0.0, 2.5)).norm() < 1e-9);
    assert_abs_diff_eq!(uniform.covariance[(0, 0)], 400.0 / 12.0, epsilon = 400.0 / 12.0 / 4000.0);
    for _ in 0..20 {
        grid.predict(5.0).expect("a proper step");
        // From the South it is observed far in the North, outside.
        let south = Pose::at(0.0, -20.0, 0.0);
        let far = Vector2::new(-110.0, core::f64::consts::FRAC_PI_2);
        assert!(grid.update(&observed(south, far, 4.0, 0.1)).is_ok());
        assert!(grid.cells().all(|(place, mass)| mass < 1e-9 || place.y < 5.0));
    }
    assert!(grid.estimate().mean.y > 4.0);
    let flat = Some([Vector2::zeros(), Vector2::new(1.0, 0.0)]);
    let refused = GridConfig { area: flat, ..config };
    assert!(GridFilter::new(walk, FIELD, prior, refused).is_err());
}

#[test]
fn an_estimator_that_moves_what_stands_behind_is_refused() {
    #[derive(Clone)]
    struct Spiral;
    impl foxhunt_core::MotionModel<3> for Spiral {
        fn propagate(&self, state: &State<3>, dt: f64) -> State<3> {
            Vector3::new(state.x + state.z * dt, state.y, state.z)
        }
        fn noise_factor(&self, _: &State<3>, _: f64) -> Matrix3<f64> {
            Matrix3::zeros()
        }
    }
    let prior = Estimate::isotropic(Vector3::zeros(), 1.0);
    assert!(GridFilter::new(Spiral, FreePower, prior, GridConfig::default()).is_err());
}

/// The laws at one observation: these problems are as coarse as they come.
const AT_ONE: laws::Checks = laws::Checks::AT_ONE_OBSERVATION;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn the_grid_keeps_the_laws((prior, observed) in problem()) {
        let walk = RandomWalk::uniform(0.2);
        let make = || GridFilter::new(walk, FIELD, prior, self::cells(32)).expect("proper");
        laws::estimator_with(make, &observed, AT_ONE);
        let ekf = move |first| Ekf::new(walk, FIELD, first);
        laws::estimator_with(|| Handover::new(make(), 1, ekf), &observed, AT_ONE);
        let mut with_power = Estimate::isotropic(prior.mean.push(-30.0), 8.0);
        with_power.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&prior.covariance);
        let walk = RandomWalk::uniform(0.2);
        let make = || {
            let cells = self::cells(32);
            GridFilter::new(walk, FreePower, with_power, cells).expect("proper")
        };
        laws::estimator_with(make, &observed, AT_ONE);
    }
}
