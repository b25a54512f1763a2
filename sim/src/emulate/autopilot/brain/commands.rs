//! The messages that arrive at an autopilot: commands, set-points and questions.

use MavResult::{
    MAV_RESULT_ACCEPTED as ACCEPTED, MAV_RESULT_DENIED as DENIED, MAV_RESULT_FAILED as FAILED,
    MAV_RESULT_TEMPORARILY_REJECTED as REJECTED, MAV_RESULT_UNSUPPORTED as UNSUPPORTED,
};
use foxhunt_wire::mavlink::{
    Autopilot, FlightMode, Frame, MavHeader, MessageData, degrees_of_e7,
    dialect::{
        AUTOPILOT_VERSION_DATA, COMMAND_ACK_DATA, COMMAND_LONG_DATA, MISSION_COUNT_DATA, MavCmd,
        MavFrame, MavMessage, MavResult, MavSeverity, MavType, SET_POSITION_TARGET_GLOBAL_INT_DATA,
        SET_POSITION_TARGET_LOCAL_NED_DATA, TIMESYNC_DATA,
    },
    heading_of_yaw, ned_of_enu,
};
use nalgebra::Vector3;

use super::Brain;

/// The ground station that it belongs to (SYSID_MYGCS).
const GROUND_SYSTEM: u32 = 255;

/// The word that stops the motors in the air.
const FORCE: f32 = 21196.0;

/// Bits of a set-point's type mask: its place, its yaw, its yaw rate are not given.
const NO_PLACE: u16 = 0x7;
const NO_YAW: u16 = 0x400;
const NO_YAW_RATE: u16 = 0x800;

/// A place of an order in whole numbers, and its frame.
type WholePlace = Option<(i32, i32, MavFrame)>;

impl Brain {
    /// Takes a message.
    pub(super) fn take(&mut self, frame: &Frame) {
        match &frame.message {
            // SYSID_MYGCS alone keeps the failsafe quiet.
            MavMessage::HEARTBEAT(beat)
                if beat.mavtype == MavType::MAV_TYPE_GCS
                    && frame.header.system_id == GROUND_SYSTEM =>
            {
                self.ground_contact = Some(self.now);
            }
            MavMessage::COMMAND_LONG(command) if self.is_meant(command.target_system) => {
                self.command(command, None, &frame.header);
            }
            MavMessage::COMMAND_INT(command) if self.is_meant(command.target_system) => {
                let long = COMMAND_LONG_DATA {
                    param1: command.param1,
                    param2: command.param2,
                    param3: command.param3,
                    param4: command.param4,
                    param7: command.z,
                    command: command.command,
                    target_system: command.target_system,
                    target_component: command.target_component,
                    ..COMMAND_LONG_DATA::default()
                };
                let place = (command.x, command.y, command.frame);
                self.command(&long, Some(place), &frame.header);
            }
            MavMessage::SET_POSITION_TARGET_GLOBAL_INT(target)
                if self.is_meant(target.target_system) =>
            {
                self.set_global(target);
            }
            MavMessage::SET_POSITION_TARGET_LOCAL_NED(target)
                if self.is_meant(target.target_system) =>
            {
                self.set_local(target);
            }
            MavMessage::PARAM_REQUEST_LIST(query) if self.is_meant(query.target_system) => {
                self.outbox.extend(self.params.all());
            }
            MavMessage::PARAM_REQUEST_READ(query) if self.is_meant(query.target_system) => {
                self.outbox.extend(self.params.read(query));
            }
            MavMessage::PARAM_SET(set) if self.is_meant(set.target_system) => {
                self.outbox.extend(self.params.set(set));
            }
            MavMessage::MISSION_REQUEST_LIST(query) if self.is_meant(query.target_system) => {
                self.outbox.push(MavMessage::MISSION_COUNT(MISSION_COUNT_DATA {
                    target_system: u8::try_from(frame.header.system_id).unwrap_or(0),
                    target_component: frame.header.component_id,
                    mission_type: query.mission_type,
                    ..MISSION_COUNT_DATA::default()
                }));
            }
            MavMessage::TIMESYNC(sync) if sync.tc1 == 0 => {
                let nanoseconds = i64::from(self.boot_ms()) * 1_000_000;
                self.outbox.push(MavMessage::TIMESYNC(TIMESYNC_DATA {
                    tc1: nanoseconds,
                    ts1: sync.ts1,
                    ..TIMESYNC_DATA::default()
                }));
            }
            _ => {}
        }
    }

    /// Carries an order out, and acknowledges it.
    fn command(&mut self, c: &COMMAND_LONG_DATA, place: WholePlace, from: &MavHeader) {
        let result = self.obey(c, place);
        let ack = MavMessage::COMMAND_ACK(COMMAND_ACK_DATA {
            command: c.command,
            result,
            target_system: u8::try_from(from.system_id).unwrap_or(0),
            target_component: from.component_id,
            ..COMMAND_ACK_DATA::default()
        });
        self.outbox.push(ack);
    }

    fn obey(&mut self, c: &COMMAND_LONG_DATA, place: WholePlace) -> MavResult {
        let autopilot = self.config.autopilot;
        match c.command {
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => self.arm_or_disarm(c),
            MavCmd::MAV_CMD_DO_SET_MODE => {
                let main = whole(c.param2);
                let sub = whole(c.param3);
                let mode = match autopilot {
                    Autopilot::ArduPilot => FlightMode { autopilot, custom: u32::from(main) },
                    Autopilot::Px4 => FlightMode::px4(main, sub),
                };
                self.order_mode(mode)
            }
            MavCmd::MAV_CMD_NAV_TAKEOFF => self.take_off(f64::from(c.param7)),
            MavCmd::MAV_CMD_NAV_LAND => self.order_mode(autopilot.land()),
            MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => self.order_mode(autopilot.return_to_launch()),
            MavCmd::MAV_CMD_CONDITION_YAW => self.condition_yaw(c),
            MavCmd::MAV_CMD_DO_CHANGE_SPEED => {
                let speed = f64::from(c.param2);
                let commanded = self.flight.mode == autopilot.commanded();
                if !(speed > 0.0 && speed.is_finite()) {
                    return DENIED;
                }
                match autopilot {
                    Autopilot::ArduPilot if !commanded => return FAILED,
                    // Set-points in OFFBOARD are flown to as fast as MPC_XY_VEL_MAX permits.
                    Autopilot::Px4 if commanded => {}
                    _ => self.on_board.with(|drone, _| drone.body.cruise(speed)),
                }
                ACCEPTED
            }
            MavCmd::MAV_CMD_DO_REPOSITION => self.reposition(c, place),
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => {
                let period_s = match f64::from(c.param2) {
                    default if default.abs() < 0.5 => 0.25,
                    off if off < 0.0 => f64::INFINITY,
                    microseconds => microseconds * 1e-6,
                };
                let known = self.streams.query(number(c.param1), period_s, self.now);
                if known { ACCEPTED } else { DENIED }
            }
            MavCmd::MAV_CMD_REQUEST_MESSAGE => self.requested(number(c.param1)),
            #[expect(deprecated, reason = "older ground stations request it in this way")]
            MavCmd::MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES => {
                self.requested(AUTOPILOT_VERSION_DATA::ID)
            }
            // PX4 leaves it to cameras that speak MAVLink themselves.
            MavCmd::MAV_CMD_IMAGE_START_CAPTURE
                if self.config.camera && autopilot == Autopilot::ArduPilot =>
            {
                self.pictures += u32::from(self.pictured.replace(c.param4) != Some(c.param4));
                ACCEPTED
            }
            MavCmd::MAV_CMD_DO_DIGICAM_CONTROL if self.config.camera && c.param5 > 0.5 => {
                self.pictures += 1;
                ACCEPTED
            }
            _ => UNSUPPORTED,
        }
    }

    fn requested(&mut self, id: u32) -> MavResult {
        match self.message(id) {
            Some(message) => {
                self.outbox.push(message);
                ACCEPTED
            }
            None => DENIED,
        }
    }

    fn refuse(&mut self, text: &str, result: MavResult) -> MavResult {
        self.send(MavSeverity::MAV_SEVERITY_CRITICAL, text);
        result
    }

    fn arm_or_disarm(&mut self, c: &COMMAND_LONG_DATA) -> MavResult {
        if c.param1 < 0.5 {
            if self.flight.is_airborne() && (c.param2 - FORCE).abs() > 0.5 {
                return self.refuse("Disarm: in the air", FAILED);
            }
            self.flight.disarm();
            return ACCEPTED;
        }
        if self.flight.armed {
            return ACCEPTED;
        }
        let autopilot = self.config.autopilot;
        match self.is_armable() {
            Err(why) if autopilot == Autopilot::ArduPilot => self.refuse(&why, FAILED),
            Err(why) => {
                self.send(MavSeverity::MAV_SEVERITY_WARNING, &why);
                self.refuse("Arming denied: Resolve system health failures first", REJECTED)
            }
            Ok(()) => {
                self.flight.arm(&self.pose, self.now);
                if self.is_placed() {
                    self.home = Vector3::new(self.pose.position.x, self.pose.position.y, 0.0);
                }
                ACCEPTED
            }
        }
    }

    fn order_mode(&mut self, mode: FlightMode) -> MavResult {
        if FlightMode::named(mode.autopilot, &mode.to_string()).is_none() {
            return self.refuse("No such mode", FAILED);
        }
        let px4 = mode.autopilot == Autopilot::Px4;
        if px4 && mode == mode.autopilot.commanded() && !self.flight.is_fed(self.now) {
            return self.refuse("Switching to mode 'Offboard' is currently not possible", REJECTED);
        }
        let by_hand = mode == mode.autopilot.at_boot();
        // ArduCopter takes any mode while its motors stand still.
        if !self.is_placed() && !by_hand && (px4 || self.flight.armed) {
            return self.refuse("Mode change failed: requires position", FAILED);
        }
        self.critical = false;
        self.begin(mode);
        ACCEPTED
    }

    fn take_off(&mut self, height: f64) -> MavResult {
        let autopilot = self.config.autopilot;
        if !self.is_placed() || self.flight.is_airborne() {
            return FAILED;
        }
        match autopilot {
            Autopilot::ArduPilot => {
                let ready = self.flight.armed && self.flight.mode == autopilot.commanded();
                if !(ready && height > 0.0 && height < 1e4) {
                    return FAILED;
                }
                self.flight.climb_to = Some(height);
            }
            Autopilot::Px4 => {
                let usual = f64::from(self.params.value("MIS_TAKEOFF_ALT").unwrap_or(2.5));
                let up = height - self.home_alt();
                let up = if up.is_finite() { up.max(0.5) } else { usual };
                self.change_mode(autopilot.take_off());
                self.flight.climb_to = Some(up);
            }
        }
        ACCEPTED
    }

    fn condition_yaw(&mut self, c: &COMMAND_LONG_DATA) -> MavResult {
        let autopilot = self.config.autopilot;
        if autopilot == Autopilot::Px4 {
            return UNSUPPORTED;
        }
        if self.flight.mode != autopilot.commanded() || !self.flight.is_airborne() {
            return FAILED;
        }
        let angle = f64::from(c.param1).to_radians();
        let relative = c.param4 > 0.5;
        let aim = match relative {
            // Counted from where it is slewing to, not from where it is; clockwise by default.
            true if c.param3 < 0.0 => self.flight.yaw.slewed() + angle,
            true => self.flight.yaw.slewed() - angle,
            false => heading_of_yaw(angle),
        };
        let rate = f64::from(c.param2).to_radians();
        self.flight.yaw.aim(aim, self.pose.heading, Some(rate));
        ACCEPTED
    }

    fn reposition(&mut self, c: &COMMAND_LONG_DATA, place: WholePlace) -> MavResult {
        let autopilot = self.config.autopilot;
        if !self.flight.armed || !self.flight.is_airborne() {
            return DENIED;
        }
        let (lat, lon, relative) = match place {
            Some((x, y, frame)) => (degrees_of_e7(x), degrees_of_e7(y), is_relative(frame)),
            None => (f64::from(c.param5), f64::from(c.param6), false),
        };
        let up = f64::from(c.param7) - if relative { 0.0 } else { self.home_alt() };
        match autopilot {
            Autopilot::ArduPilot => {
                if self.flight.mode != autopilot.commanded() && c.param2 < 0.5 {
                    return DENIED;
                }
                self.change_mode(autopilot.commanded());
            }
            Autopilot::Px4 => self.change_mode(autopilot.hold()),
        }
        self.flight.takes_own_speed |= self.flight.climb_to.take().is_some();
        self.begin_setpoints();
        self.flight.goal = self.frame.to_local(lat, lon, up);
        let yaw = f64::from(c.param4);
        if yaw.is_finite() && autopilot == Autopilot::Px4 {
            self.flight.yaw.aim(heading_of_yaw(yaw), self.pose.heading, None);
        }
        ACCEPTED
    }

    fn set_global(&mut self, target: &SET_POSITION_TARGET_GLOBAL_INT_DATA) {
        let alt = f64::from(target.alt);
        let up = match self.config.autopilot {
            // PX4 until 1.18: `home.alt - alt - ref_alt` down from its estimator's zero, where that
            // is `ref_alt - (home.alt + alt)`.
            Autopilot::Px4 if is_relative(target.coordinate_frame) => {
                alt + 2.0 * self.config.faults.reference_m + self.reference_drift()
            }
            Autopilot::ArduPilot if is_relative(target.coordinate_frame) => alt,
            _ => alt - self.home_alt(),
        };
        let up = up + self.config.faults.misread_up_m;
        let goal =
            self.frame.to_local(degrees_of_e7(target.lat_int), degrees_of_e7(target.lon_int), up);
        self.set(goal, target.type_mask.bits(), target.yaw, target.yaw_rate);
    }

    fn set_local(&mut self, target: &SET_POSITION_TARGET_LOCAL_NED_DATA) {
        let [north, east, down] = [target.x, target.y, target.z].map(f64::from);
        // Local places count from the estimator's zero; those of an offset frame from where it is.
        let from = match (target.coordinate_frame, self.config.autopilot) {
            (MavFrame::MAV_FRAME_LOCAL_OFFSET_NED, _) => self.pose.position,
            (_, Autopilot::ArduPilot) => self.home,
            (_, Autopilot::Px4) => self.home + Vector3::z() * self.config.faults.reference_m,
        };
        let goal = from + ned_of_enu(&Vector3::new(north, east, down));
        self.set(goal, target.type_mask.bits(), target.yaw, target.yaw_rate);
    }

    /// Takes its own speed with the first set-point.
    fn begin_setpoints(&mut self) {
        if std::mem::take(&mut self.flight.takes_own_speed) {
            self.take_own_speed();
        }
    }

    fn set(&mut self, goal: Vector3<f64>, mask: u16, yaw: f32, yaw_rate: f32) {
        let placed = mask & NO_PLACE == 0 && goal.iter().all(|value| value.is_finite());
        // A goal outside its fence is left out without a word.
        if !self.flight.takes_setpoint(self.now) || !placed || !self.is_inside(&goal) {
            return;
        }
        self.begin_setpoints();
        (self.flight.goal, self.by_velocity) = (goal, false);
        let yaw = f64::from(yaw);
        let rate = f64::from(yaw_rate);
        let here = self.pose.heading;
        if mask & NO_YAW == 0 && yaw.is_finite() {
            self.flight.yaw.aim(heading_of_yaw(yaw), here, None);
        } else if mask & NO_YAW_RATE == 0 && rate.is_finite() {
            self.flight.yaw.turn(-rate);
        } else if self.config.autopilot == Autopilot::ArduPilot {
            // It looks where it goes.
            let way = goal - self.pose.position;
            if way.xy().norm() > 1.0 {
                self.flight.yaw.aim(way.y.atan2(way.x), here, None);
            }
        }
    }
}

fn is_relative(frame: MavFrame) -> bool {
    #[expect(deprecated, reason = "older ground stations use it")]
    let older = MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT;
    frame == MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT || frame == older
}

/// Converts a command parameter to `u8`; a value above 255 becomes 255, which no command uses.
fn whole(parameter: f32) -> u8 {
    u8::try_from(number(parameter)).unwrap_or(u8::MAX)
}

#[expect(clippy::cast_possible_truncation, reason = "it saturates")]
fn number(parameter: f32) -> u32 {
    parameter.round() as u32
}
