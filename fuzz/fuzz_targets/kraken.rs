//! Any text as KrakenSDR's page, and any bytes as what its server sends.
#![no_main]

use foxhunt_wire::receivers::{HttpResponse, KrakenDoa};
use libfuzzer_sys::fuzz_target;

fn checked(text: &str) {
    for line in KrakenDoa::page(text).into_iter().flatten() {
        assert_eq!(line.spectrum_db.len(), 360);
        assert!(line.spectrum_db.iter().all(|value| *value <= 0.0));
        assert!((0.0..std::f64::consts::TAU).contains(&line.direction()));
    }
}

fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes);
    checked(&text);
    // The right number of fields is hard to hit.
    let fields: Vec<&str> = text.split(',').collect();
    if !fields.is_empty() {
        let line: Vec<&str> = fields.iter().copied().cycle().take(377).collect();
        checked(&line.join(","));
    }
    let mut response = HttpResponse::default();
    for some in bytes.chunks(33) {
        match response.push(some) {
            Ok(None) => {}
            Ok(Some(body)) => {
                checked(&String::from_utf8_lossy(&body));
                return;
            }
            Err(_) => return,
        }
    }
    let _ = response.end();
});
