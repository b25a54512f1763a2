//! Any bytes as a list of pulses and as a table of tags, by themselves and after a header that is
//! known; what is read is given to tags.
#![no_main]

use std::path::Path;

use foxhunt_signal::tags::{AssociationConfig, TagTable, associate, parse_pulses};
use libfuzzer_sys::fuzz_target;

const LISTS: [&str; 4] = [
    "",
    "time_s,frequency_hz,width_s,power_dbm,snr_db\n",
    "time_unix_s,dfreq_kHz,sig_dB,noise_dB\n",
    "Time;Frequency;Duration;avg (dBW);snr (dB)\n",
];
const TABLES: [&str; 3] = [
    "",
    "name,frequency_hz,interval_s,width_s,gaps_ms,other_interval_s\n",
    "tagID,nomFreq,offsetFreq,period,pulseLen,param1,param2,param3\n",
];

fuzz_target!(|bytes: &[u8]| {
    // A list and a table, a byte of 0 between them.
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let list = &bytes[..end];
    let table = bytes.get(end + 1..).unwrap_or(&[]);
    let tables: Vec<TagTable> = TABLES
        .iter()
        .filter_map(|header| {
            TagTable::parse(Path::new("tags.csv"), &[header.as_bytes(), table].concat()).ok()
        })
        .collect();
    for tag in tables.iter().flat_map(TagTable::tags) {
        assert!(tag.interval_s > 0.0 && tag.interval_s.is_finite());
        assert!(tag.gaps_s.iter().all(|gap| *gap > 0.0 && gap.is_finite()));
        assert!(tag.frequency_hz.is_none_or(f64::is_finite));
    }
    for header in LISTS {
        let text = [header.as_bytes(), list].concat();
        let Ok(read) = parse_pulses(Path::new("pulses.csv"), &text) else { continue };
        for pulse in &read.pulses {
            let values = [pulse.time_s, pulse.frequency_hz, pulse.power_dbm, pulse.snr_db];
            assert!(values.iter().all(|value| value.is_finite()), "{pulse:?}");
            assert!(pulse.width_s > 0.0 && pulse.width_s.is_finite(), "{pulse:?}");
        }
        for table in &tables {
            if let Ok(given) = associate(&read.pulses, table, &AssociationConfig::default()) {
                let count = read.pulses.len();
                assert!(given.others.iter().all(|place| *place < count));
                let mut pulses = given.tags.iter().flat_map(|tag| &tag.pulses);
                assert!(pulses.all(|place| *place < count));
            }
        }
    }
});
