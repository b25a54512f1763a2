//! Avalanche beacons are found by the magnetic field near them.

use foxhunt_hunt::{registry::Registry, scenario::Scenario};
use foxhunt_lab::campaign::{Repetition, campaign};

/// Beacons drawn from the prior, a coil that lies aslant: each is found, and ellipses are honest.
/// The sum of 24 NEES has 48 degrees of freedom; their mean is from 1.08 to 3.22 (99 %).
#[test]
fn a_buried_beacon_is_found_with_an_honest_ellipse() {
    let scenario = Scenario::find("avalanche").expect("built in");
    let registry = Registry::builtin();
    let estimator = registry.estimator(&scenario.estimator).expect("it has a name").clone();
    let repetition = Repetition { runs: 24, seed: 1, jobs: 2, progress: &|| () };
    let report = campaign(&registry, &scenario, &[estimator], &repetition).expect("in order");
    let beacon = &report.estimators[0].beacons[0];
    assert_eq!(beacon.failed, 0);
    let anees = beacon.anees.expect("all have a fix");
    assert!((1.08..3.22).contains(&anees), "ANEES {anees}");
    let error = beacon.error_m.as_ref().expect("all have a fix");
    assert!(error.p50 < 0.5, "{error:?}");
}
