use approx::assert_abs_diff_eq;
use foxhunt_core::{BeaconId, PatternSource, laws};
use foxhunt_sensors::StepperConfig;
use foxhunt_sim::{ChannelConfig, SimStepper, SimStepperConfig, World};

use crate::rig::{config, omnidirectional, quiet};

/// A world whose steppers take as long as the default ones.
fn world(channel: ChannelConfig) -> World {
    let mut config = config(channel);
    config.stepper = SimStepperConfig::default();
    World::new(&config, 11).expect("the configuration is in order")
}

/// Polls every 10 ms until the turn ends; its samples' powers and its duration.
fn turn(world: &World, source: &mut SimStepper) -> (Vec<f64>, f64) {
    let begin = world.time();
    source.begin(&[BeaconId(0)]).expect("it begins");
    for _ in 0..10_000 {
        world.advance(0.01).expect("a step");
        if let Some(sweep) = source.poll().expect("nothing fails") {
            let readings = sweep.samples.iter().map(|sample| sample.rss_dbm).collect();
            return (readings, sweep.time - begin);
        }
    }
    panic!("the turn did not end");
}

#[test]
fn it_keeps_the_laws_of_a_source() {
    let world = world(ChannelConfig::default());
    let mut source = world.stepper(0, StepperConfig::pritzl2018()).expect("it exists");
    for _ in 0..3 {
        laws::pattern_source(&mut source, &[BeaconId(1)], 6000, || {
            world.advance(0.01).expect("a step");
        });
    }
    assert!(world.stepper(1, StepperConfig::pritzl2018()).is_err());
}

#[test]
fn a_turn_takes_as_long_as_its_parts() {
    let world = world(ChannelConfig::default());
    let mut source = world.stepper(0, StepperConfig::pritzl2018()).expect("it exists");
    for _ in 0..2 {
        let (readings, duration) = turn(&world, &mut source);
        assert_eq!(readings.len(), 768);
        // 10 ms of radio 768 times, and 127 steps of 24.5 ms that are noticed after 30 ms.
        let expected = 768.0 * 0.01 + 127.0 * 0.03;
        assert_abs_diff_eq!(duration, expected, epsilon = 0.011);
    }
}

#[test]
fn every_turn_is_one_pattern() {
    let antenna = omnidirectional();
    let world = world(ChannelConfig { pattern_sigma_db: 4.0, antenna, ..quiet() });
    let mut source = world.stepper(0, StepperConfig::pritzl2018()).expect("it exists");
    let mut levels = Vec::new();
    for _ in 0..4 {
        let (readings, _) = turn(&world, &mut source);
        assert!(readings.iter().all(|rss| (rss - readings[0]).abs() < 1e-9), "the offset changed");
        levels.push(readings[0]);
        // One that is given up half-way.
        source.begin(&[BeaconId(0)]).expect("it begins");
        for _ in 0..200 {
            world.advance(0.01).expect("a step");
            assert!(source.poll().expect("nothing fails").is_none());
        }
    }
    assert!(levels.windows(2).all(|pair| (pair[0] - pair[1]).abs() > 1e-6), "{levels:?}");
}

#[test]
fn a_silent_drones_turn_ends_by_its_time_outs_with_nothing() {
    let mut config = config(ChannelConfig::default());
    config.stepper = SimStepperConfig::default();
    config.drones[0].silent_after_s = Some(0.0);
    let world = World::new(&config, 11).expect("the configuration is in order");
    let mut source = world.stepper(0, StepperConfig::pritzl2018()).expect("it exists");
    let longest = StepperConfig::pritzl2018().longest_turn(1);
    for _ in 0..2 {
        let (readings, duration) = turn(&world, &mut source);
        assert!(readings.is_empty());
        // Each of the 128 time-outs is noticed at most a step late.
        assert!((longest..longest + 1.29).contains(&duration), "{duration} s");
    }
}

#[test]
fn lost_answers_cost_time_and_samples() {
    let world = world(ChannelConfig { loss_probability: 0.05, ..ChannelConfig::default() });
    let mut source = world.stepper(0, StepperConfig::pritzl2018()).expect("it exists");
    let (readings, duration) = turn(&world, &mut source);
    // A loss ends its position: Σ 0.95ⁱ, i = 1 … 6, of 6 samples are left, 5.03.
    let expected = 128.0 * (0.95 - 0.95_f64.powi(7)) / 0.05;
    let left = crate::rig::count(&readings);
    // σ² of one position's count is below 6² / 4.
    assert_abs_diff_eq!(left, expected, epsilon = 5.0 * 3.0 * 128.0_f64.sqrt());
    assert!(left < 768.0 && duration > 12.0);
}
