use foxhunt_core::{BeaconId, Ellipse, Outcome, PatternSource};
use foxhunt_hardware::Aircraft;
use foxhunt_hunt::hunt::{Fix, PlaceEstimate};
use nalgebra::Vector2;
use serde::Serialize;

use super::Mission;

/// The result of a flight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FlightReport {
    /// Its name.
    pub name: String,
    /// Duration of the flight, in seconds.
    pub duration_s: f64,
    /// Reason why it ended before its time, if it did.
    pub failure: Option<String>,
    /// Beacons, in the order in which their searches ended.
    pub beacons: Vec<FlownFix>,
}

/// One beacon of a [`FlightReport`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FlownFix {
    /// Its name.
    pub name: String,
    /// Estimated place.
    pub estimate: PlaceEstimate,
    /// The ellipse that holds it with 95 %, if the covariance is positive definite.
    pub ellipse_95: Option<Ellipse>,
    /// Number of receptions that went through the estimator.
    pub steps: u32,
    /// Outcome of the search.
    pub outcome: Outcome,
    /// True place and error of the estimate, if the truth is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<FlownTruth>,
}

/// A fix against the truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FlownTruth {
    /// East coordinate of the beacon's true place, in metres.
    pub east_m: f64,
    /// North coordinate of it, in metres.
    pub north_m: f64,
    /// From the estimate to it, in metres.
    pub error_m: f64,
    /// Normalised estimation error squared: 2 on average where the estimator is consistent.
    pub nees: Option<f64>,
}

impl FlightReport {
    /// The result of a flight of that name after `duration_s` seconds; `truth` gives the true place
    /// of a beacon where that is known, East and North in metres.
    #[must_use]
    pub fn new<A: Aircraft, S: PatternSource>(
        name: &str,
        mission: &Mission<A, S>,
        duration_s: f64,
        truth: impl Fn(BeaconId) -> Option<Vector2<f64>>,
    ) -> Self {
        let fixes = mission.hunt().fixes();
        Self {
            name: name.to_owned(),
            duration_s,
            failure: mission.failure().map(str::to_owned),
            beacons: fixes.iter().map(|fix| FlownFix::new(fix, truth(fix.beacon))).collect(),
        }
    }
}

impl FlownFix {
    /// A fix, against the true place of its beacon where that is known, East and North in metres.
    #[must_use]
    pub fn new(fix: &Fix, place: Option<Vector2<f64>>) -> Self {
        let truth = place.map(|place| FlownTruth {
            east_m: place.x,
            north_m: place.y,
            error_m: (fix.estimate.mean - place).norm(),
            nees: fix.estimate.nees(&place),
        });
        Self {
            truth,
            name: fix.name.clone(),
            estimate: (&fix.estimate).into(),
            ellipse_95: fix.estimate.ellipse(0.95),
            steps: fix.steps,
            outcome: fix.outcome,
        }
    }
}
