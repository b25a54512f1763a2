use foxhunt_core::{Clock, Vehicle};
use foxhunt_wire::ByteStream;

use super::{MavlinkVehicle, quality};
use crate::Finding;

/// Time for which a heartbeat is awaited, in seconds.
const HEARTBEAT_S: f64 = 5.0;

/// Time for which answers are awaited, in seconds.
const ANSWERS_S: f64 = 6.0;

/// Time for which a good position is waited for, in seconds.
const POSITION_S: f64 = 5.0;

/// A clock that stands still does not keep us for ever.
const MOST_PAUSES: u32 = 1_000_000;

/// Below that share of the battery nobody sets off.
const LOW_BATTERY: f64 = 0.3;

impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    /// Looks at the autopilot: its identity, mode, position, home and battery, its hindrances to
    /// arming and its failsafes. Nothing is ordered that moves anything. `pause` is called while it
    /// waits.
    pub fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        let mut findings = Vec::new();
        let met = self.wait(HEARTBEAT_S, pause, |vehicle| vehicle.telemetry.heartbeat.is_some());
        if let Err(error) = met {
            let remedy = "check the cable, the port's name and that no other program has it open";
            return vec![Finding::bad("link", error, remedy)];
        }
        let Some((system, _, autopilot)) = self.telemetry.who else {
            findings.push(self.nobody());
            return findings;
        };
        findings.push(Finding::good("autopilot", format!("{autopilot}, system {system}")));
        let answers = |vehicle: &Self| {
            let telemetry = &vehicle.telemetry;
            telemetry.version.is_some() && telemetry.status.is_some() && telemetry.home.is_some()
        };
        if let Err(error) = self.wait(ANSWERS_S, pause, answers) {
            findings.push(Finding::bad("link", error, "check the cable"));
        }
        // Its messages come one after the other: a fix is not judged before it can have come.
        let placed = |vehicle: &Self| {
            let now = vehicle.clock.now();
            quality::for_take_off(&vehicle.telemetry, &vehicle.config.position, now).is_ok()
        };
        if let Err(error) = self.wait(POSITION_S, pause, placed) {
            findings.push(Finding::bad("link", error, "check the cable"));
        }
        let now = self.clock.now();
        findings.push(self.version());
        findings.push(Finding::good("mode", self.mode_name()));
        findings.push(match quality::for_take_off(&self.telemetry, &self.config.position, now) {
            Ok(()) => Finding::good("position", self.fix()),
            Err(why) => Finding::bad(
                "position",
                format!("{}; {why}", self.fix()),
                "take it outside, wait some minutes, and keep the antenna away from the radios",
            ),
        });
        findings.push(match self.launch_place() {
            Some(home) if self.telemetry.home.is_some() => Finding::good(
                "home",
                format!("{:.1} m East, {:.1} m North of the origin", home.x, home.y),
            ),
            _ => Finding::bad("home", "not set", "it is set with the first good position"),
        });
        findings.push(match self.telemetry.battery() {
            None => Finding::bad(
                "battery",
                "it does not report what is left",
                "set up the battery monitor (BATT_MONITOR, BATT_CAPACITY), or watch it yourself",
            ),
            Some(left) if left < LOW_BATTERY => {
                Finding::bad("battery", percent(left), "charge it before you fly")
            }
            Some(left) => Finding::good("battery", percent(left)),
        });
        let unready = self.unready(now);
        findings.push(if unready.is_empty() {
            Finding::good("arming", "its own checks pass, or are not reported")
        } else {
            Finding::bad("arming", unready, "mend what it complains of; it does not arm before")
        });
        // Nothing is asked of an autopilot that is only listened to.
        if !self.config.listen_only {
            match self.failsafes(pause) {
                Ok(failsafes) => findings.extend(failsafes),
                Err(error) => findings.push(Finding::bad("link", error, "check the cable")),
            }
        }
        let ground = self.telemetry.ground.summary(self.clock.now(), &self.telemetry.attitude);
        findings.extend(ground.map(|text| Finding::good("height above ground", text)));
        findings.extend(self.others());
        let counts = self.link.counts();
        let figures = format!(
            "{} messages, {} lost, {} bytes of garbage",
            counts.messages, counts.lost, counts.garbage_bytes
        );
        findings.push(if counts.lost > counts.messages / 10 {
            Finding::bad(
                "link",
                figures,
                "move the antennas, lower the rates, or raise the baud rate",
            )
        } else {
            Finding::good("link", figures)
        });
        findings
    }

    /// Finds who else is on the link, or could be.
    fn others(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        let stations: Vec<String> = self.telemetry.stations.iter().map(u8::to_string).collect();
        if !stations.is_empty() {
            let text = format!("other ground stations on this link: {}", stations.join(", "));
            findings.push(Finding::good("stations", text));
        }
        if self.link.is_for_anybody() {
            findings.push(Finding::bad(
                "signing",
                "anybody who reaches this port with its system number can become its other end",
                "give the link a key (vehicle.settings.signing, docs/devices/mavlink.md)",
            ));
        }
        if let Some(change) = self.link.change() {
            findings.push(Finding::good("link", &change.value));
        }
        findings
    }

    /// Serves the link until something holds, for at most `limit_s` seconds.
    pub(super) fn wait(
        &mut self,
        limit_s: f64,
        pause: &mut dyn FnMut(),
        holds: impl Fn(&Self) -> bool,
    ) -> Result<(), super::MavlinkError> {
        let begun = self.clock.now();
        for _ in 0..MOST_PAUSES {
            let now = self.serve()?;
            if holds(self) || now - begun > limit_s {
                break;
            }
            pause();
        }
        Ok(())
    }

    fn nobody(&self) -> Finding {
        let counts = self.link.counts();
        let subject = "autopilot";
        if counts.refused > 0 && self.config.signing.is_some() {
            let text = format!("{} messages were refused: not signed with our key", counts.refused);
            Finding::bad(subject, text, "give both ends the same signing key")
        } else if counts.messages > 0 {
            let text = format!("{} messages, but no autopilot's heartbeat", counts.messages);
            Finding::bad(subject, text, "check system_id, and set autopilot if it is another kind")
        } else if counts.garbage_bytes > 0 {
            let text = format!("{} bytes that are not MAVLink", counts.garbage_bytes);
            let remedy = "check the baud rate, and that the port's protocol is MAVLink 2";
            Finding::bad(subject, text, remedy)
        } else {
            let remedy =
                "check that it has power, TX and RX are crossed, and SERIALn_PROTOCOL is 2";
            Finding::bad(subject, "nothing was received", remedy)
        }
    }

    fn version(&self) -> Finding {
        match &self.telemetry.version {
            None => Finding::bad(
                "firmware",
                "it does not report its version",
                "ArduCopter 4.0 or PX4 1.13 and newer do",
            ),
            Some(version) => {
                let [kind, patch, minor, major] = version.flight_sw_version.to_le_bytes();
                let kind = match kind {
                    255 => "",
                    192..=254 => " release candidate",
                    128..=191 => " beta",
                    64..=127 => " alpha",
                    _ => " development",
                };
                Finding::good("firmware", format!("{major}.{minor}.{patch}{kind}"))
            }
        }
    }

    fn fix(&self) -> String {
        let Some(gps) = &self.telemetry.gps else { return "no GPS report".into() };
        let fix = quality::fix_name(gps.value.fix_type);
        let satellites = gps.value.satellites_visible;
        match Vehicle::position_sigma(self) {
            Some(sigma) => format!("{fix}, {satellites} satellites, good to {:.2} m", sigma.x),
            None => format!("{fix}, {satellites} satellites"),
        }
    }
}

fn percent(share: f64) -> String {
    format!("{:.0} % left", share * 100.0)
}
