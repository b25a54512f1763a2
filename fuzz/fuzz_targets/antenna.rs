//! Any text as an antenna's file, MSI Planet or CSV: what is read is written and read again, and
//! its gains are numbers.
#![no_main]

use foxhunt_sensors::{Antenna, MsiFile, PatternTable, PatternTable3d};
use libfuzzer_sys::fuzz_target;

fn look_around(antenna: &dyn Antenna) {
    for step in 0..24_u8 {
        let azimuth = f64::from(step).to_radians() * 15.0;
        for elevation in [-1.5, -0.3, 0.0, 0.7, 1.5] {
            let gain = antenna.gain_dbi(azimuth, elevation);
            assert!(!gain.is_nan(), "{gain} at {azimuth}, {elevation}");
        }
    }
}

fuzz_target!(|text: &str| {
    if let Ok(file) = MsiFile::parse(text) {
        let written = file.to_string();
        let again = MsiFile::parse(&written).expect("what was written can be read");
        assert_eq!(again.to_string(), written, "it does not come back");
        assert!(file.gain_dbi().is_finite());
        if let Ok(antenna) = file.antenna() {
            look_around(&antenna);
        }
    }
    if let Ok(table) = PatternTable::from_csv(text) {
        look_around(&table);
        let written = table.to_csv();
        let again = PatternTable::from_csv(&written).expect("what was written can be read");
        assert_eq!(again.to_csv(), written, "it does not come back");
    }
    if let Ok(table) = PatternTable3d::from_csv(text) {
        look_around(&table);
    }
});
