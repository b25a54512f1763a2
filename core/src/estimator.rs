//! Estimators, and beliefs about a place alone.

use core::fmt;

use nalgebra::Vector2;

use crate::{
    Estimate, Observation, Quantity, State, parameter::ParameterError, visit_cubature_points,
};

/// A recursive Bayesian estimator of an `N`-state from `M`-component observations.
///
/// An estimator owns its models and, if it needs one, its random generator; so this trait has
/// nothing generic in its methods and `dyn Estimator<N, M>` is as good as any concrete type.
///
/// # Laws
///
/// Checked by `laws::estimator`, feature `laws`: an empty observation changes nothing; what a
/// missing component holds changes nothing; the covariance stays symmetric and positive
/// definite; a refused step leaves the belief as it was; an angle and the same angle a turn on give
/// one posterior. Over all observations that may come, exp(`log_evidence`) integrates to 1, the
/// posterior mean averages to the prior mean, the posterior covariance and the variance of the
/// posterior mean add up to the prior covariance, and the NIS averages to the number of components.
pub trait Estimator<const N: usize, const M: usize> {
    /// Carries the belief `dt` seconds forward.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::TimeStep`] for a `dt` that is negative or not finite. On any error the
    /// belief is left as it was.
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError>;

    /// Conditions the belief on an observation made now.
    ///
    /// # Errors
    ///
    /// On any error the belief is left as it was.
    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError>;

    /// The belief's first two moments.
    fn estimate(&self) -> Estimate<N>;

    /// The quantities of its observations' components, as its measurement model defines them. The
    /// data fed to it are checked against these before a hunt begins.
    fn quantities(&self) -> [Quantity; M];

    /// Calls `visit` with states and weights that stand for the whole belief; the weights sum
    /// to 1. Unless overridden, the 2N cubature points of [`estimate`](Self::estimate).
    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        visit_cubature_points(&self.estimate(), visit);
    }
}

/// An estimator that goes back in time: its belief of an earlier time, given what came later.
///
/// Smoothing runs backward over copies of the estimator, one after the last observation of each
/// time. The last copy is smoothed as it is. Each other one is conditioned on the smoothed one
/// after it. The smoothed copy is an estimator of the same family: its moments and its samples
/// are those of p(x at that time | all observations).
///
/// # Laws
///
/// Checked by `laws::smoother`, feature `laws`: a later belief that brings no news changes nothing;
/// a refused step leaves the belief as it was.
pub trait Smooth<const N: usize, const M: usize>: Estimator<N, M> {
    /// Conditions the belief on `later`: the smoothed belief `dt` seconds afterwards, of a copy
    /// that went on from this one.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::TimeStep`] for a `dt` that is negative or not finite;
    /// [`EstimatorError::Unsupported`] names a setting for which there is no smoother. On any error
    /// the belief is left as it was.
    fn smooth(&mut self, later: &Self, dt: f64) -> Result<(), EstimatorError>;
}

/// The outcome of an update, in the same form for every family of estimators.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(tag = "kind", rename_all = "snake_case"))]
#[must_use = "nothing else shows whether the observation was rejected"]
pub enum Correction {
    /// The observation was fused.
    Fused {
        /// The normalised innovation squared, yᵀ S⁻¹ y, where the family has an innovation.
        nis: Option<f64>,
        /// ln p(z | all that came before): the log of the predictive density at the observation.
        log_evidence: f64,
        /// 1 / Σ w², where the belief is a weighted cloud.
        effective_sample_size: Option<f64>,
    },
    /// The gate kept it out: its normalised innovation squared was above the limit.
    Rejected {
        /// The normalised innovation squared.
        nis: f64,
        /// The limit that it passed.
        limit: f64,
    },
    /// The observation held nothing.
    Empty,
}

impl Correction {
    /// The normalised innovation squared, if one was computed.
    #[must_use]
    pub fn nis(&self) -> Option<f64> {
        match *self {
            Self::Fused { nis, .. } => nis,
            Self::Rejected { nis, .. } => Some(nis),
            Self::Empty => None,
        }
    }

    /// Returns true if the gate kept the observation out.
    #[must_use]
    pub fn is_rejected(&self) -> bool {
        matches!(self, Self::Rejected { .. })
    }
}

/// Reason that an estimator could not be made or could not go on.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EstimatorError {
    /// The time step is negative or not finite.
    #[error("the time step is {dt} s, not a non-negative number")]
    TimeStep {
        /// The step, in seconds.
        dt: f64,
    },
    /// A mean or covariance holds NaN or infinity; look at the model's `expected` and `jacobian`.
    #[error("the {role} is not finite")]
    NotFinite {
        /// The role of the moments.
        role: Role,
    },
    /// A covariance is finite but not positive definite.
    #[error("the {role} covariance is not positive definite")]
    NotPositiveDefinite {
        /// The role of the covariance.
        role: Role,
    },
    /// A parameter is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The estimator does not support a feature.
    #[error("{what} is not supported")]
    Unsupported {
        /// The unsupported feature.
        what: &'static str,
    },
    /// The observations hold another quantity than the estimator's model measures.
    #[error("component {component} is fed {fed}; the estimator's model measures {expected}")]
    Quantity {
        /// Index of the component, from 0.
        component: usize,
        /// The quantity that it is fed.
        fed: Quantity,
        /// The quantity that its model measures.
        expected: Quantity,
    },
    /// The observation is of a time that the estimator no longer goes back to.
    #[error("the observation of {time} s comes too late: all before {horizon} s is settled")]
    TooLate {
        /// Time of the observation, in seconds.
        time: f64,
        /// The earliest time that is still open.
        horizon: f64,
    },
    /// No particle can have led to the observation.
    #[error("none of the {particles} particles can have led to the observation")]
    Impossible {
        /// The number of particles.
        particles: usize,
    },
    /// An iteration did not settle.
    #[error("no convergence after {iterations} iterations")]
    NotConverged {
        /// The number of iterations.
        iterations: u32,
    },
}

impl EstimatorError {
    /// Checks the `dt` of a `predict`: a step of zero seconds or more.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::TimeStep`] when it is negative or not finite.
    #[inline]
    pub fn check_time_step(dt: f64) -> Result<(), Self> {
        if (0.0..=f64::MAX).contains(&dt) { Ok(()) } else { Err(Self::TimeStep { dt }) }
    }
}

/// The part that moments play in a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The belief before the step.
    Prior,
    /// The expected measurement, without the measurement's own noise.
    Expected,
    /// The innovation.
    Innovation,
    /// The belief after the step.
    Posterior,
    /// The noise that the motion adds; look at the model's parameters.
    ProcessNoise,
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Prior => "prior",
            Self::Expected => "expected measurement",
            Self::Innovation => "innovation",
            Self::Posterior => "posterior",
            Self::ProcessNoise => "process noise of the motion",
        })
    }
}

/// Belief about a target's place: a planner's view of an estimator, whatever its state holds.
pub trait Belief {
    /// The first two moments of the target's position.
    fn position(&self) -> Estimate<2>;

    /// Calls `visit` with places and weights that stand for the whole belief; the weights sum
    /// to 1. A particle filter shows its cloud, a Gaussian its cubature points.
    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64));
}

/// The belief that an [`Estimator`] holds.
#[derive(Debug)]
pub struct BeliefOf<'a, E: ?Sized, const N: usize, const M: usize>(pub &'a E);

impl<E: ?Sized + Estimator<N, M>, const N: usize, const M: usize> Belief for BeliefOf<'_, E, N, M> {
    fn position(&self) -> Estimate<2> {
        self.0.estimate().position()
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        self.0.visit_samples(&mut |state, weight| {
            visit(&state.fixed_rows::<2>(0).into_owned(), weight);
        });
    }
}

/// A Gaussian is its own belief.
impl Belief for Estimate<2> {
    fn position(&self) -> Estimate<2> {
        *self
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        visit_cubature_points(self, visit);
    }
}
