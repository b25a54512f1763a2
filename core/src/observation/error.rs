use crate::Pose;

/// Why an observation is refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ObservationError {
    /// The time is NaN or infinite.
    #[error("the time of the observation is {time}, not a finite number")]
    Time {
        /// What it was.
        time: f64,
    },
    /// The receiver's pose holds NaN or infinity.
    #[error("the receiver's pose is not finite: {pose:?}")]
    Receiver {
        /// What it was.
        pose: Pose,
    },
    /// A component is NaN or infinite.
    #[error("component {component} of the observation is {value}, not a finite number")]
    Value {
        /// Which component.
        component: usize,
        /// What it held.
        value: f64,
    },
    /// A component's variance is not positive and finite.
    #[error("the variance of component {component} is {variance}, not a positive number")]
    Variance {
        /// Which component.
        component: usize,
        /// What it held.
        variance: f64,
    },
    /// A standard deviation of the receiver's own place is negative or not finite.
    #[error("the receiver's place has a standard deviation of {sigma} m, not of zero or more")]
    ReceiverSigma {
        /// What it was.
        sigma: f64,
    },
    /// A bearing that directions compete for is missing, or is no component at all.
    #[error("directions compete for component {component}, which is missing")]
    NoBearing {
        /// Which component.
        component: usize,
    },
    /// The covariance is not symmetric and positive definite.
    #[error("the covariance of the observation is not symmetric and positive definite")]
    Covariance,
}
