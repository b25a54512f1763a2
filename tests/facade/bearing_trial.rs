//! Extractors on simulated turns against what they have to reach.

use approx::abs_diff_eq;
use foxhunt::{
    bearing_trial::{BearingReport, ExtractorReport, bearing_campaign, bearing_case_named},
    registry::{RECOMMENDED_EXTRACTOR, Registry},
    sensors::AntennaConfig,
};

use crate::support::repetition;

/// Extractor that the recommended one is compared with.
const PLAINEST: &str = "first-harmonic-db";

fn report(case: &str, runs: u32) -> BearingReport {
    let case = bearing_case_named(case).expect("it is built in");
    let antenna = AntennaConfig::default();
    let registry = Registry::builtin();
    let compared = [RECOMMENDED_EXTRACTOR, PLAINEST];
    let compared = compared.map(|name| registry.extractor(name).expect("built in").clone());
    bearing_campaign(&registry, &case, &antenna, &compared, &repetition(runs, 1)).expect("in order")
}

fn of<'r>(report: &'r BearingReport, name: &str) -> &'r ExtractorReport {
    report.extractors.iter().find(|e| e.extractor == name).expect("it is compared")
}

/// The bounds on the recommended extractor, `slack` times what 2000 turns have to keep.
fn holds(runs: u32, slack: f64) {
    let low = 0.8 / slack;
    let high = 1.25 * slack;
    // A share of 0.95 in n scatters by 0.218/√n.
    let scatter = 5.0 * 0.218 / f64::from(runs).sqrt();
    for (case, rms) in [
        ("bearing-clean", 0.53),
        ("bearing-lost", 0.70),
        ("bearing-65", 0.75),
        ("bearing-block", 0.90),
    ] {
        let report = report(case, runs);
        let best = of(&report, RECOMMENDED_EXTRACTOR);
        let is_below = best.rms_deg.is_some_and(|found| found < rms * slack);
        assert!(is_below && best.refused == 0, "{case}: {best:?}");
        let ratio = best.sigma_ratio.expect("there are bearings");
        assert!((low..high).contains(&ratio), "{case}: {best:?}");
        let inside = best.coverage_95.expect("there are bearings");
        assert!((0.91 - scatter..=0.98 + scatter).contains(&inside), "{case}: {best:?}");
        // By chance 0.13 in 2000; the noise is estimated, which makes the tails a little longer.
        assert!(best.beyond_4_sigma <= 2, "{case}: {best:?}");
        // 0.46° on a whole turn.
        assert!(case != "bearing-clean" || abs_diff_eq!(report.bound_deg, 0.46, epsilon = 0.01));
    }
    let reflector = report("bearing-reflector", runs);
    let best = of(&reflector, RECOMMENDED_EXTRACTOR);
    assert!(best.rms_deg.is_some_and(|found| found < 7.2), "{best:?}");
    assert!(best.coverage_95.is_some_and(|inside| inside > 0.88 - scatter), "{best:?}");
    assert_eq!(best.refused, 0);
    assert!(of(&reflector, PLAINEST).rms_deg.is_some_and(|found| found > 10.0));
}

/// 150 turns of each case, seeds from 1: an rms of 150 scatters by 1/√300, 6 %, so that 1.3 times
/// the bound is 5 of that.
#[test]
fn the_recommended_extractor_reaches_its_bounds() {
    holds(150, 1.3);
}

/// Claims for the recommended extractor, on 2000 turns of each case.
#[test]
#[ignore = "campaign: 10 000 turns, a minute with optimisation"]
fn the_recommended_extractor_reaches_its_bounds_in_2000_turns() {
    holds(2000, 1.0);
}
