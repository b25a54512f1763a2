//! The autopilot behind its cable: what it flies, what it suffers, and what it lets happen.

mod commands;
mod telemetry;

use std::io;

use foxhunt_core::Pose;
use foxhunt_wire::{
    ByteStream,
    mavlink::{
        Autopilot, CharArray, Codec, CommonFrame, FlightMode, Signing,
        dialect::{MavMessage, MavSeverity, STATUSTEXT_DATA},
    },
};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use super::{AutopilotConfig, Flight, Params, Streams, check_parameters};
use crate::{Emulator, Interval, SimError, World, devices::OnBoard};

/// The share of late messages that come twice.
const TWICE: f64 = 0.1;

/// MAV_COMP_ID_AUTOPILOT1.
const COMPONENT: u8 = 1;

/// Time that its position takes after a restart, in seconds.
const RESTART_S: f64 = 30.0;

/// Speed at which another station sends it, in m/s.
const STATION_MPS: f64 = 3.0;

/// Bytes of a text that one message holds.
const CHUNK: usize = 50;

/// An autopilot on a drone of a world, behind a stream of bytes.
///
/// It imitates ArduCopter: it sends nothing but heartbeats until it is requested; a take-off is
/// refused unless it is armed in GUIDED and knows its place; the first set-point in GUIDED, and
/// after a take-off, has it fly at WPNAV_SPEED, whatever was ordered before, and a speed is refused
/// in other modes; it can be armed in STABILIZE without knowing; motors that do not take off stop
/// after 10 s; a relative CONDITION_YAW counts from the heading that it is slewing to; a set-point
/// without yaw turns the nose to the goal; it stops its motors on the ground after landing; it
/// comes back when the ground station falls silent (system 255). Of PX4: its modes, set-points
/// flown to at MPC_XY_VEL_MAX, heights of take-off above sea level, telemetry without a request,
/// and OFFBOARD, which needs set-points at 2 Hz and ends without them.
///
/// A drone of a world begins in the air; one with an emulated autopilot begins on the ground below,
/// at an Up of 0.
#[derive(Debug)]
pub struct EmulatedAutopilot<S> {
    stream: S,
    codec: Codec,
    connections: u32,
    brain: Brain,
    /// Bytes on their way, with the time at which they arrive.
    late: Vec<(f64, Vec<u8>)>,
    random: Xoshiro256PlusPlus,
}

impl<S: ByteStream> EmulatedAutopilot<S> {
    /// Puts an autopilot on a drone and the drone on the ground.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Field`], [`SimError::Place`] and
    /// [`SimError::FlightMode`] name what is wrong in `config`.
    pub fn new(
        config: AutopilotConfig,
        world: &World,
        drone: usize,
        stream: S,
    ) -> Result<Self, SimError> {
        config.check()?;
        check_parameters(&config)?;
        let frame = CommonFrame::new(config.origin.lat_deg, config.origin.lon_deg)?;
        let codec = Codec::new(config.system_id, COMPONENT);
        let codec = match config.signing {
            Some(key) => codec.with_signing(Signing::new(key, 0)),
            None => codec,
        };
        let connections = stream.connections();
        let random = Xoshiro256PlusPlus::seed_from_u64(u64::from(config.system_id));
        let brain = Brain::new(config, frame, world.on_board(drone)?);
        Ok(Self { stream, codec, connections, brain, late: Vec::new(), random })
    }

    /// Returns the autopilot's mode.
    #[must_use]
    pub fn mode(&self) -> FlightMode {
        self.brain.flight.mode
    }

    /// Returns true if its motors run.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        self.brain.flight.armed
    }

    /// Returns true if it is in the air.
    #[must_use]
    pub fn is_airborne(&self) -> bool {
        self.brain.flight.is_airborne()
    }

    /// Returns the number of pictures that its camera has taken.
    #[must_use]
    pub fn pictures(&self) -> u32 {
        self.brain.pictures
    }
}

impl<S: ByteStream> Emulator for EmulatedAutopilot<S> {
    fn serve(&mut self) -> io::Result<()> {
        self.brain.step();
        let hears = self.brain.hears();
        let unix_s = self.brain.unix_s();
        let mut into = [0; 2048];
        loop {
            let count = self.stream.receive(&mut into)?;
            let Some(bytes) = into.get(..count).filter(|bytes| !bytes.is_empty()) else { break };
            // What was sent in the meantime is gone.
            if hears {
                self.codec.push(bytes);
            }
            while let Some(frame) = self.codec.next_frame(unix_s) {
                self.brain.take(&frame);
            }
        }
        if self.stream.connections() != self.connections {
            self.connections = self.stream.connections();
            self.codec.restart();
        }
        let now = self.brain.now;
        let late = self.brain.is_within(&self.brain.config.faults.late);
        for message in self.brain.emit() {
            let bytes = self.codec.encode(&message, unix_s);
            if late && self.random.random::<f64>() < TWICE {
                self.late.push((now + self.random.random::<f64>(), bytes.clone()));
            }
            let delay = if late { self.random.random::<f64>() } else { 0.0 };
            self.late.push((now + delay, bytes));
        }
        let mut due: Vec<_> = self.late.extract_if(.., |(at, _)| *at <= now).collect();
        due.sort_by(|one, other| one.0.total_cmp(&other.0));
        for (_, bytes) in due {
            match self.stream.send(&bytes) {
                // Nobody is there yet.
                Err(error) if error.kind() == io::ErrorKind::NotConnected => {}
                other => other?,
            }
        }
        Ok(())
    }
}

/// Everything of the autopilot but its cable.
#[derive(Debug)]
struct Brain {
    config: AutopilotConfig,
    frame: CommonFrame,
    on_board: OnBoard,
    flight: Flight,
    streams: Streams,
    params: Params,
    /// Place on the ground at which the drone was put down.
    home: Vector3<f64>,
    /// Pose by the autopilot's estimator at the time of the last step; Up counts from `home`.
    pose: Pose,
    /// True place of the drone.
    place: Vector3<f64>,
    /// True if its estimator found then that its GPS jumps.
    glitch: bool,
    /// Height above the ground below, in metres.
    above_ground: f64,
    now: f64,
    /// East, North and Up in metres per second; radians per second.
    velocity: Vector3<f64>,
    turning: f64,
    /// Seconds with motors running.
    used_s: f64,
    /// Time of a ground station's last heartbeat.
    ground_contact: Option<f64>,
    /// True if no ground station is heard any more and the failsafe has acted.
    ground_lost: bool,
    /// Numbers of the pilot's orders, of the failsafes and of the restarts that are done.
    piloted: usize,
    failed: usize,
    restarted: usize,
    /// Time since which the estimator knows its place.
    placed_at: f64,
    /// True if a failsafe acts, as its heartbeats say.
    critical: bool,
    /// True if it flies by velocities: it reports no target then.
    by_velocity: bool,
    /// True if another station has started its motors.
    by_others: bool,
    /// The number of pictures that its camera has taken, and the number of the last one ordered.
    pictures: u32,
    pictured: Option<f32>,
    /// The number of the last text in chunks.
    texts: u16,
    outbox: Vec<MavMessage>,
}

impl Brain {
    fn new(config: AutopilotConfig, frame: CommonFrame, on_board: OnBoard) -> Self {
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

    fn unix_s(&self) -> f64 {
        self.config.clock_origin_unix_s + self.now
    }

    /// Returns true if a message to it arrives.
    fn hears(&self) -> bool {
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

    fn is_within(&self, times: &[Interval]) -> bool {
        times.iter().any(|interval| interval.contains(self.now))
    }

    /// Returns true if the estimator knows its place.
    fn is_placed(&self) -> bool {
        self.now >= self.placed_at
    }

    /// Goes on flying at the world's present time.
    fn step(&mut self) {
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
    fn begin(&mut self, mode: FlightMode) {
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
    fn is_inside(&self, goal: &Vector3<f64>) -> bool {
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

    fn change_mode(&mut self, mode: FlightMode) {
        if mode != self.flight.mode {
            self.take_own_speed();
        }
        self.flight.change_mode(mode, &self.pose);
    }

    /// Flies as fast as it is set up to.
    fn take_own_speed(&mut self) {
        let speed = match self.config.autopilot {
            Autopilot::ArduPilot => self.params.value("WPNAV_SPEED").map(|cm| f64::from(cm) * 0.01),
            Autopilot::Px4 => self.params.value("MPC_XY_VEL_MAX").map(f64::from),
        };
        if let Some(speed) = speed.filter(|speed| *speed > 0.0) {
            self.on_board.with(|drone, _| drone.body.cruise(speed));
        }
    }

    /// Writes something to the ground station, longer texts in chunks with a common number.
    fn send(&mut self, severity: MavSeverity, text: &str) {
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
    fn is_meant(&self, system: u8) -> bool {
        system == 0 || system == self.config.system_id
    }

    /// The messages that are due now.
    fn emit(&mut self) -> Vec<MavMessage> {
        for id in self.streams.due(self.now) {
            self.outbox.extend(self.message(id));
        }
        let sent = std::mem::take(&mut self.outbox);
        if self.is_heard() { sent } else { Vec::new() }
    }

    /// Returns the reason as an error if its motors may not be started.
    fn is_armable(&self) -> Result<(), String> {
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
