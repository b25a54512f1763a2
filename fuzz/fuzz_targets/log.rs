//! Any text as a log: what is read is written and read again, and a log that is cut off is read up
//! to its last whole line. Without a header of its own the text follows one that is in order.
#![no_main]

use std::path::Path;

use foxhunt_hunt::log::{Log, LogWriter};
use libfuzzer_sys::fuzz_target;

const HEADER: &str = concat!(
    r#"{"foxhunt_log":6,"scenario":"field","seed":1,"estimator_name":"ekf","#,
    r#""model":{"reference_dbm":-29.06,"exponent":2.765},"beacons":[]}"#,
    "\n"
);

fn written(log: &Log) -> String {
    let mut text = Vec::new();
    let mut writer = LogWriter::new(&mut text, &log.header).expect("memory takes it all");
    for event in &log.events {
        writer.event(event).expect("memory takes it all");
    }
    String::from_utf8(text).expect("JSON is UTF-8")
}

fuzz_target!(|text: &str| {
    let path = Path::new("fuzz.jsonl");
    for text in [text.to_owned(), format!("{HEADER}{text}")] {
        let Ok(log) = Log::parse(&text, path) else { continue };
        let once = written(&log);
        // A number that is not finite is null in JSON, which no reader takes for a number.
        let Ok(again) = Log::parse(&once, path) else { continue };
        assert_eq!(written(&again), once, "it does not come back");
        let header = once.find('\n').map_or(once.len(), |end| end + 1);
        let middle = header + (once.len() - header) / 2;
        let middle = (middle..=once.len()).find(|end| once.is_char_boundary(*end));
        let cut = &once[..middle.unwrap_or(once.len())];
        let cut = Log::parse(cut, path).expect("a log may be cut off anywhere");
        assert_eq!(written(&cut), once[..written(&cut).len()]);
    }
});
