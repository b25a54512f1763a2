//! The messages that an autopilot sends.

use foxhunt_wire::mavlink::{
    Autopilot, MessageData, dialect::*, e7_of_degrees, ned_of_enu, whole, yaw_of_heading,
};

use super::Brain;

/// All good flags of the estimator, and the flags of an attitude without a place.
const PLACED: u16 = 0x33F;
const UNPLACED: u16 = 0x081;

/// CONST_POS_MODE.
const STANDS_STILL: u16 = 0x080;

/// GPS_GLITCH of ESTIMATOR_STATUS, and of EKF_STATUS_REPORT.
const PX4_GLITCH: u16 = 0x0400;
const ARDUPILOT_GLITCH: u16 = 0x8000;

/// The first minor version of PX4 that sets it whenever the vehicle stands still.
const TELLS_STANDING: u8 = 16;

/// ArduCopter 4.5.7, and the first release of a minor version of PX4 1.
const ARDUCOPTER_VERSION: u32 = 0x0405_07FF;
const PX4_VERSION: u32 = 0x0100_00FF;

impl Brain {
    pub(super) fn boot_ms(&self) -> u32 {
        whole(self.now * 1e3).unsigned_abs()
    }

    fn usec(&self) -> u64 {
        u64::from(self.boot_ms()) * 1000
    }

    /// Latitude and longitude as messages have them; zero while it does not know them.
    fn lat_lon(&self, place: &nalgebra::Vector3<f64>) -> (i32, i32) {
        if !self.is_placed() {
            return (0, 0);
        }
        let (lat, lon) = self.frame.to_degrees(place);
        (e7_of_degrees(lat), e7_of_degrees(lon))
    }

    /// Altitude of home in the terms of the altitudes that it reports: PX4's go with the altitude
    /// of its estimator's zero.
    pub(super) fn home_alt(&self) -> f64 {
        self.config.origin.alt_m + self.reference_drift()
    }

    /// Drift of that altitude since the beginning, in metres.
    pub(super) fn reference_drift(&self) -> f64 {
        match self.config.autopilot {
            Autopilot::ArduPilot => 0.0,
            Autopilot::Px4 => self.config.faults.reference_drift_mps * self.now,
        }
    }

    /// A place in the frame of its estimator: North, East, and Down from its zero.
    fn local(&self, place: &nalgebra::Vector3<f64>) -> [f32; 3] {
        let mut ned = ned_of_enu(&(place - self.home));
        if self.config.autopilot == Autopilot::Px4 {
            ned.z += self.config.faults.reference_m;
        }
        ned.map(single).into()
    }

    fn alt_mm(&self, up: f64) -> i32 {
        whole((self.home_alt() + up) * 1e3)
    }

    /// Returns the message of a number, as of now; `None` if the autopilot has none of that kind.
    pub(super) fn message(&self, id: u32) -> Option<MavMessage> {
        let position = &self.pose.position;
        let (lat, lon) = self.lat_lon(position);
        let ned = ned_of_enu(&self.velocity);
        let time_boot_ms = self.boot_ms();
        let compass_deg = yaw_of_heading(self.pose.heading).to_degrees().rem_euclid(360.0);
        Some(match id {
            HEARTBEAT_DATA::ID => MavMessage::HEARTBEAT(self.heartbeat()),
            ATTITUDE_DATA::ID => MavMessage::ATTITUDE(ATTITUDE_DATA {
                time_boot_ms,
                roll: single(self.pose.roll),
                pitch: single(self.pose.pitch),
                yaw: single(yaw_of_heading(self.pose.heading)),
                yawspeed: single(-self.turning),
                ..ATTITUDE_DATA::default()
            }),
            GLOBAL_POSITION_INT_DATA::ID => {
                MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
                    time_boot_ms,
                    lat,
                    lon,
                    alt: self.alt_mm(position.z),
                    relative_alt: whole(position.z * 1e3),
                    vx: hundredths(ned.x),
                    vy: hundredths(ned.y),
                    vz: hundredths(ned.z),
                    hdg: positive(compass_deg * 100.0),
                })
            }
            LOCAL_POSITION_NED_DATA::ID => {
                let [x, y, z] = self.local(position);
                MavMessage::LOCAL_POSITION_NED(LOCAL_POSITION_NED_DATA {
                    time_boot_ms,
                    x,
                    y,
                    z,
                    vx: single(ned.x),
                    vy: single(ned.y),
                    vz: single(ned.z),
                })
            }
            GPS_RAW_INT_DATA::ID => MavMessage::GPS_RAW_INT(self.gps(lat, lon)),
            SYS_STATUS_DATA::ID => MavMessage::SYS_STATUS(self.status()),
            EXTENDED_SYS_STATE_DATA::ID => {
                MavMessage::EXTENDED_SYS_STATE(EXTENDED_SYS_STATE_DATA {
                    vtol_state: MavVtolState::MAV_VTOL_STATE_UNDEFINED,
                    landed_state: self.flight.landed,
                })
            }
            HOME_POSITION_DATA::ID if self.is_placed() => {
                let (latitude, longitude) = self.lat_lon(&self.home);
                MavMessage::HOME_POSITION(HOME_POSITION_DATA {
                    latitude,
                    longitude,
                    // As it was when it was set.
                    altitude: whole(self.config.origin.alt_m * 1e3),
                    q: [1.0, 0.0, 0.0, 0.0],
                    ..HOME_POSITION_DATA::default()
                })
            }
            VFR_HUD_DATA::ID => MavMessage::VFR_HUD(VFR_HUD_DATA {
                groundspeed: single(self.velocity.xy().norm()),
                alt: single(self.home_alt() + position.z),
                climb: single(self.velocity.z),
                heading: i16::try_from(whole(compass_deg)).unwrap_or(0),
                throttle: if self.flight.is_airborne() { 50 } else { 0 },
                ..VFR_HUD_DATA::default()
            }),
            SYSTEM_TIME_DATA::ID => MavMessage::SYSTEM_TIME(SYSTEM_TIME_DATA {
                time_unix_usec: self.usec(),
                time_boot_ms,
            }),
            // PX4 keeps here what its own modes flew to, in OFFBOARD too.
            POSITION_TARGET_GLOBAL_INT_DATA::ID if !self.by_velocity => {
                let commanded = self.flight.mode == self.config.autopilot.commanded();
                let goal = match self.config.autopilot {
                    Autopilot::ArduPilot => commanded.then_some(self.flight.goal)?,
                    Autopilot::Px4 => self.flight.own_goal?,
                };
                let (lat_int, lon_int) = self.lat_lon(&goal);
                MavMessage::POSITION_TARGET_GLOBAL_INT(POSITION_TARGET_GLOBAL_INT_DATA {
                    time_boot_ms,
                    lat_int,
                    lon_int,
                    alt: single(self.home_alt() + goal.z),
                    coordinate_frame: MavFrame::MAV_FRAME_GLOBAL,
                    ..POSITION_TARGET_GLOBAL_INT_DATA::default()
                })
            }
            POSITION_TARGET_LOCAL_NED_DATA::ID
                if self.config.autopilot == Autopilot::Px4 && self.flight.armed =>
            {
                let [x, y, z] = self.local(&self.flight.goal);
                MavMessage::POSITION_TARGET_LOCAL_NED(POSITION_TARGET_LOCAL_NED_DATA {
                    time_boot_ms,
                    x,
                    y,
                    z,
                    coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
                    ..POSITION_TARGET_LOCAL_NED_DATA::default()
                })
            }
            ESTIMATOR_STATUS_DATA::ID if self.config.autopilot == Autopilot::Px4 => {
                MavMessage::ESTIMATOR_STATUS(ESTIMATOR_STATUS_DATA {
                    time_usec: self.usec(),
                    pos_horiz_accuracy: single(self.config.horizontal_accuracy_m),
                    pos_vert_accuracy: single(self.config.vertical_accuracy_m),
                    flags: EstimatorStatusFlags::from_bits_retain(self.estimator()),
                    ..ESTIMATOR_STATUS_DATA::default()
                })
            }
            EKF_STATUS_REPORT_DATA::ID if self.config.autopilot == Autopilot::ArduPilot => {
                MavMessage::EKF_STATUS_REPORT(EKF_STATUS_REPORT_DATA {
                    flags: EkfStatusFlags::from_bits_retain(self.estimator()),
                    ..EKF_STATUS_REPORT_DATA::default()
                })
            }
            DISTANCE_SENSOR_DATA::ID => MavMessage::DISTANCE_SENSOR(self.distance_sensor()?),
            RANGEFINDER_DATA::ID if self.config.autopilot == Autopilot::ArduPilot => {
                let [least, most] = self.config.rangefinder_m?;
                let distance = single(self.beam().clamp(least, most));
                MavMessage::RANGEFINDER(RANGEFINDER_DATA { distance, voltage: 0.0 })
            }
            TERRAIN_REPORT_DATA::ID
                if self.config.terrain_data && self.config.autopilot == Autopilot::ArduPilot =>
            {
                let ground = self.config.origin.alt_m + position.z - self.above_ground;
                MavMessage::TERRAIN_REPORT(TERRAIN_REPORT_DATA {
                    lat,
                    lon,
                    terrain_height: single(ground),
                    current_height: single(self.above_ground),
                    // It knows no terrain before it knows its place.
                    spacing: if self.is_placed() { 100 } else { 0 },
                    pending: 0,
                    loaded: if self.is_placed() { 64 } else { 0 },
                })
            }
            ALTITUDE_DATA::ID if self.config.autopilot == Autopilot::Px4 => {
                let ranged = self.distance_sensor().is_some_and(|sensor| is_within(&sensor));
                let known = ranged || (self.config.terrain_data && self.is_placed());
                let known = |value: f64| if known { single(value) } else { f32::NAN };
                MavMessage::ALTITUDE(ALTITUDE_DATA {
                    time_usec: self.usec(),
                    altitude_monotonic: single(position.z),
                    altitude_amsl: single(self.home_alt() + position.z),
                    altitude_local: single(position.z),
                    altitude_relative: single(position.z),
                    // The terrain's own height, not that above it.
                    altitude_terrain: known(position.z - self.above_ground),
                    bottom_clearance: known(self.above_ground),
                })
            }
            AUTOPILOT_VERSION_DATA::ID => MavMessage::AUTOPILOT_VERSION(self.version()),
            _ => return None,
        })
    }

    fn estimator(&self) -> u16 {
        let px4 = self.config.autopilot == Autopilot::Px4;
        if !self.is_placed() {
            return UNPLACED;
        }
        let mut flags = PLACED;
        if px4 && self.config.px4_minor >= TELLS_STANDING && !self.flight.is_airborne() {
            flags |= STANDS_STILL;
        }
        if self.config.faults.is_glitch(self.now) {
            flags |= if px4 { PX4_GLITCH } else { ARDUPILOT_GLITCH };
        }
        flags
    }

    fn heartbeat(&self) -> HEARTBEAT_DATA {
        let custom = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
        let armed = MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        HEARTBEAT_DATA {
            custom_mode: self.flight.mode.custom,
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: match self.config.autopilot {
                Autopilot::ArduPilot => MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
                Autopilot::Px4 => MavAutopilot::MAV_AUTOPILOT_PX4,
            },
            base_mode: if self.flight.armed { custom | armed } else { custom },
            system_status: if self.critical {
                MavState::MAV_STATE_CRITICAL
            } else if self.flight.is_airborne() {
                MavState::MAV_STATE_ACTIVE
            } else {
                MavState::MAV_STATE_STANDBY
            },
            mavlink_version: 3,
        }
    }

    fn gps(&self, lat: i32, lon: i32) -> GPS_RAW_INT_DATA {
        let millimetres = |metres: f64| whole(metres * 1e3).unsigned_abs();
        let placed = self.is_placed();
        GPS_RAW_INT_DATA {
            time_usec: self.usec(),
            lat,
            lon,
            alt: self.alt_mm(self.pose.position.z),
            eph: if placed { 70 } else { u16::MAX },
            epv: if placed { 120 } else { u16::MAX },
            vel: positive(self.velocity.xy().norm() * 100.0),
            cog: u16::MAX,
            fix_type: if placed {
                GpsFixType::GPS_FIX_TYPE_3D_FIX
            } else {
                GpsFixType::GPS_FIX_TYPE_NO_FIX
            },
            satellites_visible: if placed { 14 } else { 3 },
            h_acc: if placed { millimetres(self.config.horizontal_accuracy_m) } else { 0 },
            v_acc: if placed { millimetres(self.config.vertical_accuracy_m) } else { 0 },
            ..GPS_RAW_INT_DATA::default()
        }
    }

    fn status(&self) -> SYS_STATUS_DATA {
        use MavSysStatusSensor as S;
        let present = S::MAV_SYS_STATUS_SENSOR_3D_GYRO
            | S::MAV_SYS_STATUS_SENSOR_3D_ACCEL
            | S::MAV_SYS_STATUS_SENSOR_3D_MAG
            | S::MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
            | S::MAV_SYS_STATUS_SENSOR_GPS
            | S::MAV_SYS_STATUS_AHRS
            | S::MAV_SYS_STATUS_SENSOR_BATTERY
            | S::MAV_SYS_STATUS_PREARM_CHECK;
        let mut bad = S::empty();
        if !self.is_placed() {
            bad |= S::MAV_SYS_STATUS_SENSOR_GPS;
        }
        if !self.flight.armed && (!self.is_placed() || !self.config.faults.preflight.is_empty()) {
            bad |= S::MAV_SYS_STATUS_PREARM_CHECK;
        }
        // PX4 has that check in its health alone.
        let enabled = match self.config.autopilot {
            Autopilot::ArduPilot => present,
            Autopilot::Px4 => present.difference(S::MAV_SYS_STATUS_PREARM_CHECK),
        };
        let left = (1.0 - self.used_s / self.config.endurance_s).clamp(0.0, 1.0);
        SYS_STATUS_DATA {
            onboard_control_sensors_present: present,
            onboard_control_sensors_enabled: enabled,
            onboard_control_sensors_health: present.difference(bad),
            load: 200,
            // Three cells, from full to empty.
            voltage_battery: positive(9_900.0 + 2_700.0 * left),
            current_battery: if self.flight.armed { 1_500 } else { 50 },
            battery_remaining: i8::try_from(whole(left * 100.0)).unwrap_or(-1),
            ..SYS_STATUS_DATA::default()
        }
    }

    /// The distance to the ground along the vehicle's own axis, in metres; the ground is taken for
    /// level there.
    fn beam(&self) -> f64 {
        self.above_ground.max(0.0) / (self.pose.roll.cos() * self.pose.pitch.cos()).max(0.1)
    }

    /// The rangefinder's reading. Beyond its range it reads a centimetre more or less than the
    /// limit.
    fn distance_sensor(&self) -> Option<DISTANCE_SENSOR_DATA> {
        let [least, most] = self.config.rangefinder_m?;
        let min_distance = positive(least * 100.0);
        let max_distance = positive(most * 100.0);
        let distance = positive(self.beam() * 100.0);
        let current_distance =
            distance.clamp(min_distance.saturating_sub(1), max_distance.saturating_add(1));
        let orientation = MavSensorOrientation::MAV_SENSOR_ROTATION_PITCH_270;
        Some(DISTANCE_SENSOR_DATA {
            time_boot_ms: self.boot_ms(),
            min_distance,
            max_distance,
            current_distance,
            mavtype: MavDistanceSensor::MAV_DISTANCE_SENSOR_LASER,
            id: 0,
            orientation,
            covariance: u8::MAX,
            ..DISTANCE_SENSOR_DATA::default()
        })
    }

    fn version(&self) -> AUTOPILOT_VERSION_DATA {
        use MavProtocolCapability as C;
        AUTOPILOT_VERSION_DATA {
            capabilities: C::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
                | C::MAV_PROTOCOL_CAPABILITY_MISSION_INT
                | C::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
                | C::MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
                | C::MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
                | C::MAV_PROTOCOL_CAPABILITY_MAVLINK2,
            uid: u64::from(self.config.system_id),
            flight_sw_version: match self.config.autopilot {
                Autopilot::ArduPilot => ARDUCOPTER_VERSION,
                Autopilot::Px4 => PX4_VERSION | u32::from(self.config.px4_minor) << 16,
            },
            ..AUTOPILOT_VERSION_DATA::default()
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "the messages have no more digits")]
fn single(value: f64) -> f32 {
    value as f32
}

/// A value in hundredths, as far as sixteen bits hold it.
fn hundredths(value: f64) -> i16 {
    i16::try_from(whole(value * 100.0).clamp(-32_767, 32_767)).unwrap_or(0)
}

fn positive(value: f64) -> u16 {
    u16::try_from(whole(value).clamp(0, 65_535)).unwrap_or(0)
}

fn is_within(sensor: &DISTANCE_SENSOR_DATA) -> bool {
    (sensor.min_distance..=sensor.max_distance).contains(&sensor.current_distance)
}
