//! Seeded Monte Carlo: the same scenario many times, and what the estimators make of it.

mod run;
mod statistics;

pub use run::{BeaconCampaign, CampaignError, CampaignReport, EstimatorCampaign, campaign};
pub use statistics::{Spread, StepSpread};
