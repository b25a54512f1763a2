use foxhunt_core::{Ellipse, Outcome, PatternSource};
use foxhunt_hardware::Aircraft;
use foxhunt_hunt::hunt::{Fix, PlaceEstimate};
use serde::Serialize;

use super::Mission;

/// The result of a flight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FlightReport {
    /// Its name.
    pub name: String,
    /// How long it took, in seconds.
    pub duration_s: f64,
    /// Why it ended before its time, if it did.
    pub failure: Option<String>,
    /// What was found, in the order in which the searches ended.
    pub beacons: Vec<FlownFix>,
}

/// One beacon of a [`FlightReport`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FlownFix {
    /// Its name.
    pub name: String,
    /// Where it is believed to be.
    pub estimate: PlaceEstimate,
    /// The ellipse that holds it with 95 %, if the covariance is positive definite.
    pub ellipse_95: Option<Ellipse>,
    /// How many receptions went through the estimator.
    pub steps: u32,
    /// How the search ended.
    pub outcome: Outcome,
}

impl FlightReport {
    /// The result of a flight of that name after so many seconds.
    #[must_use]
    pub fn new<A: Aircraft, S: PatternSource>(
        name: &str,
        mission: &Mission<A, S>,
        duration_s: f64,
    ) -> Self {
        Self {
            name: name.to_owned(),
            duration_s,
            failure: mission.failure().map(str::to_owned),
            beacons: mission.hunt().fixes().iter().map(FlownFix::from).collect(),
        }
    }
}

impl From<&Fix> for FlownFix {
    fn from(fix: &Fix) -> Self {
        Self {
            name: fix.name.clone(),
            estimate: (&fix.estimate).into(),
            ellipse_95: fix.estimate.ellipse(0.95),
            steps: fix.steps,
            outcome: fix.outcome,
        }
    }
}
