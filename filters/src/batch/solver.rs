use alloc::vec::Vec;

use foxhunt_core::{Estimate, MeasurementModel, Observation, Role, State, parameter::positive};
use nalgebra::Vector2;

use super::{
    BatchError, BatchFix, Loss, at_least,
    belief::posterior,
    iteration::End,
    modes::{Modes, NoMode, overhead, search, trap},
    positive_entry,
    problem::{Datum, Problem},
    region::Region,
};
use crate::{Gaussian, count::number};

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
