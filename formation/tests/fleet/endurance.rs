use approx::assert_abs_diff_eq;
use std::f64::consts::PI;

use foxhunt_formation::{AirspaceConfig, Endurance, EnduranceConfig, Travel};
use nalgebra::Vector3;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::{
    airspace::corner,
    flown::{Flown, at},
    world,
};

fn endurance() -> Endurance {
    Endurance::new(EnduranceConfig::default()).expect("the default is in range")
}

#[test]
fn nonsense_is_refused_by_name() {
    let refused = |config| Endurance::new(config).expect_err("nonsense").name;
    let config = EnduranceConfig::default();
    assert_eq!(refused(EnduranceConfig { speed_mps: 0.0, ..config }), "speed_mps");
    assert_eq!(refused(EnduranceConfig { climb_mps: f64::NAN, ..config }), "climb_mps");
    assert_eq!(refused(EnduranceConfig { reserve_s: 900.0, ..config }), "reserve_s");
    assert_eq!(refused(EnduranceConfig { endurance_s: f64::INFINITY, ..config }), "endurance_s");
    assert_abs_diff_eq!(endurance().left_s(700.0), 80.0, epsilon = 1e-9);
}

#[test]
fn a_return_takes_what_its_way_takes() {
    let homes = [Vector3::new(0.0, 0.0, 0.0), Vector3::new(0.0, 20.0, 0.0)];
    let flown = Flown::new(&AirspaceConfig::default(), &[at(100.0, 0.0), at(100.0, 20.0)]);
    let seconds = |drones: &[usize], homes: &[_]| {
        endurance().return_s(&flown.traffic, drones, homes).expect("there is a way")
    };
    // 100 m and two metres for stopping at 2 m/s, 4 m down at 1 m/s; side by side.
    assert_abs_diff_eq!(seconds(&[0], &homes), 55.0, epsilon = 1e-9);
    assert_abs_diff_eq!(seconds(&[0, 1], &homes), 55.0, epsilon = 1e-9);
    // One after the other where the ways cross, and more.
    let crossed = [homes[1], homes[0]];
    assert!(seconds(&[0, 1], &crossed) > 2.0 * 55.0);
    assert_abs_diff_eq!(seconds(&[], &homes), 0.0, epsilon = 1e-9);
    assert_eq!(endurance().return_s(&flown.traffic, &[2], &homes), None);

    let walled = Flown::new(&corner(), &[at(5.0, 18.0)]);
    let outside = [at(15.0, 15.0)];
    assert_eq!(endurance().return_s(&walled.traffic, &[0], &outside), None);
    let around = endurance().return_s(&walled.traffic, &[0], &[at(18.0, 5.0)]).expect("a way");
    assert!(around > (2.0 * 89.0_f64.sqrt() + 2.0) / 2.0, "around the corner: {around}");

    let formation = flown.traffic.form(&[0], &[at(120.0, 0.0)]).expect("one drone");
    let round = endurance().round_s(&flown.traffic, &formation, &homes, 30.0).expect("a way");
    assert_abs_diff_eq!(round, 11.0 + 30.0 + 65.0, epsilon = 1e-9);
}

/// Lines keep 3 m; a drone has 2 m to stop, and flies half around each disc of 3 m that a resting
/// drone in its way leaves it.
#[test]
fn a_resting_drone_in_the_way_costs_half_a_circle() {
    let home = [Vector3::new(0.0, 0.0, 4.0)];
    let seconds = |resting: &[Vector3<f64>]| {
        let places = [&[at(100.0, 0.0)], resting].concat();
        let flown = Flown::new(&AirspaceConfig::default(), &places);
        endurance().return_s(&flown.traffic, &[0], &home).expect("there is a way")
    };
    let straight = (100.0 + 2.0) / 2.0;
    assert!((seconds(&[at(50.0, 3.1)]) - straight).abs() < 1e-9, "it is not in the way");
    let one = straight + PI * 3.0 / 2.0;
    assert_abs_diff_eq!(seconds(&[at(50.0, 2.9)]), one, epsilon = 1e-9);
    let two = one + PI * 3.0 / 2.0;
    assert_abs_diff_eq!(seconds(&[at(50.0, 2.9), at(20.0, -1.0)]), two, epsilon = 1e-9);
}

/// Two that cross fly one after the other, each once aside by 6 times 3 m and back, and each half
/// around the other.
#[test]
fn ways_that_cross_add_up() {
    let flown = Flown::new(&AirspaceConfig::default(), &[at(0.0, 0.0), at(0.0, 80.0)]);
    let homes = [at(60.0, 80.0), at(60.0, 0.0)];
    let seconds = endurance().return_s(&flown.traffic, &[0, 1], &homes).expect("a way");
    let metres = 2.0 * (100.0 + 2.0) + 2.0 * (2.0 * 6.0 * 3.0 + PI * 3.0);
    assert_abs_diff_eq!(seconds, metres / 2.0, epsilon = 1e-9);
}

/// Seeded: in 200 random worlds, fleets without failures are home within the bound.
#[test]
fn nobody_comes_home_later_than_the_bound() {
    let mut returned = 0;
    for seed in 0..200 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let Some(world) = world::world(&mut rng) else { continue };
        let homes = world.homes.clone();
        let mut flown = Flown::over(&world.truth, *world.traffic.config(), &homes);
        let drones: Vec<usize> = (0..homes.len()).collect();
        let places: Vec<_> = drones.iter().map(|_| world::place(&mut rng, world.extent)).collect();
        let formation = flown.traffic.form(&drones, &places).expect("drones exist");
        flown.traffic.depart(&formation).expect("drones exist");
        flown.settle();
        let Some(bound) = endurance().return_s(&flown.traffic, &drones, &homes) else { continue };
        for &drone in &drones {
            flown.traffic.recall(drone, &homes[drone]).expect("the drone exists");
        }
        flown.seconds = 0.0;
        flown.settle();
        if drones.iter().all(|&drone| flown.traffic.status(drone) == Travel::There) {
            returned += 1;
            assert!(flown.seconds <= bound + 1.0, "seed {seed}: {} s, not {bound}", flown.seconds);
        }
    }
    assert!(returned > 100, "{returned}");
}
