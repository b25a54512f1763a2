//! An autopilot's vehicle: its state, its orders from outside, and its service.

use foxhunt_core::{Clock, Pose, Spinner, Vehicle, Waypoint, angle};
use foxhunt_wire::{
    ByteStream,
    geodesy::Geodetic,
    mavlink::{CommonFrame, FrameCounts, degrees_of_e7, dialect::MavMessage},
};
use nalgebra::Vector3;

use super::{
    FenceQuery, MavlinkConfig, MavlinkError, MavlinkVehicle, RadioStatus, Telemetry,
    authority::Authority,
    link::Link,
    orders::mode_of,
    phase::{Camera, Cruise, Goal, Nose, Ordered, Phase, Stage},
    quality, setpoint,
};
use crate::{Aircraft, AircraftState, Hands};

impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    /// An autopilot at the other end of `stream`.
    ///
    /// # Errors
    ///
    /// [`MavlinkError::Config`] and [`MavlinkError::Origin`] name what is out of range.
    pub fn new(config: MavlinkConfig, stream: S, clock: C) -> Result<Self, MavlinkError> {
        config.check()?;
        let frame = match config.origin {
            Some(origin) => Some(CommonFrame::new(origin.lat_deg, origin.lon_deg)?),
            None => None,
        };
        Ok(Self {
            link: Link::new(&config, stream),
            config,
            clock,
            telemetry: Telemetry::default(),
            streams: None,
            frame,
            launch: None,
            phase: Phase::Idle,
            ordered: Ordered::Nothing,
            climbs_to: None,
            undecided: None,
            ignored: 0,
            authority: Authority::default(),
            leaving: false,
            settles: false,
            strayed: None,
            goal: None,
            order: None,
            turning: None,
            cruise: Cruise::default(),
            camera: Camera::default(),
            failure: String::new(),
            version_requested: f64::NEG_INFINITY,
            fence_query: FenceQuery::default(),
        })
    }

    /// Sets when the clock was 0, in seconds of UNIX time
    /// ([`SystemClock::started_unix_s`](crate::SystemClock::started_unix_s)): signatures carry the
    /// time, and autopilots refuse a signature that is a minute old.
    #[must_use]
    pub fn with_clock_origin(mut self, unix_s: f64) -> Self {
        self.link.clock_origin_unix_s = unix_s;
        self
    }

    /// Passes reports of the link's SiK radio on to a [`SikRadio`](crate::SikRadio).
    #[cfg(feature = "receivers")]
    #[must_use]
    pub fn with_radio_reports(mut self, feed: crate::SikFeed) -> Self {
        self.telemetry.feed = Some(feed);
        self
    }

    /// Takes the vehicle over again after the pilot or a lost link had it. The vehicle hovers until
    /// the next goal or the next order to take off. Without effect while it is ours, and while it
    /// comes down by our order.
    ///
    /// # Errors
    ///
    /// [`MavlinkError::NotCommanded`] while the pilot has not given the mode back; the link, where
    /// that fails.
    pub fn take_over(&mut self) -> Result<(), MavlinkError> {
        let now = self.serve()?;
        if self.authority.is_ours() {
            return Ok(());
        }
        self.check_link(now)?;
        let airborne = self.telemetry.airborne(now);
        let autopilot = self.telemetry.autopilot();
        if airborne && !self.is_offered(now) {
            let commanded = autopilot.commanded();
            let before = autopilot.before_take_off();
            let why = match self.authority.hands() {
                Hands::Station | Hands::Pilot if self.telemetry.mode() == Some(commanded) => {
                    let why = self.hindrance(now);
                    format!("{why}; it is given back by another mode and then {commanded}")
                }
                _ => {
                    let mode = self.mode_name();
                    format!("the pilot has it in {mode}, and gives it back by {before}")
                }
            };
            return Err(MavlinkError::NotCommanded { why });
        }
        if !airborne {
            return Ok(());
        }
        let pose = self.fresh_pose(now)?;
        self.stop();
        self.goal = Some(Goal::new(pose.position, Nose::Holds(pose.heading)));
        self.failure.clear();
        self.authority.take();
        self.ordered = Ordered::Climb;
        self.enter(Phase::TakingOver);
        self.advance(now)
    }

    /// Turns the nose to a heading, in radians counter-clockwise from East, the short way; returns
    /// when the order is on its way. It is repeated until the attitude shows that it was obeyed.
    ///
    /// # Errors
    ///
    /// As [`go_to`](Vehicle::go_to), and [`MavlinkError::Heading`] for a heading that is not
    /// finite.
    pub fn turn_to(&mut self, heading: f64) -> Result<(), MavlinkError> {
        if !heading.is_finite() {
            return Err(MavlinkError::Heading { heading });
        }
        let now = self.serve()?;
        let goal = self.commanded_goal(now)?;
        self.goal = Some(Goal { nose: Nose::Holds(angle::wrap(heading)), ..goal });
        self.turning = Some(self.turn_order(heading));
        self.advance(now)
    }

    /// Returns true if the nose points as ordered, within the configured tolerance; `false` while
    /// it turns at a rate.
    ///
    /// # Errors
    ///
    /// As [`pose`](Vehicle::pose).
    pub fn is_turned(&mut self) -> Result<bool, MavlinkError> {
        let heading = self.pose()?.heading;
        Ok(self.is_at_heading(heading))
    }

    pub(super) fn is_at_heading(&self, heading: f64) -> bool {
        let tolerance = self.config.heading_tolerance_deg.to_radians();
        self.goal.is_some_and(|goal| match goal.nose {
            Nose::Holds(wanted) => angle::distance(wanted, heading) <= tolerance,
            Nose::Turns(_) => false,
        })
    }

    /// The origin of the common frame, once it is known.
    #[must_use]
    pub fn origin(&self) -> Option<Geodetic> {
        self.frame.map(|frame| frame.origin())
    }

    /// Last report of a telemetry radio on the link, where there is one.
    #[must_use]
    pub fn radio_status(&self) -> Option<RadioStatus> {
        self.telemetry.radio
    }

    /// Returns the autopilot's last texts, the newest first.
    pub fn texts(&self) -> impl Iterator<Item = &str> {
        self.telemetry.texts.all()
    }

    /// Returns the counts of messages that came over the link, and of lost ones.
    #[must_use]
    pub fn link_counts(&self) -> FrameCounts {
        self.link.counts()
    }

    /// Moves data over the link and goes on with what was begun.
    pub(super) fn serve(&mut self) -> Result<f64, MavlinkError> {
        let now = self.clock.now();
        let flies = self.telemetry.armed() || self.phase != Phase::Idle;
        let Self { telemetry, streams, config, link, .. } = self;
        let received = link.receive(now, flies, |frame| {
            let ours = telemetry.take(now, config, frame);
            if let Some(streams) = streams.as_mut().filter(|_| ours) {
                streams.received(now, &frame.message);
            }
            ours
        });
        if let Ok(true) = received {
            // What is there now may be another one, or the same after a reset.
            if let Some(streams) = &mut self.streams {
                streams.restart();
            }
        }
        let reported = self.telemetry.estimator.is_some_and(|report| report.at >= now);
        if reported
            && self.telemetry.armed()
            && let Err(why) = quality::estimator(&self.telemetry, now)
        {
            self.telemetry.doubt.condition(now, why);
        }
        // A take-over in the meantime is noticed even while the port fails.
        self.watch(now);
        received?;
        if Authority::beats(self.telemetry.silence(now), self.config.link_timeout_s) {
            self.link.beat(now)?;
        }
        self.advance(now)?;
        Ok(now)
    }

    /// Sends a message, unless it is an order and somebody else has the vehicle.
    pub(super) fn send(&mut self, now: f64, message: &MavMessage) -> Result<(), MavlinkError> {
        let silent_s = self.telemetry.silence(now);
        if !self.authority.permits(message, now, silent_s <= self.config.link_timeout_s) {
            return Ok(());
        }
        if let MavMessage::COMMAND_LONG(command) = message
            && let Some(mode) = mode_of(self.telemetry.autopilot(), command)
        {
            self.authority.ordered(mode);
        }
        Ok(self.link.send(now, message)?)
    }

    pub(super) fn mode_name(&self) -> String {
        self.telemetry.mode().map_or_else(|| "an unknown mode".into(), |mode| mode.to_string())
    }

    fn check_link(&self, now: f64) -> Result<(), MavlinkError> {
        let silent_s = self.telemetry.silence(now);
        let limit_s = self.config.link_timeout_s;
        if silent_s > limit_s { Err(MavlinkError::Silent { silent_s, limit_s }) } else { Ok(()) }
    }

    /// Returns its pose, unless that is old or bad.
    pub(super) fn fresh_pose(&self, now: f64) -> Result<Pose, MavlinkError> {
        self.check_link(now)?;
        let limit_s = self.config.pose_timeout_s;
        let position = self.telemetry.position.as_ref().map(|message| message.at);
        let attitude = self.telemetry.attitude.as_ref().map(|message| message.at);
        for (what, at) in [("position", position), ("attitude", attitude)] {
            let age_s = at.map_or(f64::INFINITY, |at| now - at);
            if age_s > limit_s {
                return Err(MavlinkError::Stale { what, age_s, limit_s });
            }
        }
        quality::estimator(&self.telemetry, now).map_err(|why| MavlinkError::Position { why })?;
        let nowhere = || MavlinkError::Position { why: "it has no place yet".into() };
        let frame = self.frame.ok_or_else(nowhere)?;
        let pose = setpoint::pose(&frame, &self.telemetry, now).ok_or_else(nowhere)?;
        let angles = [pose.heading, pose.pitch, pose.roll];
        if pose.position.iter().chain(&angles).all(|value| value.is_finite()) {
            return Ok(pose);
        }
        Err(MavlinkError::Position { why: "its place or attitude is not a number".into() })
    }

    /// Returns its pose, unless there are signs that its place or its heading is false.
    fn trusted_pose(&self, now: f64) -> Result<Pose, MavlinkError> {
        let pose = self.fresh_pose(now)?;
        match self.telemetry.doubt.why(now) {
            Some(why) => Err(MavlinkError::Position { why: why.into() }),
            None => Ok(pose),
        }
    }

    /// Returns the present goal, if it is ours to set another one.
    pub(super) fn commanded_goal(&self, now: f64) -> Result<Goal, MavlinkError> {
        self.check_link(now)?;
        match (&self.phase, self.goal) {
            (Phase::Flying, Some(goal)) => Ok(goal),
            _ => Err(MavlinkError::NotCommanded { why: self.hindrance(now) }),
        }
    }

    /// Returns the launch place in the common frame: the autopilot's home, or the place at
    /// take-off.
    pub(super) fn launch_place(&self) -> Option<Vector3<f64>> {
        let home = self.telemetry.home.as_ref().map(|home| &home.value);
        let known = home.zip(self.frame).map(|(home, frame)| {
            frame.to_local(degrees_of_e7(home.latitude), degrees_of_e7(home.longitude), 0.0)
        });
        known.or(self.launch)
    }
}

/// Poses are errors while the link is lost, while what came is older than the configuration
/// allows, while the autopilot's estimator does not know its place, and while there are signs that
/// the place or the heading is false.
impl<S: ByteStream, C: Clock> Vehicle for MavlinkVehicle<S, C> {
    type Error = MavlinkError;

    fn pose(&mut self) -> Result<Pose, MavlinkError> {
        let now = self.serve()?;
        self.trusted_pose(now)
    }

    fn position_sigma(&self) -> Option<Vector3<f64>> {
        let old_s = (2.0 / self.config.status_rate_hz).max(1.0);
        quality::position_sigma(&self.telemetry, self.clock.now(), old_s)
    }

    /// # Errors
    ///
    /// [`MavlinkError::NotCommanded`] while it is not ours; the limit that the goal breaks; the
    /// link, where that fails. The older goal stays then.
    fn go_to(&mut self, goal: &Waypoint) -> Result<(), MavlinkError> {
        let now = self.serve()?;
        let older = self.commanded_goal(now)?;
        let here = self.trusted_pose(now)?.position;
        let launch = self.launch_place();
        if launch.is_none() && self.config.limits.fence_radius_m.is_finite() {
            let why = "its launch place is unknown, from which limits.fence_radius_m counts".into();
            return Err(MavlinkError::Position { why });
        }
        self.config.limits.check_goal(&goal.position, Some(&here), launch.as_ref())?;
        if let Some(fence) = self.fence() {
            fence.check(&goal.position, launch.as_ref())?;
        }
        self.goal = Some(Goal::new(goal.position, older.nose));
        self.advance(now)
    }

    /// Lands the vehicle at its present place, and ends a take-off for good. During a lost link
    /// that may be ordered as well: it is sent when a heartbeat shows that nobody else has the
    /// vehicle. Not while a pilot has it.
    fn land(&mut self) -> Result<(), MavlinkError> {
        self.come_down(Phase::Landing)
    }
}

impl<S: ByteStream, C: Clock> Spinner for MavlinkVehicle<S, C> {
    /// # Errors
    ///
    /// As [`go_to`](Vehicle::go_to); [`MavlinkError::SpinRate`] beyond `spin_limit_deg_s`.
    fn spin(&mut self, rate: Option<f64>) -> Result<(), MavlinkError> {
        let (rate_deg_s, limit_deg_s) =
            (rate.unwrap_or(0.0).to_degrees(), self.config.spin_limit_deg_s);
        // NaN is refused, too.
        if rate_deg_s.is_nan() || rate_deg_s.abs() > limit_deg_s {
            return Err(MavlinkError::SpinRate { rate_deg_s, limit_deg_s });
        }
        let now = self.serve()?;
        let goal = self.commanded_goal(now)?;
        let nose = match (rate, goal.nose) {
            (Some(rate), _) => Nose::Turns(rate),
            // Where it already holds its heading, that one.
            (None, holds @ Nose::Holds(_)) => holds,
            (None, Nose::Turns(_)) => Nose::Holds(self.fresh_pose(now)?.heading),
        };
        self.turning = None;
        if nose != goal.nose {
            self.goal = Some(Goal::new(goal.place, nose));
        }
        self.advance(now)
    }
}

impl<S: ByteStream, C: Clock> Aircraft for MavlinkVehicle<S, C> {
    fn state(&mut self) -> Result<AircraftState, MavlinkError> {
        let now = self.serve()?;
        Ok(AircraftState {
            silent_s: self.telemetry.last.map_or(f64::INFINITY, |last| now - last),
            mode: self.telemetry.mode().map_or_else(String::new, |mode| mode.to_string()),
            armed: self.telemetry.armed(),
            airborne: self.telemetry.airborne(now),
            // What it receives at a place that is in doubt is of no use.
            commanded: self.phase == Phase::Flying
                && self.check_link(now).is_ok()
                && self.telemetry.doubt.why(now).is_none(),
            offered: self.is_offered(now),
            hands: self.authority.hands(),
            rooted: false,
            hindrance: self.hindrance(now),
            battery: self.telemetry.battery(),
            above_ground: self.telemetry.above_ground(now),
        })
    }

    fn photograph(&mut self) -> Result<(), MavlinkError> {
        let now = self.serve()?;
        if !self.config.camera || self.config.listen_only {
            return Ok(());
        }
        self.commanded_goal(now)?;
        self.camera.order_one();
        self.photograph_further(now)
    }

    fn picture_failure(&mut self) -> Option<MavlinkError> {
        self.camera.take_failure()
    }

    fn take_off(&mut self, up_m: f64) -> Result<(), MavlinkError> {
        let now = self.serve()?;
        self.config.limits.check_up(up_m)?;
        if let Some(fence) = self.fence() {
            fence.check(&Vector3::new(0.0, 0.0, up_m), None)?;
        }
        if self.telemetry.airborne(now) || matches!(self.phase, Phase::TakingOff { .. }) {
            return Ok(());
        }
        self.check_link(now)?;
        // The motors may be being stopped as well.
        let ends = self.phase != Phase::Idle || self.order.is_some();
        if ends || !matches!(self.authority.hands(), Hands::Nobody | Hands::Ours) {
            return Err(MavlinkError::NotCommanded { why: self.hindrance(now) });
        }
        if self.telemetry.armed() {
            self.authority.engage();
            let why = "its motors run already, and not by this take-off".into();
            return Err(MavlinkError::NotCommanded { why });
        }
        self.failure.clear();
        self.stop();
        self.ordered = Ordered::Nothing;
        self.authority.take();
        self.enter(Phase::TakingOff { up: up_m, stage: Stage::Position, since: now });
        self.advance(now)
    }

    fn take_over(&mut self) -> Result<(), MavlinkError> {
        Self::take_over(self)
    }

    fn return_to_launch(&mut self) -> Result<(), MavlinkError> {
        self.come_down(Phase::Returning)
    }

    fn clear_to_take_off(&mut self) {
        self.authority.clear_to_take_off();
    }
}
