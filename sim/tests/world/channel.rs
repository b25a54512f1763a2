use std::f64::consts::TAU;

use foxhunt_core::angle::distance;
use foxhunt_sensors::{Antenna, AntennaConfig, GainRow, LogDistance, PatternTable};
use foxhunt_sim::ChannelConfig;

use crate::rig::{Rig, beacon, config, direction, omnidirectional, quiet};

/// What a receiver reads at a power in dBm.
fn read(power_dbm: f64, channel: &ChannelConfig) -> Option<f64> {
    // A metre away the logarithm is 0, and without directions the power is P₀.
    let path_loss = LogDistance::new(power_dbm, 2.0).expect("in range");
    let channel = ChannelConfig { path_loss, antenna: omnidirectional(), ..channel.clone() };
    let mut config = config(channel);
    config.beacons = vec![beacon(0.0, 1.0, 0.0)];
    Rig::new(&config, 1).ask(0)
}

#[test]
fn whole_decibels_are_rounded_half_away_from_zero() {
    let whole = ChannelConfig { whole_db: true, ..quiet() };
    for (power, reading) in [(-70.5, -71.0), (-70.49, -70.0), (-71.5, -72.0), (2.5, 3.0)] {
        assert_eq!(read(power, &whole), Some(reading), "at {power} dBm");
    }
    assert_eq!(read(-70.25, &quiet()), Some(-70.25));
}

#[test]
fn the_floor_holds_against_what_would_be_read() {
    let floor = ChannelConfig { floor_dbm: Some(-71.0), ..quiet() };
    assert_eq!(read(-71.0, &floor), Some(-71.0));
    assert_eq!(read(-71.25, &floor), None);
    let whole = ChannelConfig { whole_db: true, ..floor };
    assert_eq!(read(-71.25, &whole), Some(-71.0));
    assert_eq!(read(-71.75, &whole), None);
}

#[test]
fn the_floor_cuts_off_where_the_antenna_looks_away() {
    // 50 m off the mean over a turn is −76.04 dBm, the maximum about 8 dB more.
    let channel = ChannelConfig { floor_dbm: Some(-76.0), ..quiet() };
    let mut rig = Rig::new(&config(channel), 1);
    let truth = 40.0_f64.atan2(30.0);
    rig.turn_to(truth);
    assert!(rig.ask(0).is_some());
    rig.turn_to(truth + TAU / 2.0);
    assert_eq!(rig.ask(0), None);
}

#[test]
fn a_sample_is_the_law_and_the_gain_over_its_mean() {
    let mut rig = Rig::new(&config(quiet()), 1);
    let patch = PatternTable::reference_patch();
    let law = -29.06 - 27.65 * 50.0_f64.log10();
    for (angle, rss) in rig.turn(0, 1) {
        let gain = patch.gain_db(40.0_f64.atan2(30.0) - angle) - patch.mean_gain_db(0.0);
        assert!((rss - law - gain).abs() < 1e-9, "{rss} dBm at {angle}");
    }
}

#[test]
fn the_nose_turns_the_antenna() {
    let mut config = config(quiet());
    config.drones[0].heading_deg_ccw_from_east = 100.0;
    let found = direction(&Rig::new(&config, 1).turn(0, 1));
    let expected = 40.0_f64.atan2(30.0) - 100.0_f64.to_radians();
    // The table's rows and the 128 angles do not lie alike about the beacon.
    assert!(distance(found, expected) < 1e-6, "{found}, not {expected}");
}

#[test]
fn an_antenna_that_squints_hears_most_when_it_looks_past_the_beacon() {
    // Most gain for a wave from 30° counter-clockwise of boresight: 8 dB, over a mean of 3 dB.
    let rows = [(-150.0, -2.0), (-60.0, 3.0), (30.0, 8.0), (120.0, 3.0)];
    let rows = rows.map(|(angle_deg, gain_db)| GainRow { angle_deg, gain_db }).to_vec();
    let channel = ChannelConfig { antenna: AntennaConfig::Table(rows), ..quiet() };
    let mut rig = Rig::new(&config(channel), 1);
    let truth = 40.0_f64.atan2(30.0);
    let law = -29.06 - 27.65 * 50.0_f64.log10();
    for (off, over_mean) in [(30.0_f64, 5.0), (-60.0, 0.0), (-150.0, -5.0)] {
        rig.turn_to(truth - off.to_radians());
        assert!((rig.hear(0) - law - over_mean).abs() < 1e-9, "{off}° off");
    }
    rig.turn_to(truth);
    let ahead = rig.hear(0) - law;
    assert!(ahead > 3.0 && ahead < 5.0, "{ahead} dB");
}

#[test]
fn every_beacon_has_its_own_power_and_a_drone_above_it_hears_a_number() {
    let mut rig = Rig::new(&config(ChannelConfig { antenna: omnidirectional(), ..quiet() }), 1);
    let near = -29.06 - 27.65 * 5.0_f64.log10();
    assert!((rig.hear(1) - near).abs() < 1e-9);
    let far = -29.06 - 27.65 * 50.0_f64.log10();
    assert!((rig.hear(0) - far).abs() < 1e-9);
    for (east, north, up) in [(-5.0, 0.0, 4.0), (-5.0, 0.0, 0.0), (1e5, 0.0, 0.0)] {
        rig.fly_to(east, north, up);
        assert!(rig.hear(1).is_finite(), "at {east}, {north}, {up}");
    }
    rig.fly_to(0.0, 0.0, 0.0);
    assert!((rig.hear(1) - near).abs() < 1e-9);
}
