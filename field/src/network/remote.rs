//! A drone as the fusing node knows it, and the view of all for those who look on.

use foxhunt_core::{BeaconId, Pose, Waypoint};
use foxhunt_hardware::link::{
    BeaconView, ClockOffset, DroneView, Echo, Health, Leave, Stage, Status, Taken, Turn, UnixTime,
    View,
};
use foxhunt_hunt::hunt::Hunt;

use super::Remote;

/// Maximum number of deliveries that an order names as logged; one that comes again is named again.
const MOST_TAKEN: usize = 64;

/// Distance between places of a path, in metres.
const PATH_STEP_M: f64 = 0.25;

/// Change of a clock's offset at which it is logged again, in seconds.
const CLOCK_STEP_S: f64 = 0.05;

/// A place that is older than the last one by more seconds than this was not late on the way.
const CLOCK_SET_BACK_S: f64 = 30.0;

impl Remote {
    /// Takes note of the drone's place; returns `false` for one that is no newer than the last,
    /// unless the drone's clock was set back.
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

    /// Returns the offset of the drone's clock if it has to be logged: the first one, and each one
    /// that differs from the last.
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

/// The view of a hunt for whoever looks on.
pub(super) fn view(
    at: UnixTime,
    hunt: &Hunt,
    drones: &[Remote],
    silent: &[usize],
    hindrance: Option<&str>,
    clock_tolerance_s: f64,
) -> View {
    let believed = hunt.believed();
    let beacons = believed.iter().map(|known| BeaconView {
        number: known.beacon.0,
        name: known.name.to_owned(),
        estimate: known.estimate,
    });
    let shown = |drone: &Remote| DroneView {
        goal: drone.order.goal,
        path: drone.path.iter().copied().collect(),
    };
    let fusion = Health {
        name: "foxhunt: fusion".to_owned(),
        trouble: hindrance.map(str::to_owned),
        doing: hunt.phase().to_string(),
        values: vec![
            ("beacons".to_owned(), hunt.beacon_count().to_string()),
            ("done".to_owned(), hunt.fixes().len().to_string()),
        ],
    };
    let of = |(index, drone): (usize, &Remote)| {
        health(index, drone, silent.contains(&index), clock_tolerance_s)
    };
    View {
        at,
        beacons: beacons.collect(),
        drones: drones.iter().map(shown).collect(),
        health: std::iter::once(fusion).chain(drones.iter().enumerate().map(of)).collect(),
    }
}

fn health(index: usize, drone: &Remote, silent: bool, clock_tolerance_s: f64) -> Health {
    let late_s = drone.late_s;
    let trouble = if silent {
        Some("it is silent".to_owned())
    } else if !drone.failure.is_empty() {
        Some(drone.failure.clone())
    } else if late_s.abs() > clock_tolerance_s {
        Some(format!("its places come {late_s:.1} s late: its link is slow"))
    } else if drone.place.is_none() {
        Some("its clock is not known well enough yet".to_owned())
    } else {
        None
    };
    let doing = match (drone.order.number, drone.follows) {
        _ if drone.stage != Stage::Flying => &drone.stage.to_string(),
        (0, _) => "waits for the hunt to begin",
        (given, follows) if follows < given => "has not taken its last order yet",
        _ if drone.order.land => "is to land",
        _ if !drone.order.turn.beacons.is_empty() => "listens",
        _ => "flies or holds",
    };
    let of_clock = |number: fn(ClockOffset) -> f64| {
        drone.clock.map_or_else(|| "unknown".to_owned(), |clock| format!("{:.3}", number(clock)))
    };
    Health {
        name: format!("foxhunt: drone {index}"),
        trouble,
        doing: doing.to_owned(),
        values: vec![
            ("order".to_owned(), drone.order.number.to_string()),
            ("follows".to_owned(), drone.follows.to_string()),
            ("deliveries".to_owned(), drone.delivered.to_string()),
            ("doubled".to_owned(), drone.doubled.to_string()),
            ("late_s".to_owned(), format!("{late_s:.3}")),
            ("clock_offset_s".to_owned(), of_clock(|clock| clock.offset_s)),
            ("clock_uncertainty_s".to_owned(), of_clock(|clock| clock.uncertainty_s)),
        ],
    }
}
