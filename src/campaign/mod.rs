//! Seeded Monte Carlo: the same scenario many times, and what the estimators make of it.

mod antennas;
mod fleet_watch;
mod fleets;
mod paired;
mod planners;
mod run;
mod statistics;

pub use antennas::{
    AntennaComparison, AntennaSetup, AntennasReport, SetupCampaign, antennas_campaign,
};
pub use fleet_watch::{Breach, Violation};
pub use fleets::{FailedRun, FleetsReport, fleets_campaign};
pub use paired::Paired;
pub use planners::{
    OutcomeCount, PLANNER_SCENARIOS, PlannedBeacon, PlannerCampaign, PlannerComparison,
    PlannersReport, planners_campaign,
};
pub(crate) use run::Sample;
pub use run::{
    BeaconCampaign, CampaignError, CampaignReport, Checkpoint, EstimatorCampaign, OWN, campaign,
};
pub use statistics::{FirstPassage, Spread, StepSpread};
