//! Antennas out of files: those at hand, what writes back, what is refused and in which line.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use core::f64::consts::{FRAC_PI_2, PI, TAU};
use std::{fmt::Write as _, fs, path::PathBuf};

use foxhunt_sensors::{
    Antenna, AntennaConfig, AntennaError, MsiFile, MsiUnit, Patch, PatternFileReason, PatternTable,
    PatternTable3d, Yagi,
};

use crate::vectors::shared;

const PATTERNS: &str = "data/antenna_patterns";

fn pattern(name: &str) -> Option<String> {
    shared(&format!("{PATTERNS}/{name}"))
}

fn degrees(radians: Option<f64>) -> f64 {
    radians.expect("it is directional").to_degrees()
}

/// 360 + 360 rows of a lobe that falls to 20 dB behind.
fn sample() -> String {
    let mut text = "NAME a panel\nMAKE\nFREQUENCY 2440\nGAIN 10.5 dBd\nTILT\n".to_owned();
    for section in ["HORIZONTAL", "VERTICAL"] {
        writeln!(text, "{section} 360").expect("a string");
        for i in 0..360 {
            let below = 10.0 * (1.0 - f64::from(i).to_radians().cos());
            writeln!(text, "{i} {below:.2}").expect("a string");
        }
    }
    text
}

#[test]
fn every_pattern_at_hand_loads_and_vendor_files_write_back() {
    if pattern("nec_panel8_2g4.msi").is_none() {
        return;
    }
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared").join(PATTERNS);
    let mut loaded = 0;
    for entry in fs::read_dir(folder).expect("a file in it was read") {
        let path = entry.expect("as above").path();
        let antenna = AntennaConfig::File(path.clone()).build();
        let antenna = antenna.unwrap_or_else(|error| panic!("{error}"));
        assert!(antenna.main_lobe().gain_dbi.is_finite(), "{}", path.display());
        if path.extension().is_some_and(|e| e == "msi" || e == "pln") {
            let text = fs::read_to_string(&path).expect("it was read");
            let file = MsiFile::parse(&text).expect("it was read");
            assert_eq!(MsiFile::parse(&file.to_string()).as_ref(), Ok(&file), "{}", path.display());
            // Every header line is there again, blanks and all.
            let header = |text: &str| -> Vec<String> {
                let lines = text.lines().take_while(|line| !line.starts_with("HORIZONTAL"));
                lines.map(|line| line.trim_end().to_owned()).collect()
            };
            assert_eq!(header(&text), header(&file.to_string()), "{}", path.display());
        }
        loaded += 1;
    }
    assert!(loaded >= 13, "{loaded} files");
}

#[test]
fn vendor_files_have_the_figures_of_their_own_headers() {
    for (name, gain, across, up) in [
        ("sample_B800A065-18-0E.pln", 15.75, 65.0, 11.2),
        ("sample_SV460-SF2SNM_0920_00T.msi", 17.15, 14.5, 29.0),
    ] {
        let Some(text) = pattern(name) else { return };
        let file = MsiFile::parse(&text).expect("in order");
        assert!((file.gain_dbi() - gain).abs() < 1e-9 && file.gain().1 == MsiUnit::Dbd);
        let antenna = file.antenna().expect("in order");
        let widths = [
            degrees(antenna.half_power_beamwidth()),
            degrees(antenna.elevation_half_power_beamwidth()),
        ];
        // Headers are nominal: the first has 65° where its own rows fall by 3 dB at ±33°.
        assert_abs_diff_eq!(widths[0], across, epsilon = 4.0);
        assert_abs_diff_eq!(widths[1], up, epsilon = 1.5);
    }
    let Some(text) = pattern("sample_AMB4520R8v06_05T.msi") else { return };
    let file = MsiFile::parse(&text).expect("in order");
    assert_eq!(file.field("tilt"), Some("ELECTRICAL"));
    let lobe = file.antenna().expect("in order").main_lobe();
    // 5° down, and the beam at 32° clockwise.
    assert_abs_diff_eq!(lobe.elevation.to_degrees(), -5.0, epsilon = 1.0);
    assert_abs_diff_eq!(lobe.azimuth.to_degrees(), -32.0, epsilon = 1.0);
    assert_abs_diff_eq!(lobe.gain_dbi, 19.10, epsilon = 0.05);
}

/// Agreement of one NEC model's table over the angle, its table over both angles, and its two cuts.
#[test]
fn the_forms_of_one_antenna_agree() {
    for (name, rms_front) in [("nec_panel8_2g4", 0.60), ("nec_yagi5_2g4", 2.00)] {
        let Some(cuts) = pattern(&format!("{name}.msi")) else { return };
        let cuts = MsiFile::parse(&cuts)
            .and_then(|file| file.antenna().map_err(|error| panic!("{error}")));
        let cuts = cuts.expect("in order");
        let text = |end: &str| pattern(&format!("{name}_{end}.csv")).expect("as the one before");
        let flat = PatternTable::from_csv(&text("azimuth")).expect("in order");
        let whole = PatternTable3d::from_csv(&text("3d")).expect("in order");
        let (mut square, mut weight) = (0.0, 0.0);
        for azimuth in (0..360_u16).step_by(5).map(|a| f64::from(a).to_radians()) {
            let level = flat.gain_db(azimuth);
            assert!((whole.gain_dbi(azimuth, 0.0) - level).abs() < 0.011, "{name} at {azimuth}");
            assert!((cuts.gain_dbi(azimuth, 0.0) - level).abs() < 0.02, "{name} at {azimuth}");
            for elevation in (0..17_u16).map(|i| (f64::from(i) * 10.0 - 80.0).to_radians()) {
                if azimuth.cos() > -1e-9 {
                    let error =
                        cuts.gain_dbi(azimuth, elevation) - whole.gain_dbi(azimuth, elevation);
                    square += error * error * elevation.cos();
                    weight += elevation.cos();
                }
            }
        }
        let rms = (square / weight).sqrt();
        assert!((rms - rms_front).abs() < 0.15, "{name}: {rms} dB over the front half");
        // Computed without losses.
        let directivity = whole.directivity_dbi();
        assert!((directivity - whole.main_lobe().gain_dbi).abs() < 0.1, "{name}: {directivity}");
    }
}

#[test]
fn the_formulas_are_near_the_computed_antennas() {
    for (name, elements) in [("nec_yagi3_2g4.msi", 3), ("nec_yagi5_2g4.msi", 5)] {
        let Some(text) = pattern(name) else { return };
        let computed = MsiFile::parse(&text).expect("in order").antenna().expect("in order");
        let yagi = Yagi::new(elements, 0.25, 20.0).expect("in range");
        let widths = [&computed as &dyn Antenna, &yagi].map(|a| degrees(a.half_power_beamwidth()));
        assert!(abs_diff_eq!(widths[0], widths[1], epsilon = 3.0), "{name}: {widths:?}");
        let gains = [computed.main_lobe().gain_dbi, yagi.main_lobe().gain_dbi];
        assert!(abs_diff_eq!(gains[0], gains[1], epsilon = 1.1), "{name}: {gains:?} {widths:?}");
    }
    let Some(text) = pattern("nec_panel8_2g4_3d.csv") else { return };
    let computed = PatternTable3d::from_csv(&text).expect("in order");
    let (across, up) = (computed.half_power_beamwidth(), computed.elevation_half_power_beamwidth());
    let widths = [across, up].map(|width| width.expect("it is directional"));
    let patch = Patch::new(widths[0], widths[1], computed.front_to_back_db()).expect("in range");
    let gains = [computed.main_lobe().gain_dbi, patch.main_lobe().gain_dbi];
    assert_abs_diff_eq!(gains[0], gains[1], epsilon = 1.0);
}

/// MSI angles run clockwise and down.
#[test]
fn right_and_down_follow_the_file() {
    let mut text = "GAIN 3 dBi\nHORIZONTAL 4\n0 0\n90 6\n180 12\n270 18\n".to_owned();
    text += "VERTICAL 4\n0 0\n90 5\n180 12\n270 9\n";
    let antenna = MsiFile::parse(&text).expect("in order").antenna().expect("in order");
    assert!((antenna.gain_dbi(-FRAC_PI_2, 0.0) - (3.0 - 6.0)).abs() < 1e-9, "to the right");
    assert!((antenna.gain_dbi(FRAC_PI_2, 0.0) - (3.0 - 18.0)).abs() < 1e-9, "to the left");
    assert!(abs_diff_eq!(antenna.gain_dbi(0.0, -FRAC_PI_2), 3.0 - 5.0, epsilon = 1e-9), "down");
    assert!(abs_diff_eq!(antenna.gain_dbi(0.0, FRAC_PI_2), 3.0 - 9.0, epsilon = 1e-9), "up");
}

#[test]
fn what_is_written_of_an_antenna_is_that_antenna() {
    let yagi = Yagi::new(5, 0.25, 20.0).expect("in range");
    let file = MsiFile::sampled("a  yagi", &yagi);
    let read = MsiFile::parse(&file.to_string()).expect("as written");
    assert_eq!((read.field("name"), &read), (Some("a yagi"), &file));
    let antenna = read.antenna().expect("as written");
    for i in -9..=9 {
        let angle = f64::from(i) * 0.17;
        for (azimuth, elevation) in [(angle, 0.0), (0.0, angle), (angle + PI, 0.0)] {
            let (a, b) = (yagi.gain_dbi(azimuth, elevation), antenna.gain_dbi(azimuth, elevation));
            // Between rows of 1°, near the nulls of the array and of the dipoles.
            assert!(abs_diff_eq!(a, b, epsilon = 0.2), "{a} and {b} dB at {azimuth}, {elevation}");
        }
    }
    let table = PatternTable::from_rows(&[(-1.0, -3.5), (0.25, 8.0), (2.0, 1e-3)]).expect("proper");
    let read = PatternTable::from_csv(&table.to_csv()).expect("as written");
    for (a, b) in table.rows().zip(read.rows()) {
        assert!((a.0 - b.0).abs() < 1e-10 && a.1.to_bits() == b.1.to_bits(), "{a:?} and {b:?}");
    }
}

#[test]
fn tabs_dbd_and_carriage_returns_are_read() {
    let plain = MsiFile::parse(&sample()).expect("in order");
    assert_abs_diff_eq!(plain.gain_dbi(), 12.65, epsilon = 1e-12);
    assert_eq!((plain.field("MAKE"), plain.field("TILT")), (Some(""), Some("")));
    assert_eq!(plain.electrical_tilt_deg(), None);
    let tabs =
        MsiFile::parse(&sample().replace(' ', "\t").replace('\n', "\r\n")).expect("the same");
    assert_eq!(tabs.antenna(), plain.antenna());
    assert!(tabs.to_string().contains("HORIZONTAL\t360\n0\t0\n"));
    for (line, tilt) in [("TILT -4", -4.0), ("ELECTRICAL_TILT 6.5", 6.5)] {
        let text = sample().replacen("TILT", line, 1);
        assert_eq!(MsiFile::parse(&text).expect("in order").electrical_tilt_deg(), Some(tilt));
    }
}

#[test]
fn a_broken_vendor_file_is_refused_with_line_and_reason() {
    let edit = |from: &str, to: &str| sample().replacen(from, to, 1);
    for (text, line, reported) in [
        (edit("GAIN 10.5 dBd", "GAIN 10.5"), 4, "needs a unit"),
        (edit("GAIN 10.5 dBd", "GAIN ten dBd"), 4, "\"ten\""),
        (edit("GAIN 10.5 dBd\n", ""), 726, "GAIN is missing"),
        (edit("MAKE\n", "NAME again\n"), 2, "NAME appears twice"),
        (edit("\n17 0.44", ""), 6, "HORIZONTAL has 359 rows, not 360"),
        (edit("\n17 0.44", "\n17 NaN"), 24, "\"NaN\""),
        (edit("\n17 0.44", "\n17"), 24, "1 fields"),
        (edit("\n17 0.44", "\n15 0.44"), 24, "15° is out of order"),
        (edit("\n17 0.44", "\n17 -0.44"), 24, "-0.44 dB"),
        (edit("\n359 0.00", "\n360 0.00"), 366, "360° is beyond the turn"),
        (edit("VERTICAL", "HORIZONTAL"), 367, "HORIZONTAL appears twice"),
        (edit("VERTICAL 360", "VERTICAL many"), 367, "\"many\""),
        (sample().split("VERTICAL").next().expect("the first half").to_owned(), 366, "VERTICAL is"),
        (String::new(), 1, "GAIN is missing"),
        ("GAIN 3 dBi\nHORIZONTAL 1\n0 0\nVERTICAL 1\n0 0\n".to_owned(), 5, "1 rows"),
    ] {
        let error = MsiFile::parse(&text).expect_err(reported);
        assert_eq!(error.line, line, "{error}");
        assert!(error.to_string().contains(reported), "{error} does not contain {reported}");
    }
}

#[test]
fn tables_rise_or_fall_and_may_close() {
    let rising = "angle_deg,gain_db\n-90,1\n0,5\n90,3\n180,-7\n";
    let falling = "\u{feff}angle_deg, gain_db\r\n180,-7\r\n90,3\r\n0,5\r\n-90,1\r\n-180,-7\r\n";
    let (a, b) = (PatternTable::from_csv(rising), PatternTable::from_csv(falling));
    let (a, b) = (a.expect("in order"), b.expect("in order"));
    for i in 0..100 {
        let angle = 0.1 * f64::from(i);
        assert!(abs_diff_eq!(a.gain_db(angle), b.gain_db(angle), epsilon = 1e-9), "at {angle}");
    }
    let grid = "elevation_deg\\azimuth_deg,180,90,0,-90,-180\n90,1,1,1,1,1\n0,-9,2,8,4,-9\n";
    let grid = PatternTable3d::from_csv(grid).expect("in order");
    for (azimuth, elevation, gain) in
        [(90.0_f64, 0.0_f64, 2.0), (-90.0, 0.0, 4.0), (0.0, 45.0, 4.5)]
    {
        let ours = grid.gain_dbi(azimuth.to_radians(), elevation.to_radians());
        assert!(abs_diff_eq!(ours, gain, epsilon = 1e-9), "{ours} dB at {azimuth}, {elevation}");
    }
}

#[test]
fn a_broken_table_is_refused_with_line_and_reason() {
    let grid = |rows: &str| format!("elevation_deg\\azimuth_deg,0,90,180\n{rows}");
    for (text, line, reported) in [
        (String::new(), 1, "header is \"\""),
        ("angle,gain\n0,1\n".to_owned(), 1, "angle,gain"),
        ("angle_deg,gain_db\n0,1\n\n1\n".to_owned(), 4, "1 fields"),
        ("angle_deg,gain_db\n0,1\n90,inf\n".to_owned(), 3, "gain_db is \"inf\""),
        ("angle_deg,gain_db\n0,1\n90,1\n80,1\n".to_owned(), 4, "80° is out of order"),
        ("angle_deg,gain_db\n0,1\n90,1\n180,1\n361,1\n".to_owned(), 5, "361° is beyond"),
        ("angle_deg,gain_db\n0,1\n90,1\n180,1\n360,2\n".to_owned(), 5, "2 dB, not 1 dB"),
        ("angle_deg,gain_db\n0,1\n90,1\n".to_owned(), 3, "2 rows"),
        ("angle_deg,gain_db\n0,1\n90,1e9\n180,0\n".to_owned(), 4, "1000000000 dB"),
    ] {
        let error = PatternTable::from_csv(&text).expect_err(reported);
        assert_eq!(error.line, line, "{error}");
        assert!(error.to_string().contains(reported), "{error} does not contain {reported}");
    }
    for (text, line, reported) in [
        ("angle_deg,gain_db\n0,1\n".to_owned(), 1, "header"),
        (grid("0,1,2\n"), 2, "3 fields where 4"),
        (grid("0,1,2,\n"), 2, "gain is \"\""),
        (grid("up,1,2,3\n"), 2, "\"up\""),
        (grid("0,1,2,3\n5,1,2,3\n4,1,2,3\n"), 4, "4° is out of order"),
        (grid("95,1,2,3\n"), 2, "beyond a pole"),
        (grid(""), 1, "0 rows"),
        ("elevation_deg\\azimuth_deg,0,90,x\n".to_owned(), 1, "\"x\""),
    ] {
        let error = PatternTable3d::from_csv(&text).expect_err(reported);
        assert_eq!(error.line, line, "{error}");
        assert!(error.to_string().contains(reported), "{error} does not contain {reported}");
    }
}

#[test]
fn a_file_that_is_no_antenna_is_refused_by_its_name() {
    let build = |path: &str| AntennaConfig::File(path.into()).build().expect_err(path);
    let error = build("no/such/panel.msi");
    assert!(matches!(&error, AntennaError::Read { file, .. } if file == "no/such/panel.msi"));
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    assert!(
        matches!(build(manifest), AntennaError::Extension { extension, .. } if extension == "toml")
    );
    let broken = std::env::temp_dir().join(format!("foxhunt-antenna-{}.PLN", std::process::id()));
    fs::write(&broken, sample().replace("10.5 dBd", "10.5")).expect("a file");
    let error = AntennaConfig::File(broken.clone()).build().expect_err("it has no unit");
    fs::remove_file(&broken).expect("it is ours");
    assert!(error.to_string().contains("PLN, line 4: the gain \"10.5\""), "{error}");
    let AntennaError::File { source, .. } = error else { panic!("{error}") };
    assert!(matches!(source.reason, PatternFileReason::Unit { .. }));
}

/// The antenna of the committed files: seeded lobes about a smooth pattern, in whole tenths of dB.
fn recorded(azimuth_deg: u16, elevation_deg: i16) -> f64 {
    // A linear congruential generator, so that no library's change alters the files (Knuth's MMIX).
    let mut state = 20_u64;
    let mut draw = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        f64::from(u32::try_from(state >> 40).expect("24 bits")) / f64::from(1_u32 << 24)
    };
    let azimuth = f64::from(azimuth_deg).to_radians();
    let up = f64::from(elevation_deg).to_radians().cos();
    let ripple: f64 = (2..6_u16)
        .map(|order| (draw() - 0.5) * (f64::from(order) * azimuth + TAU * draw()).cos())
        .sum();
    // The largest gain is on boresight, as vendors' files have it.
    let gain = 8.0 - 9.0 * (1.0 - azimuth.cos() * up) + 0.5 * (1.0 - azimuth.cos()) * ripple * up;
    (gain * 10.0).round() / 10.0
}

/// Small recordings of one antenna in every form that is read, by the names of their files.
fn recordings() -> [(&'static str, String); 4] {
    let azimuths = || (0..360_u16).step_by(10);
    let elevations = || (-90..=90_i16).step_by(30);
    let mut table = "angle_deg,gain_db\n".to_owned();
    for azimuth in azimuths() {
        writeln!(table, "{azimuth},{:.1}", recorded(azimuth, 0)).expect("a string");
    }
    let mut grid = "elevation_deg\\azimuth_deg".to_owned();
    for azimuth in azimuths() {
        write!(grid, ",{azimuth}").expect("a string");
    }
    for elevation in elevations() {
        write!(grid, "\n{elevation}").expect("a string");
        // At a pole all azimuths are one direction.
        for azimuth in azimuths() {
            let azimuth = if elevation.abs() == 90 { 0 } else { azimuth };
            write!(grid, ",{:.1}", recorded(azimuth, elevation)).expect("a string");
        }
    }
    grid.push('\n');
    let largest = azimuths().map(|azimuth| recorded(azimuth, 0)).fold(f64::MIN, f64::max);
    // Clockwise and down; the vertical cut goes over the top to the back.
    let cuts = |header: &str, blank: char| {
        let mut text = header.to_owned();
        writeln!(text, "HORIZONTAL{blank}36").expect("a string");
        for angle in azimuths() {
            let below = largest - recorded((360 - angle) % 360, 0);
            writeln!(text, "{angle}{blank}{below:.1}").expect("a string");
        }
        writeln!(text, "VERTICAL{blank}36").expect("a string");
        for angle in azimuths() {
            let signed = i16::try_from(angle).expect("below 360");
            let (azimuth, down) = match signed {
                0..=90 => (0, signed),
                91..=269 => (180, 180 - signed),
                _ => (0, signed - 360),
            };
            let below = largest - recorded(azimuth, -down);
            writeln!(text, "{angle}{blank}{:.1}", below.max(0.0)).expect("a string");
        }
        text
    };
    let msi = format!("NAME a generated panel\nFREQUENCY 2440\nGAIN {largest:.1} dBi\nTILT\n");
    let dbd = largest - 2.15;
    let planet = format!(
        "NAME\ta generated panel\nFREQUENCY\t2440\nGAIN\t{dbd:.2} dBd\nELECTRICAL_TILT\t0\n"
    );
    [
        ("generated_azimuth.csv", table),
        ("generated_3d.csv", grid),
        ("generated.msi", cuts(&msi, ' ')),
        ("generated.pln", cuts(&planet, '\t').replace('\n', "\r\n")),
    ]
}

/// Files that a clone has, so that every reader of antennas is tried without recordings beside it.
/// Each is what the generator writes (`FOXHUNT_WRITE_RECORDINGS=1` rewrites them).
#[test]
fn the_recordings_of_the_repository_are_one_antenna() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    for (name, text) in recordings() {
        let path = folder.join(name);
        if std::env::var_os("FOXHUNT_WRITE_RECORDINGS").is_some() {
            fs::create_dir_all(&folder).expect("a folder");
            fs::write(&path, &text).expect("a file");
        }
        assert_eq!(fs::read_to_string(&path).expect(name), text, "{name}");
        let antenna = AntennaConfig::File(path).build().unwrap_or_else(|error| panic!("{error}"));
        for azimuth in (0..360_u16).step_by(10) {
            let gain = antenna.gain_dbi(f64::from(azimuth).to_radians(), 0.0);
            let recorded = recorded(azimuth, 0);
            assert!((gain - recorded).abs() < 0.06, "{name} at {azimuth}°: {gain}, {recorded} dB");
        }
    }
}
