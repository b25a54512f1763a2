//! Errors in files of widespread formats name the fault, its place and the value.

use approx::assert_abs_diff_eq;
use foxhunt_archive::recording::{Band, Column, Mapping, ReadOptions, Recording, Rover};

fn options(format: &str) -> ReadOptions {
    ReadOptions::default().with_format(Mapping::find(format).expect("it is shipped"))
}

fn assert_names(text: &str, options: &ReadOptions, parts: &[&str]) {
    let strict = options.clone().with_strict(true);
    let error = Recording::from_reader(text.as_bytes(), "flight.csv", &strict);
    let message = error.expect_err(text).to_string();
    for part in parts.iter().chain(&["flight.csv"]) {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

#[test]
fn a_log_of_directions_names_its_mistakes() {
    let row = |time: &str, doa: &str, lat: &str, lon: &str| {
        format!(
            "{time}, {doa}, 5, -40, 433920000, UCA, 9, st, {lat}, {lon}, 90, 90, GPS, R, R, R, R, 0.5\n"
        )
    };
    let good = row("1780308001000", "10", "50", "14");
    for (bad, parts) in [
        (
            row("1780308002000", "400", "50", "14"),
            ["line 2", "doa_deg", "\"400\"", "between -360 and 360"],
        ),
        (
            row("1780308000000", "10", "50", "14"),
            ["line 2", "epoch_ms", "1780308000000", "1 s earlier"],
        ),
        (
            row("1780308002000", "10", "0.0", "0.0"),
            ["line 2", "latitude, longitude", "0, 0", "without a fix"],
        ),
        (row("1780308002000", "10", "114", "50"), ["line 2", "latitude", "\"114\"", "swapped"]),
        (row("yesterday", "10", "50", "14"), ["line 2", "epoch_ms", "yesterday", "time"]),
        (
            "1780308002000, 10, 5\n".to_owned(),
            ["line 2", "3 fields instead of 17", "confidence", "\"5\""],
        ),
    ] {
        assert_names(&format!("{good}{bad}"), &options("krakensdr"), &parts);
    }
    // Of each channel by itself.
    let other = row("1780308000000", "10", "50", "14").replace("433920000", "868000000");
    let both = format!("{good}{other}");
    assert!(Recording::from_reader(both.as_bytes(), "flight.csv", &options("krakensdr")).is_ok());
}

#[test]
fn a_table_with_movebanks_names_names_its_mistakes() {
    const HEADER: &str = "timestamp,location-long,location-lat,tag-local-identifier,bearing_deg_compass\n\
                          2026-06-01 10:00:05.000,14,50,a,20\n";
    for (row, parts) in [
        ("2026-06-01 10:00:06,14,50,a,400", ["line 3", "bearing_deg_compass", "\"400\"", "360"]),
        ("2026-06-01 10:00:04,14,50,a,20", ["line 3", "timestamp", "10:00:04", "1 s earlier"]),
        ("2026-06-01 10:00:06,0,0,a,20", ["line 3", "location-lat, location-long", "0, 0", "fix"]),
        ("2026-06-01 10:00:06,50,140,a,20", ["line 3", "location-lat", "\"140\"", "swapped"]),
    ] {
        assert_names(&format!("{HEADER}{row}\n"), &options("movebank"), &parts);
    }
}

const GPX: &str = "<gpx><trk><trkseg>
<trkpt lat='50' lon='14'><ele>300</ele><time>2026-06-01T10:00:00Z</time></trkpt>
<trkpt lat='50.001' lon='14.002'><ele>310</ele><time>2026-06-01T10:00:10Z</time></trkpt>
</trkseg><trkseg>
<trkpt lat='50.002' lon='14'><ele>310</ele><time>2026-06-01T10:00:20Z</time></trkpt>
<trkpt lat='50.003' lon='14'><ele>310</ele><time>2026-06-01T10:00:51Z</time></trkpt>
</trkseg></trk></gpx>";

#[test]
fn a_track_is_a_line_between_near_points_of_a_segment() {
    let rover = Rover::parse(GPX.as_bytes(), "rover.gpx").expect("a track");
    // `date -u -d '2026-06-01 10:00' +%s`
    let begin = 1_780_308_000.0;
    let place = rover.place(begin + 2.5).expect("on the line");
    assert_abs_diff_eq!(place.lat_deg, 50.00025, epsilon = 1e-9);
    assert_abs_diff_eq!(place.lon_deg, 14.0005, epsilon = 1e-9);
    assert_abs_diff_eq!(place.alt_m, 302.5, epsilon = 1e-9);
    assert!(rover.place(begin).is_some() && rover.place(begin + 51.0).is_some());
    for outside in [-0.1, 15.0, 30.0, 51.1, f64::NAN] {
        assert_eq!(rover.place(begin + outside), None, "{outside}");
    }
}

#[test]
fn a_track_names_its_mistakes() {
    for (from, to, parts) in [
        ("lat='50.001'", "lat='150.001'", ["line 3", "lat", "150.001", "swapped"]),
        ("lat='50.001' lon='14.002'", "lat='0' lon='0'", ["line 3", "lat, lon", "0, 0", "fix"]),
        ("lat='50.001'", "lat='north'", ["line 3", "lat", "north", "not a number"]),
        ("lon='14.002'", "", ["line 3", "lon", "\"\"", "must not be empty"]),
        ("10:00:10Z", "09:59:59Z", ["line 3", "time", "09:59:59Z", "1 s earlier"]),
        ("10:00:10Z", "noon", ["line 3", "time", "noon", "YYYY-MM-DD"]),
        ("</trkseg><trkseg>", "</trk>", ["line 4", "neither GPX nor KML", "trkseg", "trk"]),
    ] {
        let text = GPX.replace(from, to);
        let error = Rover::parse(text.as_bytes(), "rover.gpx").expect_err(to).to_string();
        for part in parts.iter().chain(&["rover.gpx"]) {
            assert!(error.contains(part), "{part:?} is not in: {error}");
        }
    }
    for nothing in ["<gpx/>", "", "<gpx><trkpt lat='1' lon='2'/></gpx>"] {
        let error = Rover::parse(nothing.as_bytes(), "rover.gpx").expect_err(nothing).to_string();
        assert!(error.contains("no point of a track"), "{error}");
    }
}

#[test]
fn power_over_frequency_needs_a_frequency_and_a_clock() {
    let row = "2026-06-01, 12:00:05, 150150000, 150200000, 10000.00, 4096, -90, -91, -60.5, -92, -93, -93\n";
    let sweep = options("rtl-power");
    assert_names(row, &sweep, &["rtl-power", "--frequency-hz"]);
    let at = |frequency, bandwidth| {
        sweep.clone().with_band(Band::new(frequency, bandwidth).expect("proper"))
    };
    let level = |text: &str, options: &ReadOptions| {
        let rover = Rover::parse(GPX.as_bytes(), "rover.gpx").expect("a track");
        let options = options.clone().with_rover(rover, -7200.0).expect("finite");
        let read = Recording::from_reader(text.as_bytes(), "flight.csv", &options);
        read.map(|recording| recording.records()[0].rss_dbm).map_err(|error| error.to_string())
    };
    // The bins' middles are 150.15, 150.16 … MHz; the doubled last one is not at 150.20.
    for (frequency, bandwidth, expected) in [
        (150.1722e6, 0.0, Some(-60.5)),
        (150.1600e6, 0.0, Some(-91.0)),
        (150.1600e6, 20e3, Some(-60.5)),
        (150.1445e6, 0.0, None),
        (150.1999e6, 0.0, None),
    ] {
        let found = level(row, &at(frequency, bandwidth)).ok().flatten();
        assert_eq!(found, expected, "{frequency}");
    }
    let error = level(&row.replace("-91", "loud"), &at(150.16e6, 0.0)).expect_err("no number");
    for part in ["flight.csv, line 1", "150160000 Hz", "loud", "not a number"] {
        assert!(error.contains(part), "{part}: {error}");
    }
    let error = level(&row.replace("10000.00", "0"), &at(150.16e6, 0.0)).expect_err("no width");
    assert!(error.contains("hz_step") && error.contains("\"0\""), "{error}");
    // Without the offset of its time zone no row is on the track.
    let rover = Rover::parse(GPX.as_bytes(), "rover.gpx").expect("a track");
    let local = at(150.16e6, 0.0).with_rover(rover.clone(), 0.0).expect("finite");
    assert_names(
        row,
        &local,
        &["the track rover.gpx, from 2026-06-01 10:00:00 to", "7205 s after it"],
    );
    // A track needs times that it can be joined by.
    let options = ReadOptions::default().with_rover(rover, 0.0).expect("finite");
    assert_names("time_s,rss_dbm,range_m\n1,-60,5\n", &options, &["rover.gpx", "needs time_utc"]);
    assert!(Band::new(0.0, 1.0).is_err() && Band::new(1.0, -1.0).is_err());
    let options = sweep.with_constant(Column::Beacon, "fox");
    assert_names(row, &options, &["--frequency-hz"]);
}
