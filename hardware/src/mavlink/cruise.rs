use foxhunt_wire::mavlink::dialect::{COMMAND_LONG_DATA, MavCmd};

use super::{
    MavlinkConfig,
    orders::{Order, Step, single},
    phase::Goal,
};

/// Factor and margin by which it may be faster than ordered, for a gust or an overshoot; the margin
/// in metres per second.
const SHARE: f64 = 1.2;
const MARGIN_MPS: f64 = 0.5;

/// Time in seconds after which too fast a flight has the order given again.
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
    /// Reason why it does not fly at that speed.
    pub(super) failure: String,
}

impl Cruise {
    /// Begins when the vehicle takes set-points from now on, and has its own speed.
    pub(super) fn begin(config: &MavlinkConfig) -> Self {
        Self { order: speed_order(config), ..Self::default() }
    }

    /// Returns the command that is due at a speed over ground in metres per second: the order is
    /// given until it is accepted, and again while the vehicle flies faster.
    pub(super) fn due(
        &mut self,
        now: f64,
        speed: f64,
        goal: &Goal,
        config: &MavlinkConfig,
    ) -> Option<COMMAND_LONG_DATA> {
        let limit = config.cruise_speed_mps?;
        if speed <= SHARE * limit + MARGIN_MPS {
            self.fast_since = None;
        } else if self.order.is_none() && now - *self.fast_since.get_or_insert(now) >= FAST_S {
            self.failure = format!("it flies at {speed:.1} m/s; cruise_speed_mps is {limit}");
            self.order = speed_order(config);
            self.fast_since = None;
        }
        let order = self.order.as_mut()?;
        if order.accepted() {
            self.order = None;
            return None;
        }
        // One that is not confirmed has been sent twice before it counts as known.
        if !goal.confirmed && goal.times < 2 {
            return None;
        }
        match order.advance(now, config.ack_timeout_s, config.attempts) {
            Step::Wait => None,
            Step::Send(command) => Some(command),
            Step::Failed(why) => {
                self.failure = format!("the order to fly at {limit} m/s was given up: {why}");
                self.order = None;
                None
            }
        }
    }
}

fn speed_order(config: &MavlinkConfig) -> Option<Order> {
    // 1: over ground; −1: the throttle as it is.
    let parameters = [1.0, single(config.cruise_speed_mps?), -1.0, 0.0, 0.0, 0.0, 0.0];
    Some(Order::new(MavCmd::MAV_CMD_DO_CHANGE_SPEED, parameters))
}
