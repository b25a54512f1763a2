//! Configurations from files are checked like those from code.

use approx::abs_diff_eq;
use foxhunt_sensors::{LogDistance, Pritzl2018, StepperConfig};
use serde::{Serialize, de::DeserializeOwned};

fn read<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    serde_json::from_str(text).map_err(|error| error.to_string())
}

fn comes_back<T: Serialize + DeserializeOwned + PartialEq + core::fmt::Debug>(value: &T) {
    let text = serde_json::to_string(value).expect("numbers can be written");
    assert_eq!(read::<T>(&text).as_ref(), Ok(value));
}

#[test]
fn what_is_written_is_read_back() {
    comes_back(&LogDistance::pritzl2018_urban());
    comes_back(&Pritzl2018::default().with_window(5).expect("odd"));
    comes_back(&StepperConfig::default().with_mount_offset(0.25).expect("finite"));
}

#[test]
fn what_is_left_out_has_its_default() {
    assert_eq!(read("{}"), Ok(Pritzl2018::default()));
    assert_eq!(read("{}"), Ok(StepperConfig::default()));
    let wider = Pritzl2018::default().with_width_db(3.0).expect("positive");
    assert_eq!(read(r#"{"width_db": 3.0}"#), Ok(wider));
}

#[test]
fn what_is_out_of_range_or_unknown_is_refused_by_name() {
    let refusals = [
        (
            read::<LogDistance>(r#"{"reference_dbm": -30.0, "exponent": -1.0}"#).err(),
            "exponent is -1",
        ),
        (read::<LogDistance>(r#"{"reference_dbm": -30.0}"#).err(), "exponent"),
        (read::<Pritzl2018>(r#"{"window": 4}"#).err(), "window is 4"),
        (read::<Pritzl2018>(r#"{"windows": 5}"#).err(), "windows"),
        (read::<StepperConfig>(r#"{"first_timeout": 0.0}"#).err(), "first_timeout is 0"),
        (read::<StepperConfig>(r#"{"timeout": 1.0}"#).err(), "timeout"),
    ];
    for (error, names) in refusals {
        let error = error.expect("it is wrong");
        assert!(error.contains(names), "{error:?} does not name {names:?}");
    }
}

#[test]
fn antennas_are_chosen_by_name() {
    use foxhunt_sensors::{Antenna, AntennaConfig, CardioidConfig, PatchConfig, YagiConfig};
    for (text, config, gain) in [
        (r#""reference-patch""#, AntennaConfig::ReferencePatch, 0.0),
        (r#""isotropic""#, AntennaConfig::Isotropic, 0.0),
        (r#""dipole""#, AntennaConfig::Dipole, 2.15),
        (r#"{"cardioid": {}}"#, AntennaConfig::Cardioid(CardioidConfig::default()), 4.32),
        (
            r#"{"patch": {"azimuth_beamwidth_deg": 60}}"#,
            AntennaConfig::Patch(PatchConfig {
                azimuth_beamwidth_deg: 60.0,
                ..PatchConfig::default()
            }),
            9.56,
        ),
        (
            r#"{"yagi": {"elements": 3}}"#,
            AntennaConfig::Yagi(YagiConfig { elements: 3, ..YagiConfig::default() }),
            8.59,
        ),
    ] {
        let read = read::<AntennaConfig>(text).expect(text);
        assert_eq!(read, config);
        comes_back(&config);
        let lobe = read.build().expect("in range").main_lobe();
        assert!(abs_diff_eq!(lobe.gain_dbi, gain, epsilon = 0.1), "{text}: {} dBi", lobe.gain_dbi);
    }
    for name in AntennaConfig::NAMES {
        assert!(AntennaConfig::named(name).expect(name).build().is_ok(), "{name}");
    }
    assert_eq!(AntennaConfig::named("horn"), None);
    let refused = read::<AntennaConfig>(r#"{"yagi": {"element": 3}}"#).expect_err("misspelt");
    assert!(refused.contains("element"), "{refused}");
    let config = read::<AntennaConfig>(r#"{"yagi": {"elements": 1}}"#).expect("a number");
    let error = config.build().expect_err("it is no array").to_string();
    assert!(error.contains("elements is 1"), "{error}");
    comes_back(&AntennaConfig::File("panel.msi".into()));
}
