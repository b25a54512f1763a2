//! The solver, its result, and the Gaussian that is reported of an optimum.

use alloc::vec::Vec;

use foxhunt_core::{
    Covariance, Estimate, MeasurementModel, Observation, Role, State, parameter::positive,
};
use nalgebra::Vector2;

use super::{
    BatchError, Datum, Loss, Problem, at_least,
    descent::{
        End, LEAST_RCOND, Modes, NoMode, Region, overhead, reciprocal_condition, search, trap,
    },
    positive_entry,
};
use crate::{Gaussian, count::number};

/// A direction is open where the observations hold less than this share of the prior's
/// information.
const OPEN: f64 = 0.1;

/// The observations are curved along an open direction where one standard deviation of the prior
/// costs more than this on either side; a quadratic cost would rise by half of [`OPEN`].
const CURVED: f64 = 0.25;

/// Maximum likelihood, or with a prior maximum a posteriori, over all observations of a still
/// target at once: nonlinear least squares by Levenberg and Marquardt, from several starts.
///
/// Any [`MeasurementModel`] serves by its `expected`, `jacobian` and `residual`; the noise is the
/// observations' own, under a [`Loss`]. (The model's own `log_likelihood` is used only for
/// components below a limit, `Observation::below`.) The covariance is the inverse of the observed
/// information, the Hessian at the optimum (Efron & Hinkley 1978), which tends to the Cramér-Rao
/// bound.
///
/// A bearing from within a standard deviation of the optimum holds less than it seems to: its
/// density has a spike at its own receiver, whatever its value, and the information there is
/// without bounds. Its angles are left out of the solution, and [`BatchFix::silenced`] lists it.
///
/// A likelihood without an optimum is an error and never a fix far away: without a prior the
/// iterates must stay in a region about the receivers and starts, a thousand times as wide as they
/// are apart unless [`with_reach`](Self::with_reach) sets another limit.
///
/// ```
/// use foxhunt_core::{MeasurementModel, Observation, Pose, Quantity, State,
///     nalgebra::{Matrix1, Vector1, Vector2}};
/// use foxhunt_filters::BatchSolver;
///
/// struct BearingOnly;
///
/// impl MeasurementModel<2, 1> for BearingOnly {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::BEARING]
///     }
///     fn expected(&self, target: &State<2>, receiver: &Pose) -> Vector1<f64> {
///         let (east, north) = (target.x - receiver.position.x, target.y - receiver.position.y);
///         Vector1::new(f64::atan2(north, east))
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let bearings = [(0.0, 0.80), (50.0, 1.57), (100.0, 2.34)];
/// let observations = bearings
///     .map(|(east, bearing)| {
///         let (z, noise) = (Vector1::new(bearing), Matrix1::new(0.0025));
///         Observation::new(0.0, Pose::at(east, 0.0, 20.0), z, noise)
///     })
///     .into_iter()
///     .collect::<Result<Vec<_>, _>>()?;
/// let fix = BatchSolver::new(BearingOnly).solve(&observations, &[Vector2::new(40.0, 20.0)])?;
/// assert!((fix.estimate.mean - Vector2::new(50.0, 51.3)).norm() < 1.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct BatchSolver<H, const N: usize> {
    pub(super) model: H,
    pub(super) prior: Option<Gaussian<N>>,
    loss: Loss,
    reach_m: Option<f64>,
    most_iterations: u32,
    inflates: bool,
}

impl<H, const N: usize> BatchSolver<H, N> {
    /// Maximum likelihood with a Gaussian loss, at most 200 iterations from each start.
    #[must_use]
    pub fn new(model: H) -> Self {
        let prior = None;
        let loss = Loss::Gaussian;
        let reach_m = None;
        Self { model, prior, loss, reach_m, most_iterations: 200, inflates: false }
    }

    /// Sets a Gaussian prior.
    ///
    /// # Errors
    ///
    /// [`BatchError::Improper`] when it is not finite or not positive definite.
    pub fn with_prior(self, prior: Estimate<N>) -> Result<Self, BatchError> {
        let prior = Gaussian::new(prior, Role::Prior);
        Ok(self.with_gaussian(prior.map_err(|_| BatchError::Improper { what: "prior" })?))
    }

    pub(super) fn with_gaussian(self, prior: Gaussian<N>) -> Self {
        Self { prior: Some(prior), ..self }
    }

    /// Replaces the loss.
    ///
    /// # Errors
    ///
    /// [`BatchError::Parameter`] when its parameter is not a positive number.
    pub fn with_loss(self, loss: Loss) -> Result<Self, BatchError> {
        Ok(Self { loss: loss.check()?, ..self })
    }

    /// Sets the largest distance of the target from the receivers, in metres.
    ///
    /// # Errors
    ///
    /// [`BatchError::Parameter`] when it is not a positive number.
    pub fn with_reach(self, reach_m: f64) -> Result<Self, BatchError> {
        Ok(Self { reach_m: Some(positive("reach_m", reach_m)?), ..self })
    }

    /// Sets the limit to the iterations from each start.
    #[must_use]
    pub fn with_most_iterations(self, most_iterations: u32) -> Self {
        Self { most_iterations, ..self }
    }

    /// Inflates small sigmas: where the residuals are larger, multiplies all covariances of the
    /// observations by the reduced χ² of the first solution and solves again; smaller residuals
    /// change nothing.
    ///
    /// That suits sigmas that are wrong by one common factor. It does not suit errors that are
    /// alike in neighbouring observations.
    #[must_use]
    pub fn with_inflation(self) -> Self {
        Self { inflates: true, ..self }
    }

    /// The best estimate that the starts lead to. A prior's mean is a start of its own.
    ///
    /// # Errors
    ///
    /// [`BatchError::TooFew`] without a component or, but for a prior, with fewer than the
    /// state has, or without a start; [`BatchError::Improper`] when a model is not finite;
    /// [`BatchError::Flat`], [`BatchError::RanAway`] and [`BatchError::NotConverged`] when there is
    /// no optimum or it was not found.
    pub fn solve<const M: usize>(
        &self,
        observations: &[Observation<M>],
        starts: &[State<N>],
    ) -> Result<BatchFix<N>, BatchError>
    where
        H: MeasurementModel<N, M>,
    {
        self.solve_counted(observations, &[], starts)
    }

    /// Solves where each observation stands for a number of independent ones, such as a share of
    /// one where neighbours err alike: its log-likelihood is multiplied by that. An observation
    /// without a count counts for one.
    ///
    /// # Errors
    ///
    /// As [`solve`](Self::solve); [`BatchError::Value`] for a count that is not positive.
    pub fn solve_counted<const M: usize>(
        &self,
        observations: &[Observation<M>],
        counts: &[f64],
        starts: &[State<N>],
    ) -> Result<BatchFix<N>, BatchError>
    where
        H: MeasurementModel<N, M>,
    {
        let mut data: Vec<_> = observations.iter().copied().map(Datum::new).collect();
        for (index, (datum, count)) in data.iter_mut().zip(counts).enumerate() {
            datum.count = positive_entry("the count", index, *count)?;
        }
        let mut starts = starts.to_vec();
        starts.extend(self.prior.as_ref().map(Gaussian::mean));
        let problem = self.problem(&data, 1.0);
        let components = problem.components() + problem.silent();
        at_least("components", components, if self.prior.is_some() { 1 } else { N })?;
        let mut modes = self.search(&mut data, &starts, 1.0)?;
        let mut scale = 1.0;
        let agreeing_starts = (modes.agreeing, starts.len());
        let mut reduced = misfit(&self.problem(&data, scale), &best(&modes).state);
        if let Some(factor) = reduced.filter(|r| self.inflates && *r > 1.0) {
            scale = factor;
            starts = modes.ends.iter().map(|end| end.state).collect();
            modes = self.search(&mut data, &starts, scale)?;
            reduced = misfit(&self.problem(&data, scale), &best(&modes).state);
        }
        let problem = self.problem(&data, scale);
        let optimum = best(&modes);
        let rivals = modes.ends.iter().skip(1);
        let estimate = posterior(&problem, optimum)?;
        // A rival in a direction that is open to it has the spread of the optimum.
        let about = |end: &End<N>| {
            posterior(&problem, end).unwrap_or(Estimate { mean: end.state, ..estimate })
        };
        let silenced = data.iter().zip(observations).enumerate();
        Ok(BatchFix {
            rival_estimates: rivals.clone().map(about).collect(),
            estimate,
            log_posterior: problem.normaliser() - optimum.cost,
            reduced_chi_squared: reduced,
            weights: problem.weights(&optimum.state).map(|(weight, _)| weight).collect(),
            silenced: silenced
                .filter(|(_, (h, o))| h.observation.len() < o.len())
                .map(|s| s.0)
                .collect(),
            rivals: rivals.map(|end| (end.state, optimum.cost - end.cost)).collect(),
            iterations: optimum.iterations,
            agreeing_starts,
        })
    }

    pub(super) fn problem<'a, const M: usize>(
        &'a self,
        data: &'a [Datum<M>],
        scale: f64,
    ) -> Problem<'a, H, N, M> {
        let Self { model, prior, loss, .. } = self;
        Problem { model, data, prior: prior.as_ref(), loss: *loss, scale }
    }

    /// The optima; strikes out of `data` the angles taken at the optimum's own place.
    pub(super) fn search<const M: usize>(
        &self,
        data: &mut [Datum<M>],
        starts: &[State<N>],
        scale: f64,
    ) -> Result<Modes<N>, BatchError>
    where
        H: MeasurementModel<N, M>,
    {
        let region = self.region(data, starts);
        loop {
            let problem = self.problem(data, scale);
            let found = search(&problem, starts, region, self.most_iterations);
            let trapping = match &found {
                Ok(modes) => overhead(&problem, best(modes)),
                Err(NoMode { error: BatchError::NotConverged { .. }, lowest: Some(lowest) }) => {
                    trap(&problem, lowest)
                }
                Err(_) => None,
            };
            let Some(index) = trapping else { return found.map_err(|none| none.error) };
            data[index] = data[index].without_angles(&self.model);
        }
    }

    fn region<const M: usize>(&self, data: &[Datum<M>], starts: &[State<N>]) -> Region {
        const { assert!(N >= 2, "a state holds East and North") };
        let receivers = data.iter().map(|h| h.observation.receiver().position.xy());
        let places: Vec<Vector2<f64>> =
            receivers.chain(starts.iter().map(|x| x.fixed_rows::<2>(0).into_owned())).collect();
        let centre = places.iter().sum::<Vector2<f64>>() / number(places.len()).max(1.0);
        let widest = places.iter().map(|place| (place - centre).norm()).fold(1.0, f64::max);
        let default = if self.prior.is_some() { f64::INFINITY } else { 1000.0 * widest };
        Region { centre, limit: self.reach_m.unwrap_or(default) }
    }
}

/// The result of a [`BatchSolver`].
#[derive(Clone, Debug, PartialEq)]
pub struct BatchFix<const N: usize> {
    /// The optimum, and the inverse of the information there. With a prior, and observations that
    /// leave a curved direction open, such as the ring of levels from one place, the covariance is
    /// the prior's spread about the optimum instead. Without a prior such observations are refused
    /// as [`BatchError::Flat`].
    pub estimate: Estimate<N>,
    /// ln p(Z | x̂) + ln p(x̂), the second where there is a prior. With a robust loss the
    /// normaliser is still the Gaussian's, so compare it among fixes of one loss only.
    pub log_posterior: f64,
    /// The residuals' misfit: Σ w q / (n − N) with n the components present and q an
    /// observation's squared residual in its own standard deviations. About 1 where the sigmas are
    /// right; `None` where n ≤ N.
    pub reduced_chi_squared: Option<f64>,
    /// Weight of each observation, in the order in which they came.
    pub weights: Vec<f64>,
    /// The observations whose angles were left out, since they were made at the optimum's own
    /// place.
    pub silenced: Vec<usize>,
    /// The other optima that starts led to, each with its ln p(Z | x) p(x) less that of the best:
    /// where it is near 0, the observations do not distinguish the two.
    pub rivals: Vec<(State<N>, f64)>,
    /// The rivals in the same order, each with the covariance about itself.
    pub rival_estimates: Vec<Estimate<N>>,
    /// Number of iterations from the winning start.
    pub iterations: u32,
    /// Number of starts that settled in the same optimum, and number of all starts.
    pub agreeing_starts: (usize, usize),
}

/// The end with the least cost.
fn best<const N: usize>(modes: &Modes<N>) -> &End<N> {
    modes.ends.first().expect("a search that finds nothing is an error")
}

/// Σ w q / (n − N); `None` where n ≤ N.
fn misfit<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    x: &State<N>,
) -> Option<f64>
where
    H: MeasurementModel<N, M>,
{
    let spare = problem.components().checked_sub(N).filter(|spare| *spare > 0)?;
    let sum: f64 = problem.weights(x).map(|(weight, q)| weight * q).sum();
    Some(sum / number(spare))
}

/// The optimum with the inverse of its information.
pub(super) fn laplace<const N: usize>(end: &End<N>) -> Result<Estimate<N>, BatchError> {
    let factor = end.information.cholesky().ok_or(BatchError::Flat { rcond: 0.0 })?;
    let covariance = factor.solve(&Covariance::<N>::identity());
    Ok(Estimate { mean: end.state, covariance: (covariance + covariance.transpose()) * 0.5 })
}

/// The optimum with the inverse of its information; or, where the observations leave a direction
/// open along which they are curved, with the prior's spread about the optimum, P + δ δᵀ with
/// δ the optimum less the prior's mean.
///
/// Levels that were all taken at one place have a ring for a likelihood. The information at its
/// optimum knows the range, and the tangent, which leaves the ring: the target, anywhere on the
/// ring, would be thousands of such standard deviations away. The prior's spread covers it.
///
/// # Errors
///
/// [`BatchError::Flat`] where such a direction is open and there is no prior.
pub(super) fn posterior<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    end: &End<N>,
) -> Result<Estimate<N>, BatchError>
where
    H: MeasurementModel<N, M>,
{
    let estimate = laplace(end)?;
    let Some(prior) = problem.prior else {
        // The Hessian of such a ring is rounding along it; the outer products are exactly singular.
        let rcond = reciprocal_condition(&problem.local(&end.state).information);
        return if rcond < LEAST_RCOND { Err(BatchError::Flat { rcond }) } else { Ok(estimate) };
    };
    if !is_curved(problem, prior, &end.state) {
        return Ok(estimate);
    }
    let shift = end.state - prior.mean();
    let covariance = prior.estimate().covariance + shift * shift.transpose();
    Ok(Estimate { covariance, ..estimate })
}

/// Returns true if the observations leave a direction open along which their cost is not quadratic.
fn is_curved<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    prior: &Gaussian<N>,
    x: &State<N>,
) -> bool
where
    H: MeasurementModel<N, M>,
{
    let alone = Problem { prior: None, ..*problem };
    let here = alone.local(x);
    // In units of the prior the posterior's covariance is (I + A)⁻¹; its largest eigenvalue is
    // that of the direction that is the most open.
    let information = prior.factor().transpose() * here.information * prior.factor();
    let Some(factor) = (Covariance::<N>::identity() + information).cholesky() else { return false };
    // Of uneven entries, so that it is along no axis and across none.
    let mut direction = State::<N>::from_fn(|i, _| 1.0 + 0.37 * number(i));
    for _ in 0..50 {
        direction = factor.solve(&direction).normalize();
    }
    let share = direction.dot(&(information * direction));
    if share.is_nan() || share >= OPEN {
        return false;
    }
    let step = prior.factor() * direction;
    let rise = |side: State<N>| alone.cost(&side) - here.cost;
    rise(x + step) > CURVED && rise(x - step) > CURVED
}
