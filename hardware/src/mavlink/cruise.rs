use foxhunt_core::Clock;
use foxhunt_wire::{ByteStream, mavlink::dialect::MavCmd};

use super::{
    MavlinkError, MavlinkVehicle,
    orders::{Order, Step, single},
    setpoint,
};

/// How much faster than ordered it may be: a gust, an overshoot. A share, and metres per second.
const SHARE: f64 = 1.2;
const MARGIN_MPS: f64 = 0.5;

/// Faster for so many seconds is too fast, and the order is given again.
const FAST_S: f64 = 2.0;

/// The order to fly at `cruise_speed_mps`, and what became of it.
///
/// ArduCopter takes its own speed (WPNAV_SPEED) with the first set-point after GUIDED or a take-off
/// has begun, so the order follows that one (ArduCopter 4.6, `ModeGuided::pos_control_start`).
#[derive(Debug, Default)]
pub(super) struct Cruise {
    /// Absent once it was accepted or given up.
    pub(super) order: Option<Order>,
    /// Since when it has been too fast.
    fast_since: Option<f64>,
    /// Why it does not fly at that speed.
    pub(super) failure: String,
}

impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    fn speed_order(&self) -> Option<Order> {
        // 1: over ground; −1: the throttle as it is.
        let parameters = [1.0, single(self.config.cruise_speed_mps?), -1.0, 0.0, 0.0, 0.0, 0.0];
        Some(Order::new(MavCmd::MAV_CMD_DO_CHANGE_SPEED, parameters))
    }

    /// It takes set-points from now on, and has its own speed.
    pub(super) fn begin_cruise(&mut self) {
        self.cruise = Cruise { order: self.speed_order(), ..Cruise::default() };
    }

    /// Orders the speed until it is accepted, and again while it flies faster.
    pub(super) fn cruise_further(&mut self, now: f64) -> Result<(), MavlinkError> {
        let (Some(goal), Some(limit)) = (self.goal, self.config.cruise_speed_mps) else {
            return Ok(());
        };
        let speed = setpoint::velocity(&self.telemetry).xy().norm();
        if speed <= SHARE * limit + MARGIN_MPS {
            self.cruise.fast_since = None;
        } else if self.cruise.order.is_none()
            && now - *self.cruise.fast_since.get_or_insert(now) >= FAST_S
        {
            self.cruise.failure =
                format!("it flies at {speed:.1} m/s; cruise_speed_mps is {limit}");
            (self.cruise.order, self.cruise.fast_since) = (self.speed_order(), None);
        }
        let Some(order) = &mut self.cruise.order else { return Ok(()) };
        if order.accepted() {
            self.cruise.order = None;
            return Ok(());
        }
        // One that is not confirmed has been sent twice before it counts as known.
        if !goal.confirmed && goal.times < 2 {
            return Ok(());
        }
        match order.advance(now, self.config.ack_timeout_s, self.config.attempts) {
            Step::Wait => Ok(()),
            Step::Send(command) => self.command(now, command),
            Step::Failed(why) => {
                self.cruise.failure =
                    format!("the order to fly at {limit} m/s was given up: {why}");
                self.cruise.order = None;
                Ok(())
            }
        }
    }
}
