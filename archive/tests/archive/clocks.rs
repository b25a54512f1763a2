//! Levels whose clock differs from that of the receiver's path.

use foxhunt_core::{Level, Pose, Reception};
use foxhunt_hunt::{
    locate::{LocateConfig, Located},
    registry::Registry,
};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

/// Lanes of 200 m, 50 m apart, flown at 5 m/s and 30 m up; a level a second.
fn receiver(time: f64) -> Pose {
    let along = (5.0 * time).clamp(0.0, 1250.0);
    let lane = (along / 250.0).floor();
    let within = along - 250.0 * lane;
    let back = lane.rem_euclid(2.0) > 0.5;
    let east = if back { 200.0 - within.min(200.0) } else { within.min(200.0) };
    Pose::at(east, 50.0 * lane + (within - 200.0).max(0.0), 30.0)
}

/// Levels with noise of 3 dB, each measured where the receiver was `offset_s` later than stated.
fn flight(offset_s: f64, rng: &mut Xoshiro256PlusPlus) -> (Vector2<f64>, Vec<Reception>) {
    let target = Vector2::new(rng.random_range(20.0..180.0), rng.random_range(20.0..180.0));
    let reception = |second: u16| {
        let time = f64::from(second);
        let way = target.push(0.0) - receiver(time + offset_s).position;
        let noise: f64 = rng.sample(StandardNormal);
        let rss_dbm = -30.0 - 24.0 * way.norm().log10() + 3.0 * noise;
        let level = Some(Level { rss_dbm, sigma_db: 3.0 });
        Reception { time, receiver: receiver(time), level, ..Reception::default() }
    };
    (target, (0..250).map(reception).collect())
}

fn locate(receptions: &[Reception], clock_offset_s: f64) -> Located {
    let registry = Registry::builtin();
    let entry = registry.estimator("shadowing-grid").expect("it has a name");
    let config = LocateConfig { clock_offset_s, ..LocateConfig::default() };
    entry.locate(receptions, &config).expect("it is located")
}

/// Returns the offset that a remark asks for, with its interval.
fn offset(located: &Located) -> Option<[f64; 3]> {
    let remark = located.remarks.iter().find(|remark| remark.code == "clocks-differ")?;
    let (_, interval) = remark.text.split_once('(').expect("an interval");
    let (interval, rest) = interval.split_once(" s)").expect("an interval");
    let (from, to) = interval.split_once(" to ").expect("two ends");
    let (_, add) = rest.split_once("add ").expect("the flag");
    let (add, _) = add.split_once(" to ").expect("the flag");
    Some([from, to, add].map(|number| number.parse().expect("a number")))
}

#[test]
fn an_offset_is_found_and_taken_off() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(37);
    for true_s in [37.0, -37.0, 12.0] {
        let (target, receptions) = flight(true_s, &mut rng);
        let apart = locate(&receptions, 0.0);
        let [from_s, to_s, add_s] = offset(&apart).expect("the clocks differ");
        println!("{true_s} s: {add_s} s, {from_s} to {to_s}");
        assert!((add_s - true_s).abs() <= 1.0, "{true_s} s: {add_s}");
        assert!(from_s <= add_s && add_s <= to_s && to_s - from_s < 5.0, "{from_s} to {to_s}");
        let together = locate(&receptions, true_s);
        assert_eq!(offset(&together), None, "{true_s} s");
        let off = |located: &Located| (located.estimate.mean - target).norm();
        assert!(off(&together) < 10.0, "{}", off(&together));
        assert!(off(&apart) > 2.0 * off(&together), "{} {}", off(&apart), off(&together));
    }
}

/// No remark on 30 clean flights, nor on a straight one, along which another clock
/// is another place.
#[test]
fn clocks_that_agree_and_paths_that_do_not_show_it_have_no_remark() {
    for seed in 0..30 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let (_, receptions) = flight(0.0, &mut rng);
        assert_eq!(offset(&locate(&receptions, 0.0)), None, "seed {seed}");
    }
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    let straight = (0..250_u16).map(|second| {
        let time = f64::from(second);
        let at = |time: f64| Pose::at(5.0 * time, 0.0, 30.0);
        let way = Vector2::new(600.0, 150.0).push(0.0) - at(time + 20.0).position;
        let noise: f64 = rng.sample(StandardNormal);
        let rss_dbm = -30.0 - 24.0 * way.norm().log10() + 3.0 * noise;
        let level = Some(Level { rss_dbm, sigma_db: 3.0 });
        Reception { time, receiver: at(time), level, ..Reception::default() }
    });
    assert_eq!(offset(&locate(&straight.collect::<Vec<_>>(), 0.0)), None);
}
