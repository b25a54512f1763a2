//! The exported laws over the extractor, and what it refuses.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use foxhunt_core::{BearingExtractor, NoBearing, NoReading, Pose, Sample, Sweep, angle, laws};
use foxhunt_sensors::{Pattern, PatternTable, Pritzl2018, resultant_confidence};
use proptest::prelude::*;

use crate::sweeps::{Conditions, POSITIONS, simulate, sweep_of};

const SILENT: Sample = Sample {
    time: 0.0,
    receiver: Pose {
        position: nalgebra::Vector3::new(0.0, 0.0, 0.0),
        heading: 0.0,
        pitch: 0.0,
        roll: 0.0,
        velocity: None,
    },
    boresight: 0.0,
    position: 0,
    rss_dbm: 0.0,
};

fn nominal(position: u16, positions: u16) -> f64 {
    core::f64::consts::TAU * f64::from(position) / f64::from(positions)
}

proptest! {
    #[test]
    fn the_reference_extractor_keeps_the_laws(
        bearing in -3.2..3.2, heading in -3.2..3.2, noise_db in 0.0..6.0, lost in 0.0..0.97,
        whole_db: bool, seed: u64,
    ) {
        let patch = PatternTable::reference_patch();
        let conditions = Conditions { bearing, noise_db, lost, whole_db, heading };
        let samples = simulate(&conditions, &patch, seed);
        let mut room = vec![SILENT; samples.len()];
        let extractor = Pritzl2018::default();
        laws::bearing_extractor(&extractor, &sweep_of(&samples), &mut room);
    }

    /// Whole readings have one pattern, whatever the order of summation.
    #[test]
    fn the_order_of_whole_readings_does_not_matter(seed: u64) {
        let patch = PatternTable::reference_patch();
        let conditions = Conditions { whole_db: true, ..Conditions::default() };
        let mut samples = simulate(&conditions, &patch, seed);
        let extractor = Pritzl2018::default();
        let rounded = |samples: &[Sample]| -> Vec<_> {
            let pattern = extractor.pattern(&sweep_of(samples)).expect("a full turn");
            pattern.cells().iter().map(|c| c.rounded_dbm().map(f64::to_bits)).collect()
        };
        let before = rounded(&samples);
        samples.reverse();
        // Mirrored positions sum the windows the other way round.
        for sample in &mut samples {
            sample.position = POSITIONS - 1 - sample.position;
        }
        let mut after = rounded(&samples);
        after.reverse();
        prop_assert_eq!(before, after);
    }

    #[test]
    fn the_bearing_is_where_a_clean_lobe_is(bearing in -3.1..3.1, heading in -3.1..3.1) {
        let patch = PatternTable::reference_patch();
        let conditions = Conditions { bearing, heading, noise_db: 0.0, ..Conditions::default() };
        let samples = simulate(&conditions, &patch, 0);
        let reading = Pritzl2018::default().extract(&sweep_of(&samples)).expect("a full turn");
        let found = reading.bearing.expect("one lobe");
        // Half a position, for the positions need not lie evenly about the peak.
        prop_assert!(angle::distance(found.angle, bearing) < 0.5 * 0.0491 + 1e-9);
        // The lobe falls 2 dB by 29°; positions and whole decibels add less than 4°.
        prop_assert!((0.45..0.62).contains(&found.sigma), "σ {}", found.sigma);
        prop_assert!((reading.rss_dbm + 60.0).abs() < 0.01, "level {}", reading.rss_dbm);
    }
}

fn clean() -> Vec<Sample> {
    simulate(&Conditions::default(), &PatternTable::reference_patch(), 7)
}

#[test]
fn what_is_no_sweep_is_refused_by_name() {
    let extractor = Pritzl2018::default();
    let mut samples = clean();
    samples[5].rss_dbm = f64::NAN;
    assert!(matches!(
        extractor.extract(&sweep_of(&samples)),
        Err(NoReading::NotFinite { index: 5, field: "rss_dbm", .. })
    ));
    let mut samples = clean();
    samples[9].boresight = f64::INFINITY;
    assert!(matches!(
        extractor.extract(&sweep_of(&samples)),
        Err(NoReading::NotFinite { index: 9, field: "boresight", .. })
    ));
    let mut samples = clean();
    samples[3].position = POSITIONS;
    assert_eq!(
        extractor.extract(&sweep_of(&samples)),
        Err(NoReading::Position { index: 3, position: POSITIONS, positions: POSITIONS })
    );
    let samples = clean();
    for positions in [0, Pattern::CAPACITY + 1] {
        assert_eq!(
            extractor.extract(&Sweep { positions, ..sweep_of(&samples) }),
            Err(NoReading::Capacity { positions, capacity: Pattern::CAPACITY })
        );
    }
}

#[test]
fn a_longest_turn_and_a_shortest_one_have_room() {
    for positions in [1, 2, 6, Pattern::CAPACITY] {
        let samples: Vec<Sample> = (0..positions)
            .map(|position| Sample { position, boresight: nominal(position, positions), ..SILENT })
            .collect();
        let sweep = Sweep { positions, ..sweep_of(&samples) };
        let reading = Pritzl2018::default().extract(&sweep).expect("a turn");
        assert!(reading.bearing.is_err() && reading.rss_dbm.abs() < 1e-12);
    }
}

/// A window of 7 on a turn of 3 is the mean over the turn: no position counts twice.
#[test]
fn a_window_never_laps_the_turn() {
    let samples: Vec<Sample> = (0..3)
        .map(|position| Sample { position, rss_dbm: -10.0 * f64::from(position), ..SILENT })
        .collect();
    let sweep = Sweep { positions: 3, ..sweep_of(&samples) };
    let pattern = Pattern::new(&sweep, 7).expect("a turn");
    for cell in pattern.cells() {
        assert!(cell.smoothed_dbm().is_some_and(|dbm| abs_diff_eq!(dbm, -10.0, epsilon = 1e-12)));
    }
}

#[test]
fn a_bearing_that_is_too_wide_is_none() {
    let extractor = Pritzl2018::default().with_max_sigma(0.3).expect("positive");
    let reading = extractor.extract(&sweep_of(&clean())).expect("a full turn");
    assert!(matches!(reading.bearing, Err(NoBearing::TooWide { limit: 0.3, .. })));
}

#[test]
fn too_few_positions_have_a_level_but_no_bearing() {
    let samples: Vec<Sample> = clean().into_iter().filter(|s| s.position % 9 == 0).collect();
    let reading = Pritzl2018::default().extract(&sweep_of(&samples)).expect("some");
    assert_eq!(reading.bearing, Err(NoBearing::TooSparse { measured: 15, needed: 16 }));
}

#[test]
fn the_floor_is_under_a_sharp_lobe() {
    // One position stands out by far more than the moving mean and rounding can level.
    let samples: Vec<Sample> = (0..POSITIONS)
        .map(|position| {
            let boresight = nominal(position, POSITIONS);
            let rss_dbm = if position == 40 { -20.0 } else { -90.0 };
            Sample { position, boresight, rss_dbm, ..SILENT }
        })
        .collect();
    let plain = Pritzl2018::default().with_window(1).expect("odd");
    let bearing = plain.extract(&sweep_of(&samples)).expect("a turn").bearing.expect("one lobe");
    assert_abs_diff_eq!(bearing.sigma, 0.05, epsilon = 1e-15);
    assert!(angle::distance(bearing.angle, samples[40].boresight) < 1e-12);
}

#[test]
fn the_settings_are_checked() {
    let extractor = Pritzl2018::default();
    assert!(extractor.with_window(4).is_err() && extractor.with_window(361).is_err());
    assert!(extractor.with_rss_sigma_db(0.0).is_err());
    assert!(extractor.with_width_db(-1.0).is_err());
    assert!(extractor.with_max_sigma(f64::NAN).is_err());
    assert!(extractor.with_min_sigma(-0.1).is_err());
    assert!(extractor.with_min_positions(0).is_err());
}

/// The confidence of a turn of `positions` with the power 1 + cos a in milliwatt at those
/// `received`.
fn cardioid_confidence(positions: u16, received: impl Fn(u16) -> bool) -> f64 {
    let samples: Vec<Sample> = (0..positions)
        .filter(|position| received(*position))
        .map(|position| {
            let boresight = nominal(position, positions);
            let rss_dbm = 10.0 * (1.001 + boresight.cos()).log10();
            Sample { position, boresight, rss_dbm, ..SILENT }
        })
        .collect();
    let sweep = Sweep { positions, ..sweep_of(&samples) };
    resultant_confidence(&Pattern::new(&sweep, 7).expect("a turn"))
}

/// ∫(1 + cos a) cos a over ∫(1 + cos a) is one half, exactly so on equally spaced positions; the
/// pedestal that keeps the logarithm finite takes a thousandth.
#[test]
fn confidence_is_the_resultant_of_the_power() {
    let exact = 0.5 / 1.001;
    for positions in [16, 128] {
        let confidence = cardioid_confidence(positions, |_| true);
        assert_abs_diff_eq!(confidence, exact, epsilon = 1e-9);
    }
    // Every fourth position stands for as much of the circle as all of them.
    let sparse = cardioid_confidence(128, |position| position % 4 == 0);
    assert_abs_diff_eq!(sparse, exact, epsilon = 1e-9);
}

/// Positions crowd the half of the circle with the lobe: each weighs its arc, not its count.
#[test]
fn confidence_weighs_arcs() {
    let uneven = cardioid_confidence(128, |p| p % 8 == 0 || !(32..96).contains(&p));
    // The trapezoidal sum over uneven arcs is off by the square of the larger step.
    assert_abs_diff_eq!(uneven, 0.5 / 1.001, epsilon = 0.01);
}

/// Missing readings count against the confidence: an arc is 45° at most.
#[test]
fn confidence_counts_what_was_not_received() {
    let half = cardioid_confidence(128, |position| position < 64);
    // 62 arcs of one step, and the cap at either end.
    let received = (62.0 * 360.0 / 128.0 + 2.0 * 45.0) / 360.0;
    assert!(half < received, "{half}");
    let one = cardioid_confidence(128, |position| position == 0);
    assert_abs_diff_eq!(one, 0.125, epsilon = 1e-12);
}
