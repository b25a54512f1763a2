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
    phase::{Phase, Stage},
    quality,
    streams::Streams,
};

/// What the autopilot complained of is told for so long, in seconds.
const COMPLAINT_S: f64 = 15.0;

/// What goes on by itself between one call and the next.
impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    pub(super) fn enter(&mut self, phase: Phase) {
        self.phase = phase;
    }

    /// Notices that the link is lost, that somebody else has the aircraft, or that it is down.
    pub(super) fn watch(&mut self, now: f64) {
        let Some(mode) = self.heard.mode() else { return };
        let autopilot = mode.autopilot;
        let (commanded, hold) = (autopilot.commanded(), autopilot.hold());
        let (before, climb) = (autopilot.before_take_off(), autopilot.take_off());
        let (land, home) = (autopilot.land(), autopilot.return_to_launch());
        let expected: &[FlightMode] = match &self.phase {
            // Nobody has it who stands on the ground after a lost link.
            Phase::Taken { by_pilot: false, .. }
                if !self.heard.armed() && self.heard.without_heartbeat(now) < 1.0 =>
            {
                self.phase = Phase::Idle;
                return;
            }
            Phase::Idle | Phase::Taken { .. } => return,
            Phase::TakingOff { stage: Stage::Position | Stage::Mode, .. } => &[mode],
            Phase::TakingOff { stage: Stage::Arm, .. } => &[before],
            Phase::TakingOff { stage: Stage::Climb, .. } => &[before, climb],
            Phase::TakingOff { stage: Stage::Command, .. } => &[before, climb, commanded],
            Phase::TakingOver => &[before, commanded],
            Phase::Flying => &[commanded],
            Phase::Landing => &[commanded, land, hold],
            Phase::Returning => &[commanded, home, land, hold],
        };
        let expected = expected.contains(&mode);
        if self.heard.without_heartbeat(now) > self.config.link_timeout_s {
            self.lose("the link was lost".into(), false);
        } else if !expected {
            let mut why = format!("its mode became {mode}, which we did not order");
            if let Some(text) = self.heard.complaints(now - COMPLAINT_S).next() {
                why = format!("{why} ({text})");
            }
            self.lose(why, true);
        } else if matches!(self.phase, Phase::Flying | Phase::Landing | Phase::Returning)
            && !self.heard.armed()
        {
            self.goal = None;
            (self.order, self.turning) = (None, None);
            self.enter(Phase::Idle);
        }
    }

    fn lose(&mut self, why: String, by_pilot: bool) {
        (self.goal, self.order, self.turning) = (None, None, None);
        self.enter(Phase::Taken { why, by_pilot });
    }

    /// Gives up a take-off or an order.
    pub(super) fn fail(&mut self, what: &str, why: &str, then: Phase) {
        let complaint = self.heard.complaints(self.clock.now() - COMPLAINT_S).next();
        self.failure = match complaint {
            Some(text) => format!("{what} was given up: {why} ({text})"),
            None => format!("{what} was given up: {why}"),
        };
        self.order = None;
        self.enter(then);
    }

    /// Sends what is due.
    pub(super) fn advance(&mut self, now: f64) -> Result<(), MavlinkError> {
        let Some((system, component, autopilot)) = self.heard.who else { return Ok(()) };
        let origin = self.heard.position.as_ref().filter(|_| self.frame.is_none());
        let origin = origin.map(|message| (message.value.lat, message.value.lon));
        if let (Some((lat, lon)), Ok(())) =
            (origin, quality::for_take_off(&self.heard, &self.config.position, now))
        {
            self.frame = CommonFrame::new(degrees_of_e7(lat), degrees_of_e7(lon)).ok();
        }
        let streams = self.streams.get_or_insert_with(|| Streams::new(&self.config, autopilot));
        for order in streams.due(now) {
            self.command(now, order.command)?;
        }
        if self.heard.version.is_none() && now - self.version_asked > 5.0 {
            self.version_asked = now;
            self.ask_version(now)?;
        }
        for (command, result) in std::mem::take(&mut self.heard.acks) {
            for order in [&mut self.order, &mut self.turning].into_iter().flatten() {
                order.answered(command, result);
            }
        }
        match self.phase.clone() {
            Phase::Idle | Phase::Taken { .. } => Ok(()),
            Phase::TakingOff { up, stage, .. } => self.take_off_further(now, autopilot, up, stage),
            Phase::TakingOver => {
                self.say_goal(now, (system, component))?;
                self.ask_mode(now, autopilot.commanded(), Phase::Flying)
            }
            Phase::Flying => {
                self.turn_further(now)?;
                self.say_goal(now, (system, component))
            }
            Phase::Landing => self.come_down_further(now, autopilot.land()),
            Phase::Returning => self.come_down_further(now, autopilot.return_to_launch()),
        }
    }

    pub(super) fn ask_version(&mut self, now: f64) -> Result<(), MavlinkError> {
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
        let Some((target_system, target_component, _)) = self.heard.who else { return Ok(()) };
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

    /// Asks for a mode until it is there, and goes on to the next phase.
    pub(super) fn ask_mode(
        &mut self,
        now: f64,
        mode: FlightMode,
        next: Phase,
    ) -> Result<(), MavlinkError> {
        if self.heard.mode() == Some(mode) {
            if next == Phase::Flying {
                return self.up_there(now);
            }
            self.order = None;
            self.enter(next);
            return Ok(());
        }
        self.order.get_or_insert_with(|| mode_order(mode));
        if let Some(why) = self.give(now)? {
            let what = format!("the mode {mode}");
            let then = if self.heard.airborne() {
                Phase::Taken { why: format!("it does not take the mode {mode}"), by_pilot: false }
            } else {
                Phase::Idle
            };
            self.fail(&what, &why, then);
        }
        Ok(())
    }

    /// Gives the order to come down until its mode shows that it does it.
    fn come_down_further(&mut self, now: f64, mode: FlightMode) -> Result<(), MavlinkError> {
        let (at, ours) = (self.heard.mode(), mode.autopilot.commanded());
        // A mode that came after it is as good: PX4 holds when it has landed.
        if at == Some(mode) || at != Some(ours) {
            self.order = None;
            return Ok(());
        }
        // Until it is in its own hands, it is to stay in ours.
        if let Some((system, component, _)) = self.heard.who {
            self.say_goal(now, (system, component))?;
        }
        if let Some(why) = self.give(now)? {
            self.fail(&format!("the order to {mode}"), &why, Phase::Flying);
        }
        Ok(())
    }

    pub(super) fn come_down(&mut self, phase: Phase) -> Result<(), MavlinkError> {
        let now = self.serve()?;
        if self.phase == phase {
            return Ok(());
        }
        let by_pilot = matches!(self.phase, Phase::Taken { by_pilot: true, .. });
        if by_pilot || !self.heard.airborne() {
            let why = if by_pilot { self.hindrance(now) } else { "it is on the ground".into() };
            return Err(MavlinkError::NotCommanded { why });
        }
        (self.order, self.turning) = (None, None);
        self.failure.clear();
        let autopilot = self.heard.autopilot();
        self.order = Some(mode_order(match phase {
            Phase::Landing => autopilot.land(),
            _ => autopilot.return_to_launch(),
        }));
        self.enter(phase);
        self.advance(now)
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
