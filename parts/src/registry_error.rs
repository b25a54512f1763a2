/// Reason why a part that has a name cannot be built.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RegistryError {
    /// The name is unknown.
    #[error("{name:?} is not a known {what}; choose one of {}", known.join(", "))]
    Unknown {
        /// Kind of the part: an estimator, an extractor, a planner, a source.
        what: &'static str,
        /// The requested name.
        name: String,
        /// The names that there are.
        known: Vec<String>,
    },
    /// A source of range differences has no reference receiver.
    #[error("range-difference needs model.reference_m, the reference receiver's place")]
    NoReference,
    /// The estimator takes all receptions at once, and there is a stream of them.
    #[error("the estimator {estimator} needs all receptions at once; it works in `locate`")]
    NeedsAllAtOnce {
        /// Name of the estimator.
        estimator: String,
    },
    /// The estimator is built by its registrant's own code and has no settings to change.
    #[error("the estimator {estimator} has no setting {setting}")]
    NoSetting {
        /// Name of the estimator.
        estimator: String,
        /// Name of the setting that was given.
        setting: &'static str,
    },
}
