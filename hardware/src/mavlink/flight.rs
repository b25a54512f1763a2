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
    orders::{Order, Step, single},
    phase::{Goal, Nose, Ordered, Phase, Stage},
    quality, setpoint,
    streams::Streams,
};

/// Complaints of the autopilot are shown for so long, in seconds.
const COMPLAINT_S: f64 = 15.0;

/// What goes on by itself between one call and the next.
impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    pub(super) fn enter(&mut self, phase: Phase) {
        self.phase = phase;
    }

    /// Notices that the link is lost, that somebody else has the aircraft, or that it is down.
    pub(super) fn watch(&mut self, now: f64) {
        let Some(mode) = self.telemetry.mode() else { return };
        let autopilot = mode.autopilot;
        let (commanded, hold) = (autopilot.commanded(), autopilot.hold());
        let (before, climb) = (autopilot.before_take_off(), autopilot.take_off());
        let (land, home) = (autopilot.land(), autopilot.return_to_launch());
        let leaving = self.leaving.unwrap_or(mode);
        let lands = matches!(self.phase, Phase::Landing | Phase::Returning);
        if lands && mode == if self.phase == Phase::Landing { land } else { home } {
            self.leaving = None;
        }
        // PX4 alone holds when it has landed: LOITER of ArduPilot is the pilot's.
        let landed = if autopilot == Autopilot::Px4 { hold } else { land };
        let ours = [before, climb, commanded, land, home];
        // Any of them may be on its way when it is ordered to come down; but one that lands or
        // returns without our order is not turned back.
        let down = if self.phase == Phase::Returning { home } else { land };
        let ordered = [before, climb, commanded, down, leaving];
        if let Phase::Taken { in_our_mode, .. } = &mut self.phase {
            *in_our_mode &= mode == commanded;
        }
        if matches!(self.phase, Phase::TakingOff { .. })
            && self.ordered == Ordered::Nothing
            && (self.telemetry.armed() || self.telemetry.airborne(now))
        {
            return self.lose("its motors run, which we did not order".into(), true);
        }
        let expected: &[FlightMode] = match &self.phase {
            // Nobody has it who stands on the ground after a lost link.
            Phase::Taken { by_pilot: false, .. }
                if !self.telemetry.armed() && self.telemetry.without_heartbeat(now) < 1.0 =>
            {
                self.phase = Phase::Idle;
                return;
            }
            // After a lost link its pilot flies it, unless it comes home by its own rules.
            Phase::Taken { by_pilot: false, .. }
                if !ours.contains(&mode)
                    && self.telemetry.without_heartbeat(now) <= self.config.link_timeout_s =>
            {
                &ours
            }
            Phase::Idle | Phase::Taken { .. } => return,
            Phase::TakingOff { stage: Stage::Position | Stage::Mode, .. } => {
                &[leaving, before, commanded]
            }
            Phase::TakingOff { stage: Stage::Arm, .. } => &[before],
            Phase::TakingOff { stage: Stage::Climb, .. } => &[before, climb],
            Phase::TakingOff { stage: Stage::Command, .. } => &[before, climb, commanded],
            Phase::TakingOver => &[before, commanded],
            Phase::Flying => &[commanded],
            Phase::Landing | Phase::Returning if self.leaving.is_some() => &ordered,
            Phase::Landing => &[land, landed],
            Phase::Returning => &[home, land, landed],
        };
        let expected = expected.contains(&mode);
        if self.telemetry.silence(now) > self.config.link_timeout_s {
            // The order to come down stands, for when its link is back.
            if lands {
                return;
            }
            self.lose("the link was lost".into(), false);
        } else if !expected {
            let mut why = format!("its mode became {mode}, which we did not order");
            if let Some(text) = self.telemetry.texts.complaints(now - COMPLAINT_S).next() {
                why = format!("{why} ({text})");
            }
            self.lose(why, true);
        } else if matches!(self.phase, Phase::Flying | Phase::Landing | Phase::Returning)
            && !self.telemetry.armed()
        {
            (self.goal, self.order, self.turning) = (None, None, None);
            (self.ordered, self.leaving) = (Ordered::Nothing, None);
            self.enter(Phase::Idle);
        }
    }

    fn lose(&mut self, why: String, by_pilot: bool) {
        (self.goal, self.order, self.turning, self.camera.order) = (None, None, None, None);
        (self.leaving, self.strayed) = (None, None);
        self.enter(Phase::Taken { why, by_pilot, in_our_mode: false });
    }

    /// Another station flies it, in the mode of our orders.
    pub(super) fn yield_to_station(&mut self, why: String) {
        self.lose(why.clone(), true);
        self.enter(Phase::Taken { why, by_pilot: true, in_our_mode: true });
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
        match self.phase.clone() {
            Phase::Idle => self.disarm_further(now),
            Phase::Taken { .. } => Ok(()),
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

    pub(super) fn request_version(&mut self, now: f64) -> Result<(), MavlinkError> {
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

    /// Gives the order that the phase waits for; why it is given up.
    pub(super) fn give(&mut self, now: f64) -> Result<Option<String>, MavlinkError> {
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
                self.lose(self.failure.clone(), false);
            }
        }
        Ok(())
    }

    /// Sends it back once when it has left the limits. One that sinks below them is not flying to any
    /// goal of ours: it is sent none, and climbs by its own way home, or lands.
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
        if self.leaving.is_none() {
            (self.order, self.goal) = (None, None);
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
        self.leaving = self.telemetry.mode();
        self.enter(phase);
    }

    pub(super) fn come_down(&mut self, phase: Phase) -> Result<(), MavlinkError> {
        let now = self.serve()?;
        if self.phase == phase {
            return Ok(());
        }
        let refused = |why: String| Err(MavlinkError::NotCommanded { why });
        let pending = self.ordered != Ordered::Nothing;
        let taking_off = matches!(self.phase, Phase::TakingOff { .. });
        match self.phase {
            Phase::Taken { by_pilot: true, .. } => return refused(self.hindrance(now)),
            Phase::Idle if !pending && self.telemetry.airborne(now) => {
                return refused(format!("it is flown in {}, not by us", self.mode_name()));
            }
            Phase::Taken { .. } if self.telemetry.airborne(now) && self.comes_down(now) => {
                return refused(format!("it comes down by its own rules ({})", self.mode_name()));
            }
            Phase::Idle | Phase::Taken { .. } if !pending && !self.telemetry.airborne(now) => {
                return refused("it is on the ground".into());
            }
            // The motors are being stopped.
            Phase::Idle if self.order.is_some() => return Ok(()),
            _ => {}
        }
        self.failure.clear();
        let in_our_hands = matches!(
            self.phase,
            Phase::Flying | Phase::TakingOver | Phase::Landing | Phase::Returning
        );
        if taking_off || !in_our_hands && !self.telemetry.airborne(now) {
            self.end_take_off(now, phase);
        } else {
            self.begin_coming_down(phase);
        }
        self.advance(now)
    }

    /// Whether it lands or returns, as of a heartbeat that is not old.
    fn comes_down(&self, now: f64) -> bool {
        let fresh = self.telemetry.without_heartbeat(now) <= self.config.link_timeout_s;
        let down = |mode: FlightMode| {
            [mode.autopilot.land(), mode.autopilot.return_to_launch()].contains(&mode)
        };
        fresh && self.telemetry.mode().is_some_and(down)
    }

    /// Whether it is in the air, not ours, and in the mode in which it may be taken over.
    pub(super) fn is_offered(&self, now: f64) -> bool {
        let given_back = |mode: FlightMode| {
            [mode.autopilot.commanded(), mode.autopilot.before_take_off()].contains(&mode)
        };
        matches!(self.phase, Phase::Idle | Phase::Taken { in_our_mode: false, .. })
            && self.telemetry.airborne(now)
            && self.telemetry.mode().is_some_and(given_back)
    }
}

/// The order to go into a mode.
fn mode_order(mode: FlightMode) -> Order {
    let (main, sub) = mode.main_and_sub();
    let [mode, sub] = match mode.autopilot {
        Autopilot::ArduPilot => [f64::from(mode.custom), 0.0],
        Autopilot::Px4 => [f64::from(main), f64::from(sub)],
    };
    // 1: the modes are the autopilot's own.
    let parameters = [1.0, single(mode), single(sub), 0.0, 0.0, 0.0, 0.0];
    Order::new(MavCmd::MAV_CMD_DO_SET_MODE, parameters)
}
