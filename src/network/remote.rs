use std::collections::VecDeque;

use foxhunt_core::{BeaconId, Pose, Waypoint};
use foxhunt_hardware::link::{Order, Taken, Turn, UnixTime};

/// How many deliveries are told to be taken in; one that comes again is told again.
const MOST_TAKEN: usize = 64;

/// How far apart places of a path are, in metres.
const PATH_STEP_M: f64 = 0.25;

/// A place that is older than the last one by more seconds than this was not late on the way.
const CLOCK_SET_BACK_S: f64 = 30.0;

/// A drone as the one that fuses knows it.
#[derive(Debug, Default)]
pub(super) struct Remote {
    /// What it is told.
    pub(super) order: Order,
    /// Whether that was told since it changed.
    pub(super) told: bool,
    /// The number of the order that it follows.
    pub(super) follows: u64,
    /// Where it was last, and when by its own clock.
    pub(super) place: Option<(UnixTime, Pose)>,
    /// When anything was heard of it last.
    pub(super) heard_at: Option<f64>,
    /// How far its clock is behind, and the link with it, in seconds.
    pub(super) behind_s: f64,
    pub(super) failure: String,
    pub(super) path: VecDeque<(UnixTime, Pose)>,
    /// What was taken in and may not be in the log yet.
    unlogged: Vec<Taken>,
    pub(super) delivered: u64,
    pub(super) doubled: u64,
}

impl Remote {
    /// Takes note of where it is; `false` for a place that is no newer than the last one, unless its
    /// clock was set back.
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

    /// Sends it somewhere.
    pub(super) fn go_to(&mut self, number: u64, goal: Waypoint) {
        (self.order.goal, self.order.number, self.told) = (Some(goal), number, false);
    }

    /// Tells it to land.
    pub(super) fn land(&mut self, number: u64) {
        (self.order.land, self.order.number, self.told) = (true, number, false);
    }

    /// Asks it for a turn.
    pub(super) fn listen(&mut self, number: u64, beacons: Vec<BeaconId>) {
        self.order.turn = Turn { number, beacons };
        (self.order.number, self.told) = (number, false);
    }

    /// Asks it for no more than what it owes, so that one that has begun anew makes up for no more.
    pub(super) fn owes(&mut self, owed: &[BeaconId]) {
        self.order.turn.beacons.retain(|beacon| owed.contains(beacon));
    }

    /// Whether a delivery is among the last that were dealt with.
    pub(super) fn knows(&self, name: &Taken) -> bool {
        self.unlogged.contains(name) || self.order.taken.contains(name)
    }

    /// A delivery was dealt with, and will be told to be once that is logged.
    pub(super) fn dealt_with(&mut self, name: Taken) {
        self.order.taken.retain(|other| *other != name);
        if !self.unlogged.contains(&name) {
            self.unlogged.push(name);
        }
    }

    /// All that was dealt with is logged.
    pub(super) fn logged(&mut self) {
        if self.unlogged.is_empty() {
            return;
        }
        self.order.taken.append(&mut self.unlogged);
        let surplus = self.order.taken.len().saturating_sub(MOST_TAKEN);
        self.order.taken.drain(..surplus);
        self.told = false;
    }
}
