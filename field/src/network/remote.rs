use std::collections::VecDeque;

use foxhunt_core::{BeaconId, Pose, Waypoint};
use foxhunt_hardware::link::{
    ClockOffset, Echo, Leave, Order, Stage, Status, Taken, Turn, UnixTime,
};

/// Maximum number of deliveries that an order names as logged; one that comes again is named again.
const MOST_TAKEN: usize = 64;

/// Distance between places of a path, in metres.
const PATH_STEP_M: f64 = 0.25;

/// Change of a clock's offset at which it is logged again, in seconds.
const CLOCK_STEP_S: f64 = 0.05;

/// A place that is older than the last one by more seconds than this was not late on the way.
const CLOCK_SET_BACK_S: f64 = 30.0;

/// A drone, as far as the one that fuses knows it.
#[derive(Debug, Default)]
pub(super) struct Remote {
    /// Current order of the drone.
    pub(super) order: Order,
    /// True if the order was sent since it changed.
    pub(super) sent: bool,
    /// The number of the order that it follows.
    pub(super) follows: u64,
    /// Last pose, with its time by the drone's own clock.
    pub(super) place: Option<(UnixTime, Pose)>,
    /// Time of its last report.
    pub(super) reported_at: Option<f64>,
    /// Delay of its last place, in seconds.
    pub(super) late_s: f64,
    pub(super) stage: Stage,
    /// Offset of its clock, by the drone's own account.
    pub(super) clock: Option<ClockOffset>,
    /// The stamp of its last status, as long as it was not returned.
    unanswered: Option<UnixTime>,
    /// Its clock as it was logged last.
    logged_clock: Option<ClockOffset>,
    pub(super) failure: String,
    pub(super) path: VecDeque<(UnixTime, Pose)>,
    /// Deliveries that were handled and may not be in the log yet.
    unlogged: Vec<Taken>,
    pub(super) delivered: u64,
    pub(super) doubled: u64,
}

impl Remote {
    /// Takes note of where it is; `false` for a place that is no newer than the last one, unless
    /// its clock was set back.
    pub(super) fn place(&mut self, at: UnixTime, pose: Pose, most: usize) -> bool {
        let late =
            |(before, _): (UnixTime, Pose)| at <= before && before.since(at) < CLOCK_SET_BACK_S;
        if self.place.is_some_and(late) {
            return false;
        }
        self.place = Some((at, pose));
        let far =
            |(_, last): &(UnixTime, Pose)| (pose.position - last.position).norm() >= PATH_STEP_M;
        if self.path.back().is_none_or(far) {
            if self.path.len() >= most {
                self.path.pop_front();
            }
            self.path.push_back((at, pose));
        }
        true
    }

    /// Takes note of how it is.
    pub(super) fn status(&mut self, time: f64, status: Status) {
        let Status { sent, clock, order, stage, failure, .. } = status;
        self.reported_at = Some(time);
        self.follows = order;
        self.stage = stage;
        self.clock = clock;
        self.failure = failure;
        self.unanswered = Some(sent);
    }

    /// Returns the stamp of the last status that came before `now` was read.
    pub(super) fn answer(&mut self, now: UnixTime) {
        if let Some(sent) = self.unanswered.take() {
            self.order.echo = Some(Echo { sent, received: now });
        }
    }

    /// Its clock's offset where that has to be logged: the first, and those that differ from the
    /// last one.
    pub(super) fn clock_to_log(&mut self) -> Option<ClockOffset> {
        let clock = self.clock?;
        let same = |before: ClockOffset| {
            let uncertain_s = before.uncertainty_s.max(clock.uncertainty_s);
            before.jumps == clock.jumps
                && (before.offset_s - clock.offset_s).abs() < CLOCK_STEP_S.max(uncertain_s)
        };
        if self.logged_clock.is_some_and(same) {
            return None;
        }
        self.logged_clock = Some(clock);
        Some(clock)
    }

    /// Sets whether it shall take off when it is ready.
    pub(super) fn take_off(&mut self, number: u64, take_off: bool) {
        if self.order.take_off != take_off {
            self.order.take_off = take_off;
            self.renumber(number);
        }
    }

    /// Has it leave by the pilot's rules.
    pub(super) fn leave(&mut self, number: u64, leave: Leave) {
        if self.order.leave != leave {
            self.order.leave = leave;
            self.renumber(number);
        }
    }

    /// Returns true if it has done all that it will do after its last order.
    pub(super) fn is_done(&self) -> bool {
        self.follows >= self.order.number && !matches!(self.stage, Stage::Climbing | Stage::Leaving)
    }

    /// Sends it somewhere.
    pub(super) fn go_to(&mut self, number: u64, goal: Waypoint) {
        self.order.goal = Some(goal);
        self.renumber(number);
    }

    /// Orders it to land.
    pub(super) fn land(&mut self, number: u64) {
        self.order.land = true;
        self.renumber(number);
    }

    /// Orders a turn.
    pub(super) fn listen(&mut self, number: u64, beacons: Vec<BeaconId>) {
        self.order.turn = Turn { number, beacons };
        self.renumber(number);
    }

    /// Gives its order a number of its own.
    fn renumber(&mut self, number: u64) {
        self.order.number = number;
        self.sent = false;
    }

    /// Limits its turn to the beacons that it owes, so that a restarted one makes up for no more.
    pub(super) fn limit_turn(&mut self, owed: &[BeaconId]) {
        self.order.turn.beacons.retain(|beacon| owed.contains(beacon));
    }

    /// Returns true if a delivery is among the last that were handled.
    pub(super) fn knows(&self, name: &Taken) -> bool {
        self.unlogged.contains(name) || self.order.taken.contains(name)
    }

    /// Notes that a delivery was handled; orders name it once that is logged.
    pub(super) fn handled(&mut self, name: Taken) {
        self.order.taken.retain(|other| *other != name);
        if !self.unlogged.contains(&name) {
            self.unlogged.push(name);
        }
    }

    /// Notes that all that was handled is logged.
    pub(super) fn logged(&mut self) {
        if self.unlogged.is_empty() {
            return;
        }
        self.order.taken.append(&mut self.unlogged);
        let surplus = self.order.taken.len().saturating_sub(MOST_TAKEN);
        self.order.taken.drain(..surplus);
        self.sent = false;
    }
}
