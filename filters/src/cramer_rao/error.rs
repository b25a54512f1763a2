use foxhunt_core::EstimatorError;

/// Reason that there is no bound.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CramerRaoError {
    /// There is no trajectory to take an expectation over.
    #[error("there is no trajectory to take an expectation over")]
    NoTrajectories,
    /// The motion's noise depends on the state: the recursion is that of additive noise.
    #[error("the motion's noise differs between states by {difference} of its size")]
    StateDependentNoise {
        /// The largest difference of two factors, relative to the first.
        difference: f64,
    },
    /// The motion's Jacobian depends on the state in a component that has no noise.
    #[error("the motion turns with the state where it has no noise, by {difference}")]
    Noiseless {
        /// The largest element of what noise does not cover.
        difference: f64,
    },
    /// The motion maps different states onto one.
    #[error("the motion's Jacobian is singular")]
    SingularMotion,
    /// The likelihood is no density over the measurement, or the quadrature misses a part of it.
    #[error("the likelihood integrates to {mass} over the measurement, not to 1")]
    NotADensity {
        /// The likelihood's integral.
        mass: f64,
    },
    /// A model gave NaN or infinity, or the information has no inverse.
    #[error(transparent)]
    Estimator(#[from] EstimatorError),
}
