//! Our own format, there and back.

use foxhunt_archive::recording::{
    Column, Mapping, ReadOptions, RecordedSource, Recording, RecordingEnded, RecordingError,
    SweepWriter,
};
use foxhunt_core::{BeaconId, PatternSource, Pose, Sample, Sweep, angle, laws};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use nalgebra::Vector3;
use proptest::prelude::*;

fn sweep(samples: &[Sample]) -> Sweep<'_> {
    let time = samples.last().map_or(0.0, |sample| sample.time);
    Sweep { time, positions: 128, samples, ..Sweep::default() }
}

fn read_back(bytes: &[u8]) -> Recording {
    Recording::from_reader(bytes, "written.csv", &ReadOptions::default()).expect("our own")
}

/// Texts of some of these characters.
fn text(from: &str, length: std::ops::Range<usize>) -> impl Strategy<Value = String> + use<> {
    let from: Vec<_> = from.chars().collect();
    let characters = prop::collection::vec(prop::sample::select(from), length);
    characters.prop_map(|characters| characters.into_iter().collect())
}

prop_compose! {
    fn sample()(
        // So near that a receiver may have moved from any place to any other.
        time in -1e9..1e9f64, east in -25.0..25.0f64, north in -25.0..25.0f64, up in 0.0..500.0f64,
        heading in -20.0..20.0f64, pitch in -1.5..1.5f64, roll in -3.0..3.0f64,
        boresight in -20.0..20.0f64, position in 0u16..128, rss_dbm in -140.0..0.0f64,
    ) -> Sample {
        let level = Pose::level(Vector3::new(east, north, up), heading);
        let receiver = Pose { pitch, roll, ..level };
        Sample { time, receiver, boresight, position, rss_dbm }
    }
}

proptest! {
    #[test]
    fn written_sweeps_read_back(
        mut turns in prop::collection::vec(prop::collection::vec(sample(), 1..20), 1..6),
        drone in text("#\"ax,", 1..8), beacon in text("#\"é,x", 1..8),
    ) {
        let mut bytes = Vec::new();
        let mut writer = SweepWriter::new(&mut bytes).expect("memory");
        for samples in &mut turns {
            samples.sort_by(|a, b| a.time.total_cmp(&b.time));
            writer.write(&drone, &beacon, &sweep(samples)).expect("memory");
        }
        writer.finish().expect("memory");
        let recording = read_back(&bytes);
        prop_assert_eq!(recording.format(), "foxhunt");
        prop_assert!(recording.ignored_columns().is_empty() && recording.dropped().is_empty());
        let mut sweeps = recording.sweeps(128).expect("128 positions");
        sweeps.sort_by_key(|sweep| sweep.turn);
        prop_assert_eq!(sweeps.len(), turns.len());
        for (read, written) in sweeps.iter().zip(&turns) {
            prop_assert_eq!(&read.drone, &drone);
            prop_assert_eq!(read.beacon_name.as_ref(), Some(&beacon));
            prop_assert_eq!(read.sweep.samples.len(), written.len());
            for (a, b) in read.sweep.samples.iter().zip(written) {
                prop_assert_eq!(a.time.to_bits(), b.time.to_bits());
                prop_assert_eq!(a.rss_dbm.to_bits(), b.rss_dbm.to_bits());
                prop_assert_eq!(a.receiver.position, b.receiver.position);
                prop_assert_eq!(a.position, b.position);
                // Degrees and back: a few roundings of a number below 360.
                prop_assert!(angle::distance(a.boresight, b.boresight) < 1e-13);
                prop_assert!(angle::distance(a.receiver.heading, b.receiver.heading) < 1e-13);
                prop_assert!((a.receiver.pitch - b.receiver.pitch).abs() < 1e-13);
                prop_assert!((a.receiver.roll - b.receiver.roll).abs() < 1e-13);
            }
            let poses = || written.iter().map(|sample| &sample.receiver);
            let mean = Pose::mean(poses()).expect("there are samples");
            prop_assert!((read.sweep.receiver.pitch - mean.pitch).abs() < 1e-12);
            prop_assert!((read.sweep.receiver.roll - mean.roll).abs() < 1e-12);
        }
    }

    #[test]
    fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let read = Recording::from_reader(&bytes[..], "noise", &ReadOptions::default());
        prop_assert!(read.is_err());
    }

    /// Noise that gets past the header, since most of it does not.
    #[test]
    fn no_cells_make_it_panic(
        header in prop::sample::select(vec![
            "time_s,lat_deg,lon_deg,boresight_deg_compass,rss_dbm,position,turn",
            "time_utc,east_m,north_m,antenna_deg,rss_dbm,heading_deg_compass,up_m",
            "tag_id,snr_db,group,idx_in_group,yaw_deg,lat_deg,lon_deg,alt_m",
            "obs,x,y,bearing_deg", "tag,rssi_db,distance_m",
        ]),
        rows in prop::collection::vec(text("-+0123456789.,,,,einfNaT: \"#\r\n\0é", 0..40), 0..8),
        numbers in prop::collection::vec(prop::collection::vec(any::<f64>(), 4..9), 0..4),
        positions in any::<u16>(),
    ) {
        let mut text = format!("{header}\n{}\n", rows.join("\n"));
        for row in numbers {
            let row: Vec<_> = row.iter().map(ToString::to_string).collect();
            text.push_str(&row.join(","));
            text.push('\n');
        }
        if let Ok(read) = Recording::from_reader(text.as_bytes(), "noise", &ReadOptions::default()) {
            prop_assert!(!read.records().is_empty());
            for record in read.records() {
                prop_assert!(record.receiver().is_none_or(|pose| pose.is_finite()));
                prop_assert!(record.rss_dbm.is_none_or(f64::is_finite));
                prop_assert!(record.boresight.is_none_or(f64::is_finite));
            }
            let _ = read.sweeps(positions);
        }
    }

    #[test]
    fn places_in_degrees_come_out_where_they_are(
        lat in -80.0..80.0f64, lon in -179.0..179.0f64,
        east in -5_000.0..5_000.0f64, north in -5_000.0..5_000.0f64, agl in 1.0..120.0f64,
    ) {
        let origin = Geodetic { lat_deg: lat, lon_deg: lon, alt_m: 0.0 };
        let frame = LocalFrame::new(origin).expect("a place");
        // The ground lies below the flat frame by d²/2R: the file's height is above the ground.
        let place = frame.to_geodetic(&Vector3::new(east, north, 0.0));
        let text = format!(
            "lat_deg,lon_deg,alt_agl_m,rss_dbm\n{lat},{lon},0,-60\n{},{},{agl},-60\n",
            place.lat_deg, place.lon_deg
        );
        let read = read_back(text.as_bytes());
        let local = read.records()[1].receiver().expect("located").position;
        // Dropped by up to 4 m onto the ellipsoid, East and North shrink by 4 m × 7 km / R.
        prop_assert!((local - Vector3::new(east, north, agl)).norm() < 1e-2, "{}", local);
        prop_assert_eq!(read.frame().map(|frame| frame.origin()), Some(origin));
    }
}

#[test]
fn what_would_not_read_back_is_not_written() {
    let good = Sample {
        time: 0.0,
        receiver: Pose::default(),
        boresight: 0.0,
        position: 0,
        rss_dbm: -60.0,
    };
    let mut bytes = Vec::new();
    let mut writer = SweepWriter::new(&mut bytes).expect("memory");
    for name in ["", " a", "a\n"] {
        let message = writer.write(name, "b", &sweep(&[good])).expect_err(name);
        assert!(matches!(message, RecordingError::Name { column: "drone", .. }), "{message}");
        assert!(writer.write("a", name, &sweep(&[good])).is_err());
    }
    let bad = [
        Sample { rss_dbm: f64::NAN, ..good },
        Sample { rss_dbm: 400.0, ..good },
        Sample { boresight: f64::INFINITY, ..good },
        Sample { time: f64::NAN, ..good },
        Sample { receiver: Pose { pitch: 1.6, ..good.receiver }, ..good },
        Sample { receiver: Pose { roll: f64::NAN, ..good.receiver }, ..good },
    ];
    for sample in bad {
        let message = writer.write("a", "b", &sweep(&[good, sample])).expect_err("not a number");
        assert!(matches!(message, RecordingError::Sample { index: 1, .. }), "{message}");
    }
    writer.write("a", "b", &sweep(&[good])).expect("good");
    writer.finish().expect("memory");
    assert_eq!(read_back(&bytes).rows(), 1, "refused sweeps left nothing behind");
}

#[test]
fn the_example_of_the_documentation_reads() {
    let page = include_str!("../../../../docs/recordings.md");
    let csv: Vec<_> =
        page.split("```csv\n").skip(1).filter_map(|t| t.split("```").next()).collect();
    assert!(csv.len() >= 2, "{} examples", csv.len());
    for text in csv {
        let read = read_back(text.as_bytes());
        assert_eq!(read.format(), "foxhunt");
        assert!(read.ignored_columns().is_empty() && read.dropped().is_empty());
    }
    let toml = page.split("```toml mapping\n").skip(1).filter_map(|t| t.split("```").next());
    let names = toml.map(|text| Mapping::parse(text, "page").expect("a mapping").name);
    assert!(names.eq(["my-logger", "wide", "analyser"]));
    for column in Column::ALL {
        assert!(page.contains(&format!("`{column}`")), "{column} is not documented");
    }
}

#[test]
fn a_recording_is_a_pattern_source() {
    let mut bytes = Vec::new();
    let mut writer = SweepWriter::new(&mut bytes).expect("memory");
    let sample = |time: f64, rss_dbm| Sample {
        time,
        receiver: Pose::at(1.0, 2.0, 3.0),
        boresight: 0.5,
        position: 10,
        rss_dbm,
    };
    for (beacon, time, rss_dbm) in
        [("fox", 1.0, -61.0), ("hare", 2.0, -62.0), ("owl", 3.0, -63.0), ("fox", 4.0, -64.0)]
    {
        writer.write("kite", beacon, &sweep(&[sample(time, rss_dbm)])).expect("memory");
    }
    writer.write("crow", "fox", &sweep(&[sample(5.0, -65.0)])).expect("memory");
    writer.finish().expect("memory");
    let sweeps = read_back(&bytes).sweeps(128).expect("128 positions");
    let beacons = ["hare", "fox"].map(str::to_owned);
    let mut source = RecordedSource::new(sweeps, "kite", &beacons);
    assert_eq!(source.left(), 3, "the owl is no beacon of the hunt, and the crow is another drone");
    let hare = BeaconId(0);
    let fox = BeaconId(1);
    laws::pattern_source(&mut source.clone(), &[fox, hare], 2, || {});
    let mut next = |beacons: &[BeaconId]| {
        source.begin(beacons).expect("it begins");
        source.poll().map(|sweep| sweep.map(|s| (s.beacon, s.samples[0].rss_dbm)))
    };
    assert_eq!(next(&[fox]), Ok(Some((fox, -61.0))));
    assert_eq!(next(&[fox, hare]), Ok(Some((fox, -64.0))));
    assert_eq!(next(&[hare]), Ok(Some((hare, -62.0))));
    assert_eq!(next(&[fox]), Err(RecordingEnded { beacon: fox }));
    assert_eq!(next(&[]), Ok(None));
}
