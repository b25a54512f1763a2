//! Meaning of single columns of our own format.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use foxhunt_archive::recording::{Column, Mapping, North, ReadOptions, Record, Recording};
use foxhunt_core::angle::distance;
use nalgebra::{Vector2, Vector3};

fn read(text: &str) -> Recording {
    Recording::from_reader(text.as_bytes(), "dir/flight7.csv", &ReadOptions::default())
        .expect("a recording")
}

fn place(record: &Record) -> Vector3<f64> {
    record.receiver().expect("located").position
}

#[test]
fn bearings_bring_their_sigma() {
    let recording =
        read("east_m,north_m,bearing_deg_compass,bearing_sigma_deg\n0,0,225,18\n0,0,-45,\n");
    let [first, second] = recording.records() else { panic!("two rows") };
    let first = first.bearing.expect("one");
    let second = second.bearing.expect("one");
    assert!(distance(first.angle, -3.0 * FRAC_PI_4) < 1e-14, "225° looks South-West");
    assert_abs_diff_eq!(first.sigma.expect("given"), PI / 10.0, epsilon = 1e-15);
    assert!(distance(second.angle, 3.0 * FRAC_PI_4) < 1e-14 && second.sigma.is_none());
    assert!(recording.is_calibrated(), "there is no level in unknown units");
    assert_eq!(recording.drones(), ["flight7"], "the file names the drone");
}

#[test]
fn heights_are_above_the_ground_or_above_the_origin() {
    // 5 km to the North the flat frame is 2 m above the ellipsoid.
    let rows = ["50,14", "50.045,14"];
    let heights = |column: &str, values: [&str; 2]| {
        let text = format!(
            "lat_deg,lon_deg,{column},rss_dbm\n{},{},-60\n{},{},-60\n",
            rows[0], values[0], rows[1], values[1]
        );
        let recording = read(&text);
        let up: Vec<_> = recording.records().iter().map(|record| place(record).z).collect();
        (up, recording.frame().expect("in degrees").origin().alt_m)
    };
    assert_eq!(heights("alt_agl_m", ["30", "40"]), (vec![30.0, 40.0], 0.0));
    assert_eq!(heights("beacon", ["x", "y"]).0, [0.0, 0.0], "unknown heights are 0");
    let (up, origin) = heights("alt_m", ["330", "340"]);
    assert_abs_diff_eq!(origin, 330.0, epsilon = 1e-12);
    assert_abs_diff_eq!(up[0], 0.0, epsilon = 1e-8);
    // pymap3d 3.2.0: geodetic2enu(50.045, 14, 340, 50, 14, 330)
    assert_abs_diff_eq!(up[1], 8.034305211, epsilon = 1e-6);
}

#[test]
fn an_empty_height_is_not_known() {
    let text = "lat_deg,lon_deg,alt_m,rss_dbm\n50,14,330,-60\n50,14,,-60\n";
    let recording = read(text);
    assert!(place(&recording.records()[1]).norm() < 1e-8, "taken at the origin's height");
    // Higher up a degree is longer. pymap3d 3.2.0: geodetic2enu(50.09, 14, 3000, 50, 14, 3000)
    let text = "lat_deg,lon_deg,alt_m,rss_dbm\n50,14,3000,-60\n50.09,14,,-60\n";
    let far = place(&read(text).records()[1]);
    assert!((far - Vector3::new(0.0, 10015.402072706074, 0.0)).norm() < 1e-6, "{far}");
}

#[test]
fn truth_in_degrees_shares_the_frame() {
    let text =
        "lat_deg,lon_deg,truth_lat_deg,truth_lon_deg,rss_dbm\n50,14,50.001,14,-60\n50,14,,,-60\n";
    let recording = read(text);
    let truth = recording.records()[0].truth.expect("given");
    // pymap3d 3.2.0: geodetic2enu(50.001, 14, 0, 50, 14, 0)
    assert!((truth - Vector2::new(0.0, 111.229_073_619_5)).norm() < 1e-6, "{truth}");
    assert_eq!(recording.records()[1].truth, None);
}

#[test]
fn bounds_of_filters_are_inside() {
    let mapping = "name = 'm'\ndescription = 'd'\nheader = ['h']\n[columns]\nrss_db = 'rss'\n\
                   [[keep]]\ncolumn = 'h'\nmin = 15\nmax = 20\n";
    let mapping = Mapping::parse(mapping, "m.toml").expect("a mapping");
    let text = "h,rss\n14.999,1\n15,2\n20,3\n20.001,4\n,5\nnan,6\n";
    let options = ReadOptions::default().with_format(mapping);
    let recording = Recording::from_reader(text.as_bytes(), "m.csv", &options).expect("two rows");
    let kept: Vec<_> = recording.records().iter().filter_map(|record| record.rss_dbm).collect();
    assert_eq!(kept, [2.0, 3.0]);
    assert_eq!(recording.dropped()[0].rows, 4);
    assert_eq!(recording.dropped()[0].rule, "h ≥ 15 and h ≤ 20");
}

#[test]
fn what_is_not_read_is_listed() {
    let recording = read("rss_db,rss_dbmm,range_m,note\n-60,1,2,hello\n");
    assert_eq!(recording.ignored_columns(), ["rss_dbmm", "note"]);
    assert!(!recording.is_calibrated() && recording.frame().is_none());
    assert_eq!(recording.file(), "dir/flight7.csv");
}

#[test]
fn a_constant_replaces_a_column_that_is_not_there() {
    let lenth = Mapping::find("lenth1981").expect("shipped");
    let options = ReadOptions::default().with_format(lenth).with_constant(Column::EastM, 3.0);
    for text in ["y,bearing_deg\n2,45\n", "x,y,bearing_deg\n9,2,45\n"] {
        let recording = Recording::from_reader(text.as_bytes(), "b.csv", &options).expect("a row");
        assert!((place(&recording.records()[0]).xy() - Vector2::new(3.0, 2.0)).norm() < 1e-12);
    }
}

/// The compass angle from true North of each row's bearing, heading and boresight.
fn turned(text: &str, options: &ReadOptions) -> Result<Vec<[f64; 3]>, String> {
    let recording = Recording::from_reader(text.as_bytes(), "b.csv", options);
    let recording = recording.map_err(|error| error.to_string())?;
    let compass = |radians: f64| (FRAC_PI_2 - radians).to_degrees().rem_euclid(360.0);
    let angles = |record: &Record| {
        let bearing = record.bearing.map_or(f64::NAN, |bearing| compass(bearing.angle));
        let heading = compass(record.receiver().expect("located").heading);
        [bearing, heading, record.boresight.map_or(f64::NAN, compass)]
    };
    Ok(recording.records().iter().map(angles).collect())
}

#[test]
fn magnetic_angles_are_turned_by_the_declination_of_place_and_day() {
    let magnetic = ReadOptions::default().with_north(North::Magnetic);
    let angles = |text: &str, options: &ReadOptions| turned(text, options).expect("a declination");
    // NOAA's calculator (WMM2025): -5.057° at Taipei on 2026-09-05, -5.144° on 2029-01-01; it gives
    // three digits, and heights of 0.
    let by_time = "lat_deg,lon_deg,time_utc,bearing_deg_compass,heading_deg_compass,antenna_deg\n\
                   25.03,121.56,2026-09-05 12:00:00,90,350,30\n\
                   25.03,121.56,2029-01-01 00:00:00,2,0,0\n";
    let [first, second] = angles(by_time, &magnetic)[..] else { panic!("two rows") };
    for (made, expected) in first.into_iter().chain(second).zip([
        90.0 - 5.057,
        350.0 - 5.057,
        20.0 - 5.057,
        362.0 - 5.144,
        360.0 - 5.144,
        360.0 - 5.144,
    ]) {
        assert_abs_diff_eq!(made, expected, epsilon = 2e-3);
    }
    // 2026-09-05 12:00, where rows have no time or one of an origin of their own.
    let dated = magnetic.clone().with_date(1_788_609_600.0);
    for text in [
        "lat_deg,lon_deg,bearing_deg_compass\n25.03,121.56,90\n",
        "lat_deg,lon_deg,time_s,bearing_deg_compass\n25.03,121.56,3,90\n",
    ] {
        assert_abs_diff_eq!(angles(text, &dated)[0][0], 84.943, epsilon = 2e-3);
        let error = turned(text, &magnetic).expect_err("no day");
        for part in ["b.csv, line 2, bearing_deg_compass: \"90\"", "magnetic", "date"] {
            assert!(error.contains(part), "{error}");
        }
    }
    let error = turned("east_m,north_m,bearing_deg_compass\n0,0,90\n", &dated);
    assert!(error.expect_err("nowhere").contains("no places in degrees"));
    let old = by_time.replace("2029", "2019");
    let error = turned(&old, &magnetic.clone().with_strict(true)).expect_err("before the model");
    assert!(error.contains("line 3") && error.contains("2020 to 2029"), "{error}");
    // Levels alone need no North.
    let levels = "east_m,north_m,rss_dbm\n0,0,-60\n";
    assert!(turned(levels, &magnetic).is_ok());
}

#[test]
fn stated_and_grid_north_turn_angles_too() {
    let degrees = "lat_deg,lon_deg,bearing_deg_compass\n-33.8688,151.2093,10\n";
    let metres = "east_m,north_m,bearing_deg_compass\n600000,4000000,10\n";
    let mapped = |north: &str| {
        let text = format!(
            "name = 'm'\ndescription = 'd'\nheader = []\nnorth = {north}\n[columns]\n\
             lat_deg = 'lat_deg'\nlon_deg = 'lon_deg'\nbearing_deg_compass = 'bearing_deg_compass'\n"
        );
        ReadOptions::default().with_format(Mapping::parse(&text, "m.toml").expect("a mapping"))
    };
    let given = |north| ReadOptions::default().with_north(north);
    // The convergence of UTM zone 56 there is 0.998172°, by differences of Krüger's series.
    for (text, options, expected) in [
        (degrees, given(North::Stated(12.5)), 22.5),
        (metres, given(North::Stated(-11.0)), 359.0),
        (degrees, given(North::Grid), 10.998_172),
        (metres, given(North::Grid), 10.0),
        (degrees, mapped("'grid'"), 10.998_172),
        (degrees, mapped("-2.5"), 7.5),
        (degrees, mapped("-2.5").with_north(North::True), 10.0),
    ] {
        let made = turned(text, &options).expect("a North")[0][0];
        assert!(abs_diff_eq!(made, expected, epsilon = 1e-4), "{options:?}: {made}");
    }
}
