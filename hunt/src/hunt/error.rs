use foxhunt_core::{EstimatorError, PlanError, Quantity, parameter::FieldError};
use foxhunt_formation::{AirspaceError, PhaseError, TrafficError};

/// Reason why a hunt could not begin or go on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HuntError {
    /// No drone or no beacon was given.
    #[error("a hunt needs at least one {missing}")]
    Nothing {
        /// Name of what is missing.
        missing: &'static str,
    },
    /// A field of the configuration is out of its range.
    #[error(transparent)]
    Config(#[from] FieldError),
    /// A beacon's estimator could not be made.
    #[error("no estimator for beacon {beacon}")]
    Estimator {
        /// The beacon's name.
        beacon: String,
        /// Cause of the failure.
        source: EstimatorError,
    },
    /// The estimators measure what the receptions do not hold.
    #[error("the estimator measures {quantity}; the receptions hold {}", names(.measured))]
    NotMeasured {
        /// Quantity that no reception holds.
        quantity: Quantity,
        /// Quantities that the receptions hold.
        measured: Vec<Quantity>,
    },
    /// The planner had no plan.
    #[error("no plan for beacon {beacon}")]
    Plan {
        /// The beacon's name.
        beacon: String,
        /// Cause of the failure.
        source: PlanError,
    },
    /// The airspace is invalid.
    #[error("airspace: {0}")]
    Airspace(#[from] AirspaceError),
    /// The drones do not begin as they may, or a distance is out of its range.
    #[error(transparent)]
    Traffic(#[from] TrafficError),
    /// The log to go on from is another hunt's.
    #[error(
        "the log belongs to another hunt: number {} is {logged:?} in it, and here {expected:?}",
        .beacon + 1
    )]
    OtherHunt {
        /// Index of the beacon, from 0.
        beacon: usize,
        /// Name of the beacon in the log.
        logged: String,
        /// Name of the beacon in this hunt; empty if this hunt has no beacon of that number.
        expected: String,
    },
    /// A signal came in a phase that it does not belong to.
    #[error(transparent)]
    Phase(#[from] PhaseError),
}

fn names(quantities: &[Quantity]) -> String {
    let names: Vec<&str> = quantities.iter().map(|quantity| quantity.name()).collect();
    names.join(", ")
}
