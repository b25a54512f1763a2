//! Recordings of other formats in our own.

use std::{fs, path::Path};

use crate::support::{folder, foxhunt};

#[test]
fn what_is_converted_is_located_at_the_same_place() {
    let folder = folder("convert");
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../archive/tests/data");
    for name in ["otter-telemetry/bearings.csv", "foxhunt/turns.csv"] {
        let original = data.join(name);
        let [original, out] = [original, folder.join("converted.csv")]
            .map(|path| path.to_str().expect("UTF-8").to_owned());
        let report = foxhunt(["--json", "convert", &original, &out]).json();
        assert_eq!(report["file"], out);
        let text = fs::read_to_string(&out).expect("it was written");
        assert_eq!(report["rows"].as_u64(), Some(text.lines().count() as u64 - 1));
        let place = |file: &str| {
            let located = foxhunt(["--json", "locate", file, "--every-beacon"]).json();
            let places = located.as_array().expect("a list").iter();
            let axis = |of: &serde_json::Value, axis: &str| of["estimate"][axis].as_f64();
            places
                .map(|of| [axis(of, "east_m"), axis(of, "north_m")].map(|m| m.expect("metres")))
                .collect::<Vec<_>>()
        };
        let (before, after) = (place(&original), place(&out));
        assert!(!before.is_empty() && before.len() == after.len(), "{name}");
        for (before, after) in before.iter().zip(&after) {
            // Angles come back to rounding.
            let off = (before[0] - after[0]).hypot(before[1] - after[1]);
            assert!(off < 0.01, "{name}: {before:?}, {after:?}");
        }
        foxhunt(["convert", &original, &original]).failed(2, &["written over"]);
        foxhunt(["convert", &original, &out, "--rssi-topic", "/rssi"]).failed(2, &["bags"]);
        foxhunt(["convert", &original, "/no/such/x.csv"]).failed(1, &["/no/such/x.csv"]);
    }
    let no_bag = folder.join("broken.mcap");
    fs::write(&no_bag, b"\x89MCAP0\r\nand nothing more").expect("a file");
    let no_bag = no_bag.to_str().expect("UTF-8");
    let out = folder.join("bag.csv");
    foxhunt(["convert", no_bag, out.to_str().expect("UTF-8")]).failed(2, &["broken.mcap", "bag"]);
    foxhunt(["convert", no_bag]).failed(2, &["2 values"]);
}
