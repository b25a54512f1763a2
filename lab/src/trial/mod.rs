//! Trials: bearings drawn from a stated density instead of flown turns. A scripted receiver, a
//! target whose course is known, a prior, and how well estimators follow it.

mod bound;
mod campaign;
mod config;
mod course;
mod draw;
mod error;
mod prior;
mod run;
mod track;

pub use campaign::trial_campaign;
pub use config::{
    BearingsConfig, DifferencesConfig, Leg, PriorConfig, ReceiverConfig, TargetConfig,
    TargetMotion, Trial, builtin_trials,
};
pub use error::TrialError;
pub use run::{TrialRun, run_trial};

use foxhunt_core::ConstantVelocity;

impl Trial {
    /// The motion of a target with velocity, if that is what the trial has.
    fn moving(&self) -> Option<ConstantVelocity> {
        match self.motion {
            TargetMotion::Still => None,
            TargetMotion::ConstantVelocity { acceleration_density } => {
                Some(ConstantVelocity { acceleration_density })
            }
        }
    }
}
