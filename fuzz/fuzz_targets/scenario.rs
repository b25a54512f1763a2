//! Any text as the files that a user writes: scenarios, trials, calibrations, mappings. A file that
//! was read is written and read again.
#![no_main]

use foxhunt_archive::recording::Mapping;
use foxhunt_hunt::{calibration::CalibrationFile, scenario::Scenario};
use foxhunt_lab::trial::Trial;
use foxhunt_sim::World;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let _ = Trial::parse(text, "fuzz.toml");
    let _ = CalibrationFile::parse(text, "fuzz.toml");
    let _ = Mapping::parse(text, "fuzz.toml");
    let Ok(scenario) = Scenario::parse(text, "fuzz.toml") else { return };
    let written = toml::to_string(&scenario).expect("what was read can be written");
    let again = Scenario::parse(&written, "again.toml").expect("what was written can be read");
    assert_eq!(toml::to_string(&again).expect("as above"), written, "it does not come back");
    let _ = World::new(&scenario.world, 1);
    let _ = scenario.planner.build();
    let _ = scenario.field();
});
