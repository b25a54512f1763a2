//! The stages of a take-off, and what keeps an aircraft from it or from taking orders.

use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    mavlink::{
        Autopilot,
        dialect::{MavCmd, MavSysStatusSensor},
    },
};
use nalgebra::Vector3;

use super::{
    MavlinkError, MavlinkVehicle,
    orders::{Order, single},
    phase::{Cruise, Goal, Nose, Ordered, Phase, Stage},
    quality, setpoint,
};

/// Time for which set-points go to PX4 before OFFBOARD is requested, in seconds.
const BEFORE_OFFBOARD_S: f64 = 1.0;

/// Time in seconds after which its checks in the mode in which it is armed are known, and time for
/// which they are awaited.
const BEFORE_ARMING_S: f64 = 1.0;
const CHECKS_S: f64 = 5.0;

/// Time in seconds after which an autopilot that reports its target, and has kept the old one, does
/// not take the new one.
const UNTAKEN_S: f64 = 2.5;

/// Time for which warnings are shown in flight, in seconds.
const SHOWN_S: f64 = 15.0;

impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    pub(super) fn take_off_further(
        &mut self,
        now: f64,
        autopilot: Autopilot,
        up: f64,
        stage: Stage,
    ) -> Result<(), MavlinkError> {
        let Phase::TakingOff { since, .. } = self.phase else { return Ok(()) };
        let late = |limit: f64| now - since > limit;
        match stage {
            Stage::Position => {
                match quality::for_take_off(&self.telemetry, &self.config.position, now) {
                    Err(why) if late(self.config.position_timeout_s) => {
                        self.give_up(now, "the take-off", &why);
                    }
                    Err(_) => {}
                    Ok(()) => {
                        if let Err(why) = self.first_goal(now, up) {
                            self.give_up(now, "the take-off", &why.to_string());
                        } else if self.goal.is_some() {
                            self.stage(now, up, Stage::Mode);
                        }
                    }
                }
                Ok(())
            }
            Stage::Mode => {
                let next = Phase::TakingOff { up, stage: Stage::Arm, since: now };
                self.request_mode(now, autopilot.before_take_off(), next)
            }
            Stage::Arm if self.telemetry.armed() => {
                // Its home is where it was armed.
                match self.first_goal(now, up) {
                    Ok(()) => self.stage(now, up, Stage::Climb),
                    Err(why) => self.give_up(now, "the take-off", &why.to_string()),
                }
                Ok(())
            }
            // In the first moments of a mode PX4 reports the checks of the one before.
            Stage::Arm
                if autopilot == Autopilot::Px4
                    && self.order.is_none()
                    && !late(BEFORE_ARMING_S) =>
            {
                Ok(())
            }
            Stage::Arm if self.order.is_none() && !self.unready(now).is_empty() => {
                if late(CHECKS_S) {
                    let why = self.unready(now);
                    self.give_up(now, "the take-off", &why);
                }
                Ok(())
            }
            Stage::Arm => {
                let arm = || {
                    let parameters = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
                    Order::new(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, parameters)
                };
                self.order.get_or_insert_with(arm);
                self.ordered = Ordered::Arm;
                if let Some(why) = self.give(now)? {
                    self.give_up(now, "arming", &why);
                }
                Ok(())
            }
            Stage::Climb => {
                if self.telemetry.up().is_some_and(|at| at >= up - self.config.take_off_tolerance_m)
                {
                    match autopilot {
                        Autopilot::ArduPilot => self.up_there(),
                        Autopilot::Px4 => self.stage(now, up, Stage::Command),
                    }
                } else if late(self.config.take_off_timeout_s) {
                    let why = format!("it is not up after {} s", self.config.take_off_timeout_s);
                    self.give_up(now, "the take-off", &why);
                } else if !self.order.as_ref().is_some_and(Order::accepted) {
                    // PX4 takes the height above sea level.
                    let height = match autopilot {
                        Autopilot::ArduPilot => up,
                        Autopilot::Px4 => up + setpoint::launch_alt(&self.telemetry).unwrap_or(0.0),
                    };
                    let height = single(height);
                    let none = 0.0;
                    let nan = f32::NAN;
                    let climb = || match autopilot {
                        Autopilot::ArduPilot => Order::new(
                            MavCmd::MAV_CMD_NAV_TAKEOFF,
                            [none, none, none, none, none, none, height],
                        ),
                        Autopilot::Px4 => Order::new(
                            MavCmd::MAV_CMD_NAV_TAKEOFF,
                            [none, none, none, nan, nan, nan, height],
                        ),
                    };
                    self.order.get_or_insert_with(climb);
                    (self.ordered, self.climbs_to) = (Ordered::Climb, Some(up));
                    if let Some(why) = self.give(now)? {
                        if self.order.as_ref().is_some_and(Order::refused) {
                            self.ordered = Ordered::Arm;
                        }
                        self.give_up(now, "the take-off", &why);
                    }
                }
                Ok(())
            }
            Stage::Command => {
                self.send_goal(now)?;
                if !late(BEFORE_OFFBOARD_S) {
                    return Ok(());
                }
                self.request_mode(now, autopilot.commanded(), Phase::Flying)
            }
        }
    }

    /// Sets the goal after the climb: above the present place. The goal is left as it is while no
    /// fresh pose arrives.
    fn first_goal(&mut self, now: f64, up: f64) -> Result<(), MavlinkError> {
        let Ok(pose) = self.fresh_pose(now) else { return Ok(()) };
        let [east, north] = pose.position.xy().into();
        let launch = Vector3::new(east, north, 0.0);
        let place = Vector3::new(east, north, up);
        self.config.limits.check_goal(&place, None, Some(&launch))?;
        self.launch = Some(launch);
        self.goal = Some(Goal::new(place, Nose::Holds(pose.heading)));
        Ok(())
    }

    /// Ends a take-off for good: lands what climbs, and stops the motors of what stands on the
    /// ground.
    pub(super) fn give_up(&mut self, now: f64, what: &str, why: &str) {
        self.explain(now, what, why);
        self.end_take_off(now, Phase::Landing);
    }

    /// Returns true if it is in the air, or may climb by our order before it reports that.
    fn may_climb(&self, now: f64) -> bool {
        self.telemetry.airborne(now) || (self.ordered == Ordered::Climb && self.telemetry.armed())
    }

    /// Has it come down if it may be in the air, and its motors stopped if we may have started
    /// them.
    pub(super) fn end_take_off(&mut self, now: f64, phase: Phase) {
        (self.goal, self.turning, self.order) = (None, None, None);
        if self.telemetry.airborne(now) {
            self.begin_coming_down(phase);
        } else if self.may_climb(now) {
            // Coming back would climb first.
            self.begin_coming_down(Phase::Landing);
        } else {
            if self.ordered != Ordered::Nothing {
                let disarm = [0.0; 7];
                self.order = Some(Order::new(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, disarm));
            }
            self.enter(Phase::Idle);
        }
    }

    /// Stops the motors after a take-off that was ended on the ground.
    pub(super) fn disarm_further(&mut self, now: f64) -> Result<(), MavlinkError> {
        let Some(order) = &self.order else {
            if self.authority.is_ours() && !self.telemetry.armed() {
                self.authority.rest();
            }
            return Ok(());
        };
        if self.telemetry.airborne(now) {
            // It has climbed before it was ordered to.
            self.begin_coming_down(Phase::Landing);
        } else if order.accepted() && !self.telemetry.armed() {
            (self.order, self.ordered) = (None, Ordered::Nothing);
        } else if let Some(why) = self.give(now)? {
            self.explain(now, "stopping its motors", &why);
            self.order = None;
        }
        Ok(())
    }

    /// It has climbed: it is ours.
    pub(super) fn up_there(&mut self) {
        (self.order, self.climbs_to) = (None, None);
        self.cruise = Cruise::begin(&self.config);
        self.enter(Phase::Flying);
    }
}

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

    /// Returns the autopilot's last warning, or news of the link, for a while.
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
