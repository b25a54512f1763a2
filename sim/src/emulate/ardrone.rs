//! A Parrot AR.Drone 2.0 on a drone of the world.

use std::io;

use foxhunt_core::{Pose, angle};
use foxhunt_wire::{
    ByteStream,
    ardrone::{
        ArDroneCommand, ArDroneDemo, ArDroneNavdata, DroneState, FlightState, parse_commands,
    },
};
use nalgebra::{Vector2, Vector3};

use super::Emulator;
use crate::{SimError, World, devices::OnBoard};

/// A Parrot AR.Drone 2.0 on a drone of a world: orders at one stream, navdata at another.
///
/// What is imitated: navdata only after somebody spoke to their port, without numbers until they
/// are configured; orders with old sequence numbers are ignored; tilt makes speed, with some delay;
/// without orders for a while it hovers; an emergency stops the motors in the air, and is ended by
/// a second emergency order. Its drone begins on the ground below its place in the world.
#[derive(Debug)]
pub struct EmulatedArDrone<A, N> {
    orders: A,
    navdata: N,
    on_board: OnBoard,
    now: f64,
    pose: Pose,
    /// Heading when it was switched on.
    began: f64,
    /// East and North in metres per second, of the body.
    speed: Vector2<f64>,
    flight: FlightState,
    emergency: bool,
    /// True if the last reference order was an emergency order: only the first in a row acts.
    emergency_held: bool,
    configured: bool,
    /// Orders to the drone: roll, pitch, climb and yaw, in shares.
    shares: [f64; 4],
    incoming: f64,
    last_sequence: u32,
    /// True if somebody requested navdata.
    requested: bool,
    sent: f64,
    navdata_sequence: u32,
    climb_mps: f64,
    yaw_rad_s: f64,
}

/// Speed over ground with full tilt, in metres per second.
const FULL_TILT_MPS: f64 = 4.0;

/// The delay with which its speed follows its tilt, in seconds.
const FOLLOWING_S: f64 = 0.4;

/// Time without orders after which it hovers, in seconds.
const WATCHDOG_S: f64 = 0.5;

/// The height to which it climbs by itself, in metres.
const TAKE_OFF_UP_M: f64 = 1.0;

/// Time from one datagram of navdata to the next, in seconds.
const REPORT_INTERVAL_S: f64 = 1.0 / 15.0;

/// Charge of the battery, in percent.
const BATTERY: u32 = 80;

impl<A: ByteStream, N: ByteStream> EmulatedArDrone<A, N> {
    /// Puts it on a drone and the drone on the ground.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn new(world: &World, drone: usize, orders: A, navdata: N) -> Result<Self, SimError> {
        let on_board = world.on_board(drone)?;
        let (pose, now) = on_board.with(|drone, now| {
            drone.body.put_down();
            (drone.body.pose(), now)
        });
        Ok(Self {
            orders,
            navdata,
            on_board,
            now,
            pose,
            began: pose.heading,
            speed: Vector2::zeros(),
            flight: FlightState::Landed,
            emergency: false,
            emergency_held: false,
            configured: false,
            shares: [0.0; 4],
            incoming: now,
            last_sequence: 0,
            requested: false,
            sent: f64::NEG_INFINITY,
            navdata_sequence: 0,
            climb_mps: 0.7,
            yaw_rad_s: 1.75,
        })
    }

    fn is_flying(&self) -> bool {
        self.flight != FlightState::Landed
    }

    fn obey(&mut self, command: &ArDroneCommand) {
        match command {
            ArDroneCommand::Reference { fly, emergency } => {
                if *emergency && !self.emergency_held {
                    // It toggles: stops the motors, or unlocks them.
                    self.emergency = self.is_flying() || !self.emergency;
                    self.flight = FlightState::Landed;
                }
                self.emergency_held = *emergency;
                match self.flight {
                    FlightState::Landed if *fly && !self.emergency => {
                        self.flight = FlightState::TakingOff;
                    }
                    FlightState::Flying | FlightState::TakingOff if !*fly => {
                        self.flight = FlightState::Landing;
                    }
                    _ => {}
                }
            }
            ArDroneCommand::Progressive { progressive, roll, pitch, climb, yaw } => {
                let shares = [roll, pitch, climb, yaw].map(|share| f64::from(*share));
                self.shares = if *progressive { shares } else { [0.0; 4] };
            }
            ArDroneCommand::Config { key, value } => {
                self.configured |= key == "general:navdata_demo";
                match (key.as_str(), value.parse::<f64>()) {
                    ("control:control_yaw", Ok(rate)) if rate > 0.0 => {
                        self.yaw_rad_s = rate.min(6.11);
                    }
                    ("control:control_vz_max", Ok(climb)) if climb > 0.0 => {
                        self.climb_mps = climb.min(2000.0) * 1e-3;
                    }
                    _ => {}
                }
            }
            _ => {}
        }
    }

    fn step(&mut self) {
        let (pose, now) = self.on_board.with(|drone, now| (drone.body.pose(), now));
        let dt = (now - self.now).max(0.0);
        (self.pose, self.now) = (pose, now);
        if now - self.incoming > WATCHDOG_S {
            self.shares = [0.0; 4];
        }
        let [roll, pitch, climb, yaw] = self.shares;
        let (sin, cos) = pose.heading.sin_cos();
        let up = pose.position.z;
        let (tilt, climb, turn) = match self.flight {
            FlightState::Flying => (Vector2::new(-pitch, -roll), climb * self.climb_mps, -yaw),
            FlightState::TakingOff => (Vector2::zeros(), 0.5, 0.0),
            FlightState::Landing => (Vector2::zeros(), -0.5, 0.0),
            _ => (Vector2::zeros(), if up > 0.0 { -3.0 } else { 0.0 }, 0.0),
        };
        match self.flight {
            FlightState::TakingOff if up >= TAKE_OFF_UP_M => self.flight = FlightState::Flying,
            FlightState::Landing if up <= 0.01 => self.flight = FlightState::Landed,
            _ => {}
        }
        // Forward and left of the body, as East and North.
        let wanted =
            Vector2::new(tilt.x * cos - tilt.y * sin, tilt.x * sin + tilt.y * cos) * FULL_TILT_MPS;
        let wanted = if self.is_flying() { wanted } else { Vector2::zeros() };
        self.speed += (wanted - self.speed) * (dt / FOLLOWING_S).min(1.0);
        let moved = Vector3::new(self.speed.x, self.speed.y, climb) * dt;
        let mut goal = pose.position + moved;
        goal.z = goal.z.max(0.0);
        let rate = turn * self.yaw_rad_s;
        self.on_board.with(|drone, now| {
            // A goal of the world's own size is a place.
            let _ = drone.go_to(goal, now);
            let _ = drone.body.spin(Some(rate));
        });
    }

    fn report(&mut self) -> ArDroneNavdata {
        self.navdata_sequence = self.navdata_sequence.wrapping_add(1);
        let bit = |holds: bool, at: u32| u32::from(holds) << at;
        let state = bit(self.is_flying(), 0)
            | bit(!self.configured, 11)
            | bit(self.now - self.incoming > WATCHDOG_S, 30)
            | bit(self.emergency, 31);
        let (sin, cos) = self.pose.heading.sin_cos();
        let demo = ArDroneDemo {
            flight: self.flight,
            battery_percent: BATTERY,
            pitch: self.pose.pitch,
            roll: self.pose.roll,
            yaw: -angle::wrap(self.pose.heading - self.began),
            altitude_m: self.pose.position.z,
            forward_mps: self.speed.x * cos + self.speed.y * sin,
            right_mps: self.speed.x * sin - self.speed.y * cos,
        };
        let demo = self.configured.then_some(demo);
        ArDroneNavdata { state: DroneState(state), sequence: self.navdata_sequence, demo }
    }
}

impl<A: ByteStream, N: ByteStream> Emulator for EmulatedArDrone<A, N> {
    fn serve(&mut self) -> io::Result<()> {
        let linked = self.on_board.with(|drone, now| drone.is_linked(now));
        let mut into = [0; 2048];
        while let Some(bytes) = received(&mut self.orders, &mut into)? {
            let Ok(commands) = parse_commands(bytes) else { continue };
            for (sequence, command) in commands.iter().filter(|_| linked) {
                // A number of 1 begins anew, and an old one comes late.
                if *sequence == 1 || *sequence > self.last_sequence {
                    self.last_sequence = *sequence;
                    self.incoming = self.now;
                    self.obey(command);
                }
            }
        }
        while received(&mut self.navdata, &mut into)?.is_some() {
            self.requested |= linked;
        }
        self.step();
        if self.requested && self.now - self.sent >= REPORT_INTERVAL_S - 1e-9 {
            self.sent = self.now;
            let sent = self.report().encode();
            if linked {
                self.navdata.send(&sent)?;
            }
        }
        Ok(())
    }
}

fn received<'a>(stream: &mut impl ByteStream, into: &'a mut [u8]) -> io::Result<Option<&'a [u8]>> {
    let count = stream.receive(into)?;
    Ok(into.get(..count).filter(|bytes| !bytes.is_empty()))
}
