use foxhunt_core::Clock;
use foxhunt_wire::{ByteStream, FixQuality};

use super::{GnssDecoder, GnssError, GnssKind, GnssPosition, GnssReceiver, Positioning};
use crate::Finding;

/// Time that a receiver is given for a place, in seconds.
const PATIENCE_S: f64 = 10.0;

/// The most pauses, for a clock that stands still.
const PAUSES: u32 = 100_000;

/// A σ of East or North above this, in metres, is worth a word: bearings at 100 m move by 3°.
const POOR_M: f64 = 5.0;

impl<S: ByteStream, C: Clock, D: GnssDecoder> GnssReceiver<S, C, D> {
    /// Looks at the receiver for at most 10 s: its protocol, its fix, the position's σ and age,
    /// and what mends what is wrong. `pause` is called while it waits.
    pub fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        let begun = self.now();
        let mut position = self.position();
        for _ in 0..PAUSES {
            if position.is_ok() || self.now() - begun >= PATIENCE_S {
                break;
            }
            pause();
            position = self.position();
        }
        let mut findings = Vec::new();
        if let Err(GnssError::Stream(error)) = &position {
            let remedy =
                "check the cable, the port's name and who may open it; for gpsd, that it runs";
            findings.push(Finding::bad("link", error, remedy));
        }
        findings.push(self.speech());
        if self.decoder().messages() > 0 {
            findings.push(self.fix());
        }
        if let Ok(position) = position {
            findings.push(noise(&position));
            findings.push(self.age(&position));
        }
        findings
    }

    fn speech(&self) -> Finding {
        let name = self.decoder().name();
        let messages = self.decoder().messages();
        let refused = self.decoder().refused();
        let subject = "receiver";
        if messages > 0 && refused > messages / 10 {
            let text = format!("{name}, {messages} messages, {refused} more were damaged");
            let remedy =
                "use a shorter cable or a lower rate, and let no other program read the port";
            return Finding::bad(subject, text, remedy);
        }
        if messages > 0 {
            return Finding::good(subject, format!("{name}, {messages} messages"));
        }
        if self.bytes() == 0 {
            let remedy = match self.config().kind {
                GnssKind::Gpsd => "start gpsd with the receiver's port, and let it listen (-N -n)",
                _ => "check power, that its TX is at our RX, and the port's name",
            };
            return Finding::bad(subject, "it sends nothing", remedy);
        }
        let text = format!("{} bytes came, and none of them are {name}", self.bytes());
        Finding::bad(subject, text, "check the baud rate (9600, 38400 or 115200) and the kind")
    }

    fn fix(&self) -> Finding {
        let subject = "fix";
        let Some(last) = self.last() else {
            let remedy = match self.config().kind {
                GnssKind::Nmea => "turn its GGA sentences on",
                GnssKind::Ublox => "turn UBX output on at this port, or use kind = \"nmea\"",
                GnssKind::Gpsd => "check that gpsd has a receiver: `gpspipe -w`",
            };
            return Finding::bad(subject, "it reports no position", remedy);
        };
        let satellites = last.satellites.map_or(String::new(), |n| format!(", {n} satellites"));
        let hdop = last.hdop.map_or(String::new(), |hdop| format!(", HDOP {hdop:.1}"));
        let text = format!("{}{satellites}{hdop}", last.quality.name());
        match last.quality {
            FixQuality::None => {
                Finding::bad(subject, text, "give its antenna a free sky and some minutes")
            }
            FixQuality::Estimated => {
                Finding::bad(subject, text, "it guesses: give its antenna a free sky")
            }
            _ if last.flat => {
                Finding::bad(subject, text + ", no height", "wait for a fourth satellite")
            }
            FixQuality::RtkFloat => {
                Finding::bad(subject, text, "wait for the RTK fix, or check its corrections")
            }
            _ => Finding::good(subject, text),
        }
    }

    fn age(&self, position: &GnssPosition) -> Finding {
        let text = format!("{:.1} s", position.age_s);
        if position.age_s > self.config().stale_s / 2.0 {
            let remedy = "set its rate to 5 Hz, or raise stale_s if it is slow";
            return Finding::bad("age", text, remedy);
        }
        Finding::good("age", text)
    }
}

fn noise(position: &GnssPosition) -> Finding {
    let sigma = position.sigma_m;
    let text = format!("σ East {:.2} m, North {:.2} m, Up {:.2} m", sigma.x, sigma.y, sigma.z);
    if sigma.x.max(sigma.y) > POOR_M {
        let remedy = "move its antenna away from walls and trees, and from USB 3 cables";
        return Finding::bad("position noise", text, remedy);
    }
    Finding::good("position noise", text)
}
