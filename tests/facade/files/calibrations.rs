//! Files of calibrations.

use foxhunt::calibration::{
    ArraySection, BearingCalibration, BearingSection, CalibrationFile, PathLossSection,
    StationAntennaSection, StationModelSection, StationPlace, StationSection,
};

fn whole() -> CalibrationFile {
    let antenna = |deg: f64| StationAntennaSection {
        recorded_deg_compass: deg,
        boresight_deg_compass: deg + 1.0 / 3.0,
        half_interval_deg: Some(2.0),
        boresight_sigma_deg: 0.7,
        gain_db: -0.1,
        gain_sigma_db: 0.3,
        site_db: vec![0.1, -0.2],
    };
    CalibrationFile {
        recordings: vec!["a.csv".to_owned()],
        beacon: Some("fox".to_owned()),
        path_loss: Some(PathLossSection {
            p0_dbm: -29.06,
            exponent: 2.765,
            covariance: Some([[1.0, 0.1], [0.1, 0.03]]),
            at_bound: false,
            sigma_db: Some(2.5),
            points: Some(15),
        }),
        bearings: Some(BearingSection {
            extractor: Some("pritzl2018".to_owned()),
            bearings: Some(12),
            correction: BearingCalibration { offset_deg_ccw: 8.6, ..<_>::default() },
            half_intervals_deg: Some([1.0, 0.0, 0.0]),
            sigma_scale_interval: Some([0.1, 0.3]),
            sigma_floor_interval_deg: Some([0.0, 1.0]),
        }),
        arrays: vec![ArraySection {
            name: Some("mast".to_owned()),
            bearings: Some(24),
            offset_deg_ccw: 0.1 + 0.2,
            harmonics_deg: vec![[1.0 / 3.0, -2.5]],
            covariance_deg2: vec![vec![0.3, 0.1, 0.0], vec![0.1, 0.2, 0.0], vec![0.0, 0.0, 0.25]],
            sigma_deg: 1.1,
            sigma_scale: 0.9,
            sigma_floor_deg: 0.4,
        }],
        station_model: Some(StationModelSection {
            stations: Some(1),
            beamwidth_deg: 37.0,
            front_to_back_db: 15.0,
            residual_db: 5.1,
            floor_dbm: Some(-106.5),
            floor_width_db: 1.1,
            boresight_sigma_deg: 9.5,
            gain_sigma_db: 2.9,
        }),
        stations: vec![StationSection {
            name: Some("hill".to_owned()),
            place: Some(StationPlace { lat_deg: 50.0, lon_deg: 14.25 }),
            beamwidth_deg: 36.0,
            front_to_back_db: 16.0,
            residual_db: 4.8,
            floor_dbm: Some(-107.0),
            floor_width_db: 1.2,
            antennas: vec![antenna(65.0), antenna(245.0)],
        }],
        ..CalibrationFile::default()
    }
}

#[test]
fn what_is_written_is_read_back_to_the_bit() {
    for file in [whole(), CalibrationFile::default()] {
        assert_eq!(CalibrationFile::parse(&file.to_toml(), "c.toml").expect("as written"), file);
    }
}

#[test]
fn what_comes_with_the_program_is_in_order() {
    let file = CalibrationFile::shipped("uri-yagi-station").expect("it is shipped");
    // Boresights are never those of another station.
    assert!(!file.stations.is_empty() && file.stations.iter().all(|s| s.place.is_some()));
    assert_eq!(CalibrationFile::shipped("no-such-format"), None);
}

#[test]
fn stations_are_known_by_name_and_place() {
    let mut file = whole();
    let hill = file.stations[0].clone();
    file.stations.push(StationSection { name: Some("mill".to_owned()), ..hill.clone() });
    file.stations.push(StationSection { name: None, place: None, ..hill });
    let file = CalibrationFile::parse(&file.to_toml(), "c.toml").expect("as written");
    let at = |lat_deg, lon_deg| Some(StationPlace { lat_deg, lon_deg });
    let index = |name, place| {
        let found = file.station(name, place).expect("the last one is of any");
        file.stations.iter().position(|station| std::ptr::eq(station, found))
    };
    // 0.0005° are 56 m, 0.001° are 111 m.
    assert_eq!(index("hill", at(50.0005, 14.25)), Some(0));
    assert_eq!(index("mill", at(50.0005, 14.25)), Some(1));
    assert_eq!(index("hill", at(50.001, 14.25)), Some(2));
    assert_eq!(index("hill", None), Some(2));
    assert_eq!(index("tower", at(50.0, 14.25)), Some(2));
    // One table, as earlier versions wrote it.
    let one = whole().to_toml().replace("[[station]]", "[station]");
    assert_eq!(CalibrationFile::parse(&one, "c.toml").expect("a table"), whole());
}

#[test]
fn mistakes_are_named() {
    let text = whole().to_toml();
    for (from, to, expected) in [
        ("exponent = 2.765", "exponent = -1.0", "path_loss: exponent is -1"),
        ("[1.0, 0.1]", "[1.0, 0.3]", "path_loss: the covariance of P₀ and γ is 0.3"),
        ("[0.1, 0.03]", "[0.2, 0.03]", "the lower covariance of P₀ and γ is 0.2"),
        ("sigma_db = 2.5", "sigma_db = -2.5", "path_loss: sigma_db is -2.5"),
        ("sigma_scale = 1.0", "sigma_scale = -1.0", "bearings.correction: scale is -1"),
        ("sigma_deg = 1.1", "sigma_deg = -1.1", "array 1 (mast): sigma_deg is -1.1"),
        ("[0.1, 0.2, 0.0]", "[0.1, -0.2, 0.0]", "array 1 (mast): covariance_deg2"),
        ("[0.1, 0.2, 0.0]", "[0.1, 0.2]", "array 1 (mast): covariance_deg2"),
        ("beamwidth_deg = 36.0", "beamwidth_deg = 190.0", "station: beamwidth"),
        ("boresight_sigma_deg = 9.5", "boresight_sigma_deg = -1.0", "station_model: boresight"),
        ("gain_sigma_db = 2.9", "gain_sigma_deg = 2.9", "gain_sigma_deg"),
        ("gain_sigma_db = 0.3", "gain_sigma_db = -0.3", "station: gain_sigma_db is -0.3"),
        ("lat_deg = 50.0", "lat_deg = 95.0", "station: place.lat_deg is 95"),
        ("foxhunt_calibration = 1", "foxhunt_calibration = 7", "is 7; this program reads 1"),
        ("beacon = \"fox\"", "becon = \"fox\"", "becon"),
    ] {
        assert!(text.contains(from), "{from}: {text}");
        let error = CalibrationFile::parse(&text.replace(from, to), "c.toml").expect_err(to);
        let error = error.to_string();
        assert!(error.starts_with("c.toml") && error.contains(expected), "{to}: {error}");
    }
    let mut twice = whole();
    twice.arrays.extend(whole().arrays);
    twice.arrays[0].name = None;
    let error = CalibrationFile::parse(&twice.to_toml(), "c.toml").expect_err("one is hidden");
    assert!(error.to_string().contains("array 2 (mast): an array before it"), "{error}");
    twice.arrays[0].name = twice.arrays[1].name.clone();
    let error = CalibrationFile::parse(&twice.to_toml(), "c.toml").expect_err("one is unused");
    assert!(error.to_string().contains("array 2 (mast): an array before it"), "{error}");
}
