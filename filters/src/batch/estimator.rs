//! The solver after each observation, and the expansion of its cost between solutions.

use alloc::vec::Vec;
use core::array;

use foxhunt_core::{
    Correction, Covariance, Estimate, Estimator, EstimatorError, MeasurementModel, Observation,
    Quantity, RandomWalk, Role, Smooth, State, parameter::not_negative, visit_cubature_points,
};
use nalgebra::{SVector, Vector2};

use super::{
    BatchError, BatchSolver, Datum, Loss, Problem,
    descent::{End, Modes, hessian},
    solver::{laplace, posterior},
};
use crate::{Ekf, Gaussian, count::number};

/// Largest share of the posterior's variance that the drift within a batch may be.
const DRIFT_SHARE: f64 = 0.01;

/// Largest number of optima kept.
const MOST_MODES: usize = 4;

/// With more components than this times N, the optima are taken for known.
const FEW: usize = 4;

/// With fewer observations the cost changes its shape too much to be expanded.
const FEWEST: usize = 32;

/// Gap (nats) to the best optimum beyond which another does not become the best before all
/// observations are solved for again.
const BEHIND: f64 = 15.0;

/// Largest change of an expansion's curvature from the centre's, as a share of itself. The error of
/// the expansion is of the order of its square.
const STRAIGHT: f64 = 0.05;

/// Distance to either side for the slope of an expansion's curvature, in standard deviations.
const REACH: f64 = 0.02;

/// Rounds of Newton's iteration for the minimum of a cubic, which settles in a few or not at all.
const ROUNDS: usize = 20;

/// A recursive face of [`BatchSolver`]: keeps every observation of a still target, and after each
/// has the maximum a posteriori over all of them.
///
/// Nothing is linearised for good: what came early is linearised again about what was learned
/// later. A solution starts from the optima of the last one, at most four, the prior's mean and,
/// as long as there are few observations, its cubature points; the belief is the Gaussian about the
/// best optimum with the inverse of the information there, or with the prior's spread about it as
/// long as the observations leave a curved direction open, such as the ring of levels from one
/// place.
///
/// Between solutions the cost is that of the last one, expanded to third order about its optima,
/// and that of each new observation about the same places. All observations are solved for again
/// where an optimum has come so far that the curvature there is another one by a twentieth, as soon
/// as there are twice as many, and after each one as long as there are fewer than 32 or a curved
/// direction is open. So a flight takes time in proportion to its observations, and mean and σ
/// equal the whole solution's to about a hundredth of σ.
///
/// Bearings from the optimum's own place are left out of a solution, as in the solver. Which ones
/// is then decided again as soon as there are a tenth more observations; until then a whole
/// solution may leave out others, and differ by a part of σ.
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
    known: Known<N>,
    /// The belief about where the target was when the batch began, and stayed.
    still: Gaussian<N>,
    /// The variance of the drift since then.
    drifted: SVector<f64, N>,
    /// Both together.
    belief: Gaussian<N>,
    /// Laplace's ln p(Z) of the batch.
    log_evidence: f64,
}

impl<H, const N: usize, const M: usize> BatchEstimator<H, N, M>
where
    H: MeasurementModel<N, M>,
{
    /// An estimator that starts from `prior`, with a Gaussian loss, of a target that stays but for
    /// a drift.
    ///
    /// # Errors
    ///
    /// An error when the prior is not finite or its covariance not symmetric and positive definite;
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
            known: Known::none(&prior),
            still: prior,
            drifted: SVector::zeros(),
            belief: prior,
            log_evidence: 0.0,
        })
    }

    /// Replaces the loss.
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
        let mut starts = self.known.optima.clone();
        let Some(prior) = &self.solver.prior else { return starts };
        starts.push(*prior.mean());
        if self.data.len() * M <= FEW * N {
            visit_cubature_points(prior.estimate(), &mut |x, _| starts.push(*x));
        }
        starts
    }

    /// The solution by the expansions about the last one's optima, where they suffice for the
    /// newest observation.
    fn follow(&self) -> Option<Solution<N>> {
        let (newest, rest) = self.data.split_last()?;
        if self.known.expansions.is_empty() || rest.len() >= self.known.lasts {
            return None;
        }
        let own = self.solver.problem(core::slice::from_ref(newest), 1.0);
        let own = Problem { prior: None, ..own };
        let mut known = self.known.clone();
        known.normaliser += newest.normaliser();
        known.expansions.iter_mut().for_each(|expansion| expansion.add(&own));
        let ends: Option<Vec<End<N>>> = known.expansions.iter().map(Expansion::minimum).collect();
        let best = ends?.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost))?;
        let still = laplace(&best).ok()?;
        let place = newest.observation.receiver().position.xy();
        if own.has_angle(newest) && known.is_near(&place) {
            known.near.push((place, false));
        }
        let same = known.leaves_out_the_same(&still.position());
        same.then_some(Solution { best, still, known })
    }

    /// The solution over all observations.
    fn solve(&self) -> Result<Solution<N>, EstimatorError> {
        let mut data = self.data.clone();
        let Modes { mut ends, .. } = self.solver.search(&mut data, &self.starts(), 1.0)?;
        ends.truncate(MOST_MODES);
        let optima = ends.iter().map(|end| end.state).collect();
        let best = ends.first().ok_or(EstimatorError::NotConverged { iterations: 0 })?.clone();
        let problem = self.solver.problem(&data, 1.0);
        let peak = laplace(&best)?;
        let still = posterior(&problem, &best)?;
        ends.retain(|end| end.cost < best.cost + BEHIND && data.len() >= FEWEST && still == peak);
        let mut known = Known {
            optima,
            expansions: ends.iter().map(|end| Expansion::new(&problem, end)).collect(),
            normaliser: problem.normaliser(),
            lasts: 2 * data.len(),
            best: peak.position(),
            near: Vec::new(),
        };
        for (whole, used) in self.data.iter().zip(&data) {
            let place = whole.observation.receiver().position.xy();
            if problem.has_angle(whole) && known.is_near(&place) {
                known.near.push((place, !problem.has_angle(used)));
            }
        }
        if known.near.iter().any(|(_, out)| *out) {
            known.lasts = data.len() + data.len() / 10;
        }
        Ok(Solution { best, still, known })
    }

    /// Takes over a solution, and returns what it adds to the log-evidence; the belief is left as
    /// it was where that is improper.
    fn adopt(&mut self, solution: Solution<N>) -> Result<f64, EstimatorError> {
        let Solution { best, still, known } = solution;
        let peak = Gaussian::new(laplace(&best)?, Role::Posterior)?;
        let still = Gaussian::new(still, Role::Posterior)?;
        let belief = drifted(&still, &self.drifted)?;
        // Laplace: the density at the optimum times the volume of the Gaussian about it.
        let log_root: f64 = peak.factor().diagonal().iter().map(|d| libm::log(*d)).sum();
        let volume = 0.5 * number(N) * libm::log(core::f64::consts::TAU) + log_root;
        let whole = known.normaliser - best.cost + volume;
        let gained = whole - self.log_evidence;
        (self.still, self.belief, self.log_evidence) = (still, belief, whole);
        self.known = known;
        Ok(gained)
    }
}

/// Refused: a batch solves for one place from all observations, earlier and later.
impl<H, const N: usize, const M: usize> Smooth<N, M> for BatchEstimator<H, N, M>
where
    H: MeasurementModel<N, M>,
{
    fn smooth(&mut self, _: &Self, _: f64) -> Result<(), EstimatorError> {
        Err(EstimatorError::Unsupported { what: "smoothing a batch" })
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
            self.known = Known::none(&belief);
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
        let solution = self.follow().map_or_else(|| self.solve(), Ok);
        match solution.and_then(|solution| self.adopt(solution)) {
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

/// Solution of an update.
struct Solution<const N: usize> {
    best: End<N>,
    /// The belief about a target that stays.
    still: Estimate<N>,
    known: Known<N>,
}

/// Knowledge that a solution leaves for the next one.
#[derive(Clone, Debug)]
struct Known<const N: usize> {
    /// The optima when all observations were last solved for, the best first.
    optima: Vec<State<N>>,
    /// The cost about optima that may become the best; empty where it is not to be relied upon.
    expansions: Vec<Expansion<N>>,
    /// Sum of the normalisers, which turns the cost into a log-density.
    normaliser: f64,
    /// Number of observations at which all are solved for again.
    lasts: usize,
    /// The place of the best optimum then.
    best: Estimate<2>,
    /// Places near there where observations had angles, and true where these were left out.
    near: Vec<(Vector2<f64>, bool)>,
}

impl<const N: usize> Known<N> {
    fn none(prior: &Gaussian<N>) -> Self {
        Self {
            optima: Vec::new(),
            expansions: Vec::new(),
            normaliser: 0.0,
            lasts: 0,
            best: prior.estimate().position(),
            near: Vec::new(),
        }
    }

    /// Returns true if an observation at a place may come to lie within a standard deviation of the
    /// optimum, as long as that stays within one.
    fn is_near(&self, place: &Vector2<f64>) -> bool {
        (place - self.best.mean).norm_squared() < 4.0 * self.best.covariance.trace()
    }

    /// Returns true if the same angles would be left out at another optimum.
    fn leaves_out_the_same(&self, other: &Estimate<2>) -> bool {
        let within = |place: &Vector2<f64>, of: &Estimate<2>| {
            (place - of.mean).norm_squared() < of.covariance.trace()
        };
        let same = |(place, out): &(Vector2<f64>, bool)| within(place, other) == *out;
        within(&other.mean, &self.best) && self.near.iter().all(same)
    }
}

/// A cost about one of its optima, to third order: what a new observation adds takes no second
/// look at those before it.
#[derive(Clone, Debug)]
struct Expansion<const N: usize> {
    centre: State<N>,
    cost: f64,
    gradient: State<N>,
    curvature: Covariance<N>,
    /// Change of the curvature along each axis.
    bend: [Covariance<N>; N],
}

impl<const N: usize> Expansion<N> {
    /// Expands a cost about the end of a descent of it.
    fn new<H, const M: usize>(problem: &Problem<'_, H, N, M>, end: &End<N>) -> Self
    where
        H: MeasurementModel<N, M>,
    {
        let centre = end.state;
        let curvature = end.information;
        let bend = bend(problem, &centre, &curvature);
        Self { centre, cost: end.cost, gradient: State::zeros(), curvature, bend }
    }

    /// Adds another cost.
    fn add<H, const M: usize>(&mut self, other: &Problem<'_, H, N, M>)
    where
        H: MeasurementModel<N, M>,
    {
        let local = other.local(&self.centre);
        let bend = bend(other, &self.centre, &self.curvature);
        self.curvature += hessian(other, &self.centre, &self.curvature).0;
        self.cost += local.cost;
        self.gradient += local.gradient;
        self.bend.iter_mut().zip(bend).for_each(|(sum, bend)| *sum += bend);
    }

    /// Returns the minimum; `None` where that is so far from the centre that the expansion errs.
    fn minimum(&self) -> Option<End<N>> {
        let mut step = State::<N>::zeros();
        for iterations in (1..).take(ROUNDS) {
            let change = self.change(&step);
            let slope = self.gradient + (self.curvature + change * 0.5) * step;
            let information = self.curvature + change;
            let shift = information.cholesky()?.solve(&slope);
            step -= shift;
            if slope.dot(&shift) > 1e-20 {
                continue;
            }
            let change = self.change(&step);
            let information = self.curvature + change;
            if self.share(&change)? > STRAIGHT {
                return None;
            }
            let bent = self.curvature * 0.5 + change / 6.0;
            let cost = self.cost + self.gradient.dot(&step) + step.dot(&(bent * step));
            let state = self.centre + step;
            return Some(End { state, cost, information, iterations, refused: None });
        }
        None
    }

    /// Returns the curvature's change over a step.
    fn change(&self, step: &State<N>) -> Covariance<N> {
        self.bend.iter().zip(step.iter()).map(|(bend, step)| bend * *step).sum()
    }

    /// Returns the size of a change in units of the curvature.
    fn share(&self, change: &Covariance<N>) -> Option<f64> {
        let factor = self.curvature.cholesky()?.unpack();
        let half = factor.solve_lower_triangular(change)?;
        Some(factor.solve_lower_triangular(&half.transpose())?.norm())
    }
}

/// Converts the errors of a solver with a prior.
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

/// A belief about a target that has drifted on since.
fn drifted<const N: usize>(
    still: &Gaussian<N>,
    variance: &SVector<f64, N>,
) -> Result<Gaussian<N>, EstimatorError> {
    let mut estimate = *still.estimate();
    estimate.covariance += Covariance::from_diagonal(variance);
    Gaussian::new(estimate, Role::Posterior)
}

/// The cost's third derivatives, by central differences of the second ones.
fn bend<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    x: &State<N>,
    information: &Covariance<N>,
) -> [Covariance<N>; N]
where
    H: MeasurementModel<N, M>,
{
    array::from_fn(|i| {
        let size = information[(i, i)];
        let step = REACH / libm::sqrt(if size > 0.0 { size } else { 1.0 });
        let mut low = *x;
        let mut high = *x;
        low[i] -= step;
        high[i] += step;
        let change = hessian(problem, &high, information).0 - hessian(problem, &low, information).0;
        change / (high[i] - low[i])
    })
}
