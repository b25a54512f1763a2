//! Any bytes as a recording: a mapping of columns, a byte of 0, and a file. Without one the first
//! byte chooses a mapping that is built in.
#![no_main]

use foxhunt_archive::recording::{Mapping, ReadOptions, Recording, Rover, builtin_mappings};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let own = bytes.iter().position(|byte| *byte == 0).and_then(|end| {
        let text = std::str::from_utf8(&bytes[..end]).ok()?;
        Some((Mapping::parse(text, "fuzz.toml").ok()?, &bytes[end + 1..]))
    });
    let Some((first, rest)) = bytes.split_first() else { return };
    let builtin = builtin_mappings();
    let chosen = builtin[usize::from(*first) % builtin.len()].clone();
    let _ = Rover::parse(rest, "fuzz.gpx");
    for (mapping, text) in own.into_iter().chain([(chosen, rest)]) {
        let options = ReadOptions::default().with_format(mapping);
        let Ok(recording) = Recording::from_reader(text, "fuzz.csv", &options) else { continue };
        assert!(u64::try_from(recording.records().len()).is_ok_and(|read| read <= MOST));
        for record in recording.records() {
            let place = record.receiver().map(|receiver| receiver.position);
            assert!(place.is_none_or(|place| place.iter().all(|metres| metres.is_finite())));
            assert!(record.time.is_none_or(f64::is_finite));
        }
        for drone in recording.by_drone() {
            assert!(drone.records().len() <= recording.records().len());
        }
        let _ = recording.sweeps(128);
    }
});

/// A file of some kilobytes holds no more records than that.
const MOST: u64 = 1 << 24;
