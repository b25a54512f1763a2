use foxhunt_wire::mavlink::dialect::{COMMAND_LONG_DATA, MavCmd};

use super::{
    MavlinkConfig, MavlinkError,
    orders::{Order, Step},
};

/// The order to take one picture, and what became of it.
///
/// MAV_CMD_IMAGE_START_CAPTURE, as ArduPilot's cameras take it; where that is refused
/// MAV_CMD_DO_DIGICAM_CONTROL, which PX4's trigger takes.
#[derive(Debug, Default)]
pub(super) struct Camera {
    pub(super) order: Option<Order>,
    /// Number of pictures that were ordered: a camera leaves out one whose number it has had.
    ordered: u16,
    /// Reason why the last one was not taken, until that is reported.
    failure: Option<String>,
}

impl Camera {
    /// Begins the order of one more picture.
    pub(super) fn order_one(&mut self) {
        self.ordered = self.ordered.wrapping_add(1).max(1);
        // Every camera, at once, one picture, and which one that is.
        let parameters = [0.0, 0.0, 1.0, f32::from(self.ordered), 0.0, 0.0, 0.0];
        self.order = Some(Order::new(MavCmd::MAV_CMD_IMAGE_START_CAPTURE, parameters));
    }

    /// Returns once why the last picture was not taken.
    pub(super) fn take_failure(&mut self) -> Option<MavlinkError> {
        self.failure.take().map(|why| MavlinkError::Picture { why })
    }

    /// Returns the command that is due: the order is given until it is answered.
    pub(super) fn due(&mut self, now: f64, config: &MavlinkConfig) -> Option<COMMAND_LONG_DATA> {
        let order = self.order.as_mut()?;
        if order.accepted() {
            self.order = None;
            return None;
        }
        if order.refused() && order.command.command == MavCmd::MAV_CMD_IMAGE_START_CAPTURE {
            // The fifth parameter is the shutter.
            let parameters = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
            *order = Order::new(MavCmd::MAV_CMD_DO_DIGICAM_CONTROL, parameters);
        }
        match order.advance(now, config.ack_timeout_s, config.attempts) {
            Step::Wait => None,
            Step::Send(command) => Some(command),
            Step::Failed(why) => {
                self.order = None;
                self.failure = Some(why);
                None
            }
        }
    }
}
