//! The machine-readable results, as they stand in JSON.

use foxhunt_core::{Ellipse, Outcome};
use foxhunt_hunt::hunt::{FoundTransmitter, PlaceEstimate};
use nalgebra::Vector2;
use serde::Serialize;

use crate::simulation::{Found, Simulated};

/// A place in the local frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Place {
    /// East in metres.
    pub east_m: f64,
    /// North in metres.
    pub north_m: f64,
}

impl From<Vector2<f64>> for Place {
    fn from(place: Vector2<f64>) -> Self {
        Self { east_m: place.x, north_m: place.y }
    }
}

/// The result of one simulated hunt.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HuntReport {
    /// Seed of the hunt.
    pub seed: u64,
    /// The estimator's name.
    pub estimator: String,
    /// The planner's name, or that it is the scenario's own.
    pub planner: String,
    /// Duration of the hunt, in simulated seconds.
    pub duration_s: f64,
    /// The beacons, in their order.
    pub beacons: Vec<HuntedBeacon>,
}

/// One beacon of a [`HuntReport`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HuntedBeacon {
    /// Name of the beacon.
    pub name: String,
    /// The beacon's true place.
    pub truth: Place,
    /// The estimate of its place.
    pub estimate: PlaceEstimate,
    /// The ellipse that holds it with 95 %, if the covariance is positive definite.
    pub ellipse_95: Option<Ellipse>,
    /// Distance from the estimate to the truth.
    pub error_m: f64,
    /// The normalised estimation error squared.
    pub nees: Option<f64>,
    /// The number of receptions that went through the estimator.
    pub steps: u32,
    /// The number of receptions after which the semi-major axis of the 95 % ellipse was below 3 m
    /// for the first time; absent if it never was.
    pub steps_to_3m: Option<u32>,
    /// Time until then in simulated seconds, from when the search for this beacon began.
    pub time_to_3m_s: Option<f64>,
    /// The distance that all drones together flew from the beginning of the search to its end, in
    /// metres.
    pub path_m: f64,
    /// The number of formation positions at which something was received.
    pub formation_positions: u32,
    /// The end of the search.
    pub outcome: Outcome,
    /// All transmitters on its frequency, where the estimator looks for several; `truth` and
    /// `error_m` are then of the one that is nearest to `estimate`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmitters: Option<HuntedTransmitters>,
}

/// Transmitters on one frequency, found and true.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HuntedTransmitters {
    /// The true places.
    pub truths: Vec<Place>,
    /// The transmitters that were found, the most probable first.
    pub found: Vec<HuntedTransmitter>,
    /// Distance from these to the truths: GOSPA with c = 50 m, p = 2 and α = 2.
    pub gospa_m: f64,
}

/// A transmitter that was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HuntedTransmitter {
    /// Probability that it is there.
    pub existence: f64,
    /// The estimate of its place.
    pub estimate: PlaceEstimate,
    /// The ellipse that holds it with 95 %, if the covariance is positive definite.
    pub ellipse_95: Option<Ellipse>,
}

impl HuntReport {
    /// The report of a simulated hunt.
    #[must_use]
    pub fn new(seed: u64, estimator: &str, planner: &str, hunt: &Simulated) -> Self {
        Self {
            seed,
            estimator: estimator.to_owned(),
            planner: planner.to_owned(),
            duration_s: hunt.duration_s,
            beacons: hunt.found.iter().map(HuntedBeacon::from).collect(),
        }
    }
}

impl From<&Found> for HuntedBeacon {
    fn from(found: &Found) -> Self {
        Self {
            name: found.fix.name.clone(),
            truth: found.truth.into(),
            estimate: (&found.fix.estimate).into(),
            ellipse_95: found.fix.estimate.ellipse(0.95),
            error_m: found.error_m(),
            nees: found.nees(),
            steps: found.fix.steps,
            steps_to_3m: found.progress.steps_to_3m,
            time_to_3m_s: found.progress.time_to_3m_s,
            path_m: found.progress.path_m,
            formation_positions: found.fix.formation_positions,
            outcome: found.fix.outcome,
            transmitters: found.gospa().zip(found.fix.transmitters.as_ref()).map(
                |(gospa, transmitters)| HuntedTransmitters {
                    truths: found.truths.iter().map(|place| Place::from(*place)).collect(),
                    found: transmitters.iter().map(HuntedTransmitter::from).collect(),
                    gospa_m: gospa.distance,
                },
            ),
        }
    }
}

impl From<&FoundTransmitter> for HuntedTransmitter {
    fn from(found: &FoundTransmitter) -> Self {
        Self {
            existence: found.existence,
            estimate: (&found.estimate).into(),
            ellipse_95: found.estimate.ellipse(0.95),
        }
    }
}
