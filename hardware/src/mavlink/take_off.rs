use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    mavlink::{Autopilot, dialect::MavCmd},
};
use nalgebra::Vector3;

use super::{
    MavlinkError, MavlinkVehicle,
    orders::{Order, single},
    phase::{Goal, Nose, Phase, Stage},
    quality, setpoint,
};

/// Set-points go to PX4 for so long before it is asked for OFFBOARD, in seconds.
const BEFORE_OFFBOARD_S: f64 = 1.0;

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
        const WHAT: &str = "the take-off";
        match stage {
            Stage::Position => {
                match quality::for_take_off(&self.heard, &self.config.position, now) {
                    Err(why) if late(self.config.position_timeout_s) => {
                        self.fail(WHAT, &why, Phase::Idle);
                    }
                    Err(_) => {}
                    Ok(()) => {
                        if let Ok(pose) = self.fresh_pose(now) {
                            self.launch = Some(pose.position);
                            let place = pose.position + Vector3::z() * up;
                            self.goal = Some(Goal::new(place, Nose::Holds(pose.heading)));
                            self.stage(now, up, Stage::Mode);
                        }
                    }
                }
                Ok(())
            }
            Stage::Mode => {
                let next = Phase::TakingOff { up, stage: Stage::Arm, since: now };
                self.ask_mode(now, autopilot.before_take_off(), next)
            }
            Stage::Arm if self.heard.armed() => {
                self.stage(now, up, Stage::Climb);
                Ok(())
            }
            Stage::Arm => {
                let arm = || {
                    let parameters = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
                    Order::new(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, parameters)
                };
                self.order.get_or_insert_with(arm);
                if let Some(why) = self.give(now)? {
                    self.fail("arming", &why, Phase::Idle);
                }
                Ok(())
            }
            Stage::Climb => {
                if !self.heard.armed() {
                    self.fail(WHAT, "the motors were stopped", Phase::Idle);
                } else if self
                    .heard
                    .up()
                    .is_some_and(|at| at >= up - self.config.take_off_tolerance_m)
                {
                    match autopilot {
                        Autopilot::ArduPilot => self.up_there(now)?,
                        Autopilot::Px4 => self.stage(now, up, Stage::Command),
                    }
                } else if late(self.config.take_off_timeout_s) {
                    let why = format!("it is not up after {} s", self.config.take_off_timeout_s);
                    self.fail(WHAT, &why, Phase::Idle);
                } else if !self.order.as_ref().is_some_and(Order::accepted) {
                    // PX4 wants the height above sea level.
                    let height = match autopilot {
                        Autopilot::ArduPilot => up,
                        Autopilot::Px4 => up + setpoint::launch_alt(&self.heard).unwrap_or(0.0),
                    };
                    let height = single(height);
                    let (none, nan) = (0.0, f32::NAN);
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
                    if let Some(why) = self.give(now)? {
                        self.fail(WHAT, &why, Phase::Idle);
                    }
                }
                Ok(())
            }
            Stage::Command => {
                let Some((system, component, _)) = self.heard.who else { return Ok(()) };
                self.say_goal(now, (system, component))?;
                if !late(BEFORE_OFFBOARD_S) {
                    return Ok(());
                }
                self.ask_mode(now, autopilot.commanded(), Phase::Flying)
            }
        }
    }

    /// It has climbed: it is ours.
    pub(super) fn up_there(&mut self, now: f64) -> Result<(), MavlinkError> {
        self.order = None;
        self.enter(Phase::Flying);
        if let Some(speed) = self.config.cruise_speed_mps {
            // 1: over ground; −1: the throttle as it is.
            let parameters = [1.0, single(speed), -1.0, 0.0, 0.0, 0.0, 0.0];
            self.command(now, Order::new(MavCmd::MAV_CMD_DO_CHANGE_SPEED, parameters).command)?;
        }
        Ok(())
    }
}
