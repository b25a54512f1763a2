use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    mavlink::{Autopilot, dialect::MavSysStatusSensor},
};

use super::{
    MavlinkVehicle,
    phase::{Goal, Phase, Stage},
    quality,
};

/// Time in seconds after which an autopilot that reports its target, and has kept the old one, does
/// not take the new one.
const UNTAKEN_S: f64 = 2.5;

/// Time for which warnings are shown in flight, in seconds.
const SHOWN_S: f64 = 15.0;

impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    /// Returns why it takes no orders, or stays on the ground; empty without a reason.
    pub(super) fn hindrance(&self, now: f64) -> String {
        if self.telemetry.who.is_none() {
            return "no heartbeat of an autopilot yet".into();
        }
        if self.telemetry.silence(now) > self.config.link_timeout_s {
            return "nothing is received of it; it is sent no order and no heartbeat, so that its \
                    own failsafe acts"
                .into();
        }
        if !self.authority.why().is_empty() {
            return self.authority.why().into();
        }
        match &self.phase {
            Phase::Landing => return self.after_failure("it lands"),
            Phase::Returning => return self.after_failure("it returns to its launch place"),
            Phase::TakingOver => return "it is requested to change its mode".into(),
            Phase::Flying => {
                if let Some(why) = self.telemetry.doubt.why(now) {
                    return format!("{why}; what it receives is not used");
                }
                if let Some(why) = &self.strayed {
                    return format!("{why}; it is brought back");
                }
                if let Some(why) = self.goal.and_then(|goal| self.untaken(now, &goal)) {
                    return why;
                }
                let known = [&self.failure, &self.cruise.failure];
                return match known.into_iter().find(|why| !why.is_empty()) {
                    Some(why) => why.clone(),
                    None => self.warning(now).unwrap_or_default(),
                };
            }
            Phase::Idle if self.order.is_some() => return "its motors are being stopped".into(),
            Phase::Idle | Phase::TakingOff { .. } => {}
        }
        if !self.failure.is_empty() {
            return self.failure.clone();
        }
        if let Err(why) = quality::for_take_off(&self.telemetry, &self.config.position, now) {
            return why;
        }
        if let Phase::TakingOff { stage, .. } = self.phase {
            return match stage {
                Stage::Position => "it waits for a good position",
                Stage::Mode => "it is requested to change its mode",
                Stage::Arm => "it is being armed",
                Stage::Climb => "it climbs",
                Stage::Command => "it is requested to take our orders",
            }
            .into();
        }
        if self.telemetry.airborne(now) && self.telemetry.armed() {
            return match self.is_offered(now) {
                true => "it is in the air already, and was not taken over".into(),
                false => format!(
                    "it is flown in {}, not by us; a take-over needs {}",
                    self.mode_name(),
                    self.telemetry.autopilot().before_take_off()
                ),
            };
        }
        self.unready(now)
    }

    /// Its last warning, or what the link has to tell, for a while.
    fn warning(&self, now: f64) -> Option<String> {
        let since = now - SHOWN_S;
        let change = self.link.change().filter(|change| change.at >= since);
        let warning = self.telemetry.texts.complaints(since).next();
        change
            .map(|change| change.value.clone())
            .or(warning.map(|words| format!("it warns: {words}")))
    }

    /// Returns why a goal is not flown to, once the autopilot has had the time to take it.
    fn untaken(&self, now: f64, goal: &Goal) -> Option<String> {
        let waited_s = now - goal.first;
        if goal.confirmed || goal.is_new() {
            return None;
        }
        let [east, north, up] = goal.place.into();
        let reports = goal.before.is_some();
        if reports && waited_s > UNTAKEN_S {
            let why = "its own fence or limits may refuse it";
            return Some(format!(
                "it did not take its goal ({east:.1}, {north:.1}, {up:.1}) m; {why}"
            ));
        }
        let late = waited_s > self.config.ack_timeout_s * f64::from(self.config.attempts);
        late.then(|| "it does not confirm where it was sent".into())
    }

    fn after_failure(&self, what: &str) -> String {
        match self.failure.is_empty() {
            true => what.into(),
            false => format!("{what}; {}", self.failure),
        }
    }

    /// Failures of its own checks before arming.
    ///
    /// ArduPilot enables the check and then reports its health. PX4, from 1.14 on, reports the
    /// health alone, and of the mode that it is in: in one that is flown by hand without a
    /// transmitter nothing is learned about the mode in which it will be armed.
    pub(super) fn unready(&self, now: f64) -> String {
        let check = MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK;
        let autopilot = self.telemetry.autopilot();
        let reports = |enabled: MavSysStatusSensor| match autopilot {
            Autopilot::ArduPilot => enabled.contains(check),
            Autopilot::Px4 => {
                let mode = self.telemetry.mode();
                mode == Some(autopilot.before_take_off())
                    && (enabled.contains(check) || self.telemetry.is_px4_since(14))
            }
        };
        let failed = self.telemetry.status.as_ref().is_some_and(|status| {
            reports(status.value.onboard_control_sensors_enabled)
                && !status.value.onboard_control_sensors_health.contains(check)
        });
        if !failed || self.telemetry.armed() {
            return String::new();
        }
        // ArduPilot sends them every half minute.
        let since = now - 40.0;
        match autopilot {
            Autopilot::ArduPilot => {
                let complaints: Vec<_> = self.telemetry.texts.complaints(since).take(3).collect();
                Some(complaints.join("; ")).filter(|text| !text.is_empty())
            }
            Autopilot::Px4 => self.telemetry.texts.reason(since),
        }
        .unwrap_or_else(|| "its checks before arming fail".into())
    }
}
