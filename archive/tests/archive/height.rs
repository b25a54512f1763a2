//! A transmitter whose height is not known.

use foxhunt_core::{Level, Pose, Reception, Receptions};
use foxhunt_hunt::{
    locate::{Height, LocateConfig, LocateError, Located},
    registry::Registry,
};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

/// Lanes 30 m apart, 25 m above the ground, over a transmitter `up` metres above it; noise of 2 dB.
fn flight(up: f64, rng: &mut Xoshiro256PlusPlus) -> (Vector2<f64>, Vec<Reception>) {
    let target = Vector2::new(rng.random_range(40.0..160.0), rng.random_range(40.0..160.0));
    let reception = |number: u16| {
        let lane = number / 41;
        let receiver = Pose::at(5.0 * f64::from(number % 41), 30.0 * f64::from(lane), 25.0);
        let way = target.push(up) - receiver.position;
        let noise: f64 = rng.sample(StandardNormal);
        let rss_dbm = -30.0 - 22.0 * way.norm().log10() + 2.0 * noise;
        let level = Some(Level { rss_dbm, sigma_db: 2.0 });
        Reception { time: number.into(), receiver, level, ..Reception::default() }
    };
    (target, (0..41 * 7).map(reception).collect())
}

fn locate(receptions: &[Reception], config: &LocateConfig) -> Located {
    let registry = Registry::builtin();
    let entry = registry.estimator("shadowing-grid").expect("it has a name");
    entry.locate(&receptions.into(), config).expect("it is located")
}

/// At least 35 of 40 regions of 95 % hold, with a probability of 95 %. The estimated height is
/// within its σ as often as it should be, and an assumed one that is 18 m off is not.
#[test]
fn a_height_that_is_not_known_is_estimated() {
    let free = LocateConfig { height: Height::Free, ..LocateConfig::default() };
    let mut held = 0;
    let mut off_m = 0.0;
    for seed in 0..40 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let up = rng.random_range(0.0..20.0);
        let (target, receptions) = flight(up, &mut rng);
        let located = locate(&receptions, &free);
        held += u32::from(located.region_95_holds(&target) == Some(true));
        off_m += (located.up_m(&free) - up).abs() / 40.0;
    }
    println!("{held} of 40 hold, the height is off by {off_m:.1} m");
    assert!(held >= 35 && off_m < 6.0, "{held} of 40, {off_m}");
}

#[test]
fn estimators_that_take_the_height_for_known_refuse() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let (_, receptions) = flight(5.0, &mut rng);
    let registry = Registry::builtin();
    let config = LocateConfig { height: Height::Free, ..LocateConfig::default() };
    for estimator in ["particle", "batch-multistart", "least-absolute", "strongest"] {
        let entry = registry.estimator(estimator).expect("it has a name");
        let error = entry
            .locate(&Receptions::from(&*receptions), &config)
            .expect_err("it has no use of it");
        assert!(matches!(error, LocateError::NoFreeHeight { .. }), "{estimator}: {error}");
    }
    let known = locate(&receptions, &LocateConfig { target_up_m: 5.0, ..LocateConfig::default() });
    assert_eq!(known.explanation.expect("of levels").target_up_m, None);
}
