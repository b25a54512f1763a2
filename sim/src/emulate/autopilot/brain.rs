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
    /// Where it stood when it was put on the ground.
    pub(super) home: Vector3<f64>,
    /// What it truly is at the time of the last step; Up counts from where it was put down.
    pub(super) pose: Pose,
    /// How high it is above the ground below, in metres.
    pub(super) above_ground: f64,
    pub(super) now: f64,
    /// East, North and Up in metres per second; radians per second.
    pub(super) velocity: Vector3<f64>,
    pub(super) turning: f64,
    /// Seconds with motors running.
    pub(super) used_s: f64,
    /// When a ground station's heartbeat came last.
    pub(super) ground_contact: Option<f64>,
    /// Whether it has none, and has acted on that.
    ground_lost: bool,
    /// How many of the pilot's orders are done, how many failsafes, and how many restarts.
    piloted: usize,
    failed: usize,
    restarted: usize,
    /// Since when it knows where it is.
    placed_at: f64,
    /// Whether a failsafe acts, as its heartbeats say.
    pub(super) critical: bool,
    /// Whether it flies by velocities: it reports no target then.
    pub(super) by_velocity: bool,
    /// Whether another station has started its motors.
    by_others: bool,
    /// How many pictures its camera has taken, and the number of the last one ordered.
    pub(super) pictures: u32,
    pub(super) pictured: Option<f32>,
    pub(super) outbox: Vec<MavMessage>,
}

/// How long its position takes after a restart, in seconds.
const RESTART_S: f64 = 30.0;

/// How fast another station sends it, in m/s.
const STATION_MPS: f64 = 3.0;

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
            pose,
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
            outbox: Vec::new(),
            config,
        }
    }

    pub(super) fn unix_s(&self) -> f64 {
        self.config.clock_origin_unix_s + self.now
    }

    /// Whether what is sent to it arrives.
    pub(super) fn hears(&self) -> bool {
        self.is_linked() && !self.is_within(&self.config.faults.deaf)
    }

    /// Whether what it sends arrives.
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

    /// Whether its estimator knows where it is.
    pub(super) fn is_placed(&self) -> bool {
        self.now >= self.placed_at
    }

    /// Goes on flying at the world's present time.
    pub(super) fn step(&mut self) {
        let (pose, above_ground, now) =
            self.on_board.with(|drone, now| (drone.body.pose(), drone.pose().position.z, now));
        let dt = now - self.now;
        if dt > 0.0 {
            self.velocity = (pose.position - self.pose.position) / dt;
            self.turning = foxhunt_core::angle::wrap(pose.heading - self.pose.heading) / dt;
            self.used_s += if self.flight.armed { dt } else { 0.0 };
        }
        (self.pose, self.above_ground, self.now) = (pose, above_ground, now);
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
            let _ = drone.go_to(order.goal, now);
            let _ = drone.body.spin(Some(order.turn_rate));
        });
    }

    /// What failsafes, other stations and restarts do.
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
        if mode == mode.autopilot.return_to_launch() {
            self.flight.return_up = self.config.return_up_m;
        }
        self.change_mode(mode);
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
                if !self.flight.is_airborne() {
                    self.send(MavSeverity::MAV_SEVERITY_WARNING, "GCS Failsafe - Disarming");
                    self.flight.disarm();
                } else if [autopilot.commanded(), autopilot.land()].contains(&mode) {
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

    /// Writes something to the ground station.
    pub(super) fn send(&mut self, severity: MavSeverity, text: &str) {
        let text = CharArray::from(text);
        let data = STATUSTEXT_DATA { severity, text, ..STATUSTEXT_DATA::default() };
        self.outbox.push(MavMessage::STATUSTEXT(data));
    }

    /// Whether a message is meant for it.
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

    /// Why its motors may not be started.
    pub(super) fn is_armable(&self) -> Result<(), &'static str> {
        use foxhunt_wire::mavlink::Autopilot::{ArduPilot, Px4};
        let mode = self.flight.mode;
        match mode.autopilot {
            ArduPilot
                if mode == mode.autopilot.land() || mode == mode.autopilot.return_to_launch() =>
            {
                Err("Arm: Mode not armable")
            }
            // Modes that are flown by hand need no place.
            _ if mode == mode.autopilot.at_boot() || self.is_placed() => Ok(()),
            ArduPilot => Err("Arm: Need Position Estimate"),
            Px4 => Err("Preflight Fail: no global position"),
        }
    }
}
