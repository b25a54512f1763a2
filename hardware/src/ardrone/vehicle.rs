use std::io;

use foxhunt_core::{Clock, Pose, Spinner, Vehicle, Waypoint, angle};
use foxhunt_wire::{
    ByteStream,
    ardrone::{ArDroneCommand, ArDroneNavdata, FlightState, encode_commands},
};
use nalgebra::{Vector2, Vector3};

use super::{
    ArDroneConfig, ArDroneError,
    control::{self, Goal},
};
use crate::{Aircraft, AircraftState, Finding};

/// A Parrot AR.Drone 2.0: orders to its UDP port 5556, navdata from 5554.
///
/// It knows no place: that is counted from where it stood, by the speeds that it tells, and is off by more
/// the farther it flies, which [`position_sigma`](Vehicle::position_sigma) says;
/// [`correct`](Self::correct) takes a better one from outside. It is flown to its goals by orders of tilt,
/// so it has to be served some twenty times a second; without orders it hovers by itself.
///
/// After a lost link nothing is ordered until [`take_over`](Self::take_over) is called.
#[derive(Debug)]
pub struct ArDrone<A, N, C> {
    config: ArDroneConfig,
    orders: A,
    navdata: N,
    clock: C,
    sequence: u32,
    heard: Option<(f64, ArDroneNavdata)>,
    position: Vector3<f64>,
    velocity: Vector2<f64>,
    /// Metres flown since the place was known, and σ of it then.
    flown: f64,
    sigma: f64,
    phase: Phase,
    goal: Option<Goal>,
    sent: f64,
    asked: f64,
}

/// What was ordered of it, and how far that is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Idle,
    /// Up to so many metres.
    TakingOff(f64),
    Flying,
    Returning,
    Landing,
    /// Its motors are to stop.
    Stopping,
    Lost,
}

/// After so long without navdata they are asked for again, in seconds.
const ASK_S: f64 = 0.5;

/// How close is there, in metres.
const THERE_M: f64 = 0.4;

impl<A: ByteStream, N: ByteStream, C: Clock> ArDrone<A, N, C> {
    /// A drone that takes orders at one stream (UDP 5556) and tells navdata at the other (UDP 5554).
    ///
    /// # Errors
    ///
    /// [`ArDroneError::Config`] names what is out of range.
    pub fn new(
        config: ArDroneConfig,
        orders: A,
        navdata: N,
        clock: C,
    ) -> Result<Self, ArDroneError> {
        config.check()?;
        Ok(Self {
            orders,
            navdata,
            clock,
            sequence: 1,
            heard: None,
            position: Vector3::new(config.east_m, config.north_m, 0.0),
            velocity: Vector2::zeros(),
            flown: 0.0,
            sigma: config.start_sigma_m,
            phase: Phase::Idle,
            goal: None,
            sent: f64::NEG_INFINITY,
            asked: f64::NEG_INFINITY,
            config,
        })
    }

    /// Tells it where it is, East and North in metres, and σ of that.
    pub fn correct(&mut self, place: Vector2<f64>, sigma_m: f64) {
        if place.iter().all(|value| value.is_finite()) && sigma_m >= 0.0 {
            (self.position.x, self.position.y) = (place.x, place.y);
            (self.flown, self.sigma) = (0.0, sigma_m);
        }
    }

    /// Flies on after a lost link, from where it is. Without effect while it is ours.
    ///
    /// # Errors
    ///
    /// [`ArDroneError::Silent`] while nothing is heard; the link, where that fails.
    pub fn take_over(&mut self) -> Result<(), ArDroneError> {
        let now = self.serve()?;
        self.check_link(now)?;
        if self.phase == Phase::Lost {
            self.phase = if self.is_flying() { Phase::Flying } else { Phase::Idle };
            self.stay();
        }
        Ok(())
    }

    /// Stops its motors at once, wherever it is: it falls.
    ///
    /// # Errors
    ///
    /// The link, where that fails; it goes on trying.
    pub fn stop_motors(&mut self) -> Result<(), ArDroneError> {
        (self.phase, self.goal, self.sent) = (Phase::Stopping, None, f64::NEG_INFINITY);
        self.serve().map(|_| ())
    }

    /// Looks at it: its state and its battery. Nothing is ordered that moves anything. `pause` is
    /// called while it waits.
    pub fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        let begun = self.clock.now();
        // A clock that stands still does not keep us for ever.
        for _ in 0..1_000_000 {
            match self.serve() {
                Err(error) => {
                    let remedy = "join the drone's wireless network";
                    return vec![Finding::bad("link", error, remedy)];
                }
                Ok(now) if self.demo().is_some() || now - begun > 5.0 => break,
                Ok(_) => pause(),
            }
        }
        let Some(demo) = self.demo() else {
            let remedy =
                "join the drone's wireless network, and see that no other program flies it";
            return vec![Finding::bad("navdata", "nothing was heard", remedy)];
        };
        let percent = demo.battery_percent;
        let battery = format!("{percent} % left");
        vec![
            Finding::good("navdata", format!("{:?}", demo.flight)),
            if percent < 30 {
                Finding::bad("battery", battery, "charge it before you fly")
            } else {
                Finding::good("battery", battery)
            },
            if self.state_is(|state| state.is_emergency()) {
                let remedy = "put it level on the ground; the next take-off ends the emergency";
                Finding::bad("emergency", "its motors are locked", remedy)
            } else {
                Finding::good("emergency", "none")
            },
        ]
    }

    fn demo(&self) -> Option<foxhunt_wire::ardrone::ArDroneDemo> {
        self.heard?.1.demo
    }

    fn state_is(&self, holds: impl Fn(foxhunt_wire::ardrone::DroneState) -> bool) -> bool {
        self.heard.is_some_and(|(_, navdata)| holds(navdata.state))
    }

    fn is_flying(&self) -> bool {
        self.state_is(|state| state.is_flying())
    }

    fn silent_s(&self, now: f64) -> f64 {
        self.heard.map_or(f64::INFINITY, |(at, _)| now - at)
    }

    fn check_link(&self, now: f64) -> Result<(), ArDroneError> {
        let (silent_s, limit_s) = (self.silent_s(now), self.config.link_timeout_s);
        if silent_s > limit_s { Err(ArDroneError::Silent { silent_s, limit_s }) } else { Ok(()) }
    }

    fn heading(&self) -> f64 {
        // It counts clockwise from where it was switched on.
        let begun = self.config.heading_deg_ccw_from_east.to_radians();
        angle::wrap(begun - self.demo().map_or(0.0, |demo| demo.yaw))
    }

    fn known_pose(&self) -> Pose {
        let (pitch, roll) = self.demo().map_or((0.0, 0.0), |demo| (demo.pitch, demo.roll));
        Pose { position: self.position, heading: self.heading(), pitch, roll }
    }

    fn stay(&mut self) {
        let place = self.position;
        self.goal = Some(Goal { place, heading: self.heading(), rate: 0.0 });
    }

    /// Takes navdata and counts the way on.
    fn listen(&mut self, now: f64) -> io::Result<()> {
        let mut into = [0; 4096];
        for _ in 0..256 {
            let count = self.navdata.receive(&mut into)?;
            let Some(datagram) = into.get(..count).filter(|bytes| !bytes.is_empty()) else { break };
            let Ok(navdata) = ArDroneNavdata::parse(datagram) else { continue };
            // Late ones and doubled ones; a number that begins again is a drone that did.
            let before = self.heard;
            let late = before.is_some_and(|(at, last)| {
                navdata.sequence <= last.sequence && navdata.sequence > 1 && now - at < 1.0
            });
            if late {
                continue;
            }
            self.heard = Some((now, navdata));
            if let Some(demo) = navdata.demo {
                let dt = before.map_or(0.0, |(at, _)| (now - at).clamp(0.0, 0.5));
                let (sin, cos) = self.heading().sin_cos();
                let (forward, left) = (demo.forward_mps, -demo.right_mps);
                self.velocity =
                    Vector2::new(forward * cos - left * sin, forward * sin + left * cos);
                self.position.x += self.velocity.x * dt;
                self.position.y += self.velocity.y * dt;
                self.position.z = demo.altitude_m;
                self.flown += self.velocity.norm() * dt;
            }
        }
        Ok(())
    }

    fn serve(&mut self) -> Result<f64, ArDroneError> {
        let now = self.clock.now();
        let heard = self.listen(now);
        let flying = self.is_flying();
        let silent = self.silent_s(now) > self.config.link_timeout_s;
        match self.phase {
            _ if silent && !matches!(self.phase, Phase::Idle | Phase::Stopping) => {
                (self.phase, self.goal) = (Phase::Lost, None);
            }
            Phase::TakingOff(up) => {
                let up_there = self.demo().is_some_and(|demo| demo.flight == FlightState::Flying);
                if self.goal.is_none() && up_there {
                    self.stay();
                }
                if let Some(goal) = &mut self.goal {
                    goal.place.z = up;
                    if (self.position.z - up).abs() < THERE_M {
                        self.phase = Phase::Flying;
                    }
                }
            }
            Phase::Returning => {
                let there = |goal: Goal| (goal.place - self.position).xy().norm() < THERE_M;
                if self.goal.is_none_or(there) {
                    (self.phase, self.goal) = (Phase::Landing, None);
                }
            }
            Phase::Landing if !flying => self.phase = Phase::Idle,
            Phase::Flying if !flying => (self.phase, self.goal) = (Phase::Idle, None),
            Phase::Stopping if self.state_is(|state| state.is_emergency()) => {
                self.phase = Phase::Idle;
            }
            _ => {}
        }
        heard?;
        self.say(now)?;
        Ok(now)
    }

    /// Says what is due.
    fn say(&mut self, now: f64) -> io::Result<()> {
        let bare = self.heard.is_none_or(|(at, navdata)| {
            now - at > ASK_S || navdata.demo.is_none() || navdata.state.is_in_bootstrap()
        });
        if bare && now - self.asked >= ASK_S {
            self.asked = now;
            // Anything at that port has them sent back here.
            send(&mut self.navdata, &[1, 0, 0, 0])?;
            let value =
                |key: &str, value: String| ArDroneCommand::Config { key: key.into(), value };
            let turn = self.config.yaw_rate_deg_s.to_radians();
            let climb = self.config.climb_mps * 1e3;
            let bytes = encode_commands(
                &[
                    value("general:navdata_demo", "TRUE".into()),
                    value("control:control_yaw", format!("{turn:.3}")),
                    value("control:control_vz_max", format!("{climb:.0}")),
                    ArDroneCommand::Control { mode: 5, argument: 0 },
                ],
                &mut self.sequence,
            );
            send(&mut self.orders, &bytes)?;
        }
        let period = 1.0 / self.config.rate_hz;
        if now - self.sent < period - 1e-3 {
            return Ok(());
        }
        let dt = (now - self.sent).min(0.5);
        self.sent = now;
        let emergency = self.state_is(|state| state.is_emergency());
        let reference = |fly, emergency| ArDroneCommand::Reference { fly, emergency };
        let commands = match self.phase {
            // By itself it hovers.
            Phase::Lost => return Ok(()),
            Phase::Idle | Phase::Landing => vec![reference(false, false), ArDroneCommand::hover()],
            Phase::Stopping => vec![reference(false, true)],
            // The bit ends an emergency, where there is one, before it flies.
            Phase::TakingOff(_) if emergency => vec![reference(false, true)],
            Phase::TakingOff(_) | Phase::Flying | Phase::Returning => {
                let pose = self.known_pose();
                let moving = self.goal.as_mut().map(|goal| {
                    goal.heading = angle::wrap(goal.heading + goal.rate * dt);
                    control::order(&self.config, goal, &pose, &self.velocity)
                });
                vec![reference(true, false), moving.unwrap_or_else(ArDroneCommand::hover)]
            }
        };
        let mut commands = commands;
        commands.push(ArDroneCommand::Watchdog);
        let bytes = encode_commands(&commands, &mut self.sequence);
        send(&mut self.orders, &bytes)
    }

    fn commanded_goal(&self, now: f64) -> Result<Goal, ArDroneError> {
        self.check_link(now)?;
        match (self.phase, self.goal) {
            (Phase::Flying, Some(goal)) => Ok(goal),
            _ => Err(ArDroneError::NotCommanded { why: self.hindrance(now) }),
        }
    }

    fn hindrance(&self, now: f64) -> String {
        let what = match self.phase {
            Phase::Lost => "its link was lost",
            _ if self.check_link(now).is_err() => "no navdata",
            Phase::Flying => "",
            Phase::TakingOff(_) => "it climbs",
            Phase::Returning => "it returns to where it started",
            Phase::Landing => "it lands",
            Phase::Stopping => "its motors are being stopped",
            // The next take-off ends an emergency.
            Phase::Idle if self.state_is(|state| state.is_battery_low()) => "its battery is empty",
            Phase::Idle if self.is_flying() => "it is in the air, and not by our order",
            Phase::Idle => "",
        };
        what.into()
    }

    fn come_down(&mut self, phase: Phase) -> Result<(), ArDroneError> {
        let now = self.serve()?;
        self.check_link(now)?;
        if !self.is_flying() {
            return Err(ArDroneError::NotCommanded { why: "it is on the ground".into() });
        }
        self.stay();
        if let (Phase::Returning, Some(goal)) = (phase, &mut self.goal) {
            (goal.place.x, goal.place.y) = (self.config.east_m, self.config.north_m);
        }
        self.phase = phase;
        Ok(self.say(now)?)
    }
}

/// Says something to whoever is there.
fn send(stream: &mut impl ByteStream, bytes: &[u8]) -> io::Result<()> {
    match stream.send(bytes) {
        Err(error) if error.kind() == io::ErrorKind::NotConnected => Ok(()),
        other => other,
    }
}

impl<A: ByteStream, N: ByteStream, C: Clock> Vehicle for ArDrone<A, N, C> {
    type Error = ArDroneError;

    fn pose(&mut self) -> Result<Pose, ArDroneError> {
        let now = self.serve()?;
        self.check_link(now)?;
        Ok(self.known_pose())
    }

    fn position_sigma(&self) -> Option<Vector3<f64>> {
        let over_ground = self.sigma.hypot(self.config.drift_share * self.flown);
        // Ultrasound is good to a few centimetres.
        Some(Vector3::new(over_ground, over_ground, 0.1))
    }

    fn go_to(&mut self, goal: &Waypoint) -> Result<(), ArDroneError> {
        let now = self.serve()?;
        let older = self.commanded_goal(now)?;
        let place = goal.position;
        let config = &self.config;
        ArDroneConfig::limit("an Up", place.z, config.min_up_m, config.max_up_m)?;
        let start = Vector2::new(config.east_m, config.north_m);
        let away = (place.xy() - start).norm();
        ArDroneConfig::limit("a distance", away, 0.0, config.fence_radius_m)?;
        self.goal = Some(Goal { place, ..older });
        Ok(())
    }

    fn land(&mut self) -> Result<(), ArDroneError> {
        self.come_down(Phase::Landing)
    }
}

impl<A: ByteStream, N: ByteStream, C: Clock> Spinner for ArDrone<A, N, C> {
    fn spin(&mut self, rate: Option<f64>) -> Result<(), ArDroneError> {
        let now = self.serve()?;
        let goal = self.commanded_goal(now)?;
        let most = self.config.yaw_rate_deg_s;
        ArDroneConfig::limit("a turn", rate.unwrap_or(0.0).to_degrees(), -most, most)?;
        self.goal = Some(Goal { heading: self.heading(), rate: rate.unwrap_or(0.0), ..goal });
        Ok(())
    }
}

/// It has no rules of its own for coming back: it is flown to where it started, and lands there.
impl<A: ByteStream, N: ByteStream, C: Clock> Aircraft for ArDrone<A, N, C> {
    fn state(&mut self) -> Result<AircraftState, ArDroneError> {
        let now = self.serve()?;
        let demo = self.demo();
        Ok(AircraftState {
            silent_s: self.silent_s(now),
            mode: demo.map_or_else(String::new, |demo| format!("{:?}", demo.flight)),
            armed: self.is_flying(),
            airborne: self.is_flying(),
            commanded: self.phase == Phase::Flying && self.check_link(now).is_ok(),
            hindrance: self.hindrance(now),
            battery: demo.map(|demo| f64::from(demo.battery_percent.min(100)) / 100.0),
        })
    }

    fn take_off(&mut self, up_m: f64) -> Result<(), ArDroneError> {
        let now = self.serve()?;
        ArDroneConfig::limit("an Up", up_m, self.config.min_up_m, self.config.max_up_m)?;
        if self.is_flying() || matches!(self.phase, Phase::TakingOff(_)) {
            return Ok(());
        }
        self.check_link(now)?;
        // It stands level now.
        let bytes = encode_commands(&[ArDroneCommand::FlatTrim], &mut self.sequence);
        send(&mut self.orders, &bytes)?;
        (self.phase, self.goal) = (Phase::TakingOff(up_m), None);
        Ok(self.say(now)?)
    }

    fn return_to_launch(&mut self) -> Result<(), ArDroneError> {
        self.come_down(Phase::Returning)
    }
}
