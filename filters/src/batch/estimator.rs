use alloc::vec::Vec;

use foxhunt_core::{
    Correction, Covariance, Estimate, Estimator, EstimatorError, MeasurementModel, Observation,
    Quantity, RandomWalk, Role, State, parameter::not_negative, visit_cubature_points,
};
use nalgebra::SVector;

use super::{
    BatchError, BatchSolver, Loss,
    belief::{laplace, posterior},
    modes::Modes,
    problem::Datum,
};
use crate::{Ekf, Gaussian, count::number};

/// A recursive face of [`BatchSolver`]: keeps every observation of a still target, and after each
/// solves maximum a posteriori anew over all of them.
///
/// Nothing is linearised for good: what came early is linearised again about what was learned
/// later. Each update starts from the optima of the last one, at most four, the prior's mean and,
/// as long as there are few observations, its cubature points; the belief is the Gaussian about the
/// best optimum with the inverse of the information there, or with the prior's spread about it as
/// long as the observations leave a curved direction open, such as the ring of levels from one
/// place. An update takes time in proportion to the observations kept.
///
/// Bearings from the optimum's own place are left out of a solution, as in the solver.
///
/// A target that drifts: the drift since the observations began is added to the estimate. As soon
/// as it exceeds a hundredth of the posterior's variance in any direction, the batch is closed: the
/// belief becomes the prior of a new one, and the observations so far are given up. So the drift
/// that an observation ignores is at most a hundredth of the belief that it met. A drift of 0 keeps
/// everything.
///
/// The NIS is that of the new observation under the belief before, linear about its mean. The
/// log-evidence is the growth of Laplace's approximation of ln p(Z); with a robust loss its
/// normaliser is still the Gaussian's.
#[derive(Clone, Debug)]
pub struct BatchEstimator<H, const N: usize, const M: usize> {
    solver: BatchSolver<H, N>,
    motion: RandomWalk<N>,
    data: Vec<Datum<M>>,
    /// The optima of the last solution, the best first.
    modes: Vec<State<N>>,
    /// The belief about where the target was when the batch began, and stayed.
    still: Gaussian<N>,
    /// The variance of the drift since then.
    drifted: SVector<f64, N>,
    /// Both together.
    belief: Gaussian<N>,
    /// Laplace's ln p(Z) of the batch.
    log_evidence: f64,
}

/// How much of the posterior's variance the drift within a batch may be.
const DRIFT_SHARE: f64 = 0.01;

/// How many optima are kept.
const MOST_MODES: usize = 4;

/// With more components than this times N, the optima are taken for known.
const FEW: usize = 4;

impl<H, const N: usize, const M: usize> BatchEstimator<H, N, M>
where
    H: MeasurementModel<N, M>,
{
    /// An estimator that starts from `prior`, with a Gaussian loss, of a target that stays but for
    /// a drift.
    ///
    /// # Errors
    ///
    /// When the prior is not finite or its covariance not symmetric and positive definite;
    /// [`EstimatorError::Parameter`] when the drift is negative or not finite.
    pub fn new(
        motion: RandomWalk<N>,
        measurement: H,
        prior: Estimate<N>,
    ) -> Result<Self, EstimatorError> {
        for drift in &motion.drift {
            not_negative("drift", *drift)?;
        }
        let prior = Gaussian::new(prior, Role::Prior)?;
        Ok(Self {
            solver: BatchSolver::new(measurement).with_gaussian(prior),
            motion,
            data: Vec::new(),
            modes: Vec::new(),
            still: prior,
            drifted: SVector::zeros(),
            belief: prior,
            log_evidence: 0.0,
        })
    }

    /// The same with another loss.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when its parameter is not a positive number.
    pub fn with_loss(self, loss: Loss) -> Result<Self, EstimatorError> {
        let solver = self.solver.with_loss(loss)?;
        Ok(Self { solver, ..self })
    }

    /// The observations that the belief rests on, in the order in which they came.
    pub fn observations(&self) -> impl ExactSizeIterator<Item = &Observation<M>> {
        self.data.iter().map(|datum| &datum.observation)
    }

    fn starts(&self) -> Vec<State<N>> {
        let mut starts = self.modes.clone();
        let Some(prior) = &self.solver.prior else { return starts };
        starts.push(*prior.mean());
        if self.data.len() * M <= FEW * N {
            visit_cubature_points(prior.estimate(), &mut |x, _| starts.push(*x));
        }
        starts
    }

    /// Takes over what a search found; the belief is left as it was where that is improper.
    fn adopt(&mut self, modes: &Modes<N>, data: &[Datum<M>]) -> Result<f64, EstimatorError> {
        let best = modes.ends.first().ok_or(EstimatorError::NotConverged { iterations: 0 })?;
        let problem = self.solver.problem(data, 1.0);
        let peak = Gaussian::new(laplace(best)?, Role::Posterior)?;
        let still = Gaussian::new(posterior(&problem, best)?, Role::Posterior)?;
        let belief = drifted(&still, &self.drifted)?;
        // Laplace: the density at the optimum times the volume of the Gaussian about it.
        let log_root: f64 = peak.factor().diagonal().iter().map(|d| libm::log(*d)).sum();
        let volume = 0.5 * number(N) * libm::log(core::f64::consts::TAU) + log_root;
        let whole = problem.normaliser() - best.cost + volume;
        let gained = whole - self.log_evidence;
        (self.still, self.belief, self.log_evidence) = (still, belief, whole);
        self.modes = modes.ends.iter().take(MOST_MODES).map(|end| end.state).collect();
        Ok(gained)
    }
}

impl<H, const N: usize, const M: usize> Estimator<N, M> for BatchEstimator<H, N, M>
where
    H: MeasurementModel<N, M>,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        let variance = self.drifted + self.motion.drift.map(|d| d * d * dt);
        if variance == self.drifted {
            return Ok(());
        }
        let belief = drifted(&self.still, &variance)?;
        let root = self.still.factor().solve_lower_triangular_unchecked(
            &Covariance::<N>::from_diagonal(&variance.map(libm::sqrt)),
        );
        // The trace bounds the largest share that any direction has.
        if root.norm_squared() > DRIFT_SHARE {
            self.data.clear();
            self.modes.clear();
            self.solver.prior = Some(belief);
            (self.still, self.drifted, self.log_evidence) = (belief, SVector::zeros(), 0.0);
        } else {
            self.drifted = variance;
        }
        self.belief = belief;
        Ok(())
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() && !observation.is_censored() {
            return Ok(Correction::Empty);
        }
        let before = *self.belief.estimate();
        let linear = Ekf::new(RandomWalk::<N>::uniform(0.0), &self.solver.model, before)?;
        let innovation = linear.innovation(observation)?;
        let nis = (!observation.is_empty()).then_some(innovation.nis);
        self.data.push(Datum::new(*observation));
        let mut data = self.data.clone();
        let found =
            self.solver.search(&mut data, &self.starts(), 1.0).map_err(EstimatorError::from);
        match found.and_then(|modes| self.adopt(&modes, &data)) {
            Ok(log_evidence) => {
                Ok(Correction::Fused { nis, log_evidence, effective_sample_size: None })
            }
            Err(error) => {
                self.data.pop();
                Err(error)
            }
        }
    }

    fn estimate(&self) -> Estimate<N> {
        *self.belief.estimate()
    }

    fn quantities(&self) -> [Quantity; M] {
        self.solver.model.quantities()
    }
}

/// A belief about a target that has drifted on since.
fn drifted<const N: usize>(
    still: &Gaussian<N>,
    variance: &SVector<f64, N>,
) -> Result<Gaussian<N>, EstimatorError> {
    let mut estimate = *still.estimate();
    estimate.covariance += Covariance::from_diagonal(variance);
    Gaussian::new(estimate, Role::Posterior)
}

/// What a solver with a prior can fail of.
impl From<BatchError> for EstimatorError {
    fn from(error: BatchError) -> Self {
        match error {
            BatchError::Parameter(error) => Self::Parameter(error),
            BatchError::NotConverged { iterations } => Self::NotConverged { iterations },
            BatchError::Flat { .. } => Self::NotPositiveDefinite { role: Role::Posterior },
            _ => Self::NotFinite { role: Role::Expected },
        }
    }
}
