//! The laws over every filter that settings choose, and which of them have a smoother.

use approx::assert_abs_diff_eq;
use foxhunt_core::{
    Bearing, BearingMode, BearingModes, Estimate, Level, MeasurementModel, Observation, Pose,
    Reception, Smooth,
    laws::{self, Checks, Predictive},
};
use foxhunt_estimators::{
    BoxedEstimator, Components, EstimatorConfig, FilterConfig, GateConfig, LearnedReceiver,
    MovingConfig, ParticleConfig, ReceiversConfig, SeveralConfig, TimeStep, TrackConfig, TrackStep,
    WithoutBearing,
};
use foxhunt_sensors::{LogDistance, RssBearing};
use nalgebra::{Matrix2, Vector2, Vector3};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

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
        receivers: None,
        several: None,
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
    FilterConfig::Particle(ParticleConfig::of(count))
}

/// Receivers of different makes.
fn team() -> EstimatorConfig {
    let receivers = ReceiversConfig { level_sigma_db: 4.0, bearing_sigma_deg: 10.0 };
    EstimatorConfig { power_sigma_db: Some(5.0), receivers: Some(receivers), ..of(GRID) }
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
    let every_step =
        FilterConfig::Particle(ParticleConfig { every_step: true, ..ParticleConfig::of(2000) });
    let adaptive = FilterConfig::Particle(ParticleConfig {
        adaptive_bin: Some(1.0),
        ..ParticleConfig::of(2000)
    });
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
        (team(), "smoothing a place with offsets of receivers is not supported"),
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
                ..of(FilterConfig::Particle(ParticleConfig {
                    every_step: true,
                    ..ParticleConfig::of(50)
                }))
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

/// A prediction that is refused leaves the time as it was, too: the next reception is taken as if
/// there had been no other.
#[test]
fn a_refused_prediction_takes_no_time() {
    let elapsed = TrackConfig {
        time_step: TimeStep::Elapsed,
        without_bearing: WithoutBearing::UseLevel,
        ..TrackConfig::default()
    };
    let track = || {
        let config = EstimatorConfig { track: elapsed, ..moving(EKF) };
        config.track(model(), &prior(), 1, true).expect("in order")
    };
    let at = |time| {
        let receiver = Pose::at(20.0, 6.0, 10.0);
        let level = Some(Level { rss_dbm: -75.0, sigma_db: 2.0 });
        Reception { time, receiver, level, ..Reception::default() }
    };
    let mut refused = track();
    let mut plain = track();
    let _ = refused.update(&at(0.0), false).expect("in order");
    let _ = plain.update(&at(0.0), false).expect("in order");
    let nothing = Reception { level: None, ..at(f64::INFINITY) };
    assert!(refused.update(&nothing, false).is_err());
    let _ = refused.update(&at(3.0), false).expect("in order");
    let _ = plain.update(&at(3.0), false).expect("in order");
    assert_eq!(refused.position(), plain.position());
}

#[test]
fn a_team_keeps_the_laws() {
    let checks = Checks { worthless_tolerance: None, predictive: None, ..Checks::default() };
    laws::estimator_with(|| build(&team()), &observed(), checks);
}

/// Two minutes: each of some thousand observations is a grid of 19 components.
#[test]
#[ignore = "two minutes"]
fn a_team_keeps_the_laws_of_its_predictive_density() {
    let predictive = Some(Predictive { tolerance: 0.02, ..Predictive::default() });
    let checks = Checks { worthless_tolerance: None, predictive, ..Checks::default() };
    laws::estimator_with(|| build(&team()), &observed(), checks);
}

/// Settings that a team does not use are refused by name.
#[test]
fn a_team_uses_what_it_is_given() {
    let known = EstimatorConfig { power_sigma_db: None, ..team() };
    let cloud = EstimatorConfig { filter: cloud(100), ..team() };
    let late = EstimatorConfig { lag_s: Some(5.0), ..team() };
    let started = EstimatorConfig { start_on_grid: Some(2), ..team() };
    for (config, named) in [
        (known, "a known power"),
        (cloud, "another filter"),
        (late, "lag_s"),
        (started, "start_on_grid"),
    ] {
        let refused = config.build(model(), &prior(), 1).err().expect("not used").to_string();
        assert!(refused.contains(named), "{refused}");
    }
}

/// Transmitters on one frequency.
fn several() -> EstimatorConfig {
    let several = SeveralConfig { detection: 0.5, wrong: 0.05, births: 0.4, most_birth: 0.2 };
    EstimatorConfig {
        drift: 0.0,
        power_sigma_db: Some(5.0),
        several: Some(several),
        ..of(FilterConfig::RangeParameterised { parts: 8, iterations: 10 })
    }
}

/// Two transmitters 80 m apart, seen in turn by a receiver on a circle about them: both are found,
/// each within five σ, and nothing else; the place that is sought is that of one of them.
#[test]
fn two_transmitters_on_one_frequency_are_found() {
    let places = [Vector2::new(-40.0, 5.0), Vector2::new(38.0, -12.0)];
    let prior = Estimate::isotropic(Vector2::zeros(), 100.0);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
    let mut track = several().track(model(), &prior, 1, false).expect("in order");
    assert_eq!(track.found(), Some(Vec::new()));
    assert_eq!(track.position().mean, Vector2::zeros());
    for turn in 0..16_u8 {
        let around = f64::from(turn) * 0.7;
        let receiver = Pose::at(60.0 * around.cos(), 60.0 * around.sin(), 10.0);
        let expected = places.map(|p| MeasurementModel::<2, 2>::expected(&model(), &p, &receiver));
        let power = expected.map(|z| 10.0_f64.powf(0.1 * z[0]));
        let total: f64 = power.iter().sum();
        let mode = |index: usize, noise: f64| BearingMode {
            weight: power[index] / total,
            angle: expected[index][1] + 0.05 * noise,
            sigma: 0.05,
        };
        let noise: [f64; 2] = std::array::from_fn(|_| random.sample(StandardNormal));
        // What stands for a wrong direction is no direction.
        let wide = BearingMode { weight: 0.02, angle: 0.0, sigma: 1.8 };
        let modes = BearingModes::new(&[mode(0, noise[0]), mode(1, noise[1]), wide]);
        let reception = Reception {
            time: f64::from(turn),
            receiver,
            level: Some(Level { rss_dbm: 10.0 * total.log10(), sigma_db: 3.0 }),
            modes: modes.expect("in order"),
            ..Reception::default()
        };
        let step = track.update(&reception, false);
        assert!(matches!(step, Ok(TrackStep::Updated { .. })), "{step:?}");
    }
    let found = track.found().expect("it looks for several");
    assert_eq!(found.len(), 2, "{found:?}");
    for transmitter in &found {
        assert!(transmitter.existence > 0.99, "{transmitter:?}");
        let nees = |place| transmitter.estimate.nees(place).expect("definite");
        assert!(places.iter().any(|place| nees(place) < 25.0), "{transmitter:?}");
    }
    assert!(found.iter().any(|transmitter| transmitter.estimate == track.position()));
    assert!(track.smoothed().is_err());
}

/// Settings that several transmitters do not use are refused by name.
#[test]
fn several_transmitters_use_what_they_are_given() {
    let receivers = Some(ReceiversConfig { level_sigma_db: 4.0, bearing_sigma_deg: 10.0 });
    let levels = TrackConfig { components: Components::RssOnly, ..TrackConfig::default() };
    for (config, named) in [
        (EstimatorConfig { lag_s: Some(5.0), ..several() }, "lag_s"),
        (EstimatorConfig { receivers, ..several() }, "receivers"),
        (EstimatorConfig { track: levels, ..several() }, "levels alone"),
    ] {
        let refused = config.track(model(), &prior(), 1, false).expect_err("not used");
        assert!(refused.to_string().contains(named), "{refused}");
    }
    let certain = SeveralConfig { detection: 1.0, ..several().several.expect("set") };
    let config = EstimatorConfig { several: Some(certain), ..several() };
    let refused = config.track(model(), &prior(), 1, false).expect_err("never missed");
    assert!(refused.to_string().contains("detection probability"), "{refused}");
    assert!(several().build(model(), &prior(), 1).is_err());
}

/// Beliefs of a drawn team: the place's NEES, and each receiver as it was learned, with the true
/// offsets.
fn drawn_team(seed: u64) -> (f64, Vec<(LearnedReceiver, [f64; 2])>) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut normal = move || -> f64 { random.sample(StandardNormal) };
    let prior = Estimate::isotropic(Vector2::new(0.0, 0.0), 40.0);
    let place = Vector2::new(40.0 * normal(), 40.0 * normal());
    let power = 5.0 * normal();
    let offsets: [[f64; 2]; 4] =
        std::array::from_fn(|_| [4.0 * normal(), 10.0_f64.to_radians() * normal()]);
    let mut track = team().track(model(), &prior, 1, false).expect("in order");
    for round in 0..12_u8 {
        for (receiver, [level_off, bearing_off]) in offsets.into_iter().enumerate() {
            let pose = Pose::at(30.0 * normal(), 30.0 * normal(), 10.0);
            let expected = MeasurementModel::<2, 2>::expected(&model(), &place, &pose);
            // The last one scatters three times as much as it says.
            let scatter = if receiver == 3 { 3.0 } else { 1.0 };
            let rss_dbm = expected[0] + power + level_off + 3.0 * scatter * normal();
            let angle = expected[1] + bearing_off + 0.1 * scatter * normal();
            let reception = Reception {
                time: f64::from(round),
                receiver: pose,
                level: Some(Level { rss_dbm, sigma_db: 3.0 }),
                bearing: Some(Bearing { angle, sigma: 0.1, confidence: 1.0 }),
                ..Reception::default()
            };
            let step = track.heard_by(receiver).update(&reception, false);
            assert!(matches!(step, Ok(TrackStep::Updated { .. })), "{step:?}");
        }
    }
    let belief = track.position();
    let off = belief.mean - place;
    let factor = belief.covariance.cholesky().expect("definite");
    let learned = track.learned_receivers().into_iter();
    let with_truth = learned.map(|(receiver, learned)| (learned, offsets[receiver]));
    (off.dot(&factor.solve(&off)), with_truth.collect())
}

/// Over 20 teams whose receivers are off as much as their prior says: the place's ANEES and the
/// squared errors of the offsets in their σ are those of a consistent estimator (95 %), and the
/// receiver that scatters is found.
#[test]
fn a_team_learns_what_each_receiver_gets_wrong() {
    const RUNS: u32 = 20;
    let mut nees = 0.0;
    let mut squares = [0.0; 2];
    let mut scatters = [0.0; 4];
    for seed in 0..RUNS {
        let (own, learned) = drawn_team(u64::from(seed));
        nees += own / f64::from(RUNS);
        assert_eq!(learned.len(), 4);
        for (receiver, (learned, [level, bearing])) in learned.iter().enumerate() {
            assert_eq!(learned.receptions, 12);
            let pairs = [(learned.level_offset_db, level), (learned.bearing_offset, bearing)];
            for (sum, ([mean, sigma], truth)) in squares.iter_mut().zip(pairs) {
                *sum += ((mean - truth) / sigma).powi(2) / f64::from(4 * RUNS);
            }
            scatters[receiver] += learned.scatter.iter().sum::<f64>() / f64::from(2 * RUNS);
        }
    }
    // χ² of 40 degrees, and of some 20 independent offsets, over their number.
    assert!((1.22..2.97).contains(&nees), "{nees}");
    assert!(squares.iter().all(|square| (0.48..1.71).contains(square)), "{squares:?}");
    let [sound @ .., scattered] = scatters;
    assert!(sound.iter().all(|scatter| (0.8..1.2).contains(scatter)), "{scatters:?}");
    assert!((1.9..3.0).contains(&scattered), "{scatters:?}");
}

/// A bearing from 100 m by a receiver that knows its place to 10 m: the place adds 10 m across it,
/// whatever the bearing's own σ of 2 m there. With the prior's 20 m this leaves some 9 m. A place
/// that is known would leave 2 m.
#[test]
fn a_receiver_of_a_team_that_is_unsure_of_its_place_counts_for_less() {
    let receivers = ReceiversConfig { level_sigma_db: 4.0, bearing_sigma_deg: 0.1 };
    let config = EstimatorConfig { receivers: Some(receivers), ..team() };
    let prior = Estimate::isotropic(Vector2::new(100.0, 0.0), 20.0);
    let mut track = config.track(model(), &prior, 1, false).expect("in order");
    let reception = Reception {
        receiver_sigma_m: Some(Vector3::repeat(10.0)),
        bearing: Some(Bearing { angle: 0.0, sigma: 0.02, confidence: 1.0 }),
        ..Reception::default()
    };
    let step = track.heard_by(0).update(&reception, false);
    assert!(matches!(step, Ok(TrackStep::Updated { .. })), "{step:?}");
    let across = track.position().covariance[(1, 1)].sqrt();
    assert!((8.0..11.0).contains(&across), "{across}");
}
