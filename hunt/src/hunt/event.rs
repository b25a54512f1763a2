//! The commands that a hunt gives, and the events that happen in it.

use foxhunt_core::{
    BeaconId, Correction, Estimate, HeightAboveGround, Outcome, Reception, Waypoint,
};
use foxhunt_estimators::FoundTransmitter;
use foxhunt_formation::{Duty, MovedReason, OrderReason, Phase};
use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// An order of the hunt, for the owner of the devices to carry out.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Send a drone somewhere.
    GoTo {
        /// Index of the drone.
        drone: usize,
        /// Place to fly to.
        goal: Waypoint,
    },
    /// Land a drone where it is.
    Land {
        /// Index of the drone.
        drone: usize,
    },
    /// Turn the antenna of a drone and listen for beacons.
    Listen {
        /// Index of the drone.
        drone: usize,
        /// The beacons, all in the same turn.
        beacons: Vec<BeaconId>,
    },
}

/// One thing that happened in a hunt. Times are seconds, places East, North and Up in metres.
///
/// Each event is one line of the log (`foxhunt::log`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
#[expect(clippy::large_enum_variant, reason = "most events are receptions, the largest of them")]
pub enum Event {
    /// The search for a beacon began.
    BeaconStarted {
        /// Time in seconds.
        time: f64,
        /// The beacon.
        beacon: BeaconId,
        /// Name of the beacon.
        name: String,
        /// Belief of the estimator before the first reception.
        prior: Estimate<2>,
        /// Belief of the hunt then, if the estimator has a prior of its own.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        hunt_prior: Option<Estimate<2>>,
    },
    /// A hunt that was broken off goes on from its log.
    Resumed {
        /// Time in seconds.
        time: f64,
    },
    /// The formation does something else now.
    PhaseChanged {
        /// Time in seconds.
        time: f64,
        /// New phase of the formation.
        phase: Phase,
    },
    /// The planner has decided where to listen next, or that the search is over.
    Planned {
        /// Time in seconds.
        time: f64,
        /// Beacon for which it plans in the first place.
        beacon: BeaconId,
        /// Reason, as the planner explains it.
        reason: String,
    },
    /// A place that the planner wanted may not be flown to, or is too near another one; the drone
    /// goes elsewhere.
    GoalMoved {
        /// Time in seconds.
        time: f64,
        /// Index of the drone.
        drone: usize,
        /// Place that the planner wanted.
        wanted: Vector3<f64>,
        /// Place to which it goes.
        goal: Vector3<f64>,
        /// Reason for the move.
        reason: MovedReason,
    },
    /// A drone was sent to its goal, or to a corner of its way there.
    Sent {
        /// Time in seconds.
        time: f64,
        /// Index of the drone.
        drone: usize,
        /// Place to which it was sent.
        to: Vector3<f64>,
        /// Reason for the order.
        reason: OrderReason,
    },
    /// A drone has to wait for others to pass, or finds no permitted way to its goal.
    Held {
        /// Time in seconds.
        time: f64,
        /// Index of the drone.
        drone: usize,
        /// Reason for the wait.
        reason: String,
    },
    /// A drone drops out of the formation, or comes back to it.
    DutyChanged {
        /// Time in seconds.
        time: f64,
        /// Index of the drone.
        drone: usize,
        /// Duty from now on.
        duty: Duty,
    },
    /// A search is over by a rule that is not the planner's.
    Stopped {
        /// Time in seconds.
        time: f64,
        /// Beacon of the search.
        beacon: BeaconId,
        /// Outcome of the search.
        outcome: Outcome,
        /// Reason for the end.
        reason: String,
    },
    /// The drones fly home.
    Recalled {
        /// Time in seconds.
        time: f64,
        /// Reason for the recall.
        reason: String,
    },
    /// A drone was ordered to land where it is, or was given up.
    Landed {
        /// Time in seconds.
        time: f64,
        /// Index of the drone.
        drone: usize,
        /// Reason for the landing there.
        reason: String,
    },
    /// The goals of all drones were set, in their order.
    GoalsSet {
        /// Time in seconds.
        time: f64,
        /// Goal of each drone.
        goals: Vec<Vector3<f64>>,
    },
    /// A drone's turn became a reception.
    Received {
        /// Time when the hunt got it, in seconds.
        time: f64,
        /// Index of the drone.
        drone: usize,
        /// True if it belongs to the first formation position of its beacon.
        first_position: bool,
        /// The reception.
        reception: Reception,
    },
    /// The reception before went through the estimator.
    Corrected {
        /// Time in seconds.
        time: f64,
        /// Index of the drone whose reception it was.
        drone: usize,
        /// Beacon of the reception; absent in logs before version 6, where the reception before
        /// tells it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        beacon: Option<BeaconId>,
        /// Correction by the estimator.
        correction: Correction,
        /// Number of components that the reception had for the estimator: the degrees of freedom of
        /// its normalised innovation squared; not in logs before version 6.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        degrees_of_freedom: Option<usize>,
        /// Belief after the correction.
        estimate: Estimate<2>,
    },
    /// The innovations of the last receptions have become larger than the filter can explain: it
    /// has lost the target, or its noise is too small. Once, until it is consistent again.
    FilterDiverged {
        /// Time in seconds.
        time: f64,
        /// Beacon of the filter.
        beacon: BeaconId,
        /// The average normalised innovation squared of the last receptions.
        average_nis: f64,
        /// Interval of a consistent filter's average.
        interval: [f64; 2],
    },
    /// A turn or a reception was of no use.
    Refused {
        /// Time in seconds.
        time: f64,
        /// Index of the drone.
        drone: usize,
        /// Reason for the refusal.
        reason: String,
    },
    /// A drone delivered nothing at a formation position; the hunt goes on without.
    Missing {
        /// Time when the hunt stopped waiting, in seconds.
        time: f64,
        /// Index of the drone.
        drone: usize,
        /// Time that it was waited for, in seconds.
        waited_s: f64,
    },
    /// The flight of real aircraft, of which the hunt is the middle, has come to another stage.
    FlightStage {
        /// Time in seconds.
        time: f64,
        /// New stage of the flight.
        stage: FlightStage,
        /// Reason for the change.
        reason: String,
    },
    /// An aircraft does something else now.
    Aircraft {
        /// Time in seconds.
        time: f64,
        /// Index of the drone.
        drone: usize,
        /// Mode of the aircraft, by its own name.
        mode: String,
        /// True if its motors run.
        armed: bool,
        /// True if it is in the air.
        airborne: bool,
        /// True if it takes our orders.
        commanded: bool,
        /// Reason why it takes no orders, or what keeps it on the ground.
        hindrance: String,
    },
    /// State of an aircraft's battery, link and position, when that has changed noticeably.
    Health {
        /// Time in seconds.
        time: f64,
        /// Index of the drone.
        drone: usize,
        /// Charge of its battery, from 0 to 1, if it reports that.
        battery: Option<f64>,
        /// True if its messages come.
        linked: bool,
        /// σ of its position, the greatest axis in metres, where it has one.
        position_sigma_m: Option<f64>,
        /// Height above the ground by its own devices, if it has any.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        above_ground: Option<HeightAboveGround>,
    },
    /// An aircraft's own devices have it at another height above the ground than the flight's
    /// elevation model. Once, until they agree again.
    HeightDiffers {
        /// Time in seconds.
        time: f64,
        /// Index of the drone.
        drone: usize,
        /// Height above the ground by its own devices.
        reported: HeightAboveGround,
        /// Height above the ground by the elevation model, in metres.
        expected_m: f64,
        /// Allowed difference, in metres.
        tolerance_m: f64,
    },
    /// The clock of a drone on another computer is known, or known otherwise than before; its times
    /// are corrected by that.
    ClockOffset {
        /// Time in seconds.
        time: f64,
        /// Index of the drone.
        drone: usize,
        /// Offset that is added to its times, in seconds.
        offset_s: f64,
        /// The true offset is no farther from that, in seconds.
        uncertainty_s: f64,
        /// Number of times that a clock was set since the drone's node began.
        jumps: u32,
    },
    /// A device reported a failure; the hunt goes on.
    DeviceFailed {
        /// Time in seconds.
        time: f64,
        /// Index of the drone with the device; `None` for the fleet as a whole.
        drone: Option<usize>,
        /// The failure in words.
        reason: String,
    },
    /// Belief of a beacon when its search ends, of an estimator that holds more than two moments:
    /// places of equal weight that stand for it. It comes before the end.
    Cloud {
        /// Time in seconds.
        time: f64,
        /// The beacon.
        beacon: BeaconId,
        /// East and North in metres.
        places: Vec<Vector2<f64>>,
    },
    /// The search for a beacon is over.
    BeaconFinished {
        /// Time in seconds.
        time: f64,
        /// Result of the search.
        fix: Fix,
    },
}

impl Event {
    /// Returns the time of the event, in seconds.
    #[must_use]
    pub fn time(&self) -> f64 {
        match self {
            Self::BeaconStarted { time, .. }
            | Self::Resumed { time, .. }
            | Self::PhaseChanged { time, .. }
            | Self::Planned { time, .. }
            | Self::GoalMoved { time, .. }
            | Self::Sent { time, .. }
            | Self::Held { time, .. }
            | Self::DutyChanged { time, .. }
            | Self::Stopped { time, .. }
            | Self::Recalled { time, .. }
            | Self::Landed { time, .. }
            | Self::GoalsSet { time, .. }
            | Self::Received { time, .. }
            | Self::Corrected { time, .. }
            | Self::FilterDiverged { time, .. }
            | Self::Refused { time, .. }
            | Self::Missing { time, .. }
            | Self::FlightStage { time, .. }
            | Self::Aircraft { time, .. }
            | Self::Health { time, .. }
            | Self::HeightDiffers { time, .. }
            | Self::DeviceFailed { time, .. }
            | Self::ClockOffset { time, .. }
            | Self::Cloud { time, .. }
            | Self::BeaconFinished { time, .. } => *time,
        }
    }
}

/// The stage of a flight of real aircraft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum FlightStage {
    /// The aircraft are on the ground; aircraft that are not ready are waited for.
    Preparing,
    /// They take off.
    Climbing,
    /// The hunt.
    Hunting,
    /// They come back by the pilot's rules.
    Leaving,
    /// All are down, or in the pilot's hands.
    Over,
}

impl std::fmt::Display for FlightStage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Preparing => "preparing",
            Self::Climbing => "taking off",
            Self::Hunting => "hunting",
            Self::Leaving => "leaving",
            Self::Over => "over",
        })
    }
}

/// The result of the search for a beacon.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fix {
    /// The beacon.
    pub beacon: BeaconId,
    /// Name of the beacon.
    pub name: String,
    /// Estimated place.
    pub estimate: Estimate<2>,
    /// Number of receptions that went through the estimator, rejected ones included.
    pub steps: u32,
    /// Number of formation positions with a reception.
    pub formation_positions: u32,
    /// Outcome of the search.
    pub outcome: Outcome,
    /// The transmitters on its frequency, the most probable first, where the estimator looks for
    /// several; `estimate` is then of the one that is worst known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transmitters: Option<Vec<FoundTransmitter>>,
}
