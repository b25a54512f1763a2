//! A campaign, a log, a replay and the program, all with parts from outside.

use std::{fs, path::Path, process::Command};

use foxhunt::{
    campaign::{Repetition, campaign},
    core::laws,
    log::{Log, LogWriter},
    nalgebra::{Matrix3, Vector2, Vector3},
    prelude::*,
    replay::replay,
    sim::World,
};
use foxhunt_outside::{EnsembleKalman, SCENARIO, TdoaDopplerBearing, TurningTriangle, registry};

fn scenario() -> Scenario {
    Scenario::parse(SCENARIO, "array.toml").expect("in order")
}

// ANCHOR: laws
#[test]
fn the_parts_keep_the_laws() {
    let model = TdoaDopplerBearing { reference: Vector3::new(0.0, 0.0, 2.0) };
    let receiver = Pose { velocity: Some(Vector3::new(8.0, 0.0, 0.0)), ..Pose::at(10.0, 5.0, 4.0) };
    let noise = Matrix3::from_diagonal(&Vector3::new(36.0, 0.64, 0.02));
    let observation = Observation::new(0.0, receiver, Vector3::new(-5.0, 3.0, 0.7), noise);
    let observation = observation.expect("finite");
    laws::measurement_model(&model, &Vector2::new(40.0, -20.0), &observation);

    let belief = Estimate::isotropic(Vector2::new(40.0, -20.0), 10.0);
    let mut stations = [Station::holding(Pose::at(0.0, 0.0, 4.0)); 3];
    laws::formation_planner(TurningTriangle::default, &belief, &mut stations);

    let world = World::new(&scenario().world, 1).expect("in order");
    let registry = registry();
    let entry = registry.source("phased-array").expect("registered");
    let mut source = entry.build(&world, 0).expect("there is a drone");
    laws::pattern_source(&mut source, &[BeaconId(0)], 100, || {
        world.advance(0.05).expect("time goes on");
    });
}
// ANCHOR_END: laws

// ANCHOR: campaign
/// Seeds 1 to 12. The bearings alone, σ 0.15 rad from 10 m, leave 1.5 m.
#[test]
fn it_flies_a_campaign() {
    let registry = registry();
    let scenario = scenario();
    let estimator = registry.estimator("ensemble").expect("registered").clone();
    let report = campaign(&registry, &scenario, &[estimator], &Repetition::new(12));
    let report = report.expect("it flies");
    let beacon = &report.estimators[0].beacons[0];
    assert_eq!(beacon.failed, 0);
    let error_m = beacon.error_m.expect("twelve hunts");
    assert!(error_m.rms < 3.0, "rms {} m", error_m.rms);
    assert!(error_m.p10 < error_m.max, "the noise of each hunt is its own");
    assert!(beacon.anis.is_some(), "the innovations were normalised with three degrees");
}
// ANCHOR_END: campaign

#[test]
fn the_model_flies_under_a_filter_of_foxhunt() {
    let registry = registry();
    let scenario = scenario();
    let estimator = registry.estimator("array-grid").expect("registered");
    let setup = Setup { scenario: &scenario, estimator, registry: &registry };
    let flown = setup.simulate(1, |_| Ok::<_, std::io::Error>(())).expect("it flies");
    let error = flown.found[0].error_m();
    assert!(error < 5.0, "{error} m");
}

#[test]
fn its_log_replays_to_the_bit_with_its_registry_and_is_refused_without() {
    let registry = registry();
    let scenario = scenario();
    let estimator = registry.estimator("ensemble").expect("registered");
    let setup = Setup { scenario: &scenario, estimator, registry: &registry };
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("outside.jsonl");
    let file = fs::File::create(&path).expect("a folder for tests");
    let mut writer = LogWriter::new(file, &setup.log_header(1)).expect("written");
    setup.simulate(1, |event| writer.event(event)).expect("it flies");
    let log = Log::read(&path).expect("what was written");
    let replayed = replay(&log, &registry, None).expect("the name is registered");
    assert!(replayed.compared > 10, "{}", replayed.compared);
    assert_eq!(replayed.different, 0);
    let refused = replay(&log, &Registry::builtin(), None).expect_err("nobody knows it");
    assert!(refused.to_string().contains("ensemble"), "{refused}");
}

#[test]
fn a_model_that_is_not_fed_is_refused_when_the_hunt_is_made() {
    let registry = registry();
    let scenario = scenario();
    let plain = Scenario { source: Default::default(), ..scenario };
    let estimator = registry.estimator("ensemble").expect("registered");
    let setup = Setup { scenario: &plain, estimator, registry: &registry };
    let refused = setup.simulate(1, |_| Ok::<_, std::io::Error>(())).expect_err("only levels");
    let text = refused.to_string();
    assert!(text.contains("range_difference_m") && text.contains("rss_dbm"), "{text}");
}

#[test]
fn the_program_knows_the_names() {
    let program = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_foxhunt-outside"))
            .args(arguments)
            .output()
            .expect("it starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/array.toml");
    let table = program(&["campaign", file, "--runs", "2", "--estimator", "ensemble"]);
    assert!(table.contains("ensemble"), "{table}");
    assert!(program(&["list", "planners"]).contains("turning-triangle"));
    assert!(program(&["campaign", "--help"]).contains("ensemble"));
}

/// The particle spread stays that of the prior while nothing is measured.
#[test]
fn an_ensemble_begins_as_its_prior() {
    let model = TdoaDopplerBearing { reference: Vector3::zeros() };
    let prior = Estimate::isotropic(Vector2::new(3.0, -2.0), 10.0);
    let ensemble = EnsembleKalman::new(model, &prior, 20_000, 5).expect("a proper prior");
    let estimate = ensemble.estimate();
    // Standard errors: 10/√20000 = 0.07 m of the mean; √(2/20000) = 1 % of a variance.
    assert!((estimate.mean - prior.mean).norm() < 0.4);
    assert!((estimate.covariance[(0, 0)] / 100.0 - 1.0).abs() < 0.05);
}
