use std::io;

use foxhunt_core::{Clock, Vehicle};
use foxhunt_wire::{
    ByteStream,
    receivers::{KrakenDoa, KrakenError},
};

use super::{KrakenConfig, KrakenSource, KrakenSourceError};
use crate::Finding;

/// Pauses after which waiting ends, whatever the clock shows.
const PAUSES: u32 = 1_000_000;

impl<S, O, V, C> KrakenSource<S, O, V, C>
where
    S: ByteStream,
    O: FnMut() -> io::Result<S>,
    V: Vehicle,
    C: Clock,
{
    /// Reads the page once: from where each beacon is received now. `pause` is called while it
    /// waits, and has to let a little time pass.
    pub fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        let remedy = "check that it runs, its address, and that its data output is \"Kraken App\"";
        for _ in 0..PAUSES {
            match self.fetch(self.clock.now()) {
                Ok(Some(text)) => return looked(&self.config, &KrakenDoa::page(&text)),
                Ok(None) => pause(),
                Err(error) => return vec![Finding::bad("KrakenSDR", error, remedy)],
            }
        }
        let seconds = self.config.page_timeout_s;
        let late = KrakenSourceError::<V::Error>::Timeout { seconds };
        vec![Finding::bad("KrakenSDR", late, remedy)]
    }
}

/// The beacons of a page.
fn looked(config: &KrakenConfig, lines: &[Result<KrakenDoa, KrakenError>]) -> Vec<Finding> {
    let look = |(index, hz): (usize, &f64)| {
        let subject = format!("beacon {index} ({:.3} MHz)", hz / 1e6);
        let theirs = |line: &&KrakenDoa| (line.frequency_hz - hz).abs() <= config.tolerance_hz;
        match lines.iter().flatten().find(theirs) {
            None => {
                let remedy =
                    "set one of its VFOs to this frequency, and its squelch below the beacon";
                Finding::bad(&subject, "there is no channel at this frequency", remedy)
            }
            Some(line) => {
                let degrees = line.direction().to_degrees();
                let level = line.power_db + config.calibration_db;
                let confidence = line.confidence;
                let text = format!(
                    "from {degrees:.0} degrees counter-clockwise of the front, {level:.1} dBm, \
                     confidence {confidence}"
                );
                if confidence < config.least_confidence {
                    let remedy = "go closer, or lower least_confidence";
                    Finding::bad(&subject, text, remedy)
                } else {
                    Finding::good(&subject, text)
                }
            }
        }
    };
    config.frequencies_hz.iter().enumerate().map(look).collect()
}
