//! A ground station's fixed antennas as one coarse pattern, on recordings beside the checkout.

use foxhunt_archive::{
    recorded::{CalibrateConfig, RecordedError, StationConfig, calibrate_bearings, fit_boresights},
    recording::{ReadOptions, Recording},
};
use foxhunt_sensors::{AtSite, FirstHarmonic, Site};

use crate::support::shared;

fn recording(name: &str) -> Option<Recording> {
    let path = shared(name)?;
    Some(Recording::read(&path, &ReadOptions::default()).expect("it can be read"))
}

/// Every day's bearings by what was fitted to the other days. The strongest antenna alone has a
/// median error of 24° to 26°, as the boresights are documented or fitted; half of a circle's
/// directions are within 90°.
#[test]
fn days_that_were_not_fitted_have_honest_bearings() {
    let Some(recording) = recording("uri_yagi_station/detections.csv") else { return };
    let config = StationConfig::default();
    let mut fitted = fit_boresights(&[&[recording]], Some("tag"), &config).expect("a fit");
    let calibration = fitted.stations.remove(0).expect("a station");
    assert!(calibration.fit.doubts.is_empty(), "{:?}", calibration.fit.doubts);
    let unfitted = calibration.cross_validation.as_ref().expect("bearings of every day");
    assert_eq!(calibration.groups, 7, "seven days");
    assert!(unfitted.bearings > 900 && unfitted.refused < 120, "{unfitted:?}");
    assert!(unfitted.median_error < 22_f64.to_radians(), "{unfitted:?}");
    assert!((0.90..=0.98).contains(&unfitted.coverage_95), "{unfitted:?}");
    assert!((0.8..=1.15).contains(&unfitted.sigma.rms_ratio), "{unfitted:?}");
    // A σ that knows which bearing is the better one.
    assert!(unfitted.sigma.correlation.is_some_and(|r| r > 0.2), "{unfitted:?}");

    let pattern = &calibration.fit.pattern;
    // The antennas are Yagis in the four quarters, in the recordings' order from −π on.
    let documented = [245.0_f64, 155.0, 65.0, 335.0];
    for (antenna, half) in pattern.antennas().iter().zip(&calibration.fit.boresight_half_intervals)
    {
        let compass = (90.0 - antenna.boresight.to_degrees()).rem_euclid(360.0);
        let off = documented.iter().map(|d| (d - compass).abs()).fold(f64::INFINITY, f64::min);
        assert!(off < 15.0 && (1.0..40.0).contains(&half.to_degrees()), "{antenna:?} ± {half}");
    }
    assert!((25.0..60.0).contains(&pattern.beamwidth().to_degrees()), "{pattern:?}");
    assert!((3.5..6.0).contains(&pattern.residual_db()), "{pattern:?}");
    let [floor, _] = pattern.floor().expect("it was fitted");
    assert!((-110.0..=-103.0).contains(&floor), "{floor}");
}

/// Without a calibration: four readings in a wooded valley make bearings whose own σ holds a
/// quarter of the truths. The σ of an unknown site, from published measurements alone, holds nine
/// in ten.
#[test]
fn bearings_of_an_unknown_site_are_honest() {
    let Some(recording) = recording("uri_yagi_station/detections.csv") else { return };
    let held = |site: Option<Site>| {
        let plain = FirstHarmonic::default();
        let config = CalibrateConfig::default();
        let recordings = std::slice::from_ref(&recording);
        let fit = match site {
            None => calibrate_bearings(recordings, Some("tag"), &plain, &config),
            Some(site) => {
                calibrate_bearings(recordings, Some("tag"), &AtSite::new(plain, site), &config)
            }
        };
        fit.expect("bearings").sigma.expect("a fit").coverage_95
    };
    let own = held(None);
    let unknown = held(Some(Site::Unknown));
    assert!(own < 0.35, "{own}");
    assert!((0.88..=0.97).contains(&unknown), "{unknown}");
}

#[test]
fn an_antenna_that_turns_is_no_station() {
    let Some(recording) = recording("uavrt_rotation/rotation_B_2023-06.csv") else { return };
    let gathered = fit_boresights(&[&[recording]], Some("4"), &StationConfig::default());
    assert!(matches!(gathered, Err(RecordedError::NoStation { .. })), "{gathered:?}");
}
