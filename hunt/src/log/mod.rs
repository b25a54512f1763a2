//! The log of a hunt: one versioned file of JSON lines, a header and then the events.
//!
//! Every number is written so that reading gives back each of its bits.

mod reader;
mod writer;

pub use reader::{Log, LogError};
pub use writer::LogWriter;

use foxhunt_sim::BeaconCourse;
use foxhunt_wire::geodesy::Geodetic;
use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

use crate::config::{EstimatorConfig, ModelConfig, PlannerConfig};

/// The version of the log that this program writes.
pub const LOG_VERSION: u32 = 7;

/// The oldest version that it reads: one without clouds, and with beacons that stay. Version 5 has
/// hunts that go on from their log; version 6 estimators and sources of users' own;
/// version 7 the health of drones, their heights above the ground, and models over terrain.
pub const OLDEST_LOG_VERSION: u32 = 2;

/// The first line of a log: how the estimates came about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogHeader {
    /// [`LOG_VERSION`] of the program that wrote it.
    pub foxhunt_log: u32,
    /// Name of the scenario or flight.
    pub scenario: String,
    /// The seed of estimators that draw random numbers, and of a simulated world.
    pub seed: u64,
    /// The estimator's name.
    pub estimator_name: String,
    /// The estimator, if it is made of the library's parts; absent for one of a user's own code,
    /// which is replayed where its name is [registered](crate::registry::Registry).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimator: Option<EstimatorConfig>,
    /// Law of propagation that the estimator assumed.
    pub model: ModelConfig,
    /// Planner that decided where to listen; absent in logs before version 4.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub planner: Option<PlannerConfig>,
    /// The beacons, in their order.
    pub beacons: Vec<LoggedBeacon>,
    /// UNIX time when the hunt's time was 0, in whole seconds, if it was flown by real clocks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epoch_unix_s: Option<i64>,
    /// Places where the drones stood when the hunt began, East, North and Up in metres, if a hunt
    /// may have to go on from this log.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub homes: Vec<Vector3<f64>>,
    /// Place of the local frame's zero on Earth, if that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<Geodetic>,
}

/// A beacon of a logged hunt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoggedBeacon {
    /// Name of the beacon.
    pub name: String,
    /// True place at the time 0, East and North in metres, if that is known.
    pub truth: Option<Vector2<f64>>,
    /// Course from there; it stays where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub course: Option<BeaconCourse>,
    /// True places of further transmitters on its frequency, which stay.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Vector2<f64>>,
}

impl LoggedBeacon {
    /// Returns its true place after `time` seconds, if that is known.
    #[must_use]
    pub fn place_at(&self, time: f64) -> Option<Vector2<f64>> {
        let start = self.truth?;
        Some(self.course.as_ref().map_or(start, |course| course.place_at(start, time)))
    }

    /// Returns the true place after `time` seconds of the transmitter on its frequency that is
    /// nearest to a place; its own where it is alone.
    #[must_use]
    pub fn nearest_at(&self, time: f64, place: &Vector2<f64>) -> Option<Vector2<f64>> {
        let off = |truth: &Vector2<f64>| (truth - place).norm_squared();
        let truths = self.place_at(time).into_iter().chain(self.others.iter().copied());
        truths.min_by(|a, b| off(a).total_cmp(&off(b)))
    }
}
