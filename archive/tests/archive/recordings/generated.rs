//! Small recordings of every shipped format, generated from a seed and committed in `tests/data`,
//! so that a clone alone tests every reader. `FOXHUNT_WRITE_TEST_DATA=1` writes them again.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::{
    collections::BTreeMap,
    f64::consts::{PI, TAU},
    fmt::Write,
    fs,
    path::{Path, PathBuf},
};

use foxhunt_archive::{
    movebank::{MovebankFix, write_movebank},
    recorded::{
        CalibrateConfig, ReceptionConfig, StationConfig, bearings, calibrate, fit_boresights,
        receptions, recorded_truth,
    },
    recording::{Band, Mapping, ReadOptions, Recording, Rover, builtin_mappings},
};
use foxhunt_core::{Ellipse, Reception, angle};
use foxhunt_hunt::{
    locate::{LocateConfig, Located},
    registry::Registry,
};
use foxhunt_sensors::{FirstHarmonic, Pritzl2018};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame, radians_to_compass_deg};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

const SEED: u64 = 13;

/// Place of the transmitter in all of them, East and North in metres.
const TARGET: Vector2<f64> = Vector2::new(60.0, 40.0);

/// The reference receiver of the range differences.
const REFERENCE: Vector3<f64> = Vector3::new(0.0, 0.0, 2.0);

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data")
}

fn read(file: &str) -> Recording {
    Recording::read(folder().join(file), &options(file)).expect("it is in the repository")
}

/// Options to read a file: one without a header by its format, of the tag's frequency, along a
/// track.
fn options(file: &str) -> ReadOptions {
    let format = file.strip_suffix(".csv").unwrap_or_default();
    let mut options = ReadOptions::default();
    if ["krakensdr", "rtl-power", "hackrf-sweep"].contains(&format) {
        options = options.with_format(Mapping::find(format).expect("it is shipped"));
    }
    if ["rtl-power", "hackrf-sweep"].contains(&format) {
        let rover = Rover::read(folder().join("rover.gpx")).expect("it is in the repository");
        options = options.with_band(Band::new(150.1722e6, 0.0).expect("positive"));
        // Local time is two hours ahead of UTC.
        options = options.with_rover(rover, -7200.0).expect("finite");
    }
    options
}

fn frame() -> LocalFrame {
    LocalFrame::new(Geodetic { lat_deg: 50.0, lon_deg: 14.0, alt_m: 0.0 }).expect("a place")
}

/// A normal deviate, by the sum of twelve uniform ones.
fn normal(rng: &mut Xoshiro256PlusPlus) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

/// The animals and days of the hand-made bearings.
const OTTERS: [(&str, &str); 4] =
    [("Arthur", "1.0"), ("Arthur", "2.0"), ("Caren", "1.0"), ("Caren", "2.0")];

/// Place of the otter with that number, in UTM metres.
fn otter(number: usize) -> Vector2<f64> {
    let step = [0.0, 1.0, 2.0, 3.0][number];
    Vector2::new(609_500.0 + 700.0 * step, 4_074_700.0 + 900.0 * step * step)
}

fn bearing_from(east: f64, north: f64) -> f64 {
    (TARGET.y - north).atan2(TARGET.x - east)
}

fn range_from(place: Vector3<f64>) -> f64 {
    (TARGET.push(0.0) - place).norm()
}

/// The files by their names.
fn generate() -> BTreeMap<&'static str, String> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let frame = frame();
    let mut files = BTreeMap::new();
    let mut add = |name, lines: Vec<String>| files.insert(name, lines.join("\n") + "\n");

    // A climb, then 100 m to the East and 80 m to the North; in the middle the lock is lost.
    let mut lines = vec!["t_s,lat_deg,lon_deg,alt_agl_m,yaw_deg,power_db,quality_db,n".to_owned()];
    for i in 0..48_u32 {
        let along = 5.0 * f64::from(i.saturating_sub(4));
        let place = Vector3::new(along.min(100.0), (along - 100.0).max(0.0), 0.0);
        let up = (8.0 * f64::from(i)).min(30.0);
        let at = frame.to_geodetic(&place);
        let range = range_from(place + Vector3::z() * up);
        let level = 60.0 - 25.0 * range.log10() + 1.5 * normal(&mut rng);
        let quality = if (20..23).contains(&i) { 40 } else { 72 };
        let yaw = if i < 24 { 90 } else { 0 };
        lines.push(format!(
            "{i}.5,{:.8},{:.8},{up:.2},{yaw},{level:.3},{quality},31",
            at.lat_deg, at.lon_deg
        ));
    }
    add("aerpaw-afar.csv", lines);

    // Six stations on an arc; bearings to within 3°.
    let mut lines = vec!["obs,x,y,bearing_deg".to_owned()];
    for i in 0..6_u32 {
        let (sin, cos) = (0.5 * f64::from(i)).sin_cos();
        let east = 60.0 - 50.0 * cos;
        let north = 40.0 - 50.0 * sin;
        let error = 3.0_f64.to_radians() * normal(&mut rng);
        let compass = radians_to_compass_deg(bearing_from(east, north) + error);
        lines.push(format!("{},{east:.2},{north:.2},{compass:.1}", i + 1));
    }
    add("lenth1981/bearings.csv", lines);
    add("lenth1981/truth.csv", vec!["x,y,note".to_owned(), "60,40,generated".to_owned()]);

    // P₀ −40 dB and γ 2.5, σ 1 dB.
    let mut lines = vec!["tag,rssi_db,distance_m".to_owned()];
    for i in 0..30_u32 {
        let range = 10.0 * f64::from(1 + i % 10);
        let level = -40.0 - 25.0 * range.log10() + normal(&mut rng);
        lines.push(format!("7,{level:.2},{range}"));
    }
    add("rssi-distance.csv", lines);

    // One turn of a cardioid in hover at the origin; every ninth pulse is lost.
    let mut lines =
        vec!["t_s,tag_id,snr_db,group,idx_in_group,lat_deg,lon_deg,alt_m,yaw_deg".into()];
    for i in 0..36_u32 {
        let boresight = TAU * f64::from(i) / 36.0;
        let gain = 20.0 * (0.55 + 0.45 * (boresight - bearing_from(0.0, 0.0)).cos()).log10();
        let level = 30.0 + gain + 0.3 * normal(&mut rng);
        let level = if i % 9 == 4 { "-9999.0".to_owned() } else { format!("{level:.2}") };
        let compass = radians_to_compass_deg(boresight);
        lines.push(format!("{i}.25,2,{level},{},{},50,14,20,{compass:.1}", i / 3, 1 + i % 3));
        if i % 18 == 0 {
            lines.push(format!("{i}.5,3,12.5,{},1,50,14,20,{compass:.1}", i / 3));
        }
    }
    add("uavrt-rotation.csv", lines);

    // A tag walks around a station with four antennas for two days; a burst every 20 s.
    let mut lines = vec!["time,antenna,rssi_dbm,tag_lat_deg,tag_lon_deg".to_owned()];
    for i in 0..48_u32 {
        let angle = 2.1 * f64::from(i);
        let place = Vector3::new(400.0 * angle.cos(), 400.0 * angle.sin(), 0.0);
        let at = frame.to_geodetic(&place);
        let mut time = String::new();
        let day = 1 + i / 24;
        let second = 20 * (i % 24);
        // Writing to a text cannot fail.
        let _ = write!(time, "2026-05-0{day} 10:{:02}:{:02}", second / 60, second % 60);
        for (antenna, compass) in [(1, 245.0_f64), (2, 155.0), (3, 65.0), (4, 335.0)] {
            let off = angle::wrap((90.0 - compass).to_radians() - angle);
            let level = -85.0 - 12.0 * (1.0 - off.cos()) + 2.0 * normal(&mut rng);
            if level > -105.0 {
                let lat = at.lat_deg;
                let lon = at.lon_deg;
                lines.push(format!("{time},{antenna},{level:.0},{lat:.7},{lon:.7}"));
            }
        }
        if i % 8 == 0 {
            lines.push(format!("{time},5,-95,{:.7},{:.7}", at.lat_deg, at.lon_deg));
        }
    }
    add("uri-yagi-station/detections.csv", lines);
    add("uri-yagi-station/station.csv", vec!["lat_deg,lon_deg".into(), "50,14".into()]);

    // Our own format: turns of an antenna; ranges; range differences to a reference receiver.
    let mut lines =
        vec!["turn,time_s,east_m,north_m,up_m,boresight_deg_compass,rss_dbm".to_owned()];
    for i in 0..96_u32 {
        let turn = i / 32;
        let (east, north) = [(0.0, 0.0), (40.0, -20.0), (20.0, 70.0)][turn as usize];
        let boresight = TAU * f64::from(i % 32) / 32.0;
        let gain = 20.0 * (0.55 + 0.45 * (boresight - bearing_from(east, north)).cos()).log10();
        let level = -60.0 + gain + 0.3 * normal(&mut rng);
        let compass = radians_to_compass_deg(boresight);
        lines.push(format!("{turn},{i},{east},{north},10,{compass:.2},{level:.2}"));
    }
    add("foxhunt/turns.csv", lines);
    let mut ranges = vec!["time_s,east_m,north_m,up_m,range_m,range_sigma_m".to_owned()];
    let mut differences =
        vec!["east_m,north_m,up_m,range_difference_m,range_difference_sigma_m".to_owned()];
    for i in 0..12_u32 {
        let (sin, cos) = (0.6 * f64::from(i)).sin_cos();
        let place = Vector3::new(50.0 + 70.0 * cos, 30.0 + 60.0 * sin, 20.0);
        let east = place.x;
        let north = place.y;
        let range = range_from(place) + normal(&mut rng);
        ranges.push(format!("{i},{east:.3},{north:.3},20,{range:.3},1"));
        let difference = range_from(place) - range_from(REFERENCE) + 0.5 * normal(&mut rng);
        differences.push(format!("{east:.3},{north:.3},20,{difference:.3},0.5"));
    }
    add("foxhunt/ranges.csv", ranges);
    add("foxhunt/differences.csv", differences);

    // Up, around the target at 40 m, and down again.
    let mut lines =
        vec!["time_s,lat_deg,lon_deg,alt_agl_m,yaw_deg,pitch_deg,roll_deg,rss_db".to_owned()];
    for i in 0..60_u32 {
        let (sin, cos) = (TAU * f64::from(i) / 60.0).sin_cos();
        let place = Vector3::new(60.0 + 80.0 * cos, 40.0 + 50.0 * sin, 0.0);
        let up = (8.0 * f64::from(i.min(59 - i))).min(40.0);
        let at = frame.to_geodetic(&place);
        let level = 20.0 - 23.0 * range_from(place + Vector3::z() * up).log10();
        let level = level + 1.5 * normal(&mut rng);
        let lat = at.lat_deg;
        let lon = at.lon_deg;
        lines
            .push(format!("{i},{lat:.8},{lon:.8},{up:.1},{:.1},1,-2,{level:.2}", -4.0 + 6.0 * sin));
    }
    add("aerpaw-tower.csv", lines);

    // Two animals on two days, four bearings each, in UTM metres; some lead past North.
    let mut lines = vec!["rx_x_m,rx_y_m,bearing_deg,animal,day".to_owned()];
    let mut truths = vec!["tx_x_m,tx_y_m,animal,day".to_owned()];
    for (number, (animal, day)) in OTTERS.into_iter().enumerate() {
        let target = otter(number);
        truths.push(format!("{},{},{animal},{day}", target.x, target.y));
        for i in 0..4_u32 {
            let (sin, cos) = (1.0 + 1.5 * f64::from(i)).sin_cos();
            let receiver = target + 800.0 * Vector2::new(cos, sin);
            let error = 3.0_f64.to_radians() * normal(&mut rng);
            let compass = radians_to_compass_deg((-sin).atan2(-cos) + error);
            let compass = if i == 2 { compass + 360.0 } else { compass - 360.0 * f64::from(i / 3) };
            let x = receiver.x;
            let y = receiver.y;
            lines.push(format!("{x:.2},{y:.2},{compass:.2},{animal},{day}"));
        }
    }
    add("otter-telemetry/bearings.csv", lines);
    add("otter-telemetry/truth.csv", truths);

    // A flight over two collars, of which one has a place; in the middle it receives nothing.
    let mut lines = vec!["lat_deg,lon_deg,alt_m,c172541000_dB,c172742000_dB".to_owned()];
    for i in 0..40_u32 {
        let place = Vector3::new(4.0 * f64::from(i), 15.0 * f64::from(i % 8), 0.0);
        let at = frame.to_geodetic(&place);
        let level = -10.0 - 20.0 * range_from(place).log10() + normal(&mut rng);
        let other = -30.0 + normal(&mut rng);
        let other = if i < 30 { format!("{other:.2}") } else { String::new() };
        lines.push(format!("{:.8},{:.8},100,{level:.2},{other}", at.lat_deg, at.lon_deg));
    }
    add("ucsd-collars/run.csv", lines);
    let at = frame.to_geodetic(&TARGET.push(0.0));
    let truth = format!("172541000,{:.8},{:.8}", at.lat_deg, at.lon_deg);
    add("ucsd-collars/ucsd_truth.csv", vec!["collar_hz,lat_deg,lon_deg".to_owned(), truth]);
    add_standards(&mut rng, &mut files);
    files
}

/// Recordings as widespread programs and networks write them, along one flight around the target.
fn add_standards(rng: &mut Xoshiro256PlusPlus, files: &mut BTreeMap<&'static str, String>) {
    let frame = frame();
    let begin = "2026-06-01T10:00:00Z";
    let mut gpx = vec![
        r#"<?xml version="1.0" encoding="UTF-8"?>"#.to_owned(),
        r#"<gpx version="1.1" creator="generated" xmlns="http://www.topografix.com/GPX/1/1">"#
            .to_owned(),
        "<trk><name>flight</name><trkseg>".to_owned(),
    ];
    let mut kraken = Vec::new();
    let mut rtl = Vec::new();
    let mut hackrf = Vec::new();
    let mut motus = vec![
        "hitID,ts,sig,port,antBearing,recvType,recvDeployName,recvDeployLat,recvDeployLon,\
         motusTagID,motusFilter"
            .to_owned(),
    ];
    let mut movebank = vec![
        "event-id,visible,timestamp,location-long,location-lat,tag-local-identifier,rss_dbm"
            .to_owned(),
    ];
    for i in 0..60_u32 {
        let (sin, cos) = (TAU * f64::from(i) / 60.0).sin_cos();
        let place = Vector3::new(60.0 + 90.0 * cos, 40.0 + 60.0 * sin, 20.0);
        let at = frame.to_geodetic(&place);
        let lat = at.lat_deg;
        let lon = at.lon_deg;
        let level = -30.0 - 23.0 * range_from(place).log10() + 1.5 * normal(rng);
        let heading = radians_to_compass_deg((60.0 * cos).atan2(-90.0 * sin));
        if i % 3 == 0 {
            gpx.push(format!("  <trkpt lat=\"{lat:.8}\" lon=\"{lon:.8}\">"));
            let time = begin.replace("00Z", &format!("{i:02}Z"));
            gpx.push(format!("    <ele>{:.1}</ele><time>{time}</time>", 320.0 + place.z));
            gpx.push("  </trkpt>".to_owned());
        }
        let to_target = radians_to_compass_deg(bearing_from(place.x, place.y));
        let doa = (to_target - heading + 3.0 * normal(rng)).rem_euclid(360.0);
        // 2026-06-01 10:00 UTC.
        let epoch_ms = 1_780_308_000_000_u64 + 1000 * u64::from(i);
        kraken.push(format!(
            "{epoch_ms}, {doa:.0}, 5.2, {level:.1}, 433920000, UCA, 100, rover, {lat:.8}, {lon:.8}, \
             {heading:.1}, {heading:.1}, GPS, R, R, R, R, 0.00, 1.25, 0.31 "
        ));
        let noise = |rng: &mut Xoshiro256PlusPlus| -95.0 + normal(rng);
        // 150.15 to 150.20 MHz in bins of 10 kHz: the tag is in the third; the last one is doubled.
        let mut bins: Vec<f64> = (0..5).map(|_| noise(rng)).collect();
        bins[2] = level;
        let last = bins[4];
        let cells = |bins: &[f64]| bins.iter().map(|b| format!(", {b:.2}")).collect::<String>();
        rtl.push(format!(
            "2026-06-01, 12:00:{i:02}, 150150000, 150200000, 10000.00, 4096{}, {last:.2}",
            cells(&bins)
        ));
        // Two hops; bins begin one width above the lowest frequency.
        hackrf.push(format!(
            "2026-06-01, 12:00:{i:02}.500000, 140000000, 145000000, 1000000.00, 20{}",
            cells(&(0..5).map(|_| noise(rng)).collect::<Vec<_>>())
        ));
        hackrf.push(format!(
            "2026-06-01, 12:00:{i:02}.500000, 149150000, 150200000, 350000.00, 20, -inf, nan, {level:.2}"
        ));
        if i % 6 == 0 {
            let seconds = 1_780_308_000 + 20 * i;
            let number = 4 * i;
            for (port, compass) in [(1, 30.0_f64), (2, 150.0), (3, 270.0)] {
                let off = (radians_to_compass_deg(bearing_from(0.0, 0.0)) - compass).to_radians();
                let sig = -40.0 - 12.0 * (1.0 - off.cos()) + normal(rng);
                motus.push(format!(
                    "{},{seconds}.{port}25,{sig:.1},{port},{compass},SENSORGNOME,Hill,50,14,22867,{}",
                    number + port,
                    u32::from(i > 0)
                ));
            }
            motus.push(format!("{number},{seconds}.5,180,1,0,LOTEK,Mast,50.01,14,22867,1"));
        }
        movebank.push(format!(
            "{},{},2026-06-01 10:00:{i:02}.000,{lon:.8},{lat:.8},fox-7,{level:.2}",
            9_000_000 + i,
            i != 5
        ));
    }
    gpx.push("</trkseg></trk></gpx>".to_owned());
    for (name, lines) in [
        ("rover.gpx", gpx),
        ("krakensdr.csv", kraken),
        ("rtl-power.csv", rtl),
        ("hackrf-sweep.csv", hackrf),
        ("motus.csv", motus),
        ("movebank.csv", movebank),
    ] {
        files.insert(name, lines.join("\n") + "\n");
    }
}

#[test]
fn what_is_committed_is_what_the_generator_makes() {
    for (name, text) in generate() {
        let path = folder().join(name);
        if std::env::var_os("FOXHUNT_WRITE_TEST_DATA").is_some() {
            fs::create_dir_all(path.parent().expect("a folder")).expect("it can be made");
            fs::write(&path, &text).expect("it can be written");
        }
        let committed = fs::read_to_string(&path).expect(name);
        assert_eq!(committed, text, "{name}");
    }
}

#[test]
fn every_shipped_format_has_a_recording() {
    let mut formats: Vec<String> = Vec::new();
    for name in generate().keys().filter(|name| {
        !["truth.csv", "station.csv", ".gpx"].iter().any(|beside| name.ends_with(beside))
    }) {
        formats.push(read(name).format().to_owned());
    }
    // Those below are read by tests of their own.
    for name in [
        "ctt/detections.csv",
        "wildlife/srx1200.csv",
        "wildlife/bear.csv",
        "receivers/ats-aerial.csv",
        "receivers/tinygs.jsonl",
        "receivers/tinygs.txt",
    ] {
        formats.push(read(name).format().to_owned());
    }
    for name in fs::read_dir(folder().join("json")).expect("a folder") {
        let path = name.expect("an entry").path();
        if !path.extension().is_some_and(|ending| ending == "py" || ending == "csv") {
            let recording = Recording::read(&path, &ReadOptions::default()).expect("a recording");
            formats.push(recording.format().to_owned());
        }
    }
    // Paths are tables of tests of their own.
    for mapping in builtin_mappings().iter().filter(|mapping| !mapping.path) {
        assert!(formats.contains(&mapping.name), "{} has none", mapping.name);
    }
}

fn located(receptions: &[Reception], estimator: &str) -> Located {
    let registry = Registry::builtin();
    let entry = registry.estimator(estimator).expect("it has a name");
    let config =
        LocateConfig { reference_m: Some(REFERENCE), margin_m: 100.0, ..LocateConfig::default() };
    entry.locate(&receptions.into(), &config).expect("it is located")
}

fn received(file: &str, beacon: Option<&str>) -> Vec<Reception> {
    let config = ReceptionConfig { rss_sigma_db: 2.0, positions: 32, ..ReceptionConfig::default() };
    receptions(&[read(file)], beacon, &Pritzl2018::default(), &config)
        .expect("they are of use")
        .iter()
        .collect()
}

fn miss(located: &Located) -> f64 {
    (located.estimate.mean - TARGET).norm()
}

#[test]
fn a_flight_with_levels() {
    let recording = read("aerpaw-afar.csv");
    assert_eq!((recording.rows(), recording.records().len()), (48, 43));
    let dropped: Vec<_> = recording.dropped().iter().map(|d| (d.rule.as_str(), d.rows)).collect();
    assert_eq!(dropped, [("alt_agl_m ≥ 15", 2), ("quality_db ≥ 60", 3)]);
    assert_eq!(recording.ignored_columns(), ["n"]);
    assert!(!recording.is_calibrated() && recording.is_located());
    let receptions = received("aerpaw-afar.csv", None);
    assert_eq!(receptions.len(), 43);
    assert!(receptions.iter().all(|r| r.level.is_some() && r.bearing.is_none()));
    // The origin is the first place that is kept: the climb's, which is the frame's.
    let located = located(&receptions, "batch-multistart");
    assert!(miss(&located) < 15.0, "{located:?}");
}

#[test]
fn bearings_from_stations() {
    let recording = read("lenth1981/bearings.csv");
    assert!(recording.records().iter().all(|r| r.truth == Some(TARGET) && r.bearing.is_some()));
    let located = located(&received("lenth1981/bearings.csv", None), "lenth1981");
    assert!(miss(&located) < 8.0 && located.observations == 6, "{located:?}");
}

#[test]
fn levels_at_known_distances() {
    let recording = read("rssi-distance.csv");
    assert_eq!(recording.beacons(), [Some("7")]);
    assert!(!recording.is_located());
    let config = CalibrateConfig::default();
    let extractor = Pritzl2018::default();
    let fit = calibrate(&[(&recording, &extractor)], Some("7"), &config);
    let fit = fit.expect("30 points").fit;
    // σ of the exponent is 0.06, of P₀ 1.1 dB.
    assert_abs_diff_eq!(fit.exponent, 2.5, epsilon = 0.25);
    assert_abs_diff_eq!(fit.reference_dbm, -40.0, epsilon = 4.0);
}

#[test]
fn a_rotation_of_the_body() {
    let recording = read("uavrt-rotation.csv");
    assert_eq!((recording.rows(), recording.records().len()), (38, 34));
    let turns = bearings(&recording, &FirstHarmonic::default(), 36).expect("two turns");
    let turn = turns.iter().find(|turn| turn.sweep.beacon_name.as_deref() == Some("2"));
    let turn = turn.expect("the tag's own turn");
    assert_eq!(turn.sweep.sweep.samples.len(), 32);
    let bearing = turn.reading.bearing.expect("a cardioid");
    assert!(angle::distance(bearing.angle, bearing_from(0.0, 0.0)) < PI / 18.0, "{bearing:?}");
}

#[test]
fn bursts_at_a_station() {
    let recording = read("uri-yagi-station/detections.csv");
    assert_eq!(recording.drones(), ["station"]);
    let origin = recording.frame().expect("in degrees").origin();
    assert!(abs_diff_eq!(origin.lat_deg, 50.0, epsilon = 1e-12), "from the file beside it");
    let sweeps = recording.sweeps(4).expect("4 positions");
    assert_eq!(sweeps.len(), 48);
    assert!(sweeps.iter().all(|s| s.located && (1..=4).contains(&s.sweep.samples.len())));
    let fitted = fit_boresights(&[&[recording]], Some("tag"), &StationConfig::default());
    let mut fitted = fitted.expect("two days");
    let fitted = fitted.stations.remove(0).expect("it has bursts enough");
    // Two days are too few groups: the bursts are cut into ten.
    assert_eq!(fitted.groups, 10);
    let judged = fitted.cross_validation.expect("groups enough");
    assert!(judged.median_error < 25_f64.to_radians(), "{judged:?}");
}

#[test]
fn turns_of_an_antenna() {
    let receptions = received("foxhunt/turns.csv", None);
    assert_eq!(receptions.len(), 3);
    for reception in &receptions {
        let place = reception.receiver.position;
        let bearing = reception.bearing.expect("a cardioid");
        let off = angle::distance(bearing.angle, bearing_from(place.x, place.y));
        assert!(off < 15_f64.to_radians(), "{bearing:?}");
    }
}

#[test]
fn ranges_and_range_differences_locate() {
    // σ of a place is about 0.5 m and 0.4 m: 12 values of σ 1 m and 0.5 m.
    let ranges = received("foxhunt/ranges.csv", None);
    assert!(ranges.iter().all(|r| r.level.is_none() && r.measured.iter().count() == 1));
    let by_ranges = located(&ranges, "multilateration");
    assert!(miss(&by_ranges) < 2.0 && by_ranges.observations == 12, "{by_ranges:?}");
    let differences = received("foxhunt/differences.csv", None);
    for estimator in ["range-differences", "range-difference"] {
        let located = located(&differences, estimator);
        assert!(miss(&located) < 2.0 && located.observations == 12, "{estimator}: {located:?}");
    }
}

#[test]
fn a_flight_over_a_tower_without_the_ground() {
    let recording = read("aerpaw-tower.csv");
    assert_eq!((recording.format(), recording.rows()), ("aerpaw-tower", 60));
    // The first second and the last.
    let dropped: Vec<_> = recording.dropped().iter().map(|d| (d.rule.as_str(), d.rows)).collect();
    assert_eq!(dropped, [("alt_agl_m ≥ 2", 2)]);
    assert_eq!(recording.ignored_columns(), [""; 0]);
    assert!(recording.records().iter().all(|r| r.receiver().is_some_and(|p| p.position.z >= 8.0)));
}

#[test]
fn animals_and_days_are_beacons_with_a_truth_each() {
    let recordings = [read("otter-telemetry/bearings.csv")];
    assert_eq!(recordings[0].format(), "otter-telemetry");
    let names = OTTERS.map(|(animal, day)| format!("{animal}-{day}"));
    assert!(recordings[0].beacons().into_iter().eq(names.iter().map(|name| Some(name.as_str()))));
    assert_eq!(recorded_truth(&recordings, None), None, "no row is of a nameless beacon");
    for (number, name) in names.iter().enumerate() {
        assert_eq!(recorded_truth(&recordings, Some(name)), Some(otter(number)), "{name}");
        let config = ReceptionConfig::default();
        let received = receptions(&recordings, Some(name), &Pritzl2018::default(), &config);
        let received: Vec<_> = received.expect("they are of use").iter().collect();
        assert_eq!(received.len(), 4);
        // Of 3° at 800 m; the place comes out in the file's own metres.
        let located = located(&received, "lenth1981");
        let miss = (located.estimate.mean - otter(number)).norm();
        assert!(miss < 120.0 && located.observations == 4, "{name}: {located:?}");
    }
}

#[test]
fn columns_side_by_side_are_beacons() {
    let recordings = [read("ucsd-collars/run.csv")];
    assert_eq!((recordings[0].format(), recordings[0].rows()), ("ucsd-collars", 40));
    assert_eq!(recordings[0].beacons(), [Some("172541000"), Some("172742000")]);
    assert_eq!(recordings[0].records().len(), 40 + 30);
    assert_eq!(
        (recordings[0].dropped()[0].rule.as_str(), recordings[0].dropped()[0].rows),
        ("a measurement", 10)
    );
    assert!(recordings[0].ignored_columns().is_empty());
    assert_eq!(received("ucsd-collars/run.csv", Some("172742000")).len(), 30);
    let truth = recorded_truth(&recordings, Some("172541000")).expect("it is in the table");
    assert!((truth - TARGET).norm() < 0.01, "{truth}");
    assert_eq!(recorded_truth(&recordings, Some("172742000")), None);
}

#[test]
fn a_truth_that_moves_by_less_than_half_a_metre_stays() {
    for (moved_m, stays) in [(0.4, true), (0.6, false)] {
        let table = format!(
            "east_m,north_m,rss_dbm,truth_east_m,truth_north_m\n0,0,-60,30,40\n5,0,-61,30,40\n\
             9,0,-62,{},40\n",
            30.0 + moved_m
        );
        let recording = Recording::from_reader(table.as_bytes(), "f.csv", &ReadOptions::default());
        let truth = recorded_truth(&[recording.expect("a table")], None);
        assert_eq!(truth, stays.then_some(Vector2::new(30.0, 40.0)), "{moved_m}");
    }
}

#[test]
fn directions_of_an_array_are_relative_to_the_heading() {
    let recording = read("krakensdr.csv");
    assert_eq!((recording.rows(), recording.records().len()), (60, 60));
    assert!(recording.is_in_utc() && !recording.is_calibrated());
    assert_eq!((recording.beacons(), recording.drones()), (vec![Some("433920000")], vec!["rover"]));
    // Errors of 3° and of the rounding.
    for record in recording.records() {
        let place = record.receiver().expect("it has places").position;
        let origin = recording.frame().expect("in degrees").to_geodetic(&place);
        let place = frame().to_local(&origin);
        let bearing = record.bearing.expect("each row has one");
        let off = angle::distance(bearing.angle, bearing_from(place.x, place.y));
        assert!(off < 14_f64.to_radians() && bearing.sigma.is_none(), "{record:?}");
    }
    assert_eq!(recording.records()[1].time, Some(1_780_308_001.0));
}

#[test]
fn power_over_frequency_is_a_level_along_a_track() {
    for (file, rows) in [("rtl-power.csv", 60), ("hackrf-sweep.csv", 120)] {
        let recording = read(file);
        // The track ends with its last point, at 57 s; hops without the frequency are of no use.
        let kept = recording.records().len();
        assert_eq!((recording.rows(), kept), (rows, if rows == 60 { 58 } else { 57 }), "{file}");
        let truth =
            recording.frame().expect("on Earth").to_local(&frame().to_geodetic(&TARGET.push(0.0)));
        let received = received(file, None);
        let located = located(&received, "least-absolute");
        let miss = (located.estimate.mean - truth.xy()).norm();
        assert!(miss < 15.0 && located.observations == kept, "{file}: {miss} m, {located:?}");
        // Heights are those above the track's begin.
        assert!(received.iter().all(|r| r.receiver.position.z.abs() < 0.2), "{received:?}");
    }
}

#[test]
fn detections_of_a_network_are_turns_of_its_stations() {
    let recording = read("motus.csv");
    assert_eq!((recording.format(), recording.rows()), ("motus", 40));
    let dropped: Vec<_> = recording.dropped().iter().map(|d| (d.rule.as_str(), d.rows)).collect();
    assert_eq!(dropped, [("recvType ≠ LOTEK", 10), ("motusFilter ≠ 0", 3)]);
    let sweeps = recording.sweeps(128).expect("turns");
    assert_eq!(sweeps.len(), 9);
    assert!(sweeps.iter().all(|s| s.drone == "Hill" && s.sweep.samples.len() == 3), "{sweeps:?}");
}

#[test]
fn movebank_names_who_when_and_where() {
    let recording = read("movebank.csv");
    assert_eq!((recording.format(), recording.rows()), ("movebank", 60));
    assert_eq!(
        (recording.dropped()[0].rule.as_str(), recording.dropped()[0].rows),
        ("visible ≠ false", 1)
    );
    assert!(recording.is_calibrated() && recording.is_in_utc());
    assert_eq!(recording.beacons(), [Some("fox-7")]);
    assert_eq!(recording.ignored_columns(), ["event-id"]);
}

#[test]
fn a_place_is_written_with_movebanks_names() {
    let ellipse = Ellipse { semi_major: 50.0, semi_minor: 20.0, orientation: PI / 6.0 };
    let fix = MovebankFix {
        tag: "fox-7".to_owned(),
        received: [1_780_308_000.0, 1_780_308_061.0],
        place: TARGET,
        ellipse_95: Some(ellipse),
    };
    let without = MovebankFix { tag: "a,b".to_owned(), ellipse_95: None, ..fix.clone() };
    let mut out = Vec::new();
    write_movebank(&mut out, &frame(), &[fix, without]).expect("a vector takes all");
    let mut reader = csv::Reader::from_reader(out.as_slice());
    let header = reader.headers().expect("it has one").clone();
    let rows: Vec<_> = reader.records().collect::<Result<_, _>>().expect("whole rows");
    let cell = |row: usize, name: &str| {
        let column = header.iter().position(|column| column == name).expect(name);
        rows[row][column].to_owned()
    };
    let number = |name: &str| cell(0, name).parse::<f64>().expect(name);
    for (name, text) in [
        ("tag-local-identifier", "fox-7"),
        ("timestamp", "2026-06-01 10:00:30.500"),
        ("start-timestamp", "2026-06-01 10:00:00"),
        ("end-timestamp", "2026-06-01 10:01:01"),
        ("location-error-numerical", "50.0"),
        ("location-error-percentile", "95"),
        ("sensor-type", "radio-transmitter"),
    ] {
        assert_eq!(cell(0, name), text, "{name}");
    }
    assert!(cell(0, "location-accuracy-comments").contains("60 degrees clockwise from North"));
    let at = |lat: f64, lon: f64| {
        frame().to_local(&Geodetic { lat_deg: lat, lon_deg: lon, alt_m: 0.0 }).xy()
    };
    let place = at(number("location-lat"), number("location-long"));
    assert!((place - TARGET).norm() < 0.02, "{place}");
    // √(50² cos² 30° + 20² sin² 30°) and √(50² sin² 30° + 20² cos² 30°).
    let high = at(number("lat-upper"), number("long-upper")) - TARGET;
    let low = at(number("lat-lower"), number("long-lower")) - TARGET;
    for (corner, sign) in [(high, 1.0_f64), (low, -1.0)] {
        assert!((corner - Vector2::new(44.441, 30.414) * sign).norm() < 0.03, "{corner}");
    }
    assert_eq!(cell(1, "tag-local-identifier"), "a,b");
    assert_eq!(cell(1, "location-error-numerical"), "");
}
