use crate::Pose;

/// Reason for refusing an observation.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ObservationError {
    /// The time is NaN or infinite.
    #[error("the time of the observation is {time}, not a finite number")]
    Time {
        /// The time.
        time: f64,
    },
    /// The receiver's pose holds NaN or infinity.
    #[error("the receiver's pose is not finite: {pose:?}")]
    Receiver {
        /// The receiver's pose.
        pose: Pose,
    },
    /// A component is NaN or infinite.
    #[error("component {component} of the observation is {value}, not a finite number")]
    Value {
        /// Index of the component.
        component: usize,
        /// Value of the component.
        value: f64,
    },
    /// A component's variance is not positive and finite.
    #[error("the variance of component {component} is {variance}, not a positive number")]
    Variance {
        /// Index of the component.
        component: usize,
        /// The variance.
        variance: f64,
    },
    /// A standard deviation of the receiver's own place is negative or not finite.
    #[error("the receiver's place has a standard deviation of {sigma} m, not of zero or more")]
    ReceiverSigma {
        /// The standard deviation, in metres.
        sigma: f64,
    },
    /// A bearing that directions compete for is missing, or is no component at all.
    #[error("directions compete for component {component}, which is missing")]
    NoBearing {
        /// Index of the component.
        component: usize,
    },
    /// The covariance is not symmetric and positive definite.
    #[error("the covariance of the observation is not symmetric and positive definite")]
    Covariance,
}
