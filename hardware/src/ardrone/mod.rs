//! The Parrot AR.Drone 2.0.

mod config;
#[cfg(test)]
mod safety;
mod serve;

pub use config::{ArDroneConfig, ArDroneError};

use std::io;

use foxhunt_core::{Clock, Pose, Spinner, Vehicle, Waypoint, angle};
use foxhunt_wire::{
    ByteStream,
    ardrone::{ArDroneCommand, ArDroneDemo, ArDroneNavdata, DroneState, encode_commands},
};
use nalgebra::{Vector2, Vector3};

use crate::{Aircraft, AircraftState, Finding, Hands, MotionCapture};

/// Ordered place and heading of the drone.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Goal {
    place: Vector3<f64>,
    /// Direction of the nose, in radians counter-clockwise from East; moved on while it turns.
    heading: f64,
    /// Radians per second, counter-clockwise; 0 to hold the heading.
    rate: f64,
}

/// A Parrot AR.Drone 2.0: orders to its UDP port 5556, navdata from 5554.
///
/// The drone does not measure its place: the driver counts it from the launch place, by the
/// reported speeds, and [`position_sigma`](foxhunt_core::Vehicle::position_sigma) grows with the
/// distance flown. Place and heading of [motion capture](Self::with_motion_capture) take
/// precedence, and [`correct`](Self::correct) takes a better place from elsewhere. Orders of tilt
/// fly the drone to its goals, so it has to be served some twenty times a second; without orders it
/// hovers by itself.
///
/// After a lost link nothing is ordered until [`take_over`](Self::take_over) is called.
#[derive(Debug)]
pub struct ArDrone<A, N, C> {
    config: ArDroneConfig,
    orders: A,
    navdata: N,
    clock: C,
    sequence: u32,
    received: Option<(f64, ArDroneNavdata)>,
    position: Vector3<f64>,
    /// East, North and Up in metres per second.
    velocity: Vector3<f64>,
    /// Metres flown since the place was known, and σ of it then.
    flown: f64,
    sigma: f64,
    /// Direction of its nose where its own yaw is 0, in radians counter-clockwise from East.
    begun: f64,
    motion_capture: Option<MotionCapture>,
    /// Time and heading of the last pose from motion capture.
    captured: Option<(f64, f64)>,
    phase: Phase,
    /// It is ordered to land until then, even if it does not seem to fly: its take-off may be on
    /// its way.
    land_until: f64,
    /// Reason why a take-off was given up.
    failure: String,
    goal: Option<Goal>,
    sent: f64,
    requested: f64,
}

/// Stage of the last order.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Idle,
    /// Climbs to `up` metres; begun at `since`. An emergency from before it is ended by it; not one
    /// that comes when it was `calm`.
    TakingOff {
        up: f64,
        since: f64,
        calm: bool,
    },
    Flying,
    Returning,
    Landing,
    /// The motors are to stop.
    Stopping,
    Lost,
}

impl<A: ByteStream, N: ByteStream, C: Clock> ArDrone<A, N, C> {
    /// A drone that takes orders at one stream (UDP 5556) and sends navdata from the other (UDP
    /// 5554).
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
            received: None,
            position: Vector3::new(config.east_m, config.north_m, 0.0),
            velocity: Vector3::zeros(),
            flown: 0.0,
            sigma: config.start_sigma_m,
            begun: config.heading_deg_ccw_from_east.to_radians(),
            motion_capture: None,
            captured: None,
            phase: Phase::Idle,
            land_until: f64::NEG_INFINITY,
            failure: String::new(),
            goal: None,
            sent: f64::NEG_INFINITY,
            requested: f64::NEG_INFINITY,
            config,
        })
    }

    /// Has motion capture give its place over ground and its heading. Its own odometry goes on
    /// from there while no poses come. Its height stays that of its ultrasound.
    #[must_use]
    pub fn with_motion_capture(self, motion_capture: MotionCapture) -> Self {
        Self { motion_capture: Some(motion_capture), ..self }
    }

    /// Returns its motion capture, if it has any.
    #[must_use]
    pub fn motion_capture(&self) -> Option<&MotionCapture> {
        self.motion_capture.as_ref()
    }

    /// Sets its place, East and North in metres, and σ of that, from a better source.
    pub fn correct(&mut self, place: Vector2<f64>, sigma_m: f64) {
        if place.iter().all(|value| value.is_finite()) && sigma_m >= 0.0 {
            (self.position.x, self.position.y) = (place.x, place.y);
            (self.flown, self.sigma) = (0.0, sigma_m);
        }
    }

    /// Flies on after a lost link, from the present place. Without effect while the drone is ours.
    ///
    /// # Errors
    ///
    /// [`ArDroneError::Silent`] while nothing is received; the link, where that fails.
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

    fn demo(&self) -> Option<ArDroneDemo> {
        self.received?.1.demo
    }

    fn state_is(&self, holds: impl Fn(DroneState) -> bool) -> bool {
        self.received.is_some_and(|(_, navdata)| holds(navdata.state))
    }

    fn is_flying(&self) -> bool {
        self.state_is(|state| state.is_flying())
    }

    fn silent_s(&self, now: f64) -> f64 {
        self.received.map_or(f64::INFINITY, |(at, _)| now - at)
    }

    fn check_link(&self, now: f64) -> Result<(), ArDroneError> {
        let silent_s = self.silent_s(now);
        let limit_s = self.config.link_timeout_s;
        if silent_s > limit_s { Err(ArDroneError::Silent { silent_s, limit_s }) } else { Ok(()) }
    }

    fn heading(&self) -> f64 {
        let reported = self.received.map_or(f64::NEG_INFINITY, |(at, _)| at);
        match self.captured {
            Some((at, heading)) if at >= reported => angle::wrap(heading),
            // It counts clockwise from where it was switched on.
            _ => angle::wrap(self.begun - self.demo().map_or(0.0, |demo| demo.yaw)),
        }
    }

    fn known_pose(&self) -> Pose {
        let (pitch, roll) = self.demo().map_or((0.0, 0.0), |demo| (demo.pitch, demo.roll));
        let velocity = self.demo().map(|_| self.velocity);
        Pose { position: self.position, heading: self.heading(), pitch, roll, velocity }
    }

    fn stay(&mut self) {
        let place = self.position;
        self.goal = Some(Goal { place, heading: self.heading(), rate: 0.0 });
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
            Phase::TakingOff { .. } => "it climbs",
            Phase::Returning => "it returns to where it started",
            Phase::Landing => "it lands",
            Phase::Stopping => "its motors are being stopped",
            // The next take-off ends an emergency.
            Phase::Idle if self.state_is(|state| state.is_battery_low()) => "its battery is empty",
            Phase::Idle if !self.failure.is_empty() => &self.failure,
            Phase::Idle if self.is_flying() => "it is in the air, and not by our order",
            Phase::Idle => "",
        };
        what.into()
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

/// An AR.Drone has no rules of its own for coming back: it is flown to its launch place, and lands
/// there.
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
            offered: self.phase == Phase::Lost && self.is_flying(),
            hands: match self.phase {
                Phase::Idle => Hands::Nobody,
                Phase::Lost if self.check_link(now).is_err() => Hands::Unheard,
                Phase::Lost => Hands::GivenBack,
                _ => Hands::Ours,
            },
            rooted: false,
            hindrance: self.hindrance(now),
            battery: demo.map(|demo| f64::from(demo.battery_percent.min(100)) / 100.0),
            above_ground: None,
        })
    }

    fn take_off(&mut self, up_m: f64) -> Result<(), ArDroneError> {
        let now = self.serve()?;
        ArDroneConfig::limit("an Up", up_m, self.config.min_up_m, self.config.max_up_m)?;
        if self.is_flying() || matches!(self.phase, Phase::TakingOff { .. }) {
            return Ok(());
        }
        self.check_link(now)?;
        if self.phase == Phase::Landing {
            return Err(ArDroneError::NotCommanded { why: self.hindrance(now) });
        }
        self.failure.clear();
        // It stands level now.
        let bytes = encode_commands(&[ArDroneCommand::FlatTrim], &mut self.sequence);
        send(&mut self.orders, &bytes)?;
        (self.phase, self.goal) = (Phase::TakingOff { up: up_m, since: now, calm: false }, None);
        Ok(self.send_due(now)?)
    }

    fn take_over(&mut self) -> Result<(), ArDroneError> {
        Self::take_over(self)
    }

    fn return_to_launch(&mut self) -> Result<(), ArDroneError> {
        self.come_down(Phase::Returning)
    }

    fn device_failure(&mut self) -> Option<ArDroneError> {
        let now = self.clock.now();
        self.motion_capture.as_mut()?.take_loss(now).map(ArDroneError::from)
    }
}

impl<A: ByteStream, N: ByteStream, C: Clock> ArDrone<A, N, C> {
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
                Ok(now) if now - begun > 5.0 => break,
                Ok(_) if self.demo().is_some() && self.is_captured() => break,
                Ok(_) => pause(),
            }
        }
        let now = self.clock.now();
        let captured = self.motion_capture.as_ref().map(|capture| capture.finding(now));
        let Some(demo) = self.demo() else {
            let remedy =
                "join the drone's wireless network, and see that no other program flies it";
            let silent = Finding::bad("navdata", "nothing was received", remedy);
            return [silent].into_iter().chain(captured).collect();
        };
        let percent = demo.battery_percent;
        let battery = format!("{percent} % left");
        let mut findings = vec![
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
        ];
        findings.extend(captured);
        findings
    }

    /// Returns true once a pose has come from motion capture, or if it has none.
    fn is_captured(&self) -> bool {
        self.motion_capture.is_none() || self.captured.is_some()
    }
}

/// Sends bytes; without a peer they are dropped.
fn send(stream: &mut impl ByteStream, bytes: &[u8]) -> io::Result<()> {
    match stream.send(bytes) {
        Err(error) if error.kind() == io::ErrorKind::NotConnected => Ok(()),
        other => other,
    }
}
