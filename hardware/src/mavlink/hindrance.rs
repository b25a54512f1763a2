use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    mavlink::{Autopilot, dialect::MavSysStatusSensor},
};

use super::{
    MavlinkVehicle,
    phase::{Phase, Stage},
    quality,
};

impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    /// Why it takes no orders, or what keeps it on the ground.
    pub(super) fn hindrance(&self, now: f64) -> String {
        if self.telemetry.who.is_none() {
            return "no heartbeat of an autopilot yet".into();
        }
        if self.telemetry.without_heartbeat(now) > self.config.link_timeout_s {
            return "its heartbeats stopped; it is sent no order and no heartbeat, so that its own \
                    failsafe acts"
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
                if let Some(why) = &self.strayed {
                    return format!("{why}; it is brought back");
                }
                let lost = self.goal.filter(|goal| !goal.confirmed);
                let late = lost.is_some_and(|goal| goal.times > self.config.attempts);
                let ardupilot = self.telemetry.autopilot() == Autopilot::ArduPilot;
                return match late && ardupilot {
                    true => "it does not confirm where it was sent".into(),
                    false if self.failure.is_empty() => self.cruise.failure.clone(),
                    false => self.failure.clone(),
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
                false => format!("it is flown in {}, not by us", self.mode_name()),
            };
        }
        self.unready(now)
    }

    fn after_failure(&self, what: &str) -> String {
        match self.failure.is_empty() {
            true => what.into(),
            false => format!("{what}; {}", self.failure),
        }
    }

    /// Failures of its own checks before arming.
    pub(super) fn unready(&self, now: f64) -> String {
        let check = MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK;
        let failed = self.telemetry.status.as_ref().is_some_and(|status| {
            status.value.onboard_control_sensors_enabled.contains(check)
                && !status.value.onboard_control_sensors_health.contains(check)
        });
        if !failed || self.telemetry.armed() {
            return String::new();
        }
        // They are sent every half minute.
        let complaints: Vec<_> = self.telemetry.complaints(now - 40.0).take(3).collect();
        match complaints.is_empty() {
            true => "its checks before arming fail".into(),
            false => complaints.join("; "),
        }
    }
}
