//! The times when an offset and a bearing error are newly drawn.

use foxhunt_core::Vehicle;
use foxhunt_sim::ChannelConfig;
use nalgebra::Vector3;

use crate::rig::{Rig, config, omnidirectional, quiet};

/// Everything but the pattern's offset is constant at a place.
fn rig() -> Rig {
    let antenna = omnidirectional();
    Rig::new(&config(ChannelConfig { pattern_sigma_db: 4.0, antenna, ..quiet() }), 8)
}

/// The offset in dB of what beacon 0 sends, 50 m from the origin.
fn offset(rig: &mut Rig) -> f64 {
    let place = rig.vehicle.pose().expect("it works").position;
    let range = (place - Vector3::new(30.0, 40.0, 0.0)).norm();
    rig.receive(0) + 29.06 + 27.65 * range.log10()
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

#[test]
fn a_turn_is_one_pattern_and_the_next_turn_another() {
    let mut rig = rig();
    let turns: Vec<f64> = (0..6)
        .map(|_| {
            let turn = rig.turn(0, 2);
            let (_, first) = turn[0];
            assert!(turn.iter().all(|(_, rss)| same(*rss, first)), "the offset changed");
            first
        })
        .collect();
    assert!(turns.windows(2).all(|pair| !same(pair[0], pair[1])), "{turns:?}");
}

#[test]
fn a_place_may_have_one_pattern_for_all_turns() {
    let antenna = omnidirectional();
    let channel = ChannelConfig { pattern_sigma_db: 4.0, patterns_stay: true, antenna, ..quiet() };
    let mut rig = Rig::new(&config(channel), 8);
    let first = rig.receive(0);
    for _ in 0..3 {
        assert!(rig.turn(0, 2).iter().all(|(_, rss)| same(*rss, first)));
    }
    let first = offset(&mut rig);
    rig.fly_to(5.0, 0.0, 0.0);
    assert!(!same(offset(&mut rig), first), "another place");
}

#[test]
fn a_turn_that_is_begun_again_is_another_pattern() {
    let mut rig = rig();
    let turn = |rig: &mut Rig, angles: &[f64]| -> f64 {
        let offsets: Vec<f64> = angles
            .iter()
            .map(|angle| {
                rig.turn_to(*angle);
                offset(rig)
            })
            .collect();
        assert!(offsets.iter().all(|o| same(*o, offsets[0])), "{offsets:?}");
        offsets[0]
    };
    let first = turn(&mut rig, &[0.0, 0.1, 0.2]);
    let second = turn(&mut rig, &[0.0, 0.1, 0.2, 0.3]);
    let third = turn(&mut rig, &[0.3, 0.2]);
    assert!(!same(first, second) && !same(second, third) && !same(first, third));
}

#[test]
fn beacons_that_share_a_turn_have_a_pattern_each() {
    let mut rig = rig();
    let before = offset(&mut rig);
    assert!(same(offset(&mut rig), before));
    // The other beacon is 5 m away.
    let other = |rig: &mut Rig| rig.receive(1) + 29.06 + 27.65 * 5.0_f64.log10();
    let second = other(&mut rig);
    assert!(!same(second, before));
    assert!(same(offset(&mut rig), before) && same(other(&mut rig), second));
}

#[test]
fn another_place_is_another_pattern_and_a_gust_is_not() {
    let mut rig = rig();
    let before = offset(&mut rig);
    rig.fly_to(0.3, 0.2, 0.3);
    assert!(same(offset(&mut rig), before), "0.47 m");
    rig.fly_to(0.3, 0.3, 0.3);
    let after = offset(&mut rig);
    assert!(!same(after, before), "0.52 m");
    rig.fly_to(0.0, 0.3, 0.3);
    assert!(same(offset(&mut rig), after), "from the new place");
}
