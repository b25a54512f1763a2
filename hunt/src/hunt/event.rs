use foxhunt_core::{BeaconId, Correction, Estimate, HeightAboveGround, Outcome, Reception};
use foxhunt_formation::{Duty, MovedReason, OrderReason, Phase};
use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

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
        /// When.
        time: f64,
        /// Which beacon.
        beacon: BeaconId,
        /// Its name.
        name: String,
        /// What the estimator believes before the first reception.
        prior: Estimate<2>,
        /// What the hunt believes then, where the estimator has a prior of its own.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        hunt_prior: Option<Estimate<2>>,
    },
    /// A hunt that was broken off goes on from its log.
    Resumed {
        /// When.
        time: f64,
    },
    /// The formation does something else now.
    PhaseChanged {
        /// When.
        time: f64,
        /// What it does.
        phase: Phase,
    },
    /// The planner has decided where to listen next, or that the search is over.
    Planned {
        /// When.
        time: f64,
        /// For which beacon in the first place.
        beacon: BeaconId,
        /// Why, as the planner explains it.
        reason: String,
    },
    /// A place that the planner wanted may not be flown to, or is too near another one; the drone
    /// goes elsewhere.
    GoalMoved {
        /// When.
        time: f64,
        /// Which drone.
        drone: usize,
        /// Where the planner wanted it.
        wanted: Vector3<f64>,
        /// Where it goes.
        goal: Vector3<f64>,
        /// Why.
        reason: MovedReason,
    },
    /// A drone was sent to its goal, or to a corner of its way there.
    Sent {
        /// When.
        time: f64,
        /// Which drone.
        drone: usize,
        /// Where to.
        to: Vector3<f64>,
        /// Why.
        reason: OrderReason,
    },
    /// A drone has to wait for others to pass, or finds no permitted way to its goal.
    Held {
        /// When.
        time: f64,
        /// Which drone.
        drone: usize,
        /// Why.
        reason: String,
    },
    /// A drone drops out of the formation, or comes back to it.
    DutyChanged {
        /// When.
        time: f64,
        /// Which drone.
        drone: usize,
        /// What it does from now on.
        duty: Duty,
    },
    /// A search is over by a rule that is not the planner's.
    Stopped {
        /// When.
        time: f64,
        /// For which beacon.
        beacon: BeaconId,
        /// How it ended.
        outcome: Outcome,
        /// Why.
        reason: String,
    },
    /// The drones fly home.
    Recalled {
        /// When.
        time: f64,
        /// Why.
        reason: String,
    },
    /// A drone was ordered to land where it is, or was given up.
    Landed {
        /// When.
        time: f64,
        /// Which drone.
        drone: usize,
        /// Why there.
        reason: String,
    },
    /// The goals of all drones were set, in their order.
    GoalsSet {
        /// When.
        time: f64,
        /// Where each shall go.
        goals: Vec<Vector3<f64>>,
    },
    /// A drone's turn became a reception.
    Received {
        /// When the hunt got it.
        time: f64,
        /// Which drone.
        drone: usize,
        /// Whether it belongs to the first formation position of its beacon.
        first_position: bool,
        /// The reception.
        reception: Reception,
    },
    /// The reception before went through the estimator.
    Corrected {
        /// When.
        time: f64,
        /// Which drone's reception it was.
        drone: usize,
        /// Of which beacon; that of the reception before in logs before version 6.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        beacon: Option<BeaconId>,
        /// What the estimator did.
        correction: Correction,
        /// How many components the reception had for the estimator: the degrees of freedom of its
        /// normalised innovation squared; not in logs before version 6.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        degrees_of_freedom: Option<usize>,
        /// What is believed since.
        estimate: Estimate<2>,
    },
    /// The innovations of the last receptions have become larger than the filter can explain: it
    /// has lost the target, or its noise is too small. Once, until it is consistent again.
    FilterDiverged {
        /// When.
        time: f64,
        /// Which beacon's filter.
        beacon: BeaconId,
        /// The average normalised innovation squared of the last receptions.
        average_nis: f64,
        /// Where a consistent filter's would be.
        interval: [f64; 2],
    },
    /// A turn or a reception was of no use.
    Refused {
        /// When.
        time: f64,
        /// Which drone's.
        drone: usize,
        /// Why.
        reason: String,
    },
    /// A drone delivered nothing at a formation position; the hunt goes on without.
    Missing {
        /// When the hunt stopped waiting.
        time: f64,
        /// Which drone.
        drone: usize,
        /// How long it was waited for, in seconds.
        waited_s: f64,
    },
    /// The flight of real aircraft, of which the hunt is the middle, has come to another stage.
    FlightStage {
        /// When.
        time: f64,
        /// Which.
        stage: FlightStage,
        /// Why.
        reason: String,
    },
    /// An aircraft does something else now.
    Aircraft {
        /// When.
        time: f64,
        /// Which drone.
        drone: usize,
        /// What it calls its mode.
        mode: String,
        /// Whether its motors run.
        armed: bool,
        /// Whether it is in the air.
        airborne: bool,
        /// Whether it takes our orders.
        commanded: bool,
        /// Why it takes none, or what keeps it on the ground.
        hindrance: String,
    },
    /// How battery, link and position of an aircraft are, when that has changed noticeably.
    Health {
        /// When.
        time: f64,
        /// Which drone.
        drone: usize,
        /// What is left in its battery, from 0 to 1, where it reports that.
        battery: Option<f64>,
        /// Whether its messages come.
        linked: bool,
        /// σ of its position, the greatest axis in metres, where it has one.
        position_sigma_m: Option<f64>,
        /// How high it is above the ground by its own devices, where it has any.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        above_ground: Option<HeightAboveGround>,
    },
    /// An aircraft's own devices have it at another height above the ground than the flight's
    /// elevation model. Once, until they agree again.
    HeightDiffers {
        /// When.
        time: f64,
        /// Which drone.
        drone: usize,
        /// How high it is above the ground by its own devices.
        reported: HeightAboveGround,
        /// How high by the elevation model, in metres.
        expected_m: f64,
        /// How far apart they may be, in metres.
        tolerance_m: f64,
    },
    /// The clock of a drone on another computer is known, or known otherwise than before; its times
    /// are corrected by that.
    ClockOffset {
        /// When.
        time: f64,
        /// Which drone.
        drone: usize,
        /// What is added to its times, in seconds.
        offset_s: f64,
        /// The true offset is no farther from that, in seconds.
        uncertainty_s: f64,
        /// How often a clock was set since the drone's node began.
        jumps: u32,
    },
    /// A device reported a failure; the hunt goes on.
    DeviceFailed {
        /// When.
        time: f64,
        /// Which drone's device; none for the fleet as a whole.
        drone: Option<usize>,
        /// The failure in words.
        reason: String,
    },
    /// What is believed of a beacon when its search ends, of an estimator that holds more than two
    /// moments: places of equal weight that stand for it. It comes before the end.
    Cloud {
        /// When.
        time: f64,
        /// Of which beacon.
        beacon: BeaconId,
        /// East and North in metres.
        places: Vec<Vector2<f64>>,
    },
    /// The search for a beacon is over.
    BeaconFinished {
        /// When.
        time: f64,
        /// What came of it.
        fix: Fix,
    },
}

impl Event {
    /// When it happened, in seconds.
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
    /// The aircraft are on the ground; those that are not ready are waited for.
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
    /// Which beacon.
    pub beacon: BeaconId,
    /// Its name.
    pub name: String,
    /// Where it is believed to be.
    pub estimate: Estimate<2>,
    /// How many receptions went through the estimator, rejected ones included.
    pub steps: u32,
    /// At how many formation positions there was a reception.
    pub formation_positions: u32,
    /// How the search ended.
    pub outcome: Outcome,
}
