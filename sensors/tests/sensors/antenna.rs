//! Antennas: their published figures, the laws, the gains of tables between rows, refusals.

use approx::assert_abs_diff_eq;
use core::f64::consts::{FRAC_PI_2, PI, TAU};

use foxhunt_sensors::{
    Antenna, Cardioid, Dipole, Isotropic, ParameterError, Patch, PatternTable, PatternTable3d,
    PatternTableError, PrincipalCuts, Yagi,
};
use proptest::prelude::*;

/// 0 dB ahead, −10 to the left, −20 behind, −6 to the right.
const ROWS: [(f64, f64); 4] = [(-FRAC_PI_2, -6.0), (0.0, 0.0), (FRAC_PI_2, -10.0), (PI, -20.0)];

fn table() -> PatternTable {
    PatternTable::from_rows(&ROWS).expect("a table")
}

/// One of every kind.
fn all() -> Vec<Box<dyn Antenna>> {
    let down = PatternTable::from_rows(&ROWS.map(|(a, g)| (a, 0.5 * g))).expect("a table");
    let grid = vec![(-1.5, down.clone()), (0.0, table()), (1.0, down.clone())];
    vec![
        Box::new(Isotropic),
        Box::new(Dipole),
        Box::new(Cardioid::default()),
        Box::new(Cardioid::new(25.0).expect("positive")),
        Box::new(Patch::new(1.2, 0.8, 17.0).expect("in range")),
        Box::new(Yagi::new(5, 0.25, 20.0).expect("in range")),
        Box::new(table()),
        Box::new(PatternTable3d::from_rows(grid).expect("a table")),
        Box::new(PrincipalCuts::new(8.0, table(), down)),
    ]
}

proptest! {
    #[test]
    fn the_gain_is_finite_and_periodic(azimuth in -20.0..20.0, elevation in -1.6..1.6) {
        let elevation = f64::clamp(elevation, -FRAC_PI_2, FRAC_PI_2);
        for antenna in all() {
            let gain = antenna.gain_dbi(azimuth, elevation);
            prop_assert!(gain.is_finite(), "{antenna:?}");
            let after = antenna.gain_dbi(azimuth + TAU, elevation);
            prop_assert!((gain - after).abs() < 1e-9, "{antenna:?}: {gain} and {after} dB");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn the_mean_is_that_over_the_turn(elevation in -1.5..1.5) {
        for antenna in all() {
            let gain = |i: u16| antenna.gain_dbi(f64::from(i) * TAU / 36e2, elevation);
            let mean = (0..3600).map(gain).sum::<f64>() / 3600.0;
            // A spline that is cut off at its rows is no cubic there, which its mean takes it for.
            let ours = antenna.mean_gain_db(elevation);
            prop_assert!((ours - mean).abs() < 0.05, "{antenna:?}: {ours}, should be {mean}");
        }
    }
}

/// Balanis 2016, eq. 4-91 and §4.6: 1.643 and 78°. With Cin(2π) to more digits 2.1509 dBi, 78.08°.
#[test]
fn the_dipole_has_the_textbook_figures() {
    let dipole = Dipole;
    assert_abs_diff_eq!(dipole.directivity_dbi(), 2.1509, epsilon = 1e-3);
    assert_abs_diff_eq!(dipole.main_lobe().gain_dbi, 2.1509, epsilon = 1e-4);
    let width = dipole.elevation_half_power_beamwidth().expect("it has nulls").to_degrees();
    assert_abs_diff_eq!(width, 78.08, epsilon = 0.01);
    assert_eq!(dipole.half_power_beamwidth(), None);
    // cos(π/2 · sin 30°) / cos 30° = √½ / √¾.
    let at_30 = dipole.gain_dbi(0.3, PI / 6.0) - dipole.gain_dbi(0.3, 0.0);
    assert_abs_diff_eq!(at_30, 10.0 * (2.0_f64 / 3.0).log10(), epsilon = 1e-12);
    for pole in [FRAC_PI_2, -FRAC_PI_2] {
        assert!((dipole.gain_dbi(0.0, pole) - 2.1509 + 60.0).abs() < 1e-3, "the null is filled");
    }
}

/// A cardioid's half-power points are where cos ψ = √2 − 1; its directivity is 3.
#[test]
fn the_cardioid_has_the_textbook_figures() {
    let cardioid = Cardioid::default();
    let width = 2.0 * (2.0_f64.sqrt() - 1.0).acos();
    for ours in [cardioid.half_power_beamwidth(), cardioid.elevation_half_power_beamwidth()] {
        assert_abs_diff_eq!(ours.expect("it is directional"), width, epsilon = 1e-9);
    }
    assert_abs_diff_eq!(cardioid.main_lobe().gain_dbi, 10.0 * 3.0_f64.log10(), epsilon = 1e-12);
    assert_abs_diff_eq!(cardioid.front_to_back_db(), 60.0, epsilon = 1e-9);
    let limacon = Cardioid::new(20.0).expect("positive");
    assert_abs_diff_eq!(limacon.front_to_back_db(), 20.0, epsilon = 1e-9);
}

#[test]
fn a_patch_has_the_figures_of_its_data_sheet() {
    for (across, up, ratio) in [(70.0_f64, 70.0_f64, 17.0), (86.0, 60.0, 20.0), (30.0, 15.0, 30.0)]
    {
        let patch = Patch::new(across.to_radians(), up.to_radians(), ratio).expect("in range");
        let width = patch.half_power_beamwidth().expect("it is directional").to_degrees();
        // Only the tail of the back lobe is on top.
        assert_abs_diff_eq!(width, across, epsilon = 0.1);
        let width = patch.elevation_half_power_beamwidth().expect("it is directional");
        assert_abs_diff_eq!(width.to_degrees(), up, epsilon = 0.1);
        assert_abs_diff_eq!(patch.front_to_back_db(), ratio, epsilon = 0.01);
    }
}

/// Balanis 2016, table 6.3: the array's beamwidth 2 acos(1 − 0.1398 / (n d/λ)).
#[test]
fn a_yagi_is_as_wide_as_a_hansen_woodyard_array() {
    for elements in [3_u16, 5, 10, 20] {
        let yagi = Yagi::new(elements, 0.25, 40.0).expect("in range");
        let width = yagi.half_power_beamwidth().expect("it is directional");
        let expected = 2.0 * (1.0 - 0.1398 / (f64::from(elements) * 0.25)).acos();
        // The formula is one for long arrays.
        assert_abs_diff_eq!(width / expected, 1.0, epsilon = 0.05);
        let lobe = yagi.main_lobe();
        assert_abs_diff_eq!(lobe.azimuth, 0.0, epsilon = 1e-9);
        assert_abs_diff_eq!(lobe.elevation, 0.0, epsilon = 1e-9);
        let narrower = yagi.elevation_half_power_beamwidth().expect("it is directional");
        assert!(narrower < width, "the dipoles' own pattern narrows it");
    }
}

/// Formulas claim to be lossless: gain is directivity.
#[test]
fn a_lossless_antenna_has_the_gain_of_its_directivity() {
    for antenna in all().iter().take(6) {
        let lobe = antenna.main_lobe();
        let directivity = antenna.directivity_dbi();
        assert!((lobe.gain_dbi - directivity).abs() < 1e-3, "{antenna:?}: {directivity} dBi");
    }
}

#[test]
fn what_is_out_of_range_is_refused_by_name() {
    let named = |refused: Result<(), ParameterError>, name: &str| {
        let error = refused.expect_err(name).to_string();
        assert!(error.contains(name), "{error:?} does not name {name}");
    };
    named(Cardioid::new(0.0).map(drop), "front_to_back_db");
    named(Patch::new(0.0, 1.0, 17.0).map(drop), "azimuth_beamwidth");
    named(Patch::new(1.0, 3.2, 17.0).map(drop), "elevation_beamwidth");
    named(Patch::new(1.0, 1.0, f64::NAN).map(drop), "front_to_back_db");
    named(Yagi::new(2, 0.25, 17.0).map(drop), "elements");
    named(Yagi::new(5, 0.31, 17.0).map(drop), "spacing_wavelengths");
    named(Yagi::new(5, 0.25, -3.0).map(drop), "front_to_back_db");
}

#[test]
fn a_table_is_exact_at_its_rows_and_closes_on_itself() {
    let table = table();
    for (angle, gain) in ROWS {
        for turns in [-2.0, 0.0, 1.0] {
            let ours = table.gain_db(angle + turns * TAU);
            assert!((ours - gain).abs() < 1e-9, "{ours} dB at {angle}, should be {gain}");
        }
    }
    assert_abs_diff_eq!(table.gain_db(PI - 1e-9), table.gain_db(1e-9 - PI), epsilon = 1e-6);
    assert_eq!(table.rows().map(|(_, gain)| gain).collect::<Vec<_>>(), ROWS.map(|(_, g)| g));
}

/// Equal steps: the mean of a spline is that of its rows.
#[test]
fn a_tables_figures_are_those_of_its_rows() {
    let round = PatternTable::equally_spaced(&[2.0; 8]).expect("a table");
    assert_eq!(round.half_power_beamwidth(), None);
    assert_eq!(table().elevation_half_power_beamwidth(), None, "the same at every elevation");
    assert_abs_diff_eq!(round.mean_gain_db(0.3), 2.0, epsilon = 1e-12);
    assert_abs_diff_eq!(round.front_to_back_db(), 0.0, epsilon = 1e-12);
    let wave: Vec<f64> = (0..72_u16).map(|i| 5.0 * (f64::from(i) * TAU / 72.0).cos()).collect();
    let wave = PatternTable::equally_spaced(&wave).expect("a table");
    assert_abs_diff_eq!(wave.mean_gain_db(0.0), 0.0, epsilon = 1e-12);
    assert_abs_diff_eq!(wave.front_to_back_db(), 10.0, epsilon = 1e-12);
    let width = 2.0 * (1.0 - 0.2 * 10.0 * 2.0_f64.log10()).acos();
    let ours = wave.half_power_beamwidth().expect("it is directional");
    // The spline's bound: 5/384 of the step to its fourth power, times 5 dB, over the slope.
    assert_abs_diff_eq!(ours, width, epsilon = 2e-6);
    // The lobe may lie across the table's ends.
    let turned: Vec<_> = wave.rows().map(|(angle, gain)| (angle - 3.0, gain)).collect();
    let turned = PatternTable::from_rows(&turned).expect("a table");
    assert_abs_diff_eq!(turned.half_power_beamwidth().expect("as above"), ours, epsilon = 1e-9);
    assert_abs_diff_eq!(turned.main_lobe().azimuth.rem_euclid(TAU), TAU - 3.0, epsilon = 1e-3);
}

#[test]
fn a_null_one_row_wide_does_not_ring_above_the_maximum() {
    let mut gains = [0.0; 360];
    gains[90] = -40.0;
    let table = PatternTable::equally_spaced(&gains).expect("a table");
    for i in 0..3600_u16 {
        let gain = table.gain_db(f64::from(i) * TAU / 3600.0);
        assert!((-40.0..=0.0).contains(&gain), "{gain} dB");
    }
    assert_abs_diff_eq!(table.gain_db(FRAC_PI_2), -40.0, epsilon = 1e-9);
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
        // Within the table's range, whatever the wrap and the ringing.
        let low = gains.iter().copied().fold(f64::INFINITY, f64::min);
        let high = gains.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        prop_assert!((low..=high).contains(&gain));
    }
}

#[test]
fn a_3d_table_is_linear_from_row_to_row_and_stays_beyond() {
    let level = PatternTable::equally_spaced(&[4.0; 4]).expect("a table");
    let grid = vec![(-0.5, level.clone()), (0.5, table())];
    let grid = PatternTable3d::from_rows(grid).expect("a table");
    for (elevation, gain) in [(-1.5, 4.0), (-0.5, 4.0), (0.0, -3.0), (0.5, -10.0), (1.5, -10.0)] {
        let ours = grid.gain_dbi(FRAC_PI_2, elevation);
        assert!((ours - gain).abs() < 1e-9, "{ours} dB at {elevation}, should be {gain}");
    }
    let refused = |rows: &[f64]| {
        let rows = rows.iter().map(|e| (*e, level.clone())).collect();
        PatternTable3d::from_rows(rows).err()
    };
    assert_eq!(refused(&[]), Some(PatternTableError::TooFew { rows: 0, needed: 1 }));
    let beyond = PatternTableError::Elevation { row: 0, elevation: 2.0 };
    assert_eq!(refused(&[2.0]), Some(beyond));
    assert_eq!(refused(&[0.1, 0.1]), Some(PatternTableError::Order { row: 1, angle: 0.1 }));
    assert!(refused(&[0.1, f64::NAN]).is_some());
}

#[test]
fn principal_cuts_are_the_cuts_themselves() {
    // Both cuts have their maximum ahead.
    let lobe = |deepest: f64| {
        let rows = (0..72_u16).map(|i| deepest * (1.0 - (f64::from(i) * TAU / 72.0).cos()));
        PatternTable::equally_spaced(&rows.collect::<Vec<_>>()).expect("a table")
    };
    let (across, up) = (lobe(-8.0), lobe(-12.0));
    let antenna = PrincipalCuts::new(9.0, across.clone(), up.clone());
    for i in 1..180_u16 {
        let angle = f64::from(i).to_radians();
        let ours = antenna.gain_dbi(angle, 0.0) - 9.0;
        assert!((ours - across.gain_db(angle)).abs() < 1e-9, "{ours} dB at azimuth {i}°");
        if i < 90 {
            let ours = antenna.gain_dbi(0.0, angle) - 9.0;
            assert!((ours - up.gain_db(angle)).abs() < 1e-9, "{ours} dB at elevation {i}°");
        }
    }
    assert_abs_diff_eq!(antenna.gain_dbi(0.0, 0.0), 9.0, epsilon = 1e-12);
    // By hand at h = v = ½: equal weights make 2 · −3.01 dB / √2.
    let half = 10.0 * 2.0_f64.log10();
    let at = |deepest: f64| (1.0 - half / deepest).acos();
    let ours = antenna.gain_dbi(at(8.0), at(12.0)) - 9.0;
    assert_abs_diff_eq!(ours + half * 2.0_f64.sqrt(), 0.0, epsilon = 1e-4);
}

#[test]
fn what_is_no_table_is_refused() {
    let refused = |rows: &[(f64, f64)]| PatternTable::from_rows(rows).err();
    assert_eq!(refused(&ROWS[..2]), Some(PatternTableError::TooFew { rows: 2, needed: 3 }));
    let nan = PatternTable::equally_spaced(&[0.0, 1.0, f64::NEG_INFINITY]).err();
    let value = f64::NEG_INFINITY;
    assert_eq!(nan, Some(PatternTableError::NotFinite { row: 2, field: "gain", value }));
    let loud = PatternTable::equally_spaced(&[0.0, 1e4, 0.0]).err();
    assert_eq!(loud, Some(PatternTableError::Gain { row: 1, gain: 1e4, limit: 1000.0 }));
    let twice = [(0.0, 1.0), (1.0, 1.0), (1.0, 1.0)];
    assert_eq!(refused(&twice), Some(PatternTableError::Order { row: 2, angle: 1.0 }));
    let closed = [(0.0, 1.0), (1.0, 1.0), (TAU, 1.0)];
    assert_eq!(refused(&closed), Some(PatternTableError::Span { span: TAU }));
}
