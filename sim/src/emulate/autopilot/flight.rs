use foxhunt_core::Pose;
use foxhunt_wire::mavlink::{
    Autopilot, FlightMode,
    dialect::{MavLandedState, MavSeverity},
};
use nalgebra::Vector3;

use super::yaw::Yaw;

/// The state of its flight: its mode and what that makes of its orders.
#[derive(Debug)]
pub(super) struct Flight {
    pub(super) mode: FlightMode,
    pub(super) armed: bool,
    pub(super) landed: MavLandedState,
    pub(super) yaw: Yaw,
    /// The place that the mode flies to.
    pub(super) goal: Vector3<f64>,
    /// Last goal of a mode of its own.
    pub(super) own_goal: Option<Vector3<f64>>,
    /// The height at which it comes back.
    pub(super) return_up: f64,
    /// The height of a take-off, while there is one.
    pub(super) climb_to: Option<f64>,
    /// Time of the last set-point.
    pub(super) setpoint_at: f64,
    /// True if set-points come often enough for OFFBOARD.
    pub(super) setpoints_flow: bool,
    /// Time after the last set-point at which OFFBOARD ends, in seconds, and the mode that follows.
    pub(super) offboard_loss: (f64, FlightMode),
    armed_at: f64,
    /// Time when it touched the ground.
    down_at: Option<f64>,
    /// True if it is above home, or comes there.
    over_home: bool,
    /// True if the next set-point is the first since its mode or its climb began: ArduCopter takes
    /// its own speed with that one, whatever was ordered before.
    pub(super) takes_own_speed: bool,
    pub(super) texts: Vec<(MavSeverity, &'static str)>,
}

/// The orders to the body.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyOrder {
    pub(super) goal: Vector3<f64>,
    pub(super) turn_rate: f64,
}

/// Motors that do not take off stop after this time, in seconds.
const IDLE_S: f64 = 10.0;

/// Motors stop this long after touching the ground, in seconds.
const STOP_S: f64 = 1.0;

/// Set-points farther apart than this do not flow, in seconds: 2 Hz.
const FLOW_S: f64 = 0.5;

/// Distance within which a place or height counts as reached, in metres.
const THERE_M: f64 = 0.3;

impl Flight {
    pub(super) fn new(mode: FlightMode, pose: &Pose, now: f64) -> Self {
        Self {
            mode,
            armed: false,
            landed: MavLandedState::MAV_LANDED_STATE_ON_GROUND,
            yaw: Yaw::new(pose.heading),
            goal: pose.position,
            own_goal: None,
            return_up: 0.0,
            climb_to: None,
            setpoint_at: f64::NEG_INFINITY,
            setpoints_flow: false,
            offboard_loss: (f64::INFINITY, mode),
            armed_at: now,
            down_at: None,
            over_home: false,
            takes_own_speed: true,
            texts: Vec::new(),
        }
    }

    pub(super) fn is_airborne(&self) -> bool {
        self.landed != MavLandedState::MAV_LANDED_STATE_ON_GROUND
    }

    pub(super) fn arm(&mut self, pose: &Pose, now: f64) {
        if !self.armed {
            (self.armed, self.armed_at, self.goal) = (true, now, pose.position);
            self.yaw.hold(pose.heading);
            self.texts.push((MavSeverity::MAV_SEVERITY_INFO, "Arming motors"));
        }
    }

    pub(super) fn disarm(&mut self) {
        if self.armed {
            self.texts.push((MavSeverity::MAV_SEVERITY_INFO, "Disarming motors"));
        }
        (self.armed, self.climb_to, self.down_at) = (false, None, None);
        self.landed = MavLandedState::MAV_LANDED_STATE_ON_GROUND;
    }

    /// Every mode begins where it is.
    pub(super) fn change_mode(&mut self, mode: FlightMode, pose: &Pose) {
        if mode == self.mode {
            return;
        }
        self.mode = mode;
        self.goal = pose.position;
        self.yaw.hold(pose.heading);
        (self.over_home, self.down_at, self.takes_own_speed) = (false, None, true);
        if mode != mode.autopilot.take_off() {
            self.climb_to = None;
        }
    }

    /// A set-point came; whether it is obeyed.
    pub(super) fn takes_setpoint(&mut self, now: f64) -> bool {
        self.setpoints_flow = now - self.setpoint_at <= FLOW_S;
        self.setpoint_at = now;
        let flying = self.mode == self.mode.autopilot.commanded() && self.armed;
        // ArduCopter stays on the ground until it is ordered to take off; a set-point ends the
        // climb.
        let taken = flying && (self.is_airborne() || self.mode.autopilot == Autopilot::Px4);
        if taken {
            self.takes_own_speed |= self.climb_to.take().is_some();
        }
        taken
    }

    /// Returns true if set-points come often enough for OFFBOARD now.
    pub(super) fn is_fed(&self, now: f64) -> bool {
        self.setpoints_flow && now - self.setpoint_at <= FLOW_S
    }

    /// Goes on with the mode, at the height `above_ground` over the ground below.
    pub(super) fn step(
        &mut self,
        pose: &Pose,
        above_ground: f64,
        home: Vector3<f64>,
        now: f64,
        dt: f64,
    ) -> BodyOrder {
        let at = pose.position;
        let ground_z = at.z - above_ground;
        let autopilot = self.mode.autopilot;
        if !self.armed {
            let ground = Vector3::new(at.x, at.y, ground_z);
            (self.goal, self.landed) = (ground, MavLandedState::MAV_LANDED_STATE_ON_GROUND);
            return BodyOrder { goal: ground, turn_rate: 0.0 };
        }
        let offboard = autopilot == Autopilot::Px4 && self.mode == autopilot.commanded();
        let (loss_s, then) = self.offboard_loss;
        if offboard && now - self.setpoint_at > loss_s {
            self.texts.push((MavSeverity::MAV_SEVERITY_CRITICAL, "Offboard control lost"));
            self.change_mode(then, pose);
        }
        if let Some(up) = self.climb_to {
            self.goal.z = up;
            self.landed = MavLandedState::MAV_LANDED_STATE_TAKEOFF;
            if (at.z - up).abs() < THERE_M {
                self.climb_to = None;
                self.landed = MavLandedState::MAV_LANDED_STATE_IN_AIR;
                if autopilot == Autopilot::Px4 {
                    self.change_mode(autopilot.hold(), pose);
                    self.goal.z = up;
                }
            }
        } else if self.mode == autopilot.land() && self.is_airborne() {
            self.descend(above_ground, ground_z, now);
        } else if self.mode == autopilot.return_to_launch() && self.is_airborne() {
            self.come_back(at, ground_z, home, now);
        } else if self.is_airborne() {
            self.landed = MavLandedState::MAV_LANDED_STATE_IN_AIR;
        } else if self.goal.z > at.z + THERE_M {
            // PX4 takes off by a set-point, too.
            self.landed = MavLandedState::MAV_LANDED_STATE_TAKEOFF;
        } else {
            self.goal = at;
            if now - self.armed_at > IDLE_S {
                self.disarm();
            }
        }
        if self.mode != autopilot.commanded() && self.mode != autopilot.by_hand() {
            self.own_goal = Some(self.goal);
        }
        BodyOrder { goal: self.goal, turn_rate: self.yaw.step(pose.heading, dt) }
    }

    /// Down to the ground, which is at `ground_z` below it.
    fn descend(&mut self, above_ground: f64, ground_z: f64, now: f64) {
        self.landed = MavLandedState::MAV_LANDED_STATE_LANDING;
        self.goal = Vector3::new(self.goal.x, self.goal.y, ground_z);
        if above_ground > 0.05 {
            self.down_at = None;
        } else if now - *self.down_at.get_or_insert(now) >= STOP_S {
            self.disarm();
        }
    }

    /// Up, home, down.
    fn come_back(&mut self, at: Vector3<f64>, ground_z: f64, home: Vector3<f64>, now: f64) {
        let up = self.return_up.max(self.goal.z);
        if self.over_home && (at - home).xy().norm() < THERE_M {
            self.goal = home;
            return self.descend(at.z - ground_z, ground_z, now);
        }
        self.landed = MavLandedState::MAV_LANDED_STATE_IN_AIR;
        if self.over_home || (at.z - up).abs() < THERE_M {
            self.over_home = true;
            self.goal = Vector3::new(home.x, home.y, up);
        } else {
            self.goal.z = up;
        }
    }
}
