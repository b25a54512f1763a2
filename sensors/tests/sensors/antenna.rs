//! Antenna tables: what they say between rows, and what is no table.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use foxhunt_sensors::{Antenna, PatternTable, PatternTableError};
use proptest::prelude::*;

/// 0 dB ahead, −10 to the left, −20 behind, −6 to the right.
const ROWS: [(f64, f64); 4] = [(-FRAC_PI_2, -6.0), (0.0, 0.0), (FRAC_PI_2, -10.0), (PI, -20.0)];

#[test]
fn between_rows_it_is_linear_and_it_closes_on_itself() {
    let table = PatternTable::from_rows(&ROWS).expect("a table");
    for (angle, gain) in [
        (0.0, 0.0),
        (0.25 * PI, -5.0),
        (-0.25 * PI, -3.0),
        (0.75 * PI, -15.0),
        (PI, -20.0),
        (-PI, -20.0),
        (1.25 * PI, -13.0),
        (1.5 * PI - 1e-12, -6.0),
    ] {
        for turns in [-2.0, 0.0, 1.0] {
            let ours = table.gain_db(angle + turns * TAU);
            assert!((ours - gain).abs() < 1e-9, "{ours} dB at {angle}, should be {gain}");
        }
    }
}

/// By hand: the mean of four equal strips; −3.0103 dB at 0.30103 · 90° to the left and 0.50172 · 90° to
/// the right.
#[test]
fn its_figures_are_those_of_the_straight_lines() {
    let table = PatternTable::from_rows(&ROWS).expect("a table");
    assert!((table.mean_gain_db(0.0) + 9.0).abs() < 1e-12);
    assert!((table.front_to_back_db() - 20.0).abs() < 1e-12);
    let half = 2.0_f64.log10() * 10.0;
    let width = (half / 10.0 + half / 6.0) * FRAC_PI_2;
    let ours = table.half_power_beamwidth().expect("it is directional");
    assert!((ours - width).abs() < 1e-12, "{ours}, should be {width}");
    // Rows at unequal steps weigh by them.
    let uneven =
        PatternTable::from_rows(&[(0.0, 0.0), (1.0, -6.0), (4.0, -12.0)]).expect("a table");
    let mean = (-3.0 - 9.0 * 3.0 - 6.0 * (TAU - 4.0)) / TAU;
    assert!((uneven.mean_gain_db(0.0) - mean).abs() < 1e-12);
    // The lobe may lie across the table's ends.
    let turned = ROWS.map(|(angle, gain)| (angle + 2.0 * FRAC_PI_2, gain));
    let turned = PatternTable::from_rows(&turned).expect("a table");
    let ours = turned.half_power_beamwidth().expect("it is directional");
    assert!((ours - width).abs() < 1e-12);
    let round = PatternTable::equally_spaced(&[2.0; 8]).expect("a table");
    assert_eq!(round.half_power_beamwidth(), None);
    assert!(
        (round.mean_gain_db(0.0) - 2.0).abs() < 1e-12 && round.front_to_back_db().abs() < 1e-12
    );
}

proptest! {
    #[test]
    fn equally_spaced_is_rows_at_equal_steps(
        gains in prop::collection::vec(-40.0..10.0, 3..100), angle in -20.0..20.0,
    ) {
        let step = TAU / f64::from(u16::try_from(gains.len()).expect("a few"));
        let rows: Vec<(f64, f64)> =
            (0_u16..).zip(&gains).map(|(i, &g)| (f64::from(i) * step, g)).collect();
        let (a, b) = (PatternTable::equally_spaced(&gains), PatternTable::from_rows(&rows));
        let (a, b) = (a.expect("a table"), b.expect("a table"));
        let gain = a.gain_db(angle);
        prop_assert!((gain - b.gain_db(angle)).abs() < 1e-9);
        // Between the neighbours, whatever the wrap.
        let low = gains.iter().copied().fold(f64::INFINITY, f64::min);
        let high = gains.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        prop_assert!((low - 1e-9..=high + 1e-9).contains(&gain));
        let mean = gains.iter().sum::<f64>() / (TAU / step);
        prop_assert!((a.mean_gain_db(0.0) - mean).abs() < 1e-9);
    }
}

#[test]
fn what_is_no_table_is_refused() {
    let refused = |rows: &[(f64, f64)]| PatternTable::from_rows(rows).err();
    assert_eq!(refused(&ROWS[..2]), Some(PatternTableError::TooFew { rows: 2, needed: 3 }));
    let nan = PatternTable::equally_spaced(&[0.0, 1.0, f64::NEG_INFINITY]).err();
    let value = f64::NEG_INFINITY;
    assert_eq!(nan, Some(PatternTableError::NotFinite { row: 2, field: "gain", value }));
    let twice = [(0.0, 1.0), (1.0, 1.0), (1.0, 1.0)];
    assert_eq!(refused(&twice), Some(PatternTableError::Order { row: 2, angle: 1.0 }));
    let closed = [(0.0, 1.0), (1.0, 1.0), (TAU, 1.0)];
    assert_eq!(refused(&closed), Some(PatternTableError::Span { span: TAU }));
}
