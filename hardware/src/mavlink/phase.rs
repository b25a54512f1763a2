//! Stages of a flight and its goal, the watch over the way there, and the orders of its speed and
//! of pictures.

use foxhunt_wire::mavlink::dialect::{COMMAND_LONG_DATA, MavCmd};
use nalgebra::Vector3;

use super::{
    MavlinkConfig, MavlinkError,
    orders::{Order, Step, single},
};

/// Distance in metres, besides its braking, from which it has gone away from its goal: gusts and
/// overshoots are less.
const AWAY_M: f64 = 4.0;

/// Time for which it has to be away, in seconds.
const AWAY_S: f64 = 1.0;

/// The least deceleration when it is sent elsewhere in flight, in m/s²: autopilots plan with 2.5.
const BRAKES_MPS2: f64 = 1.5;

/// Faster from one report to the next is a position that jumps, not a flight, in m/s.
const JUMPS_MPS: f64 = 30.0;

/// Time in seconds after which another target has replaced the goal.
const REPLACED_S: f64 = 0.9;

/// Mask of the last six reports.
const LAST: u8 = 0b11_1111;

/// Number of other targets among the last reports from which on another station sends them, too.
const OFTEN: u32 = 3;

/// Factor and margin by which it may be faster than ordered, for a gust or an overshoot; the margin
/// in metres per second.
const SHARE: f64 = 1.2;
const MARGIN_MPS: f64 = 0.5;

/// Time in seconds after which too fast a flight has the order given again.
const FAST_S: f64 = 2.0;

/// Stage of the order that an aircraft was given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Phase {
    /// Nothing yet, or it is down again.
    Idle,
    /// On its way up to `up` metres; at this stage since then.
    TakingOff { up: f64, stage: Stage, since: f64 },
    /// In the mode of our orders, flying to the goal.
    Flying,
    /// It is requested to take the mode of our orders again.
    TakingOver,
    /// Landing at the present place.
    Landing,
    /// Coming back by its own rules.
    Returning,
}

/// The farthest that was ordered of a take-off since it stood on the ground, its motors at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Ordered {
    #[default]
    Nothing,
    /// The motors were to run.
    Arm,
    /// It was to climb, and may do so.
    Climb,
}

/// The stages of a take-off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// Until the position is good.
    Position,
    /// Until it is in the mode in which it is armed.
    Mode,
    /// Until its motors run.
    Arm,
    /// Until it is up.
    Climb,
    /// Until it is in the mode of our orders: PX4 alone climbs in another one.
    Command,
}

/// Ordered place and heading of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Goal {
    /// In metres of the common frame.
    pub place: Vector3<f64>,
    pub nose: Nose,
    /// True if the autopilot has shown that it knows the goal.
    pub confirmed: bool,
    /// Times at which it was sent first, and last.
    pub first: f64,
    pub sent: f64,
    /// Number of times that it was sent.
    pub times: u32,
    /// The autopilot's own target before it was sent.
    pub before: Option<Vector3<f64>>,
    /// Reports of other targets of the autopilot, which knew it or could.
    pub others: OtherTargets,
    /// Watch over its way there.
    pub drift: Drift,
}

/// Order to the nose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Nose {
    /// Points there, in radians counter-clockwise from East.
    Holds(f64),
    /// Turns at this rate in radians per second, counter-clockwise.
    Turns(f64),
}

impl Goal {
    pub(super) fn new(place: Vector3<f64>, nose: Nose) -> Self {
        Self {
            place,
            nose,
            confirmed: false,
            first: f64::NEG_INFINITY,
            sent: f64::NEG_INFINITY,
            times: 0,
            before: None,
            others: OtherTargets::default(),
            drift: Drift::default(),
        }
    }

    /// Returns true if it was never sent in this form.
    pub(super) fn is_new(&self) -> bool {
        self.times == 0
    }
}

/// Distances between a vehicle and its goal, to notice that it goes somewhere else: another station
/// may send it velocities or attitudes, of which it reports no target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Drift {
    nearest_m: f64,
    /// Distance that it may still go in its old direction, in metres.
    braking_m: f64,
    last: Option<(f64, Vector3<f64>)>,
    away_since: Option<f64>,
}

impl Drift {
    /// Takes a report of its place and its speed in m/s; returns how far it has gone away from the
    /// goal in metres once that is beyond doubt.
    pub(super) fn see(
        &mut self,
        at: f64,
        place: Vector3<f64>,
        speed: f64,
        goal: &Vector3<f64>,
    ) -> Option<f64> {
        let distance = (place - goal).norm();
        let last = self.last.replace((at, place));
        let Some((before, there)) = last else {
            self.nearest_m = distance;
            self.braking_m = speed * speed / (2.0 * BRAKES_MPS2);
            return None;
        };
        if at <= before {
            return None;
        }
        if (place - there).norm() > 1.0 + JUMPS_MPS * (at - before) {
            self.nearest_m = distance;
        }
        self.nearest_m = self.nearest_m.min(distance);
        let away_m = distance - self.nearest_m;
        if away_m <= AWAY_M + self.braking_m {
            self.away_since = None;
            return None;
        }
        (at - *self.away_since.get_or_insert(at) >= AWAY_S).then_some(away_m)
    }
}

/// Reports of the autopilot's own target that are not its goal: all in a row for a while, or some
/// of the last ones, as when set-points of another station alternate with ours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OtherTargets {
    /// Time of the last report, in seconds.
    at: f64,
    /// Bits of the last reports, the newest the lowest, 1 for another target.
    recent: u8,
    /// Time since which some of them have had another target, in seconds.
    some_since: Option<f64>,
    /// Time since which all reports have had another target, in seconds.
    all_since: Option<f64>,
}

impl Default for OtherTargets {
    fn default() -> Self {
        Self { at: f64::NEG_INFINITY, recent: 0, some_since: None, all_since: None }
    }
}

impl OtherTargets {
    /// Takes a report, which may be the last one again; returns true if another target has
    /// replaced the goal.
    pub(super) fn see(&mut self, at: f64, other: bool) -> bool {
        if at > self.at {
            self.at = at;
            self.recent = (self.recent << 1 | u8::from(other)) & LAST;
        }
        let since = |since: Option<f64>, holds: bool| holds.then(|| since.unwrap_or(at));
        self.some_since = since(self.some_since, self.recent != 0);
        self.all_since = since(self.all_since, other);
        let lasts = |since: Option<f64>| since.is_some_and(|since| at - since >= REPLACED_S);
        let often = self.recent.count_ones() >= OFTEN && lasts(self.some_since);
        other && (lasts(self.all_since) || often)
    }
}

/// The order to fly at `cruise_speed_mps`, and what became of it.
///
/// ArduCopter takes its own speed (WPNAV_SPEED) with the first set-point after GUIDED or a take-off
/// has begun, so the order follows that one (ArduCopter 4.6, `ModeGuided::pos_control_start`).
#[derive(Debug, Default)]
pub(super) struct Cruise {
    /// Absent once it was accepted or given up.
    pub order: Option<Order>,
    /// Since when it has been too fast.
    fast_since: Option<f64>,
    /// Reason why it does not fly at that speed.
    pub failure: String,
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

/// The order to take one picture, and what became of it.
///
/// MAV_CMD_IMAGE_START_CAPTURE, as ArduPilot's cameras take it; where that is refused
/// MAV_CMD_DO_DIGICAM_CONTROL, which PX4's trigger takes.
#[derive(Debug, Default)]
pub(super) struct Camera {
    pub order: Option<Order>,
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

fn speed_order(config: &MavlinkConfig) -> Option<Order> {
    // 1: over ground; −1: the throttle as it is.
    let parameters = [1.0, single(config.cruise_speed_mps?), -1.0, 0.0, 0.0, 0.0, 0.0];
    Some(Order::new(MavCmd::MAV_CMD_DO_CHANGE_SPEED, parameters))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sees two reports a second, ours and others by their letters; when the goal was replaced.
    fn replaced(reports: &str) -> Option<f64> {
        let mut others = OtherTargets::default();
        reports.chars().zip(0..).find_map(|(report, half)| {
            let at = 0.5 * f64::from(half);
            // Each is looked at twice.
            others.see(at, report == 'x');
            others.see(at, report == 'x').then_some(at)
        })
    }

    #[test]
    fn targets_that_alternate_with_ours_are_noticed_and_single_ones_are_not() {
        assert_eq!(replaced("oooooxxx"), Some(3.5));
        assert_eq!(replaced("oxoxoxox"), Some(2.5));
        assert_eq!(replaced("ooxoxxo"), Some(2.5));
        assert_eq!(replaced("xooooooxoooooxoooooxxo"), None);
    }

    /// Flies along North at a speed from a place, 10 reports a second; when that was noticed.
    fn noticed(north: f64, mps: f64, first_mps: f64, seconds: u32) -> Option<f64> {
        let mut drift = Drift::default();
        (0..seconds * 10).find_map(|tenth| {
            let at = f64::from(tenth) * 0.1;
            let place = Vector3::new(0.0, north + mps * at, 5.0);
            drift.see(at, place, first_mps, &Vector3::new(0.0, 0.0, 5.0)).map(|_| at)
        })
    }

    #[test]
    fn going_away_is_noticed_and_braking_and_jumps_are_not() {
        let at = noticed(0.0, 2.0, 0.0, 20).expect("it goes away");
        assert!((3.0..3.4).contains(&at), "4 m at 2 m/s and a second: {at} s");
        assert_eq!(noticed(-50.0, 2.0, 0.0, 20), None, "it comes nearer");
        assert_eq!(noticed(5.0, 8.0, 8.0, 2), None, "it brakes from 8 m/s");
        let mut drift = Drift::default();
        let goal = Vector3::zeros();
        for tenth in 0..100 {
            let place = Vector3::new(if tenth < 30 { 0.0 } else { 55.0 }, 0.0, 0.0);
            assert_eq!(drift.see(f64::from(tenth) * 0.1, place, 0.0, &goal), None);
        }
    }
}
