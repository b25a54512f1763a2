//! The laws over every filter that settings choose, and which of them have a smoother.

use approx::assert_abs_diff_eq;
use foxhunt_core::{
    Bearing, Estimate, Level, MeasurementModel, Observation, Pose, Reception, Smooth,
    laws::{self, Checks, Predictive},
};
use foxhunt_estimators::{
    BoxedEstimator, EstimatorConfig, FilterConfig, GateConfig, MovingConfig, TrackConfig,
};
use foxhunt_sensors::{LogDistance, RssBearing};
use nalgebra::{Matrix2, Vector2};

fn model() -> RssBearing<LogDistance> {
    RssBearing::new(LogDistance::new(-29.06, 2.765).expect("in range"))
}

/// A place some 50 m from the receiver, known to 3 m: a mild problem.
fn prior() -> Estimate<2> {
    let covariance = Matrix2::new(9.0, 4.0, 4.0, 9.0);
    Estimate { mean: Vector2::new(-30.0, 4.0), covariance }
}

fn observed() -> Observation<2> {
    let receiver = Pose::at(20.0, 6.0, 10.0);
    let noise = Matrix2::from_diagonal(&Vector2::new(4.0, 0.0036));
    let value = model().expected(&prior().mean, &receiver) + Vector2::new(2.0, 0.05);
    Observation::new(0.0, receiver, value, noise).expect("proper")
}

fn of(filter: FilterConfig) -> EstimatorConfig {
    EstimatorConfig {
        filter,
        drift: 0.2,
        prior_sigma_m: None,
        power_sigma_db: None,
        exponent_sigma: None,
        moving: None,
        lag_s: None,
        start_on_grid: None,
        track: TrackConfig::default(),
    }
}

fn build(config: &EstimatorConfig) -> BoxedEstimator<2, 2> {
    config.build(model(), &prior(), 1).expect("in order")
}

const OPEN: GateConfig = GateConfig::Open;

const GRID: FilterConfig = FilterConfig::Grid { side: 48, level_noise_spread: None };

const SUM: FilterConfig = FilterConfig::GaussianSum { parts: 3, outliers: None, iterations: 1 };

const EKF: FilterConfig = FilterConfig::Ekf { gate: OPEN, iterations: 1 };

const IMM: FilterConfig =
    FilterConfig::Imm { sojourn_s: [30.0, 30.0], still_drift: 0.02, iterations: 1 };

fn cloud(count: usize) -> FilterConfig {
    FilterConfig::Particle { count, adaptive_bin: None, every_step: false }
}

fn moving(filter: FilterConfig) -> EstimatorConfig {
    let moving = MovingConfig { spectral_density: 0.01, speed_sigma: 0.5 };
    EstimatorConfig { drift: 0.0, moving: Some(moving), ..of(filter) }
}

/// Filters whose NIS is that of their predictive density, and the tolerance.
#[test]
fn every_filter_of_settings_keeps_the_laws() {
    let ukf = FilterConfig::Ukf { gate: OPEN, alpha: 1.0, beta: 2.0, kappa: 0.0, iterations: 1 };
    let cubature = FilterConfig::Cubature { gate: OPEN, outliers: None, iterations: 1 };
    let often = FilterConfig::Cubature { gate: OPEN, outliers: None, iterations: 10 };
    let power = |filter| EstimatorConfig { power_sigma_db: Some(2.0), ..of(filter) };
    let exponent = |filter| EstimatorConfig { exponent_sigma: Some(0.1), ..power(filter) };
    let every_step = FilterConfig::Particle { count: 2000, adaptive_bin: None, every_step: true };
    let adaptive =
        FilterConfig::Particle { count: 2000, adaptive_bin: Some(1.0), every_step: false };
    let doubtful = FilterConfig::Grid { side: 48, level_noise_spread: Some(0.5) };
    for (config, tolerance, nis) in [
        (of(EKF), 1e-6, true),
        (of(ukf), 1e-6, true),
        (of(cubature), 1e-6, true),
        (of(often), 0.05, true),
        (of(SUM), 0.01, true),
        (of(FilterConfig::DualEkf { iterations: 1 }), 0.01, true),
        (moving(IMM), 1e-3, true),
        (moving(EKF), 1e-6, true),
        (moving(cloud(2000)), 1e-3, true),
        (of(cloud(2000)), 1e-3, true),
        (of(every_step), 1e-3, true),
        (of(adaptive), 1e-3, true),
        (power(EKF), 1e-6, true),
        (exponent(EKF), 1e-6, true),
        (power(FilterConfig::RaoBlackwellised { count: 2000 }), 1e-3, true),
        (EstimatorConfig { start_on_grid: Some(1), ..of(EKF) }, 0.02, true),
        (of(GRID), 0.02, true),
        (power(GRID), 0.02, true),
        // The noise of the level is one of five: its NIS is by the noise that was given.
        (power(doubtful), 0.02, false),
    ] {
        let predictive = Predictive { tolerance, nis, ..Predictive::default() };
        let checks = Checks {
            // A grid rebuilds its cells for the one and not for the other.
            worthless_tolerance: None,
            predictive: Some(predictive),
            ..Checks::default()
        };
        laws::estimator_with(|| build(&config), &observed(), checks);
    }
}

#[test]
fn filters_of_settings_have_smoothers_or_say_so() {
    let power = |filter| EstimatorConfig { power_sigma_db: Some(2.0), ..of(filter) };
    for (config, tolerance) in [
        (of(EKF), 1e-9),
        (power(EKF), 1e-9),
        (moving(EKF), 1e-9),
        (of(SUM), 0.01),
        (moving(IMM), 1e-9),
        (moving(cloud(2000)), 0.26),
        (of(cloud(2000)), 0.26),
        (of(GRID), 0.05),
        (EstimatorConfig { start_on_grid: Some(1), ..moving(EKF) }, 1e-9),
    ] {
        laws::smoother(|| build(&config), &observed(), 2.0, tolerance);
    }
    for (config, refusal) in [
        (power(GRID), "smoothing cells whose state holds more than a place is not supported"),
        (
            power(FilterConfig::RaoBlackwellised { count: 50 }),
            "smoothing a Rao-Blackwellised cloud is not supported",
        ),
        (
            EstimatorConfig { lag_s: Some(5.0), ..of(EKF) },
            "smoothing with a lag for late observations is not supported",
        ),
        (
            EstimatorConfig {
                drift: 0.0,
                ..of(FilterConfig::Particle { count: 50, adaptive_bin: None, every_step: true })
            },
            "smoothing a plain cloud whose motion has no noise in some component of the state is \
             not supported",
        ),
    ] {
        let mut one = build(&config);
        let later = one.clone();
        let refused = one.smooth(&later, 1.0).expect_err("no smoother");
        assert_eq!(refused.to_string(), refusal);
    }
    // Two kinds do not go together.
    let refused = build(&of(EKF)).smooth(&build(&of(cloud(50))), 1.0).expect_err("two kinds");
    assert!(refused.to_string().starts_with("smoothing by an estimator of another kind"));
}

/// A track goes back over its receptions; two of one time have one belief.
#[test]
fn a_track_is_smoothed() {
    let mut track = moving(EKF).smoothable_track(model(), &prior(), 1).expect("in order");
    let mut filtered = Vec::new();
    for second in [0.0, 1.0, 1.0, 2.0, 4.0, 5.0] {
        let place = Vector2::new(-30.0 + 0.4 * second, 4.0);
        let receiver = Pose::at(20.0, 6.0 - 8.0 * second, 10.0);
        let expected = MeasurementModel::<2, 2>::expected(&model(), &place, &receiver);
        let reception = Reception {
            time: second,
            receiver,
            level: Some(Level { rss_dbm: expected[0], sigma_db: 2.0 }),
            bearing: Some(Bearing { angle: expected[1], sigma: 0.06, confidence: 1.0 }),
            ..Reception::default()
        };
        let _ = track.update(&reception, false).expect("in order");
        filtered.push((second, track.position()));
    }
    let smoothed = track.smoothed().expect("a smoother");
    assert_eq!(smoothed.len(), filtered.len());
    assert_eq!(smoothed.last(), filtered.last());
    assert_eq!(smoothed[1], smoothed[2]);
    for ((time, before), (at, after)) in filtered.iter().zip(&smoothed).take(5) {
        assert_abs_diff_eq!(time, at, epsilon = 1e-12);
        assert!(after.covariance.trace() < before.covariance.trace(), "{time} s");
    }
    let plain = moving(EKF).track(model(), &prior(), 1, true).expect("in order");
    let refused = plain.smoothed().expect_err("no earlier beliefs").to_string();
    assert!(refused.starts_with("smoothing an estimator that keeps no earlier beliefs"));
}
