use foxhunt_core::{BeaconId, Clock, Radio};
use foxhunt_wire::ByteStream;

use super::{XbeeError, radio::XbeeRadio, setup::Setup};
use crate::Finding;

/// Number of queries to each beacon.
const LOOKS: u8 = 5;
/// A port that takes longer than this for the radio's own answer, in seconds, holds bytes back.
const SLOW_S: f64 = 0.012;
/// Pauses after which waiting ends, whatever the clock shows.
const PAUSES: u32 = 1_000_000;

impl<S: ByteStream, C: Clock> XbeeRadio<S, C> {
    /// Looks at the radio and queries every beacon some times: the radio's identity, its present
    /// receptions, the speed of its port. `pause` is called while it waits, and has to let a little
    /// time pass.
    pub fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        let longest = Setup::longest(self.config.setup_timeout_s);
        let begun = self.clock.now();
        if let Err(error) = self.wait(longest, pause, |radio| radio.identity()) {
            return vec![unusable(error.as_ref())];
        }
        // Five questions, each answered by the radio itself.
        let quick_s = (self.clock.now() - begun) / 5.0;
        let mut findings: Vec<Finding> =
            self.identity().map(|identity| Finding::good("radio", identity)).into_iter().collect();
        findings.push(port(quick_s));
        let beacons = self.config.beacons.clone();
        for (index, address) in (0..).zip(beacons) {
            let subject = format!("beacon {index} ({address})");
            findings.push(self.look(BeaconId(index), &subject, pause));
        }
        findings.extend(self.line());
        findings
    }

    fn look(&mut self, beacon: BeaconId, subject: &str, pause: &mut dyn FnMut()) -> Finding {
        let mut levels = Vec::new();
        let before = self.counts();
        for _ in 0..LOOKS {
            if let Err(error) = self.request(beacon) {
                return unusable(Some(&error));
            }
            let patience = 2.0 * self.config.answer_timeout_s;
            let level = self.wait(patience, pause, |radio| radio.level_dbm_taken());
            match level {
                Ok(level) => levels.push(format!("{level:.0}")),
                Err(Some(error)) => return unusable(Some(&error)),
                Err(None) => {}
            }
        }
        let undelivered = self.counts().undelivered - before.undelivered;
        match (levels.len(), undelivered) {
            (0, 0) => Finding::bad(
                subject,
                "RSSI now: no answer",
                "its radio takes the question, so run the program that answers at the beacon, \
                 or set question to \"remote-db\"",
            ),
            (0, _) => Finding::bad(
                subject,
                "RSSI now: no answer, and no acknowledgement",
                "switch the beacon on, go closer, and check its address (SH, SL), its channel (CH) \
                 and its network (ID)",
            ),
            (answers, _) => Finding::good(
                subject,
                format_args!("RSSI now: {} dBm ({answers} of {LOOKS})", levels.join(", ")),
            ),
        }
    }

    /// Returns the finding on broken frames and garbage, if there were any.
    fn line(&self) -> Option<Finding> {
        let bad = self.link.bad_frames;
        let skipped = self.link.skipped();
        (bad > 0).then(|| {
            Finding::bad(
                "line",
                format_args!("{bad} broken frames, {skipped} bytes of garbage"),
                "check that the port's baud rate is the radio's BD, the cable, and that nothing \
                 else has the port open",
            )
        })
    }

    /// Polls until there is something, with the last error if there was one.
    fn wait<T>(
        &mut self,
        patience: f64,
        pause: &mut dyn FnMut(),
        look: impl Fn(&mut Self) -> Option<T>,
    ) -> Result<T, Option<XbeeError>> {
        let until = self.clock.now() + patience;
        let mut failure = None;
        for _ in 0..PAUSES {
            let served = self.serve();
            if let Some(found) = look(self) {
                return Ok(found);
            }
            failure = served.err();
            // A failure of the setup has been tried often enough.
            let settled = failure.as_ref().is_some_and(|f| !matches!(f, XbeeError::Stream(_)));
            if settled || self.clock.now() >= until {
                break;
            }
            pause();
        }
        Err(failure)
    }
}

fn unusable(error: Option<&XbeeError>) -> Finding {
    let silent = XbeeError::NotAnswering;
    let error = error.unwrap_or(&silent);
    let remedy = match error {
        XbeeError::Stream(_) => "plug it in, check the port's name, and that you may open it",
        XbeeError::Mode { .. } => "set AP to 1 with XCTU, and write it",
        XbeeError::Question { .. } => "take question \"auto\" or \"remote-db\"",
        XbeeError::Address { .. } => "give the beacon's SH and SL",
        XbeeError::NotSent { .. } => "check that radio and beacon are in one network (ID, CH)",
        XbeeError::RemoteRefused { .. } => "take question \"auto\"",
        _ => "check its power, the port, and that the port's baud rate is the radio's BD",
    };
    Finding::bad("radio", error, remedy)
}

fn port(quick_s: f64) -> Finding {
    let text = format!("{:.1} ms for an answer of the radio", quick_s * 1e3);
    if quick_s > SLOW_S {
        let remedy = "an FTDI adapter holds bytes back for 16 ms: write 1 to \
                      /sys/bus/usb-serial/devices/ttyUSB0/latency_timer";
        Finding::bad("port", text, remedy)
    } else {
        Finding::good("port", text)
    }
}
