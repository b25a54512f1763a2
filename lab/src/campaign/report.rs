use foxhunt_filters::consistency::Verdict;
use serde::Serialize;

use crate::{FirstPassage, Spread, StepSpread};

/// Name in reports of a planner or an estimator that is the scenario's own.
pub const OWN: &str = "scenario's own";

/// The results of a campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CampaignReport {
    /// The scenario's name.
    pub scenario: String,
    /// The planner: the scenario's own, [`OWN`], unless the caller names another one; absent where
    /// nothing flies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planner: Option<String>,
    /// The number of hunts that each estimator flew.
    pub runs: u32,
    /// The seed of the first run; run i has this plus i.
    pub seed: u64,
    /// The estimators, in the order of the call.
    pub estimators: Vec<EstimatorCampaign>,
}

/// One estimator's campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EstimatorCampaign {
    /// The estimator's name.
    pub estimator: String,
    /// The beacons, in their order.
    pub beacons: Vec<BeaconCampaign>,
}

/// One estimator on one beacon over all runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BeaconCampaign {
    /// The beacon's name.
    pub name: String,
    /// Distance from the estimate to the truth; absent when every run failed, like all that
    /// follows.
    pub error_m: Option<Spread>,
    /// Receptions that went through the estimator.
    pub steps: Option<StepSpread>,
    /// The number of steps after which the semi-major axis of the 95 % ellipse was below 3 m for
    /// the first time, over all runs; absent where nothing flies. A run that could not go on never
    /// got there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps_to_3m: Option<FirstPassage>,
    /// Time until then in simulated seconds, from when the search for this beacon began.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_to_3m_s: Option<FirstPassage>,
    /// The distance that all drones together flew from the beginning of the search to its end, in
    /// metres, over the runs in which it ended; absent where nothing flies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path_m: Option<Spread>,
    /// The average normalised estimation error squared; 2 for a consistent estimator.
    pub anees: Option<f64>,
    /// The 95 % interval of a consistent estimator's ANEES.
    pub anees_interval: Option<[f64; 2]>,
    /// The verdict by the ANEES on whether the errors are as large as the covariances claim.
    pub verdict: Verdict,
    /// The share of truths inside the 95 % ellipse.
    pub coverage_95: Option<f64>,
    /// The interval that holds the true share with at least 95 %.
    pub coverage_95_interval: Option<[f64; 2]>,
    /// The average normalised innovation squared over all steps that have one.
    pub anis: Option<f64>,
    /// The 95 % interval of a consistent estimator's ANIS.
    pub anis_interval: Option<[f64; 2]>,
    /// Runs without a fix: nothing received before the search ended, not over in time, or an
    /// estimate without a positive definite covariance.
    pub failed: u32,
    /// The root mean square of a bound on the error of any estimator, such as the posterior
    /// Cramér-Rao bound, at the end; where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound_m: Option<f64>,
    /// The root mean square error over the whole track, not only at its end; where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub track_rms_m: Option<f64>,
    /// The errors on the way, where the scenario sets checkpoints.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub checkpoints: Vec<Checkpoint>,
}

/// The errors after some of the measurements.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Checkpoint {
    /// The number of measurements.
    pub measurements: u32,
    /// Distance from the estimate to the truth; absent when every run failed, like what follows.
    pub error_m: Option<Spread>,
    /// The average normalised estimation error squared; 2 for a consistent estimator.
    pub anees: Option<f64>,
    /// The root mean square of a bound on the error of any estimator, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound_m: Option<f64>,
}
