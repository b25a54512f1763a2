//! The recordings beside the checkout. Row counts and values come from a few lines of Python's csv
//! module over the same files.

use approx::assert_abs_diff_eq;
use std::{f64::consts::PI, path::Path};

use foxhunt_archive::{
    recorded::recorded_truth,
    recording::{Column, Mapping, ReadOptions, Recording, RecordingError},
};
use foxhunt_core::{BeaconId, angle::distance};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame, compass_deg_to_radians};
use nalgebra::Vector2;

use crate::support::shared;

fn read(path: &Path) -> Recording {
    Recording::read(path, &ReadOptions::default()).expect("a recording that can be read")
}

/// Radians of a compass angle, compared to rounding.
fn assert_compass(radians: f64, deg_compass: f64) {
    let error = distance(radians, compass_deg_to_radians(deg_compass));
    assert!(error < 1e-12, "{radians} rad is not {deg_compass}° on the compass");
}

#[test]
fn aerpaw_flights_are_read_in_one_frame() {
    // Rows; rows below 15 m; of the others, those without lock; what is left.
    let flights = [
        ("288_loc1", 673, 56, 32, 585),
        ("288_loc2", 722, 57, 264, 401),
        ("288_loc3", 690, 52, 412, 226),
        ("300_loc1", 698, 60, 97, 541),
        ("300_loc2", 705, 61, 198, 446),
        ("300_loc3", 732, 57, 316, 359),
    ];
    let name = |flight: &str| format!("aerpaw_afar/afar_exp{flight}_1hz.csv");
    let paths: Option<Vec<_>> = flights.iter().map(|flight| shared(&name(flight.0))).collect();
    let Some(paths) = paths else { return };
    let recordings = Recording::read_all(&paths, &ReadOptions::default()).expect("all six");
    for (recording, (flight, rows, low, unlocked, kept)) in recordings.iter().zip(flights) {
        assert_eq!(recording.format(), "aerpaw-afar");
        assert_eq!(recording.rows(), rows, "{flight}");
        let dropped: Vec<_> =
            recording.dropped().iter().map(|d| (d.rule.as_str(), d.rows)).collect();
        assert_eq!(dropped, [("alt_agl_m ≥ 15", low), ("quality_db ≥ 60", unlocked)]);
        assert_eq!(recording.records().len(), kept, "{flight}");
        assert!(!recording.is_calibrated() && recording.is_located());
        assert_eq!(recording.frame(), recordings[0].frame());
        assert_eq!(recording.drones(), [format!("afar_exp{flight}_1hz")]);
        assert_eq!(recording.beacons(), [None]);
        assert_eq!(recording.ignored_columns(), ["speed_mps", "vz_mps", "power_sd_db", "n"]);
        assert!(recording.sweeps(128).expect("none").is_empty(), "the antenna has no direction");
        for record in recording.records() {
            let place = record.receiver().expect("located").position;
            // The flights stay within the site, some hundred metres wide.
            assert!((15.0..120.0).contains(&place.z) && place.norm() < 1_000.0, "{place}");
        }
    }
}

#[test]
fn an_aerpaw_row_keeps_its_values() {
    let Some(path) = shared("aerpaw_afar/afar_exp288_loc1_1hz.csv") else { return };
    let recording = read(&path);
    // The first line that passes, as the file has it.
    let text = std::fs::read_to_string(&path).expect("it was read before");
    let first = &recording.records()[0];
    let line = text.lines().nth(usize::try_from(first.line).expect("small") - 1).expect("a line");
    let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
    let receiver = first.receiver().expect("located");
    assert_eq!(first.time, Some(cells[0]));
    assert_eq!(first.rss_dbm, Some(cells[9]));
    assert_abs_diff_eq!(receiver.position.z, cells[3], epsilon = 1e-12);
    assert_compass(receiver.heading, cells[6]);
    assert!(receiver.position.xy().norm() < 1e-6, "the first position is the origin");
    let frame = recording.frame().expect("in degrees");
    assert_abs_diff_eq!(frame.origin().lat_deg, cells[1], epsilon = 1e-12);
    assert_abs_diff_eq!(frame.origin().lon_deg, cells[2], epsilon = 1e-12);
}

#[test]
fn lenths_bearings_bring_their_truth() {
    let Some(path) = shared("lenth1981/bearings.csv") else { return };
    let recording = read(&path);
    assert_eq!((recording.format(), recording.rows()), ("lenth1981", 8));
    assert_eq!(recording.frame(), None, "local metres");
    let stations = [
        (9.0, 3.2, 234.0),
        (9.4, 5.5, 215.0),
        (9.95, 9.05, 196.0),
        (8.7, 8.7, 193.0),
        (8.07, 9.7, 188.0),
        (5.6, 9.0, 250.0),
        (4.4, 8.9, 160.0),
        (1.85, 5.25, 118.0),
    ];
    assert_eq!(recording.records().len(), stations.len());
    for (record, (x, y, bearing)) in recording.records().iter().zip(stations) {
        let place = record.receiver().expect("located").position;
        assert!((place.xy() - Vector2::new(x, y)).norm() < 1e-12 && place.z.abs() < 1e-12);
        let read = record.bearing.expect("a bearing");
        assert_compass(read.angle, bearing);
        assert_eq!((read.sigma, record.rss_dbm), (None, None));
        assert_eq!(record.truth, Some(Vector2::new(7.5, 2.2)), "from the file beside it");
    }
}

#[test]
fn tag_readings_have_ranges_and_no_place() {
    let Some(path) = shared("rssi_distance/vhf_tags.csv") else { return };
    let recording = read(&path);
    assert_eq!((recording.format(), recording.rows()), ("rssi-distance", 847));
    assert_eq!(recording.records().len(), 847);
    assert!(!recording.is_located() && !recording.is_calibrated());
    assert_eq!(recording.beacons(), [Some("0")]);
    let first = &recording.records()[0];
    assert_eq!((first.line, first.known_range), (2, Some(10.0)));
    assert_eq!(first.rss_dbm, Some(-70.516_337_836_134_97));
    let ranges: Vec<_> =
        recording.records().iter().filter_map(|record| record.known_range).collect();
    assert!(ranges.iter().all(|range| (10.0..=320.0).contains(range)) && ranges.len() == 847);
}

#[test]
fn uavrt_rotations_are_one_turn_a_tag() {
    // Rows; those with a ratio; those of each tag; whether there are times.
    for (name, rows, kept, tags, timed) in [
        ("rotation_A_2023-05-22.csv", 209, 208, [("2", 206), ("3", 2)], true),
        ("rotation_B_2023-06.csv", 183, 178, [("2", 3), ("4", 175)], false),
    ] {
        let Some(path) = shared(&format!("uavrt_rotation/{name}")) else { return };
        let recording = read(&path);
        assert_eq!((recording.format(), recording.rows()), ("uavrt-rotation", rows), "{name}");
        assert_eq!(
            recording.records().len(),
            kept,
            "{name}: neither an empty cell nor −9999 dB is a reading"
        );
        assert!(!recording.is_calibrated());
        let sweeps = recording.sweeps(16).expect("16 positions");
        let counts: Vec<_> = sweeps
            .iter()
            .map(|s| (s.beacon_name.as_deref().expect("a tag"), s.sweep.samples.len()))
            .collect();
        assert!(counts.len() == 2 && tags.iter().all(|tag| counts.contains(tag)), "{counts:?}");
        for sweep in &sweeps {
            assert!(
                sweep.located && sweep.sweep.samples.windows(2).all(|w| w[0].time <= w[1].time)
            );
            for sample in &sweep.sweep.samples {
                // 16 positions: within half a step of the nominal angle.
                let nominal = 2.0 * PI * f64::from(sample.position) / 16.0;
                assert!(distance(sample.boresight, nominal) <= PI / 16.0 + 1e-12);
            }
        }
        assert_eq!(recording.records()[0].time.is_some(), timed);
    }
    let Some(path) = shared("uavrt_rotation/rotation_A_2023-05-22.csv") else { return };
    let recording = read(&path);
    let first = &recording.records()[0];
    assert_eq!(first.rss_dbm, Some(36.843_531));
    assert_compass(first.boresight.expect("directional"), 43.326);
    let receiver = first.receiver().expect("located");
    assert!((receiver.position.z - 9.693_001).abs() < 1e-12, "relative to the take-off");
    assert_compass(receiver.heading, 43.326);
}

#[test]
fn the_yagi_station_receives_bursts() {
    let Some(path) = shared("uri_yagi_station/detections.csv") else { return };
    let recording = read(&path);
    assert_eq!((recording.format(), recording.rows()), ("uri-yagi-station", 3798));
    assert_eq!(recording.records().len(), 3798);
    assert!(recording.is_calibrated());
    let omni = recording.records().iter().filter(|record| record.boresight.is_none()).count();
    assert_eq!(omni, 681);
    let first = &recording.records()[0];
    assert_compass(first.boresight.expect("antenna 3"), 65.0);
    assert_eq!((first.rss_dbm, first.time), (Some(-97.0), Some(1_616_345_508.0)));
    // pymap3d 3.2.0: geodetic2enu(41.53591, -71.58314, 0, 41.520752667, -71.599254667, 0).
    let truth = first.truth.expect("a tag with GPS");
    assert!((truth - Vector2::new(1_344.769_394, 1_683.561_398)).norm() < 1e-6, "{truth}");
    let frame = recording.frame().expect("in degrees");
    assert!((frame.origin().lat_deg - 41.520_752_667).abs() < 1e-12, "from station.csv");

    let sweeps = recording.sweeps(4).expect("4 positions");
    // Bursts of at least one of the four Yagis.
    assert_eq!(sweeps.len(), 1078);
    assert!(
        sweeps
            .iter()
            .all(|sweep| sweep.sweep.samples.len() <= 4 && !sweep.sweep.samples.is_empty())
    );
    let numbered = sweeps[0].as_sweep(BeaconId(3));
    assert_eq!((numbered.beacon, numbered.positions, numbered.samples.len()), (BeaconId(3), 4, 1));

    // Without the file beside it, the station's place has to be given.
    let bytes = std::fs::read(&path).expect("it was read before");
    let options = ReadOptions::default();
    let message = Recording::from_reader(&bytes[..], "stdin", &options).expect_err("no station");
    assert!(
        matches!(&message, RecordingError::NothingBeside { beside, .. } if beside == "station.csv")
    );
    let options = options.with_constant(Column::LatDeg, 41.5).with_constant(Column::LonDeg, -71.6);
    let moved = Recording::from_reader(&bytes[..], "stdin", &options).expect("a station");
    let frame = moved.frame().expect("in degrees");
    assert_abs_diff_eq!(frame.origin().lat_deg, 41.5, epsilon = 1e-12);
    let shift = LocalFrame::new(Geodetic { lat_deg: 41.5, lon_deg: -71.6, alt_m: 0.0 })
        .expect("a place")
        .to_local(&recording.frame().expect("in degrees").origin());
    let difference = moved.records()[0].truth.expect("a tag") - truth - shift.xy();
    // The two frames' axes differ by the curvature over 2.3 km.
    assert!(difference.norm() < 1.0, "{difference}");
}

#[test]
fn tower_flights_lose_what_was_recorded_on_the_ground() {
    for (flight, rows, low) in [
        ("100m_fs20MHz", 913, 17),
        ("40m_fs10MHz", 858, 25),
        ("40m_fs20MHz", 919, 86),
        ("40m_fs5MHz", 894, 61),
        ("70m_fs20MHz", 884, 21),
    ] {
        let Some(path) = shared(&format!("aerpaw_tower/flight_{flight}.csv")) else { return };
        let recording = read(&path);
        assert_eq!((recording.format(), recording.rows()), ("aerpaw-tower", rows), "{flight}");
        assert_eq!(recording.dropped()[0].rows, low, "{flight}");
        assert_eq!(recording.records().len() as u64, rows - low, "{flight}");
    }
}

#[test]
fn every_otter_and_day_has_a_truth_of_its_own() {
    let Some(path) = shared("otter_telemetr/bearings.csv") else { return };
    let recordings = [read(&path)];
    assert_eq!(recordings[0].format(), "otter-telemetry");
    assert_eq!((recordings[0].rows(), recordings[0].records().len()), (312, 312));
    assert_eq!(recordings[0].frame(), None, "UTM metres stay what they are");
    let beacons = recordings[0].beacons();
    assert_eq!(beacons.len(), 78);
    let mut truths = Vec::new();
    for beacon in beacons {
        let of = recordings[0].records().iter().filter(|record| record.beacon.as_deref() == beacon);
        assert_eq!(of.count(), 4, "{beacon:?}");
        let truth = recorded_truth(&recordings, beacon).expect("it is in truth.csv");
        assert!((6e5..6.3e5).contains(&truth.x) && (4.06e6..4.1e6).contains(&truth.y), "{truth}");
        if !truths.contains(&truth) {
            truths.push(truth);
        }
    }
    // One otter was at the same place on two days.
    assert_eq!(truths.len(), 77);
    let arthur = recorded_truth(&recordings, Some("Arthur-15509.0")).expect("the first");
    assert_eq!((arthur.x, arthur.y), (609_583.402_365_280_5, 4_074_725.165_636_958_6));
}

#[test]
fn collars_side_by_side_are_beacons_with_places() {
    for (run, rows) in [("000419", 136), ("000427", 152)] {
        let Some(path) = shared(&format!("pulses/ucsd_run_{run}.csv")) else { return };
        let recordings = [read(&path)];
        assert_eq!(recordings[0].format(), "ucsd-collars");
        assert_eq!(recordings[0].rows(), rows, "{run}");
        let names = ["172541000", "172582000", "172742000"];
        assert_eq!(recordings[0].beacons(), names.map(Some));
        assert_eq!(recordings[0].records().len() as u64, 3 * rows);
        for name in names {
            assert!(recorded_truth(&recordings, Some(name)).is_some(), "{run}, {name}");
        }
    }
}

#[test]
fn pulses_of_a_semicolon_file_are_read_by_a_mapping() {
    let Some(path) = shared("pulses/pyrt_umr_150172kHz.csv") else { return };
    let mapping = "name = 'pyradiotracking'\ndescription = 'pulses'\nheader = ['Device', 'Time']\n\
                   [columns]\ndrone = 'Device'\ntime_utc = 'Time'\nrss_db = 'max (dBW)'\n\
                   beacon = 'Frequency'\n[constants]\nrange_m = 100\n";
    let mapping = Mapping::parse(mapping, "m.toml").expect("a mapping");
    let options = ReadOptions::default().with_format(mapping);
    let recording = Recording::read(&path, &options).expect("a recording");
    assert_eq!(recording.records().len(), 4_720);
}
