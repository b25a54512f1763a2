use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::f64::consts::TAU;

use foxhunt_core::{MeasurementModel, Vehicle, angle::distance};
use foxhunt_sensors::{
    Antenna, AntennaConfig, Dipole, ElevationPattern, GainRow, LogDistance, PatchConfig,
    PatternTable, Propagation, RssBearing, TwoRay, WithElevationPattern,
};
use foxhunt_sim::{
    ChannelConfig, DeadZoneConfig, DroneConfig, PathLossConfig, ScatteringConfig, ShadowingConfig,
    TwoRayConfig, World,
};

use nalgebra::{Vector2, Vector4};

use crate::rig::{
    Rig, beacon, config, direction, level, mean, omnidirectional, other, quiet, reflector,
    scattering,
};

/// The reading of a receiver at a power in dBm.
fn read(power_dbm: f64, channel: &ChannelConfig) -> Option<f64> {
    // A metre away the logarithm is 0, and without directions the power is P₀.
    let path_loss = LogDistance::new(power_dbm, 2.0).expect("in range").into();
    let channel = ChannelConfig { path_loss, antenna: omnidirectional(), ..channel.clone() };
    let mut config = config(channel);
    config.beacons = vec![beacon(0.0, 1.0, 0.0)];
    Rig::new(&config, 1).request(0)
}

/// Two transmitters as far away as each other are 3 dB stronger than one; one that is ten times as
/// far adds a hundredth by free space's exponent.
#[test]
fn the_powers_of_transmitters_on_one_frequency_add() {
    let path_loss = LogDistance::new(-50.0, 2.0).expect("in range").into();
    let channel = ChannelConfig { path_loss, antenna: omnidirectional(), ..quiet() };
    let mut config = config(channel);
    config.beacons = vec![beacon(0.0, 10.0, 0.0)];
    let read = |config: &_| Rig::new(config, 1).request(0).expect("it is near");
    assert_abs_diff_eq!(read(&config), -70.0, epsilon = 1e-9);
    config.beacons[0].others = vec![other(10.0)];
    assert_abs_diff_eq!(read(&config), -70.0 + 10.0 * 2.0_f64.log10(), epsilon = 1e-9);
    config.beacons[0].others = vec![other(100.0)];
    assert_abs_diff_eq!(read(&config), -70.0 + 10.0 * 1.01_f64.log10(), epsilon = 1e-9);
}

/// Samples in a dead zone draw from the streams as all do: what is received outside does not
/// change.
#[test]
fn nothing_is_received_in_a_dead_zone() {
    let zone = DeadZoneConfig { east_m: 5.0, north_m: 0.0, radius_m: 2.0 };
    let noisy = ChannelConfig::default();
    let readings = |dead_zones: Vec<DeadZoneConfig>| {
        let mut rig = Rig::new(&config(ChannelConfig { dead_zones, ..noisy.clone() }), 1);
        [0.0, 4.0, 6.5, 8.0].map(|east| {
            rig.fly_to(east, 0.0, 20.0);
            rig.request(0)
        })
    };
    let [free, dead] = [readings(Vec::new()), readings(vec![zone])];
    assert!(free.iter().all(Option::is_some));
    assert_eq!(dead, [free[0], None, None, free[3]]);
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
    assert!(rig.request(0).is_some());
    rig.turn_to(truth + TAU / 2.0);
    assert_eq!(rig.request(0), None);
}

#[test]
fn a_sample_is_the_law_and_the_gain_over_its_mean() {
    let mut rig = Rig::new(&config(quiet()), 1);
    let patch = PatternTable::reference_patch();
    let law = -29.06 - 27.65 * 50.0_f64.log10();
    for (angle, rss) in rig.turn(0, 1) {
        let gain = patch.gain_db(40.0_f64.atan2(30.0) - angle) - patch.mean_gain_db(0.0);
        assert!(abs_diff_eq!(rss - law, gain, epsilon = 1e-9), "{rss} dBm at {angle}");
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
fn an_antenna_that_squints_receives_most_when_it_looks_past_the_beacon() {
    // Most gain for a wave from 30° counter-clockwise of boresight: 8 dB, over a mean of 3 dB.
    let rows = [(-150.0, -2.0), (-60.0, 3.0), (30.0, 8.0), (120.0, 3.0)];
    let rows = rows.map(|(angle_deg, gain_db)| GainRow { angle_deg, gain_db }).to_vec();
    let channel = ChannelConfig { antenna: AntennaConfig::Table(rows), ..quiet() };
    let mut rig = Rig::new(&config(channel), 1);
    let truth = 40.0_f64.atan2(30.0);
    let law = -29.06 - 27.65 * 50.0_f64.log10();
    for (off, over_mean) in [(30.0_f64, 5.0), (-60.0, 0.0), (-150.0, -5.0)] {
        rig.turn_to(truth - off.to_radians());
        assert!(abs_diff_eq!(rig.receive(0) - law, over_mean, epsilon = 1e-9), "{off}° off");
    }
    rig.turn_to(truth);
    let ahead = rig.receive(0) - law;
    assert!(ahead > 3.0 && ahead < 5.0, "{ahead} dB");
}

#[test]
fn every_beacon_has_its_own_power_and_a_drone_above_it_receives_a_number() {
    let mut rig = Rig::new(&config(ChannelConfig { antenna: omnidirectional(), ..quiet() }), 1);
    let near = -29.06 - 27.65 * 5.0_f64.log10();
    assert_abs_diff_eq!(rig.receive(1), near, epsilon = 1e-9);
    let far = -29.06 - 27.65 * 50.0_f64.log10();
    assert_abs_diff_eq!(rig.receive(0), far, epsilon = 1e-9);
    for (east, north, up) in [(-5.0, 0.0, 4.0), (-5.0, 0.0, 0.0), (1e5, 0.0, 0.0)] {
        rig.fly_to(east, north, up);
        assert!(rig.receive(1).is_finite(), "at {east}, {north}, {up}");
    }
    rig.fly_to(0.0, 0.0, 0.0);
    assert_abs_diff_eq!(rig.receive(1), near, epsilon = 1e-9);
}

#[test]
fn a_drone_above_receives_through_the_antennas_vertical_pattern() {
    let mut rig = Rig::new(&config(ChannelConfig { antenna: AntennaConfig::Dipole, ..quiet() }), 1);
    rig.fly_to(30.0, 0.0, 40.0);
    // 40 m up and 40 m away.
    let law = -29.06 - 27.65 * (40.0 * 2.0_f64.sqrt()).log10();
    let gain = Dipole.gain_dbi(0.0, TAU / 8.0) - Dipole.gain_dbi(0.0, 0.0);
    assert_abs_diff_eq!(rig.receive(0) - law, gain, epsilon = 1e-9);
}

/// The mean over a turn in the world is what the model expects of a drone that is near and high.
#[test]
fn truth_and_model_agree_on_the_elevation() {
    let antenna = AntennaConfig::Patch(PatchConfig::default());
    let pattern = ElevationPattern::of(&antenna.build().expect("in range"));
    let law = RssBearing::new(LogDistance::pritzl2018_field());
    let model = WithElevationPattern::new(law, pattern);
    let mut rig = Rig::new(&config(ChannelConfig { antenna, ..quiet() }), 1);
    let mut closest = 0.0_f64;
    let mut without = 0.0_f64;
    for (east, north, up) in [(0.0, 0.0, 0.0), (25.0, 30.0, 10.0), (28.0, 40.0, 30.0)] {
        rig.fly_to(east, north, up);
        let readings = level(&rig.turn(0, 1));
        let pose = rig.vehicle.pose().expect("it works");
        let state = Vector4::new(30.0, 40.0, 0.0, 0.0);
        let [expected, flat]: [Vector2<f64>; 2] =
            [model.expected(&state, &pose), law.expected(&state, &pose)];
        closest = closest.max((readings - expected[0]).abs());
        without = without.max((readings - flat[0]).abs());
    }
    // 128 positions here, 360 directions there, a spline between degrees.
    assert!(closest < 0.01, "{closest} dB");
    assert!(without > 3.0, "{without} dB if the vertical pattern is left out");
}

#[test]
fn two_ray_knows_the_heights() {
    let path_loss = PathLossConfig::TwoRay(TwoRayConfig::new(5.0));
    let quiet = ChannelConfig { path_loss, antenna: omnidirectional(), ..quiet() };
    let mut rig = Rig::new(&config(quiet), 1);
    for up in [0.0, 3.0, 60.0] {
        rig.fly_to(0.0, 0.0, up);
        let wavelength = 299_792_458.0 / 2.44e9;
        let law = TwoRay::new(5.0, wavelength, 0.1, up.max(0.1)).expect("in range");
        let expected = law.rss_dbm(50.0_f64.hypot(up));
        assert!(abs_diff_eq!(rig.receive(0), expected, epsilon = 1e-9), "at {up} m");
    }
}

#[test]
fn shadowing_belongs_to_places_and_beacons() {
    let shadowing = Some(ShadowingConfig { sigma_db: 6.0, correlation_m: 20.0 });
    let channel = ChannelConfig { antenna: omnidirectional(), shadowing, ..quiet() };
    let mut config = config(channel.clone());
    config.drones.push(DroneConfig::default());
    let world = World::new(&config, 3).expect("in order");
    let mut rig = Rig::on(&world, 0);
    let mut other = Rig::on(&world, 1);
    let first = rig.receive(0);
    let second = rig.receive(1);
    assert!((other.receive(0) - first).abs() < 1e-12, "another drone at the same place");
    other.fly_to(100.0, 0.0, 0.0);
    let law = -29.06 - 27.65 * 70.0_f64.hypot(40.0).log10();
    let away = other.receive(0) - law;
    other.fly_to(0.0, 0.0, 0.0);
    assert!(abs_diff_eq!(other.receive(0), first, epsilon = 1e-12), "the same place again");
    let here = first + 29.06 + 27.65 * 50.0_f64.log10();
    let of_the_other = second + 29.06 + 27.65 * 5.0_f64.log10();
    assert!(here.abs() > 1e-3 && (here - away).abs() > 1e-3 && (here - of_the_other).abs() > 1e-3);
    // Drones' own draws stay what they are.
    let noisy = ChannelConfig { sample_sigma_db: 2.0, ..channel };
    let listen = |shadowing| {
        let channel = ChannelConfig { shadowing, ..noisy.clone() };
        Rig::new(&crate::rig::config(channel), 3).receive(0)
    };
    assert_abs_diff_eq!(listen(shadowing) - listen(None), here, epsilon = 1e-9);
}

/// From (-20, 0) the way is 20 m and √(50² + 40²) m where the direct one is 50 m.
#[test]
fn a_reflection_beats_with_the_direct_wave_and_comes_from_its_own_direction() {
    let channel = ChannelConfig { reflectors: vec![reflector(0.5)], ..quiet() };
    let round = ChannelConfig { antenna: omnidirectional(), ..channel.clone() };
    let phase = |east: f64| {
        let ways = (20.0 + east) + 50.0_f64.hypot(40.0) - (30.0 - east).hypot(40.0);
        TAU / 2.0 - TAU / (299_792_458.0 / 2.44e9) * ways
    };
    let mut rig = Rig::new(&config(round), 1);
    let mut beats = Vec::new();
    for i in 0..40_u8 {
        let east = f64::from(i) * 0.004;
        rig.fly_to(east, 0.0, 0.0);
        let sum = (1.0 + 0.5 * phase(east).cos()).hypot(0.5 * phase(east).sin());
        let law = -29.06 - 27.65 * (30.0 - east).hypot(40.0).log10();
        let over = rig.receive(0) - law;
        assert!(abs_diff_eq!(over, 20.0 * sum.log10(), epsilon = 1e-6), "{over} dB at {east} m");
        beats.push(sum);
    }
    let most = beats.iter().copied().fold(0.0, f64::max);
    let least = beats.iter().copied().fold(2.0, f64::min);
    assert!(most > 1.45 && least < 0.55, "16 cm are more than a wavelength: {least} to {most}");
    // With the patch, by hand in amplitudes.
    let patch = PatternTable::reference_patch();
    let mut rig = Rig::new(&config(channel), 1);
    let law = -29.06 - 27.65 * 50.0_f64.log10();
    for (angle, rss) in rig.turn(0, 1) {
        let amplitude = |arrival: f64| 10.0_f64.powf(0.05 * patch.gain_db(arrival - angle));
        let direct = amplitude(40.0_f64.atan2(30.0));
        let reflected = 0.5 * amplitude(TAU / 2.0);
        let real = direct + reflected * phase(0.0).cos();
        let sum = 20.0 * real.hypot(reflected * phase(0.0).sin()).log10();
        let expected = law + sum - patch.mean_gain_db(0.0);
        assert!((rss - expected).abs() < 1e-6, "{rss}, not {expected} dBm at {angle}");
    }
}

/// Every pattern draws its own waves, which bend it; a pattern's turn meets the same ones all
/// along, from their own directions in the world, whether the antenna turns or the body with it.
#[test]
fn scattered_waves_bend_a_pattern_and_stay_where_they_are() {
    let channel = ChannelConfig { scattering: Some(scattering()), ..quiet() };
    let truth = 40.0_f64.atan2(30.0);
    let headed = |heading_deg_ccw_from_east: f64, seed: u64| {
        let mut config = config(channel.clone());
        config.drones[0].heading_deg_ccw_from_east = heading_deg_ccw_from_east;
        Rig::new(&config, seed)
    };
    let mut errors = Vec::new();
    for seed in 0..40 {
        let level = headed(0.0, seed).turn(0, 2);
        assert!(level.chunks_exact(2).all(|pair| (pair[0].1 - pair[1].1).abs() < 1e-9));
        // A quarter of a turn is 32 of 128 positions.
        let turned = headed(90.0, seed).turn(0, 2);
        let same = level.iter().skip(64).zip(&turned);
        assert!(same.clone().count() == 192 && same.clone().all(|(a, b)| (a.1 - b.1).abs() < 1e-6));
        errors.push(distance(direction(&level), truth).to_degrees());
    }
    assert!(mean(&errors) > 10.0, "{errors:?}");
    // Forty dB below the direct wave they bend nothing.
    let weak = ScatteringConfig { k_db: 40.0, ..scattering() };
    let channel = ChannelConfig { scattering: Some(weak), ..quiet() };
    let found = direction(&Rig::new(&config(channel), 1).turn(0, 1));
    assert!(distance(found, truth) < 0.03, "{found}, not {truth}");
}

/// The mean power at an antenna without directions is that of the law, whatever K: 4000 patterns,
/// whose powers have a standard deviation of their mean at most.
#[test]
fn scattering_keeps_the_mean_power() {
    for k_db in [-10.0, 0.0, 6.0] {
        let scattering = Some(ScatteringConfig { k_db, ..scattering() });
        let channel = ChannelConfig { scattering, antenna: omnidirectional(), ..quiet() };
        let mut rig = Rig::new(&config(channel), 9);
        let law = -29.06 - 27.65 * 50.0_f64.log10();
        let powers: Vec<f64> = (0..4000)
            .map(|_| {
                rig.world.begin_pattern(0).expect("it exists");
                10.0_f64.powf((rig.receive(0) - law) / 10.0)
            })
            .collect();
        assert!(abs_diff_eq!(mean(&powers), 1.0, epsilon = 0.06), "K {k_db} dB: {}", mean(&powers));
    }
}

/// A channel without scattering draws what it drew before there was any.
#[test]
fn scattering_draws_after_the_pattern() {
    let listen = |scattering| {
        let channel = ChannelConfig { scattering, ..ChannelConfig::default() };
        Rig::new(&config(channel), 4).receive(0)
    };
    let weak = ScatteringConfig { k_db: 60.0, ..scattering() };
    let apart = listen(Some(weak)) - listen(None);
    assert_abs_diff_eq!(apart, 0.0, epsilon = 0.05);
}
