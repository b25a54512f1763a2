use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    mavlink::{
        Autopilot, CommonFrame, FlightMode, MessageData, degrees_of_e7,
        dialect::{AUTOPILOT_VERSION_DATA, COMMAND_LONG_DATA, MavCmd, MavMessage},
    },
};

use super::{
    MavlinkError, MavlinkVehicle,
    authority::Seen,
    link::Streams,
    orders::{Order, Step, mode_order},
    phase::{Goal, Nose, Ordered, Phase, Stage},
    quality, setpoint,
};
use crate::Hands;

/// Time for which complaints of the autopilot are shown, in seconds.
const COMPLAINT_S: f64 = 15.0;

/// Longest time for which a heartbeat is left undecided, in seconds; meanwhile nothing is ordered.
const UNDECIDED_S: f64 = 6.0;

/// Number of heartbeats with another mode after an accepted order that show somebody's choice. The
/// first of them may be older than the order.
const IGNORED: u32 = 2;

/// PX4 ends its climb this far below the height that was ordered, in metres (NAV_MC_ALT_RAD, with
/// some room).
const CLIMBED_SHORT_M: f64 = 1.0;

/// The work that goes on by itself between one call and the next.
impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    pub(super) fn enter(&mut self, phase: Phase) {
        self.phase = phase;
    }

    /// Notices that the link is lost, that somebody else has the aircraft, or that it is down.
    pub(super) fn watch(&mut self, now: f64) {
        let Some(beat_at) = self.telemetry.heartbeat.as_ref().map(|beat| beat.at) else { return };
        let lands = matches!(self.phase, Phase::Landing | Phase::Returning);
        if self.telemetry.silence(now) > self.config.link_timeout_s {
            // That it is to come down stands; whether it is ordered, its next heartbeat decides.
            if self.authority.falls_silent() && !lands {
                self.stop();
            }
            return;
        }
        let Some(mode) = self.telemetry.mode().filter(|_| beat_at > self.authority.read_at())
        else {
            return;
        };
        // Whether PX4 has ended its climb by itself, a position of now tells.
        let position_at = self.telemetry.position.as_ref().map_or(f64::NEG_INFINITY, |of| of.at);
        if self.climbs_to.is_some()
            && mode == mode.autopilot.hold()
            && now - position_at > self.config.pose_timeout_s
            && now - *self.undecided.get_or_insert(now) < UNDECIDED_S
        {
            return;
        }
        self.undecided = None;
        let short_m = self.config.take_off_tolerance_m.max(CLIMBED_SHORT_M);
        let climbed =
            self.climbs_to.zip(self.telemetry.up()).is_some_and(|(to, up)| up >= to - short_m);
        let seen = Seen {
            mode,
            armed: self.telemetry.armed(),
            airborne: self.telemetry.airborne(now),
            failsafe: self.telemetry.failsafe(),
            climbs: matches!(self.phase, Phase::TakingOff { stage: Stage::Climb, .. })
                && self.order.as_ref().is_some_and(Order::accepted),
            up_m: self.telemetry.up().unwrap_or(0.0),
            climbed,
            started: self.ordered != Ordered::Nothing,
            ended: lands || (self.phase == Phase::Idle && self.order.is_some()),
            complaint: self.telemetry.texts.complained(now - COMPLAINT_S),
        };
        self.authority.hear(beat_at, &seen);
        match self.authority.hands() {
            Hands::Ours => {
                let target = match self.phase {
                    Phase::Returning => mode.autopilot.return_to_launch(),
                    _ => mode.autopilot.land(),
                };
                self.leaving &= !(lands && mode == target);
                self.notice_ignored(mode);
            }
            hands => {
                self.stop();
                if matches!(hands, Hands::Nobody | Hands::Grounded) {
                    (self.ordered, self.climbs_to) = (Ordered::Nothing, None);
                }
            }
        }
    }

    /// Notices that somebody has chosen another mode before a heartbeat could show the ordered and
    /// accepted mode.
    fn notice_ignored(&mut self, mode: FlightMode) {
        let accepted = self.order.as_ref().filter(|order| order.accepted());
        let target = accepted.and_then(|order| order.mode(mode.autopilot));
        let Some(target) = target.filter(|target| *target != mode) else {
            self.ignored = 0;
            return;
        };
        self.ignored += 1;
        if self.ignored >= IGNORED {
            self.stop();
            let why = format!("it accepted {target} and is in {mode}, which we did not order");
            self.authority.release(why);
        }
    }

    /// Ends whatever was under way.
    pub(super) fn stop(&mut self) {
        (self.goal, self.order, self.turning, self.camera.order) = (None, None, None, None);
        (self.leaving, self.strayed, self.ignored) = (false, None, 0);
        self.enter(Phase::Idle);
    }

    /// Another station flies it, in the mode of our orders.
    pub(super) fn yield_to_station(&mut self, why: String) {
        self.stop();
        self.authority.yield_to_station(why);
    }

    /// Records why something was given up, for the error.
    pub(super) fn explain(&mut self, now: f64, what: &str, why: &str) {
        let complaint = self.telemetry.texts.reason(now - COMPLAINT_S);
        self.failure = match complaint {
            Some(text) => format!("{what} was given up: {why} ({text})"),
            None => format!("{what} was given up: {why}"),
        };
    }

    /// Sends what is due.
    pub(super) fn advance(&mut self, now: f64) -> Result<(), MavlinkError> {
        let Some((.., autopilot)) = self.telemetry.who else { return Ok(()) };
        let origin = self.telemetry.position.as_ref().filter(|_| self.frame.is_none());
        let origin = origin.map(|message| (message.value.lat, message.value.lon));
        if let (Some((lat, lon)), Ok(())) =
            (origin, quality::for_take_off(&self.telemetry, &self.config.position, now))
        {
            self.frame = CommonFrame::new(degrees_of_e7(lat), degrees_of_e7(lon)).ok();
        }
        let streams = self.streams.get_or_insert_with(|| Streams::new(&self.config, autopilot));
        for order in streams.due(now) {
            self.command(now, order.command)?;
        }
        if self.phase == Phase::Idle {
            self.learn_fence(now)?;
        }
        if self.telemetry.version.is_none() && now - self.version_requested > 5.0 {
            self.version_requested = now;
            self.request_version(now)?;
        }
        for (command, result) in std::mem::take(&mut self.telemetry.acks) {
            let orders = [
                &mut self.order,
                &mut self.turning,
                &mut self.cruise.order,
                &mut self.camera.order,
            ];
            for order in orders.into_iter().flatten() {
                order.answered(command, result);
            }
        }
        if matches!(self.phase, Phase::Flying | Phase::Landing | Phase::Returning) {
            self.photograph_further(now)?;
        }
        match self.phase {
            Phase::Idle => self.disarm_further(now),
            Phase::TakingOff { up, stage, .. } => self.take_off_further(now, autopilot, up, stage),
            Phase::TakingOver => {
                self.send_goal(now)?;
                self.request_mode(now, autopilot.commanded(), Phase::Flying)
            }
            Phase::Flying => {
                self.keep_inside(now);
                self.turn_further(now)?;
                self.send_goal(now)?;
                self.cruise_further(now)
            }
            Phase::Landing => self.come_down_further(now, autopilot.land()),
            Phase::Returning => self.come_down_further(now, autopilot.return_to_launch()),
        }
    }

    /// Orders a picture until the order is answered.
    pub(super) fn photograph_further(&mut self, now: f64) -> Result<(), MavlinkError> {
        self.camera.due(now, &self.config).map_or(Ok(()), |command| self.command(now, command))
    }

    /// Orders the speed until it is accepted, and again while it flies faster.
    fn cruise_further(&mut self, now: f64) -> Result<(), MavlinkError> {
        let Some(goal) = self.goal else { return Ok(()) };
        let speed = setpoint::velocity(&self.telemetry).xy().norm();
        let command = self.cruise.due(now, speed, &goal, &self.config);
        command.map_or(Ok(()), |command| self.command(now, command))
    }

    fn request_version(&mut self, now: f64) -> Result<(), MavlinkError> {
        #[expect(clippy::cast_precision_loss, reason = "message numbers are below 2^24")]
        let id = AUTOPILOT_VERSION_DATA::ID as f32;
        let parameters = [id, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        self.command(now, Order::new(MavCmd::MAV_CMD_REQUEST_MESSAGE, parameters).command)
    }

    pub(super) fn command(
        &mut self,
        now: f64,
        command: COMMAND_LONG_DATA,
    ) -> Result<(), MavlinkError> {
        let Some((target_system, target_component, _)) = self.telemetry.who else { return Ok(()) };
        let command = COMMAND_LONG_DATA { target_system, target_component, ..command };
        self.send(now, &MavMessage::COMMAND_LONG(command))
    }

    /// Gives the order that the phase waits for, when a heartbeat has just shown that nobody else
    /// has it; why it is given up.
    pub(super) fn give(&mut self, now: f64) -> Result<Option<String>, MavlinkError> {
        if !self.authority.may_order(now) {
            return Ok(None);
        }
        let Some(order) = &mut self.order else { return Ok(None) };
        match order.advance(now, self.config.ack_timeout_s, self.config.attempts) {
            Step::Wait => Ok(None),
            Step::Send(command) => self.command(now, command).map(|()| None),
            Step::Failed(why) => Ok(Some(why)),
        }
    }

    pub(super) fn stage(&mut self, now: f64, up: f64, stage: Stage) {
        self.order = None;
        self.enter(Phase::TakingOff { up, stage, since: now });
    }

    /// Requests a mode until it is there, and goes on to the next phase.
    pub(super) fn request_mode(
        &mut self,
        now: f64,
        mode: FlightMode,
        next: Phase,
    ) -> Result<(), MavlinkError> {
        if self.telemetry.mode() == Some(mode) {
            if next == Phase::Flying {
                self.up_there();
                return Ok(());
            }
            self.order = None;
            self.enter(next);
            return Ok(());
        }
        self.order.get_or_insert_with(|| mode_order(mode));
        if let Some(why) = self.give(now)? {
            let what = format!("the mode {mode}");
            if matches!(self.phase, Phase::TakingOff { .. }) {
                self.give_up(now, &what, &why);
            } else {
                self.explain(now, &what, &why);
                self.stop();
                self.authority.release(self.failure.clone());
            }
        }
        Ok(())
    }

    /// Sends it back once when it has left the limits. One that sinks below them is not flying to
    /// any goal of ours: it is sent none, and climbs by its own way home, or lands.
    fn keep_inside(&mut self, now: f64) {
        let Ok(pose) = self.fresh_pose(now) else { return };
        let sinks_mps = pose.velocity.map_or(0.0, |velocity| -velocity.z);
        if let Some(why) = self.config.limits.sinks(pose.position.z, sinks_mps) {
            return self.leave_without_goals(why);
        }
        if self.telemetry.doubt.why(now).is_some() {
            return;
        }
        let launch = self.launch_place();
        let strayed = self.config.limits.strayed(&pose.position, launch.as_ref());
        if let (None, Some((place, _))) = (&self.strayed, &strayed) {
            let nose = self.goal.map_or(Nose::Holds(pose.heading), |goal| goal.nose);
            self.goal = Some(Goal::new(*place, nose));
        }
        self.strayed = strayed.map(|(_, why)| why);
    }

    /// Gives the order to come down until its mode shows that it does it.
    fn come_down_further(&mut self, now: f64, mode: FlightMode) -> Result<(), MavlinkError> {
        if !self.leaving {
            (self.order, self.goal) = (None, None);
            return Ok(());
        }
        if !self.authority.is_ours() {
            return Ok(());
        }
        // PX4 leaves OFFBOARD for the pilot's modes without set-points: it stays in place until it
        // has taken the order.
        if self.telemetry.mode() == Some(mode.autopilot.commanded()) {
            self.send_goal(now)?;
        }
        self.order.get_or_insert_with(|| mode_order(mode));
        if let Some(why) = self.give(now)? {
            self.explain(now, &format!("the order to {mode}"), &why);
            // It is ordered again, to land at least.
            self.order = None;
            self.settles = true;
            self.enter(Phase::Landing);
        }
        Ok(())
    }

    pub(super) fn begin_coming_down(&mut self, phase: Phase) {
        let now = self.clock.now();
        let here = self.fresh_pose(now).ok();
        let px4 = self.telemetry.autopilot() == Autopilot::Px4;
        self.goal =
            here.filter(|_| px4).map(|pose| Goal::new(pose.position, Nose::Holds(pose.heading)));
        (self.order, self.turning, self.strayed) = (None, None, None);
        (self.leaving, self.settles) = (true, false);
        self.authority.bring_down(now);
        self.enter(phase);
    }

    pub(super) fn come_down(&mut self, phase: Phase) -> Result<(), MavlinkError> {
        let now = self.serve()?;
        if self.phase == phase || (self.phase == Phase::Landing && self.settles) {
            return Ok(());
        }
        let refused = |why: String| Err(MavlinkError::NotCommanded { why });
        let airborne = self.telemetry.airborne(now);
        let hands = self.authority.hands();
        match hands {
            Hands::Autopilot => {
                return refused(format!("it comes down by its own rules ({})", self.mode_name()));
            }
            Hands::Pilot | Hands::Station => return refused(self.hindrance(now)),
            Hands::Nobody if airborne => {
                return refused(format!("it is flown in {}, not by us", self.mode_name()));
            }
            // The motors are being stopped.
            Hands::Ours if self.phase == Phase::Idle && self.order.is_some() => return Ok(()),
            Hands::Ours if self.phase == Phase::Idle => {
                return refused("it is on the ground".into());
            }
            Hands::Nobody | Hands::Grounded => return refused("it is on the ground".into()),
            Hands::Ours | Hands::GivenBack | Hands::Stopped | Hands::Unheard => {}
        }
        self.failure.clear();
        if matches!(self.phase, Phase::TakingOff { .. }) {
            self.end_take_off(now, phase);
        } else if hands == Hands::Unheard && !airborne {
            // Coming back would climb first.
            self.begin_coming_down(Phase::Landing);
        } else {
            self.begin_coming_down(phase);
        }
        self.advance(now)
    }

    /// Returns true if it is in the air, not ours, and in the mode in which it may be taken over.
    pub(super) fn is_offered(&self, now: f64) -> bool {
        let Some(mode) = self.telemetry.mode() else { return false };
        let commanded = mode.autopilot.commanded();
        let before = mode.autopilot.before_take_off();
        let offered = match self.authority.hands() {
            Hands::Nobody => [commanded, before].contains(&mode),
            Hands::GivenBack => true,
            // PX4's HOLD: whether he gives it back by that, he alone knows.
            Hands::Pilot => mode == before && before != commanded,
            _ => false,
        };
        offered && self.telemetry.airborne(now)
    }
}
