use foxhunt_core::{Clock, Pose, angle};
use foxhunt_wire::{
    ByteStream,
    ardrone::{ArDroneDemo, ArDroneNavdata, DroneState},
};
use nalgebra::{Vector2, Vector3};

use super::{ArDroneConfig, ArDroneError, control::Goal};

/// A Parrot AR.Drone 2.0: orders to its UDP port 5556, navdata from 5554.
///
/// It knows no place: that is counted from where it stood, by the speeds that it reports, and is
/// off by more the farther it flies, which
/// [`position_sigma`](foxhunt_core::Vehicle::position_sigma) gives; [`correct`](Self::correct)
/// takes a better one from outside. It is flown to its goals by orders of tilt, so it has to be
/// served some twenty times a second; without orders it hovers by itself.
///
/// After a lost link nothing is ordered until [`take_over`](Self::take_over) is called.
#[derive(Debug)]
pub struct ArDrone<A, N, C> {
    pub(super) config: ArDroneConfig,
    pub(super) orders: A,
    pub(super) navdata: N,
    pub(super) clock: C,
    pub(super) sequence: u32,
    pub(super) received: Option<(f64, ArDroneNavdata)>,
    pub(super) position: Vector3<f64>,
    /// East, North and Up in metres per second.
    pub(super) velocity: Vector3<f64>,
    /// Metres flown since the place was known, and σ of it then.
    pub(super) flown: f64,
    pub(super) sigma: f64,
    pub(super) phase: Phase,
    /// It is ordered to land until then, even if it does not seem to fly: its take-off may be on
    /// its way.
    pub(super) land_until: f64,
    /// Reason why a take-off was given up.
    pub(super) failure: String,
    pub(super) goal: Option<Goal>,
    pub(super) sent: f64,
    pub(super) requested: f64,
}

/// Stage of the last order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Phase {
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
    /// Its motors are to stop.
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
            phase: Phase::Idle,
            land_until: f64::NEG_INFINITY,
            failure: String::new(),
            goal: None,
            sent: f64::NEG_INFINITY,
            requested: f64::NEG_INFINITY,
            config,
        })
    }

    /// Sets its place, East and North in metres, and σ of that, from a better source.
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

    pub(super) fn demo(&self) -> Option<ArDroneDemo> {
        self.received?.1.demo
    }

    pub(super) fn state_is(&self, holds: impl Fn(DroneState) -> bool) -> bool {
        self.received.is_some_and(|(_, navdata)| holds(navdata.state))
    }

    pub(super) fn is_flying(&self) -> bool {
        self.state_is(|state| state.is_flying())
    }

    pub(super) fn silent_s(&self, now: f64) -> f64 {
        self.received.map_or(f64::INFINITY, |(at, _)| now - at)
    }

    pub(super) fn check_link(&self, now: f64) -> Result<(), ArDroneError> {
        let silent_s = self.silent_s(now);
        let limit_s = self.config.link_timeout_s;
        if silent_s > limit_s { Err(ArDroneError::Silent { silent_s, limit_s }) } else { Ok(()) }
    }

    pub(super) fn heading(&self) -> f64 {
        // It counts clockwise from where it was switched on.
        let begun = self.config.heading_deg_ccw_from_east.to_radians();
        angle::wrap(begun - self.demo().map_or(0.0, |demo| demo.yaw))
    }

    pub(super) fn known_pose(&self) -> Pose {
        let (pitch, roll) = self.demo().map_or((0.0, 0.0), |demo| (demo.pitch, demo.roll));
        let velocity = self.demo().map(|_| self.velocity);
        Pose { position: self.position, heading: self.heading(), pitch, roll, velocity }
    }

    pub(super) fn stay(&mut self) {
        let place = self.position;
        self.goal = Some(Goal { place, heading: self.heading(), rate: 0.0 });
    }

    pub(super) fn commanded_goal(&self, now: f64) -> Result<Goal, ArDroneError> {
        self.check_link(now)?;
        match (self.phase, self.goal) {
            (Phase::Flying, Some(goal)) => Ok(goal),
            _ => Err(ArDroneError::NotCommanded { why: self.hindrance(now) }),
        }
    }

    pub(super) fn hindrance(&self, now: f64) -> String {
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
