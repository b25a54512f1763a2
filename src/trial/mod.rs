//! Trials: bearings drawn from a stated density instead of flown turns. A scripted receiver, a
//! target whose course is known, a prior, and what estimators make of it.

mod bound;
mod campaign;
mod config;
mod course;
mod draw;
mod error;
mod factory;
mod prior;
mod run;

pub use campaign::trial_campaign;
pub use config::{
    BearingsConfig, Leg, PriorConfig, ReceiverConfig, TargetConfig, TargetMotion, Trial,
    builtin_trials,
};
pub use error::TrialError;
pub use factory::{TrialEstimator, trial_estimator_named, trial_estimators};
pub use run::{TrialRun, run_trial};
