//! Tables of programs that hold a receiver's path. Their columns are the published ones.

use approx::assert_abs_diff_eq;
use foxhunt_archive::recording::{
    Column, Mapping, ReadOptions, Recording, RecordingError, Rover, builtin_mappings,
};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};

/// The beginning of the path, 2026-06-21 14:03:00 UTC.
const BEGIN: f64 = 1_782_050_580.0;

/// A flight of 60 s at 10 m/s to the North, 30 m above the take-off, ten rows a second.
fn flight(header: &str, row: impl Fn(u32, f64, f64, f64) -> String) -> String {
    let rows = (0..600).map(|tenth| {
        let along = f64::from(tenth);
        row(tenth, 48.2 + along / 111_200.0, 16.37, if tenth == 0 { 0.0 } else { 30.0 })
    });
    format!("{header}\n{}", rows.collect::<String>())
}

/// Each program's table, with the zone of its times.
fn tables() -> [(&'static str, String, &'static str); 7] {
    let clock = |tenth: u32, hour: u32| {
        format!("{hour}:{:02}:{:02}.{}", 3 + tenth / 600, tenth / 10 % 60, tenth % 10)
    };
    let airdata = |unit: &str, foot: f64| {
        flight(
            &format!(
                "time(millisecond),datetime(utc),latitude,longitude,height_above_takeoff({unit}),\
                 altitude_above_seaLevel({unit}),satellites,gpslevel,voltage(v), \
                 compass_heading(degrees), pitch(degrees),flycState,rc_throttle,battery_percent"
            ),
            |tenth, lat, lon, up| {
                let second = tenth / 10;
                format!(
                    "{},2026-06-21 14:03:{second:02},{lat:.7},{lon:.7},{:.2},{:.2},14,5,15.1,0.1,\
                     -1.2,Waypoint,1024,98\n",
                    tenth * 100,
                    up / foot,
                    (230.0 + up) / foot
                )
            },
        )
    };
    let dji = |unit: &str, foot: f64| {
        flight(
            &format!(
                "sep=,\nCUSTOM.date [local],CUSTOM.updateTime [local],OSD.flyTime [s],\
                 OSD.latitude,OSD.longitude,OSD.height [{unit}],OSD.altitude [{unit}],\
                 RC.downlinkSignal,RC.uplinkSignal"
            ),
            |tenth, lat, lon, up| {
                format!(
                    "6/21/2026,{} PM,{},{lat:.8},{lon:.8},{:.2},{:.1},{},100\n",
                    clock(tenth, 4),
                    tenth / 10,
                    up / foot,
                    (230.0 + up) / foot,
                    90 - tenth / 20
                )
            },
        )
    };
    [
        ("airdata", airdata("feet", 0.3048), "+02:00"),
        ("airdata-metric", airdata("meters", 1.0), "+02:00"),
        ("dji", dji("ft", 0.3048), "+02:00"),
        ("dji-metric", dji("m", 1.0), "+02:00"),
        (
            "dji-log-parser",
            flight(
                "CUSTOM.dateTime,OSD.flyTime,OSD.latitude,OSD.longitude,OSD.height,OSD.altitude,\
                 RC.downlinkSignal,RC.uplinkSignal",
                |tenth, lat, lon, up| {
                    let time = clock(tenth, 14);
                    let signal = 90 - tenth / 20;
                    format!("2026-06-21T{time}Z,{tenth},{lat},{lon},{up},260,{signal},100\n")
                },
            ),
            "UTC",
        ),
        (
            "dji-txtlog",
            flight(
                "CUSTOM.updateTime,GIMBAL.yaw,OSD.height [m],CUSTOM.isVideo,OSD.latitude,\
                 OSD.longitude",
                |tenth, lat, lon, up| {
                    let time = clock(tenth, 14);
                    format!("2026/06/21 {time},90,{up},,{lat},{lon}\n")
                },
            ),
            "UTC",
        ),
        (
            "qgroundcontrol",
            flight(
                "Timestamp,roll,pitch,heading,groundSpeed,altitudeRelative,altitudeAMSL,\
                 flightDistance,throttlePct,battery0.voltage,gps.lat,gps.lon,gps.hdop,gps.lock",
                |tenth, lat, lon, up| {
                    let time = clock(tenth, 16);
                    let amsl = 230.0 + up;
                    // Before the first fix a ground station has no place.
                    let place = match tenth {
                        300..320 => "--.--,--.--".to_owned(),
                        _ => format!("{lat},{lon}"),
                    };
                    format!("2026-06-21 {time},0,0,90,10,{up},{amsl},0,40,15.2,{place},0.9,6\n")
                },
            ),
            "+02:00",
        ),
    ]
}

fn zoned(zone: &str) -> ReadOptions {
    ReadOptions::default().with_time_zone(zone.parse().expect("a zone"))
}

fn read(name: &str, table: &str, options: &ReadOptions) -> Result<Recording, RecordingError> {
    Recording::from_reader(table.as_bytes(), name, options)
}

#[test]
fn each_table_is_recognised_as_a_path_in_metres_and_utc() {
    let folder = std::env::temp_dir().join(format!("foxhunt-paths-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    for (name, table, zone) in tables() {
        let begin = &table.as_bytes()[..table.len().min(Rover::BEGIN)];
        assert!(Rover::is_path_table(begin) && !Rover::is_track(begin), "{name}");
        let level = ReadOptions::default().with_constant(Column::RssDb, 0.0);
        let level = level.with_time_format("mdy".parse().expect("a format"));
        assert_eq!(read(name, &table, &level).expect(name).format(), name);
        let file = folder.join(name);
        std::fs::write(&file, &table).expect("the folder can be written to");
        let mut options = zoned(zone);
        options.time_format = Some("mdy".parse().expect("a format"));
        let rover = Rover::read_with(&file, &options).unwrap_or_else(|e| panic!("{name}: {e}"));
        let frame = LocalFrame::new(rover.begin()).expect("a place");
        for second in [0.0, 5.0, 12.3, 47.75] {
            let local = frame.to_local(&rover.place(BEGIN + second).expect("on the path"));
            let off = local.x.hypot(local.y - 10.0 * second);
            // A degree of 111.2 km is not that of the ellipsoid to 0.02 %.
            assert!(off < 0.4, "{name}, {second} s: {local}");
            assert!(second < 1.5 || (local.z - 30.0).abs() < 0.05, "{name}, {second} s: {local}");
        }
    }
    std::fs::remove_dir_all(&folder).expect("it was made");
    let paths = builtin_mappings().iter().filter(|mapping| mapping.path).count();
    assert_eq!(paths, tables().len(), "each path has a table here");
}

#[test]
fn a_path_alone_is_refused_with_its_levels() {
    for (name, table, _) in tables() {
        let error = read(name, &table, &ReadOptions::default()).expect_err(name).to_string();
        let expected = match table.contains("RC.downlinkSignal") {
            true => "--level NAME: RC.downlinkSignal, RC.uplinkSignal",
            false => "hold times and places, but no levels",
        };
        assert!(error.contains(expected), "{name}: {error}");
    }
}

#[test]
fn a_level_of_a_path_is_read_by_its_name() {
    let [.., (_, dji, _), _, _] = tables();
    let options = ReadOptions::default().with_level("RC.downlinksignal");
    let recording = read("flight.csv", &dji, &options).expect("a path with levels");
    assert_eq!((recording.format(), recording.records().len()), ("dji-log-parser", 600));
    assert!(!recording.is_calibrated());
    let last = recording.records().last().expect("a row");
    assert_eq!(last.rss_dbm, Some(61.0));
    assert_abs_diff_eq!(last.receiver().expect("a place").position.z, 30.0, epsilon = 1e-9);
    // A format that is stated has the level, too.
    let stated = options.with_format(Mapping::find("dji-log-parser").expect("it is shipped"));
    let recording = read("flight.csv", &dji, &stated).expect("a path with levels");
    assert_eq!(recording.records().last().and_then(|record| record.rss_dbm), Some(61.0));
    // Any table with times and places has levels by name, in dBm where the name says so.
    let table = "time,lat,lon,rssi,link [dBm]\n\
                 2026-06-21 14:03:00,48.2,16.37,-60,-71\n2026-06-21 14:03:01,48.2,16.37,-60,-72\n";
    let options = ReadOptions::default().with_level("link [dBm]");
    let recording = read("walk.csv", table, &options).expect("levels");
    assert_eq!(recording.records()[1].rss_dbm, Some(-72.0));
    assert!(recording.is_calibrated());
    let options = ReadOptions::default().with_level("snr");
    let error = read("walk.csv", table, &options).expect_err("no such column").to_string();
    assert!(error.contains("without levels \"snr\"") && error.contains("rssi, link"), "{error}");
}

/// The log that an Android phone with Google's GNSS Logger writes beside the levels of a receiver.
#[test]
fn a_log_of_gnss_logger_is_a_path() {
    let mut log = "# \n# Header Description:\n# \n# Raw,utcTimeMillis,TimeNanos,Svid\n# \n\
                   # Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,\
                   AccuracyMeters,BearingDegrees,UnixTimeMillis\n"
        .to_owned();
    for second in 0..60 {
        let lat = 48.2 + 10.0 * f64::from(second) / 111_200.0;
        let time = 1_782_050_580_000_i64 + 1000 * i64::from(second);
        log += &format!("Raw,{time},1,5\nFix,GPS,{lat:.8},16.37,273.5,1.4,3.8,0.0,{time}\n");
    }
    assert!(Rover::is_track(log.as_bytes()));
    let rover = Rover::parse(log.as_bytes(), "gnss_log.txt").expect("a path");
    let frame = LocalFrame::new(rover.begin()).expect("a place");
    let local = frame.to_local(&rover.place(BEGIN + 30.5).expect("on the path"));
    assert_abs_diff_eq!(local.y, 305.0, epsilon = 0.2);
    assert_abs_diff_eq!(local.x, 0.0, epsilon = 0.01);
    let error = read("gnss_log.txt", &log, &ReadOptions::default()).expect_err("no levels");
    assert!(error.to_string().contains("a log of Android's GNSS Logger"), "{error}");
}

#[test]
fn tables_with_measurements_are_no_paths() {
    for table in [
        "time,lat,lon,rssi\n0,48,16,-60\n",
        "time,rssi\n0,-60\n",
        "time,lat,lon,heading\n0,48,16,90\n",
        "lat,lon,bearing\n48,16,90\n",
        "noise\n",
        "",
    ] {
        assert!(!Rover::is_path_table(table.as_bytes()), "{table}");
    }
    let logger = b"# a logger\ndate,lat,lon,satellites\n2026-06-21 14:03,48,16,9\n";
    assert!(Rover::is_path_table(logger));
}

/// The path is in UTC whatever zone the levels are in.
#[test]
fn a_zone_leaves_times_that_are_named_utc() {
    let [(_, airdata, _), ..] = tables();
    let rover = Rover::parse(airdata.as_bytes(), "flight.csv").expect("a path");
    let options = zoned("+02:00").with_rover(rover, 0.0).expect("finite");
    let levels = "time,rssi\n2026-06-21 16:03:05,-60\n2026-06-21 16:03:06,-61\n";
    let recording = read("levels.csv", levels, &options).expect("joined");
    let begin = LocalFrame::new(Geodetic { lat_deg: 48.2, lon_deg: 16.37, alt_m: 0.0 });
    let frame = recording.frame().expect("degrees");
    let place = recording.records()[0].receiver().expect("a place").position;
    let local = begin.expect("a place").to_local(&frame.to_geodetic(&place));
    assert_abs_diff_eq!(local.y, 50.0, epsilon = 0.2);
}
