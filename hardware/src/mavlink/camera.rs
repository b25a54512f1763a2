use foxhunt_core::Clock;
use foxhunt_wire::{ByteStream, mavlink::dialect::MavCmd};

use super::{
    MavlinkError, MavlinkVehicle,
    orders::{Order, Step},
};

/// The order to take one picture, and what became of it.
///
/// MAV_CMD_IMAGE_START_CAPTURE, as ArduPilot's cameras take it; where that is refused
/// MAV_CMD_DO_DIGICAM_CONTROL, which PX4's trigger takes.
#[derive(Debug, Default)]
pub(super) struct Camera {
    pub(super) order: Option<Order>,
    /// How many pictures were ordered: a camera leaves out one whose number it has had.
    ordered: u16,
    /// Why the last one was not taken, until that is reported.
    failure: Option<String>,
}

impl Camera {
    fn order_one(&mut self) {
        self.ordered = self.ordered.wrapping_add(1).max(1);
        // Every camera, at once, one picture, and which one that is.
        let parameters = [0.0, 0.0, 1.0, f32::from(self.ordered), 0.0, 0.0, 0.0];
        self.order = Some(Order::new(MavCmd::MAV_CMD_IMAGE_START_CAPTURE, parameters));
    }

    /// Why the last picture was not taken, once.
    pub(super) fn take_failure(&mut self) -> Option<MavlinkError> {
        self.failure.take().map(|why| MavlinkError::Picture { why })
    }
}

impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    /// Orders a picture if it is known to have a camera.
    pub(super) fn begin_picture(&mut self, now: f64) -> Result<(), MavlinkError> {
        if !self.config.camera || self.config.listen_only {
            return Ok(());
        }
        self.commanded_goal(now)?;
        self.camera.order_one();
        self.photograph_further(now)
    }

    /// Orders it until that is answered.
    pub(super) fn photograph_further(&mut self, now: f64) -> Result<(), MavlinkError> {
        let Some(order) = &mut self.camera.order else { return Ok(()) };
        if order.accepted() {
            self.camera.order = None;
            return Ok(());
        }
        if order.refused() && order.command.command == MavCmd::MAV_CMD_IMAGE_START_CAPTURE {
            // The fifth parameter is the shutter.
            let parameters = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
            *order = Order::new(MavCmd::MAV_CMD_DO_DIGICAM_CONTROL, parameters);
        }
        match order.advance(now, self.config.ack_timeout_s, self.config.attempts) {
            Step::Wait => Ok(()),
            Step::Send(command) => self.command(now, command),
            Step::Failed(why) => {
                (self.camera.order, self.camera.failure) = (None, Some(why));
                Ok(())
            }
        }
    }
}
