//! Seeded Monte Carlo: the same scenario many times, and the statistics of each contender.

mod antennas;
mod fleet_watch;
mod fleets;
mod planners;
mod report;
mod run;
mod sigmas;
mod summary;

pub use antennas::{
    AntennaComparison, AntennaSetup, AntennasReport, SetupCampaign, antennas_campaign,
};
pub use fleet_watch::{Breach, Violation};
pub(crate) use fleets::FleetRun;
pub use fleets::{FailedRun, FleetsReport, fleets_campaign};
pub use planners::{
    OutcomeCount, PLANNER_SCENARIOS, PlannedBeacon, PlannerCampaign, PlannerComparison,
    PlannersReport, planners_campaign,
};
pub use report::{BeaconCampaign, CampaignReport, Checkpoint, EstimatorCampaign, OWN};
pub use run::{CampaignError, Repetition, campaign, campaign_watched, campaign_with};
pub use sigmas::{
    BearingStatistics, SigmaCampaign, SigmaComparison, SigmaSetup, SigmasCampaign, SigmasReport,
    sigmas_campaign,
};
pub use summary::BeaconRun;
pub(crate) use summary::{BeaconSummary, Sample};
#[cfg(feature = "store")]
pub(crate) use {
    run::{Flown, beacon_names},
    summary::FlightsSummary,
};
