//! An autopilot that flies a drone of the world, as ArduCopter or PX4 would: the state of its
//! flight, the control of its nose, its parameters, and its streams of messages.

mod brain;
mod config;

pub use brain::EmulatedAutopilot;
pub use config::{AutopilotConfig, AutopilotFaults, FailsafeOrder, GpsStep, PilotOrder};

use foxhunt_core::{Pose, angle};
use foxhunt_wire::mavlink::{
    Autopilot, CharArray, FlightMode, MessageData,
    dialect::{
        ALTITUDE_DATA, ATTITUDE_DATA, DISTANCE_SENSOR_DATA, EKF_STATUS_REPORT_DATA,
        ESTIMATOR_STATUS_DATA, EXTENDED_SYS_STATE_DATA, GLOBAL_POSITION_INT_DATA, GPS_RAW_INT_DATA,
        HEARTBEAT_DATA, HOME_POSITION_DATA, LOCAL_POSITION_NED_DATA, MavLandedState, MavMessage,
        MavParamType, MavSeverity, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA,
        POSITION_TARGET_GLOBAL_INT_DATA, POSITION_TARGET_LOCAL_NED_DATA, RANGEFINDER_DATA,
        SYS_STATUS_DATA, SYSTEM_TIME_DATA, TERRAIN_REPORT_DATA, VFR_HUD_DATA,
    },
};
use nalgebra::Vector3;

use crate::SimError;

/// Motors that do not take off stop after this time, in seconds.
const IDLE_S: f64 = 10.0;

/// Motors stop this long after touching the ground, in seconds.
const STOP_S: f64 = 1.0;

/// Set-points farther apart than this do not flow, in seconds: 2 Hz.
const FLOW_S: f64 = 0.5;

/// Distance within which a place or height counts as reached, in metres.
const THERE_M: f64 = 0.3;

/// The default slew rate of a heading, in radians per second.
const SLEW: f64 = 1.0;

/// The gain of the control of the nose, per second.
const GAIN: f64 = 4.0;

/// The messages that may be requested, each with the rate at which PX4 sends it without a request,
/// per second.
const KNOWN: [(u32, f64); 17] = [
    (ATTITUDE_DATA::ID, 10.0),
    (GLOBAL_POSITION_INT_DATA::ID, 5.0),
    (LOCAL_POSITION_NED_DATA::ID, 2.0),
    (GPS_RAW_INT_DATA::ID, 1.0),
    (SYS_STATUS_DATA::ID, 1.0),
    (EXTENDED_SYS_STATE_DATA::ID, 1.0),
    (HOME_POSITION_DATA::ID, 0.5),
    (VFR_HUD_DATA::ID, 2.0),
    (SYSTEM_TIME_DATA::ID, 1.0),
    (POSITION_TARGET_GLOBAL_INT_DATA::ID, 1.0),
    (POSITION_TARGET_LOCAL_NED_DATA::ID, 1.0),
    (ESTIMATOR_STATUS_DATA::ID, 1.0),
    (EKF_STATUS_REPORT_DATA::ID, 0.0),
    (DISTANCE_SENSOR_DATA::ID, 1.0),
    (ALTITUDE_DATA::ID, 1.0),
    (RANGEFINDER_DATA::ID, 0.0),
    (TERRAIN_REPORT_DATA::ID, 0.0),
];

/// The state of its flight: its mode and what that makes of its orders.
#[derive(Debug)]
struct Flight {
    mode: FlightMode,
    armed: bool,
    landed: MavLandedState,
    yaw: Yaw,
    /// The place that the mode flies to.
    goal: Vector3<f64>,
    /// Last goal of a mode of its own.
    own_goal: Option<Vector3<f64>>,
    /// The height at which it comes back.
    return_up: f64,
    /// The height of a take-off, while there is one.
    climb_to: Option<f64>,
    /// Time of the last set-point.
    setpoint_at: f64,
    /// True if set-points come often enough for OFFBOARD.
    setpoints_flow: bool,
    /// Time after the last set-point at which OFFBOARD ends, in seconds, and the mode that follows.
    offboard_loss: (f64, FlightMode),
    armed_at: f64,
    /// Time when it touched the ground.
    down_at: Option<f64>,
    /// True if it is above home, or comes there.
    over_home: bool,
    /// True if the next set-point is the first since its mode or its climb began: ArduCopter takes
    /// its own speed with that one, whatever was ordered before.
    takes_own_speed: bool,
    texts: Vec<(MavSeverity, &'static str)>,
}

/// The orders to the body.
#[derive(Clone, Copy, Debug)]
struct BodyOrder {
    goal: Vector3<f64>,
    turn_rate: f64,
}

impl Flight {
    fn new(mode: FlightMode, pose: &Pose, now: f64) -> Self {
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

    fn is_airborne(&self) -> bool {
        self.landed != MavLandedState::MAV_LANDED_STATE_ON_GROUND
    }

    fn arm(&mut self, pose: &Pose, now: f64) {
        if !self.armed {
            (self.armed, self.armed_at, self.goal) = (true, now, pose.position);
            self.yaw.hold(pose.heading);
            self.texts.push((MavSeverity::MAV_SEVERITY_INFO, "Arming motors"));
        }
    }

    fn disarm(&mut self) {
        if self.armed {
            self.texts.push((MavSeverity::MAV_SEVERITY_INFO, "Disarming motors"));
        }
        (self.armed, self.climb_to, self.down_at) = (false, None, None);
        self.landed = MavLandedState::MAV_LANDED_STATE_ON_GROUND;
    }

    /// Changes the mode; every mode begins with the present pose as its goal.
    fn change_mode(&mut self, mode: FlightMode, pose: &Pose) {
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
    fn takes_setpoint(&mut self, now: f64) -> bool {
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
    fn is_fed(&self, now: f64) -> bool {
        self.setpoints_flow && now - self.setpoint_at <= FLOW_S
    }

    /// Goes on with the mode, at the height `above_ground` over the ground below.
    fn step(
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

/// The control of the nose.
#[derive(Clone, Copy, Debug)]
struct Yaw {
    /// The heading to reach in the end.
    aim: f64,
    /// The heading wanted now, on the way to `aim`.
    slewed: f64,
    /// The rate at which `slewed` moves, in radians per second.
    slew: f64,
    /// A rate instead, counter-clockwise.
    rate: Option<f64>,
}

impl Yaw {
    fn new(heading: f64) -> Self {
        Self { aim: heading, slewed: heading, slew: SLEW, rate: None }
    }

    /// The heading wanted at the moment.
    fn slewed(&self) -> f64 {
        self.slewed
    }

    fn hold(&mut self, heading: f64) {
        *self = Self::new(heading);
    }

    /// Turns to a heading, at a rate where one is given.
    fn aim(&mut self, heading: f64, now_at: f64, slew: Option<f64>) {
        if self.rate.take().is_some() {
            self.slewed = now_at;
        }
        self.aim = heading;
        self.slew = slew.filter(|slew| *slew > 0.0).unwrap_or(SLEW);
    }

    fn turn(&mut self, rate: f64) {
        self.rate = Some(rate);
    }

    /// The rate at which to turn, in radians per second counter-clockwise.
    fn step(&mut self, heading: f64, dt: f64) -> f64 {
        if let Some(rate) = self.rate {
            (self.aim, self.slewed) = (heading, heading);
            return rate;
        }
        let most = self.slew * dt;
        let moved = angle::wrap(self.aim - self.slewed).clamp(-most, most);
        self.slewed = angle::wrap(self.slewed + moved);
        let ahead = if dt > 0.0 { moved / dt } else { 0.0 };
        // No faster than the step allows without passing it.
        let gain = if dt > 0.0 { GAIN.min(0.5 / dt) } else { GAIN };
        ahead + gain * angle::wrap(self.slewed - heading)
    }
}

/// The few parameters that ground stations request. All are single precision numbers.
#[derive(Debug)]
struct Params {
    all: Vec<(&'static str, f32)>,
}

impl Params {
    fn new(config: &AutopilotConfig) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "parameters have no more digits")]
        let return_up = config.return_up_m as f32;
        let system = f32::from(config.system_id);
        let failsafe = f32::from(u8::from(config.ground_failsafe_s.is_some()));
        let all = usual(config.autopilot).iter().map(|(name, value)| {
            let usual = match *name {
                "SYSID_THISMAV" | "MAV_SYS_ID" => system,
                "RTL_ALT" => return_up * 100.0,
                "RTL_RETURN_ALT" => return_up,
                "FS_GCS_ENABLE" => failsafe,
                "NAV_DLL_ACT" => 2.0 * failsafe,
                _ => *value,
            };
            #[expect(clippy::cast_possible_truncation, reason = "parameters have no more digits")]
            let set_up = config.faults.parameters.get(*name).map(|value| *value as f32);
            (*name, set_up.unwrap_or(usual))
        });
        Self { all: all.collect() }
    }

    fn value(&self, name: &str) -> Option<f32> {
        self.all.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
    }

    fn all(&self) -> Vec<MavMessage> {
        (0..self.all.len()).filter_map(|index| self.message(index)).collect()
    }

    fn read(&self, query: &PARAM_REQUEST_READ_DATA) -> Option<MavMessage> {
        match usize::try_from(query.param_index) {
            Ok(index) => self.message(index),
            Err(_) => self.message(self.position(&query.param_id)?),
        }
    }

    /// Sets one, and returns its value.
    fn set(&mut self, set: &PARAM_SET_DATA) -> Option<MavMessage> {
        let index = self.position(&set.param_id)?;
        if let Some((_, value)) = self.all.get_mut(index).filter(|_| set.param_value.is_finite()) {
            *value = set.param_value;
        }
        self.message(index)
    }

    fn position(&self, name: &CharArray<16>) -> Option<usize> {
        let name = name.to_str().ok()?;
        self.all.iter().position(|(known, _)| *known == name)
    }

    fn message(&self, index: usize) -> Option<MavMessage> {
        let (name, param_value) = *self.all.get(index)?;
        Some(MavMessage::PARAM_VALUE(PARAM_VALUE_DATA {
            param_value,
            param_count: u16::try_from(self.all.len()).ok()?,
            param_index: u16::try_from(index).ok()?,
            param_id: CharArray::from(name),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        }))
    }
}

/// The messages that it sends, each at its own rate.
#[derive(Debug)]
struct Streams {
    all: Vec<Stream>,
}

#[derive(Debug)]
struct Stream {
    id: u32,
    /// Time from one message to the next, in seconds; infinite if it was not requested.
    period: f64,
    due: f64,
}

impl Streams {
    fn new(config: &AutopilotConfig, now: f64) -> Self {
        let ranges = config.rangefinder_m.is_some();
        let terrain = config.terrain_data;
        let px4 = config.autopilot == Autopilot::Px4;
        // What the firmware has no message of, or the vehicle no device for.
        let has = |id: u32| match id {
            ESTIMATOR_STATUS_DATA::ID | POSITION_TARGET_LOCAL_NED_DATA::ID => px4,
            EKF_STATUS_REPORT_DATA::ID => !px4,
            DISTANCE_SENSOR_DATA::ID => ranges,
            RANGEFINDER_DATA::ID => ranges && !px4,
            TERRAIN_REPORT_DATA::ID => terrain && !px4,
            ALTITUDE_DATA::ID => (ranges || terrain) && px4,
            _ => true,
        };
        let known = KNOWN.iter().filter(|(id, _)| has(*id)).map(|(id, rate)| {
            let unrequested = px4;
            Stream {
                id: *id,
                period: if unrequested { 1.0 / rate } else { f64::INFINITY },
                due: now,
            }
        });
        let beat = Stream { id: HEARTBEAT_DATA::ID, period: 1.0, due: now };
        Self { all: std::iter::once(beat).chain(known).collect() }
    }

    /// Requests a message every `period` seconds from now on; returns false if it may not be
    /// requested.
    fn query(&mut self, id: u32, period: f64, now: f64) -> bool {
        let Some(stream) = self.all.iter_mut().find(|stream| stream.id == id) else {
            return false;
        };
        // Serial ports and processors have an end.
        (stream.period, stream.due) = (period.max(0.01), now);
        true
    }

    /// Returns the messages that are due now.
    fn due(&mut self, now: f64) -> Vec<u32> {
        let mut due = Vec::new();
        for stream in &mut self.all {
            // A nanosecond is forgiven: time is a sum of steps.
            if stream.period.is_finite() && now >= stream.due - 1e-9 {
                due.push(stream.id);
                // In step with itself, and never a burst after a pause.
                stream.due = (stream.due + stream.period).max(now - stream.period);
                if stream.due <= now {
                    stream.due = now + stream.period;
                }
            }
        }
        due
    }
}

/// The parameters of a firmware, as they are at first.
fn usual(autopilot: Autopilot) -> &'static [(&'static str, f32)] {
    match autopilot {
        Autopilot::ArduPilot => &[
            ("SYSID_THISMAV", 1.0),
            ("SYSID_MYGCS", 255.0),
            ("RTL_ALT", 1500.0),
            ("FS_GCS_ENABLE", 1.0),
            ("FS_GCS_TIMEOUT", 5.0),
            ("FS_THR_ENABLE", 1.0),
            ("BATT_FS_LOW_ACT", 0.0),
            ("FENCE_ENABLE", 0.0),
            ("FENCE_TYPE", 7.0),
            ("FENCE_ACTION", 1.0),
            ("FENCE_RADIUS", 300.0),
            ("FENCE_ALT_MAX", 100.0),
            ("FENCE_ALT_MIN", -10.0),
            ("FENCE_MARGIN", 2.0),
            ("FENCE_TOTAL", 0.0),
            ("DISARM_DELAY", 10.0),
            ("WPNAV_SPEED", 1000.0),
        ],
        Autopilot::Px4 => &[
            ("MAV_SYS_ID", 1.0),
            ("MIS_TAKEOFF_ALT", 2.5),
            ("RTL_RETURN_ALT", 15.0),
            ("NAV_DLL_ACT", 2.0),
            ("NAV_RCL_ACT", 2.0),
            ("COM_LOW_BAT_ACT", 0.0),
            ("GF_ACTION", 0.0),
            ("GF_MAX_HOR_DIST", 0.0),
            ("GF_MAX_VER_DIST", 0.0),
            ("COM_OF_LOSS_T", 1.0),
            ("COM_OBL_RC_ACT", 0.0),
            ("MPC_XY_VEL_MAX", 12.0),
            ("CAL_GYRO0_ID", 1.0),
            ("CAL_ACC0_ID", 1.0),
            ("CAL_MAG0_ID", 1.0),
        ],
    }
}

/// Refuses parameters to set up that the firmware does not have.
fn check_parameters(config: &AutopilotConfig) -> Result<(), SimError> {
    let usual = usual(config.autopilot);
    let unknown = |name: &&String| usual.iter().all(|(known, _)| known != *name);
    match config.faults.parameters.keys().find(unknown) {
        Some(name) => Err(SimError::Parameter { name: name.clone() }),
        None => Ok(()),
    }
}
