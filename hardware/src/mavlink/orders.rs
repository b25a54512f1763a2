use foxhunt_wire::mavlink::{
    Autopilot, FlightMode,
    dialect::{COMMAND_LONG_DATA, MavCmd, MavResult},
};

/// An order that is given until it is answered and has its effect.
#[derive(Clone, Debug)]
pub(super) struct Order {
    pub command: COMMAND_LONG_DATA,
    sent: f64,
    tries: u32,
    answer: Option<MavResult>,
}

/// Next action on an order.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Step {
    Wait,
    Send(COMMAND_LONG_DATA),
    /// It was refused, or never answered.
    Failed(String),
}

/// Number of time-outs that the effect of an accepted order may take.
const SETTLING: f64 = 3.0;

impl Order {
    pub(super) fn new(command: MavCmd, parameters: [f32; 7]) -> Self {
        let [param1, param2, param3, param4, param5, param6, param7] = parameters;
        let command = COMMAND_LONG_DATA {
            param1,
            param2,
            param3,
            param4,
            param5,
            param6,
            param7,
            command,
            target_system: 0,
            target_component: 0,
            confirmation: 0,
        };
        Self { command, sent: f64::NEG_INFINITY, tries: 0, answer: None }
    }

    /// Takes an answer to an order of this number.
    pub(super) fn answered(&mut self, command: u32, result: MavResult) {
        if command == self.command.command as u32 {
            self.answer = Some(result);
        }
    }

    pub(super) fn accepted(&self) -> bool {
        matches!(
            self.answer,
            Some(MavResult::MAV_RESULT_ACCEPTED | MavResult::MAV_RESULT_IN_PROGRESS)
        )
    }

    /// The mode that it is for, if it orders one.
    pub(super) fn mode(&self, autopilot: Autopilot) -> Option<FlightMode> {
        let orders_mode = self.command.command == MavCmd::MAV_CMD_DO_SET_MODE;
        mode_of(autopilot, &self.command).filter(|_| orders_mode)
    }

    pub(super) fn refused(&self) -> bool {
        self.answer.is_some() && !self.accepted()
    }

    /// Returns the next action while it has no effect.
    pub(super) fn advance(&mut self, now: f64, timeout: f64, attempts: u32) -> Step {
        if self.answer == Some(MavResult::MAV_RESULT_UNSUPPORTED) {
            return Step::Failed("the autopilot does not know this order".into());
        }
        let patience = if self.accepted() { SETTLING * timeout } else { timeout };
        if now - self.sent < patience {
            return Step::Wait;
        }
        if self.tries >= attempts {
            return Step::Failed(match self.answer {
                None => format!("no answer to {attempts} orders"),
                Some(result) if self.accepted() => format!("{}, but not done", name(result)),
                Some(result) => format!("refused ({})", name(result)),
            });
        }
        self.sent = now;
        self.command.confirmation = u8::try_from(self.tries).unwrap_or(u8::MAX);
        self.tries += 1;
        Step::Send(self.command.clone())
    }
}

fn name(result: MavResult) -> &'static str {
    match result {
        MavResult::MAV_RESULT_ACCEPTED => "accepted",
        MavResult::MAV_RESULT_TEMPORARILY_REJECTED => "temporarily rejected",
        MavResult::MAV_RESULT_DENIED => "denied",
        MavResult::MAV_RESULT_IN_PROGRESS => "in progress",
        MavResult::MAV_RESULT_CANCELLED => "cancelled",
        MavResult::MAV_RESULT_FAILED => "failed",
        _ => "not taken in this form",
    }
}

/// The order to go into a mode.
pub(super) fn mode_order(mode: FlightMode) -> Order {
    let (main, sub) = mode.main_and_sub();
    let [mode, sub] = match mode.autopilot {
        Autopilot::ArduPilot => [f64::from(mode.custom), 0.0],
        Autopilot::Px4 => [f64::from(main), f64::from(sub)],
    };
    // 1: the modes are the autopilot's own.
    let parameters = [1.0, single(mode), single(sub), 0.0, 0.0, 0.0, 0.0];
    Order::new(MavCmd::MAV_CMD_DO_SET_MODE, parameters)
}

/// The mode that an order brings about, if it brings one about.
pub(super) fn mode_of(autopilot: Autopilot, order: &COMMAND_LONG_DATA) -> Option<FlightMode> {
    match order.command {
        MavCmd::MAV_CMD_NAV_TAKEOFF => Some(autopilot.take_off()),
        MavCmd::MAV_CMD_DO_SET_MODE => Some(match autopilot {
            Autopilot::ArduPilot => FlightMode { autopilot, custom: small(order.param2).into() },
            Autopilot::Px4 => FlightMode::px4(small(order.param2), small(order.param3)),
        }),
        _ => None,
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "it saturates, and modes are numbers below 256"
)]
fn small(parameter: f32) -> u8 {
    parameter as u8
}

/// A single precision number of a message; no more digits are sent.
#[expect(clippy::cast_possible_truncation, reason = "the messages have no more digits")]
pub(super) fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_is_repeated_until_it_is_answered_and_no_further() {
        let mut order = Order::new(MavCmd::MAV_CMD_NAV_LAND, [0.0; 7]);
        let mut sent = 0;
        let mut failure = None;
        for tenth in 0..100 {
            match order.advance(f64::from(tenth) * 0.1, 1.0, 3) {
                Step::Send(_) => sent += 1,
                Step::Failed(why) => failure = failure.or(Some((tenth, why))),
                Step::Wait => {}
            }
        }
        assert_eq!(sent, 3);
        assert_eq!(failure, Some((30, "no answer to 3 orders".into())));
        let mut order = Order::new(MavCmd::MAV_CMD_NAV_LAND, [0.0; 7]);
        assert!(matches!(order.advance(0.0, 1.0, 3), Step::Send(_)));
        order.answered(MavCmd::MAV_CMD_NAV_TAKEOFF as u32, MavResult::MAV_RESULT_DENIED);
        order.answered(MavCmd::MAV_CMD_NAV_LAND as u32, MavResult::MAV_RESULT_ACCEPTED);
        assert!(order.accepted());
        assert_eq!(order.advance(2.9, 1.0, 3), Step::Wait);
        assert!(matches!(order.advance(3.0, 1.0, 3), Step::Send(_)));
    }
}
