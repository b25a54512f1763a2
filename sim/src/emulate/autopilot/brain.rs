use foxhunt_core::Pose;
use foxhunt_wire::mavlink::{
    Autopilot, CharArray, CommonFrame, FlightMode, Frame,
    dialect::{
        COMMAND_LONG_DATA, MISSION_COUNT_DATA, MavMessage, MavSeverity, MavType, STATUSTEXT_DATA,
        TIMESYNC_DATA,
    },
};
use nalgebra::Vector3;

use super::{AutopilotConfig, flight::Flight, params::Params, streams::Streams};
use crate::{Interval, devices::OnBoard};

/// Everything of the autopilot but its cable.
#[derive(Debug)]
pub(super) struct Brain {
    pub(super) config: AutopilotConfig,
    pub(super) frame: CommonFrame,
    pub(super) on_board: OnBoard,
    pub(super) flight: Flight,
    pub(super) streams: Streams,
    pub(super) params: Params,
    /// The place where it was put on the ground.
    pub(super) home: Vector3<f64>,
    /// Pose by its estimator at the time of the last step; Up counts from where it was put down.
    pub(super) pose: Pose,
    /// Its true place.
    place: Vector3<f64>,
    /// True if its estimator found then that its GPS jumps.
    glitch: bool,
    /// Height above the ground below, in metres.
    pub(super) above_ground: f64,
    pub(super) now: f64,
    /// East, North and Up in metres per second; radians per second.
    pub(super) velocity: Vector3<f64>,
    pub(super) turning: f64,
    /// Seconds with motors running.
    pub(super) used_s: f64,
    /// Time of a ground station's last heartbeat.
    pub(super) ground_contact: Option<f64>,
    /// True if no ground station is heard any more and the failsafe has acted.
    ground_lost: bool,
    /// Numbers of the pilot's orders, of the failsafes and of the restarts that are done.
    piloted: usize,
    failed: usize,
    restarted: usize,
    /// Time since which it knows where it is.
    placed_at: f64,
    /// True if a failsafe acts, as its heartbeats say.
    pub(super) critical: bool,
    /// True if it flies by velocities: it reports no target then.
    pub(super) by_velocity: bool,
    /// True if another station has started its motors.
    by_others: bool,
    /// The number of pictures that its camera has taken, and the number of the last one ordered.
    pub(super) pictures: u32,
    pub(super) pictured: Option<f32>,
    /// The number of the last text in chunks.
    texts: u16,
    pub(super) outbox: Vec<MavMessage>,
}

/// Time that its position takes after a restart, in seconds.
const RESTART_S: f64 = 30.0;

/// Speed at which another station sends it, in m/s.
const STATION_MPS: f64 = 3.0;

/// Bytes of a text that one message holds.
const CHUNK: usize = 50;

/// The ground station that it belongs to (SYSID_MYGCS).
const GROUND_SYSTEM: u32 = 255;

impl Brain {
    pub(super) fn new(config: AutopilotConfig, frame: CommonFrame, on_board: OnBoard) -> Self {
        let (pose, now) = on_board.with(|drone, now| {
            drone.launch();
            (drone.body.pose(), now)
        });
        Self {
            flight: Flight::new(config.autopilot.at_boot(), &pose, now),
            streams: Streams::new(&config, now),
            params: Params::new(&config),
            frame,
            on_board,
            home: pose.position,
            place: pose.position,
            pose,
            glitch: false,
            above_ground: 0.0,
            now,
            velocity: Vector3::zeros(),
            turning: 0.0,
            used_s: 0.0,
            ground_contact: None,
            ground_lost: false,
            piloted: 0,
            failed: 0,
            restarted: 0,
            placed_at: config.position_good_after_s,
            critical: false,
            by_velocity: false,
            by_others: false,
            pictures: 0,
            pictured: None,
            texts: 0,
            outbox: Vec::new(),
            config,
        }
    }

    pub(super) fn unix_s(&self) -> f64 {
        self.config.clock_origin_unix_s + self.now
    }

    /// Returns true if a message to it arrives.
    pub(super) fn hears(&self) -> bool {
        self.is_linked() && !self.is_within(&self.config.faults.deaf)
    }

    /// Returns true if a message of it arrives.
    fn is_heard(&self) -> bool {
        self.is_linked() && !self.is_within(&self.config.faults.unheard)
    }

    fn is_linked(&self) -> bool {
        self.on_board.with(|drone, now| drone.is_linked(now))
            && !self.is_within(&self.config.faults.silent)
    }

    pub(super) fn is_within(&self, times: &[Interval]) -> bool {
        times.iter().any(|interval| interval.contains(self.now))
    }

    /// Returns true if its estimator knows where it is.
    pub(super) fn is_placed(&self) -> bool {
        self.now >= self.placed_at
    }

    /// Goes on flying at the world's present time.
    pub(super) fn step(&mut self) {
        let (pose, above_ground, now) =
            self.on_board.with(|drone, now| (drone.body.pose(), drone.pose().position.z, now));
        let dt = now - self.now;
        if dt > 0.0 {
            self.velocity = (pose.position - self.place) / dt;
            self.turning = foxhunt_core::angle::wrap(pose.heading - self.pose.heading) / dt;
            self.used_s += if self.flight.armed { dt } else { 0.0 };
        }
        let aside = self.config.faults.aside(now);
        self.place = pose.position;
        let pose = Pose { position: pose.position + aside, ..pose };
        (self.pose, self.above_ground, self.now) = (pose, above_ground, now);
        self.set_up_flight();
        self.tell_glitches();
        while let Some(order) = self.config.faults.pilot.get(self.piloted) {
            if order.at_s > now {
                break;
            }
            self.piloted += 1;
            if let Some(mode) = FlightMode::named(self.config.autopilot, &order.mode) {
                self.critical = false;
                self.begin(mode);
            }
        }
        self.suffer(dt);
        self.fail_safe();
        let order = self.flight.step(&pose, above_ground, self.home, now, dt);
        for (severity, text) in std::mem::take(&mut self.flight.texts) {
            self.send(severity, text);
        }
        self.on_board.with(|drone, now| {
            // A goal of the world's own size is a place.
            let _ = drone.go_to(order.goal - aside, now);
            let _ = drone.body.spin(Some(order.turn_rate));
        });
    }

    /// Lets failsafes, other stations and restarts act.
    fn suffer(&mut self, dt: f64) {
        while let Some(order) = self.config.faults.failsafes.get(self.failed).cloned() {
            if order.at_s > self.now {
                break;
            }
            self.failed += 1;
            let mode = FlightMode::named(self.config.autopilot, &order.mode);
            if let (Some(mode), true) = (mode, self.flight.is_airborne()) {
                self.send(MavSeverity::MAV_SEVERITY_WARNING, &order.text);
                self.critical = true;
                self.begin(mode);
            }
        }
        while let Some(at_s) = self.config.faults.restarts_s.get(self.restarted) {
            if *at_s > self.now {
                break;
            }
            self.restarted += 1;
            if !self.flight.is_airborne() {
                self.flight = Flight::new(self.config.autopilot.at_boot(), &self.pose, self.now);
                self.streams = Streams::new(&self.config, self.now);
                self.placed_at = self.now + RESTART_S;
                (self.critical, self.ground_contact) = (false, None);
            }
        }
        let commanded = self.flight.mode == self.config.autopilot.commanded();
        if commanded && self.flight.is_airborne() && self.is_within(&self.config.faults.velocities)
        {
            // The body goes as fast as it may: so far ahead is the goal.
            self.flight.climb_to = None;
            self.flight.goal =
                self.pose.position + Vector3::new(0.0, STATION_MPS * dt.max(0.1), 0.0);
            (self.by_velocity, self.flight.setpoint_at) = (true, self.now);
        }
        let motors = self.is_within(&self.config.faults.motors);
        if motors && !self.flight.armed && !self.flight.is_airborne() {
            self.flight.arm(&self.pose, self.now);
            self.by_others = true;
        } else if !motors && std::mem::take(&mut self.by_others) && !self.flight.is_airborne() {
            self.flight.disarm();
        }
    }

    /// Goes into a mode, as it comes back from here.
    pub(super) fn begin(&mut self, mode: FlightMode) {
        self.change_mode(mode);
    }

    /// Takes over what its parameters say of its flight.
    fn set_up_flight(&mut self) {
        let value = |name: &str| self.params.value(name).map(f64::from);
        let autopilot = self.config.autopilot;
        let up = match autopilot {
            Autopilot::ArduPilot => value("RTL_ALT").map(|cm| cm * 0.01),
            Autopilot::Px4 => value("RTL_RETURN_ALT"),
        };
        self.flight.return_up = up.unwrap_or(self.config.return_up_m);
        if let (Some(loss_s), Some(action)) = (value("COM_OF_LOSS_T"), value("COM_OBL_RC_ACT")) {
            let then = match action {
                3.0 => autopilot.return_to_launch(),
                4.0 => autopilot.land(),
                5.0 => autopilot.hold(),
                _ => autopilot.by_hand(),
            };
            self.flight.offboard_loss = (loss_s, then);
        }
    }

    /// ArduCopter tells in words what its estimator finds.
    fn tell_glitches(&mut self) {
        let glitch = self.config.faults.is_glitch(self.now);
        if std::mem::replace(&mut self.glitch, glitch) == glitch
            || self.config.autopilot == Autopilot::Px4
        {
            return;
        }
        match glitch {
            true => self.send(MavSeverity::MAV_SEVERITY_CRITICAL, "GPS Glitch or Compass error"),
            false => self.send(MavSeverity::MAV_SEVERITY_CRITICAL, "Glitch cleared"),
        }
    }

    /// Returns true if its own fence lets it go to a place.
    pub(super) fn is_inside(&self, goal: &Vector3<f64>) -> bool {
        let value = |name: &str| self.params.value(name).map_or(0.0, f64::from);
        if value("FENCE_ENABLE") < 0.5 {
            return true;
        }
        let kinds = value("FENCE_TYPE");
        let has = |bit: f64| (kinds / bit).floor() % 2.0 > 0.5;
        let away = (goal - self.home).xy().norm();
        !(has(1.0) && goal.z > value("FENCE_ALT_MAX") || has(2.0) && away > value("FENCE_RADIUS"))
    }

    fn fail_safe(&mut self) {
        let autopilot = self.config.autopilot;
        let limit = self.config.ground_failsafe_s;
        let Some((received, limit)) = self.ground_contact.zip(limit) else { return };
        let lost = self.now - received > limit && (self.flight.armed || self.ground_lost);
        match (std::mem::replace(&mut self.ground_lost, lost), lost) {
            (false, true) => {
                // The pilot's modes go on: FS_OPTIONS is 16.
                let mode = self.flight.mode;
                // PX4's state is critical where a failsafe has changed its mode.
                self.critical = autopilot == Autopilot::ArduPilot || mode == autopilot.commanded();
                // PX4 goes on with a landing.
                let lands = autopilot == Autopilot::ArduPilot && mode == autopilot.land();
                if !self.flight.is_airborne() {
                    self.send(MavSeverity::MAV_SEVERITY_WARNING, "GCS Failsafe - Disarming");
                    self.flight.disarm();
                } else if mode == autopilot.commanded() || lands {
                    self.send(MavSeverity::MAV_SEVERITY_WARNING, "GCS Failsafe - RTL");
                    self.begin(autopilot.return_to_launch());
                } else {
                    let text = "GCS Failsafe - Continuing Pilot Control";
                    self.send(MavSeverity::MAV_SEVERITY_WARNING, text);
                }
            }
            (true, false) => {
                self.critical = false;
                self.send(MavSeverity::MAV_SEVERITY_WARNING, "GCS Failsafe Cleared");
            }
            _ => {}
        }
    }

    pub(super) fn change_mode(&mut self, mode: FlightMode) {
        if mode != self.flight.mode {
            self.take_own_speed();
        }
        self.flight.change_mode(mode, &self.pose);
    }

    /// Flies as fast as it is set up to.
    pub(super) fn take_own_speed(&mut self) {
        let speed = match self.config.autopilot {
            Autopilot::ArduPilot => self.params.value("WPNAV_SPEED").map(|cm| f64::from(cm) * 0.01),
            Autopilot::Px4 => self.params.value("MPC_XY_VEL_MAX").map(f64::from),
        };
        if let Some(speed) = speed.filter(|speed| *speed > 0.0) {
            self.on_board.with(|drone, _| drone.body.cruise(speed));
        }
    }

    /// Writes something to the ground station, longer texts in chunks with a common number.
    pub(super) fn send(&mut self, severity: MavSeverity, text: &str) {
        let chunked = text.len() > CHUNK;
        self.texts = self.texts.wrapping_add(u16::from(chunked)).max(1);
        let id = if chunked { self.texts } else { 0 };
        for (chunk_seq, chunk) in (0..).zip(text.as_bytes().chunks(CHUNK)) {
            let text = CharArray::from(String::from_utf8_lossy(chunk).as_ref());
            let data = STATUSTEXT_DATA { severity, text, id, chunk_seq };
            self.outbox.push(MavMessage::STATUSTEXT(data));
        }
    }

    /// Returns true if a message is meant for it.
    pub(super) fn is_meant(&self, system: u8) -> bool {
        system == 0 || system == self.config.system_id
    }

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

    /// The messages that are due now.
    pub(super) fn emit(&mut self) -> Vec<MavMessage> {
        for id in self.streams.due(self.now) {
            self.outbox.extend(self.message(id));
        }
        let sent = std::mem::take(&mut self.outbox);
        if self.is_heard() { sent } else { Vec::new() }
    }

    /// Returns the reason as an error if its motors may not be started.
    pub(super) fn is_armable(&self) -> Result<(), String> {
        use foxhunt_wire::mavlink::Autopilot::{ArduPilot, Px4};
        let mode = self.flight.mode;
        let failed = &self.config.faults.preflight;
        let why = match mode.autopilot {
            ArduPilot
                if mode == mode.autopilot.land() || mode == mode.autopilot.return_to_launch() =>
            {
                "Arm: Mode not armable".into()
            }
            ArduPilot if !failed.is_empty() => format!("PreArm: {failed}"),
            Px4 if !failed.is_empty() => format!("Preflight Fail: {failed}"),
            // Modes that are flown by hand need no place.
            _ if mode == mode.autopilot.at_boot() || self.is_placed() => return Ok(()),
            ArduPilot => "Arm: Need Position Estimate".into(),
            Px4 => "Preflight Fail: no global position".into(),
        };
        Err(why)
    }
}
