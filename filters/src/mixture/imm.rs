//! Interacting multiple models, and the chain that their modes follow.

use alloc::{vec, vec::Vec};
use core::mem;

use foxhunt_core::{
    Axis, Correction, Estimate, Estimator, EstimatorError, Observation, Quantity, Role, State,
    parameter::require,
};

use super::{
    Component, InnovationOf, Reinitialise, belief_of, combine, correct, nis_of, normalise, weighted,
};
use crate::count::number;

/// Markov chain of a target's modes of motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    modes: usize,
    /// Row by row: a stochastic matrix for a step, or a generator in 1 / s.
    matrix: Vec<f64>,
    per: Per,
}

impl Transition {
    /// One change at each `predict` of a positive time step, however long: `matrix[i][j]` is the
    /// probability of mode j after mode i.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when there is no mode, the matrix is not square, an entry is
    /// negative or a row does not sum to 1 (to 10⁻⁹).
    pub fn per_step(matrix: &[&[f64]]) -> Result<Self, EstimatorError> {
        let modes = matrix.len();
        let name = "transition matrix";
        require(modes > 0, name, 0.0, "of at least one mode")?;
        for row in matrix {
            require(row.len() == modes, name, number(row.len()), "square")?;
            for entry in *row {
                require(*entry >= 0.0, name, *entry, "of non-negative entries")?;
            }
            let sum: f64 = row.iter().sum();
            require((sum - 1.0).abs() <= 1e-9, name, sum, "of rows that sum to 1")?;
        }
        Ok(Self { modes, matrix: matrix.concat(), per: Per::Step })
    }

    /// Changes at any time: mode i lasts `seconds[i]` on average, exponentially distributed, and is
    /// followed by each of the others with the same probability. Two steps change as much as one
    /// of their length together.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when there is no mode or a mean is not positive; it may be
    /// infinite.
    pub fn sojourn(seconds: &[f64]) -> Result<Self, EstimatorError> {
        let modes = seconds.len();
        require(modes > 0, "modes", 0.0, "at least 1")?;
        let mut matrix = vec![0.0; modes * modes];
        for (i, mean) in seconds.iter().enumerate() {
            require(*mean > 0.0, "sojourn time", *mean, "positive")?;
            for j in (0..modes).filter(|j| *j != i) {
                matrix[i * modes + j] = 1.0 / mean / number(modes - 1);
                matrix[i * modes + i] -= 1.0 / mean / number(modes - 1);
            }
        }
        Ok(Self { modes, matrix, per: Per::Second })
    }

    /// Returns the number of modes.
    #[must_use]
    pub fn modes(&self) -> usize {
        self.modes
    }

    /// The probability of each mode after each other over `dt` > 0 seconds, row by row.
    pub(super) fn over(&self, dt: f64) -> Vec<f64> {
        match self.per {
            Per::Step => self.matrix.clone(),
            Per::Second => self.exponential(dt),
        }
    }

    /// exp(G Δt) by uniformisation (Jensen 1953): with the fastest rate λ and the stochastic
    /// U = I + G / λ it is Σ e^(−λΔt) (λΔt)ᵏ / k! Uᵏ, a sum of non-negative terms; over
    /// a time in which λ Δt ≤ 1, then squared as often as that was halved.
    fn exponential(&self, dt: f64) -> Vec<f64> {
        let n = self.modes;
        let fastest = (0..n).map(|i| -self.matrix[i * n + i]).fold(0.0, f64::max);
        let identity: Vec<f64> =
            (0..n * n).map(|k| if k / n == k % n { 1.0 } else { 0.0 }).collect();
        if fastest <= 0.0 {
            return identity;
        }
        // After 60 doublings of the shortest sojourn nothing is left of the beginning.
        let mut jumps = libm::fmin(fastest * dt, 1e18);
        let mut doublings = 0;
        while jumps > 1.0 {
            jumps *= 0.5;
            doublings += 1;
        }
        let uniform: Vec<f64> =
            identity.iter().zip(&self.matrix).map(|(one, g)| one + g / fastest).collect();
        let mut term = identity;
        let mut sum = vec![0.0; n * n];
        let mut weight = libm::exp(-jumps);
        // 1 / 20! is below the last place.
        for k in 0..20 {
            sum.iter_mut().zip(&term).for_each(|(s, t)| *s += t * weight);
            term = product(&term, &uniform, n);
            weight *= jumps / number(k + 1);
        }
        // Squaring doubles what a row has lost to rounding.
        rescale(&mut sum, n);
        for _ in 0..doublings {
            sum = product(&sum, &sum, n);
            rescale(&mut sum, n);
        }
        sum
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Per {
    Step,
    Second,
}

/// Interacting multiple models (Blom & Bar-Shalom 1988): one estimator for each mode of motion,
/// and a Markov chain by which the target changes between them.
///
/// At each prediction every estimator goes on from the Gaussian with the moments of what all of
/// them believed, weighed by how probable it is that the target came from their mode to its own
/// (Bar-Shalom, Li & Kirubarajan 2001, §11.6.6). At each update the modes' probabilities are
/// multiplied by their evidence.
///
/// All estimators hold the same state; a still target is a state with velocity under a
/// [`RandomWalk`](foxhunt_core::RandomWalk). A model that fails gets no probability until the chain
/// comes back to it, which begins it again; only where all fail does this one, and is as it was.
/// The effect of a model's own gate is described at [`Bank`](crate::Bank).
///
/// ```
/// use foxhunt_core::{ConstantVelocity, Estimate, Estimator, MeasurementModel, MotionModel,
///     Observation, Pose, Quantity, RandomWalk, State, nalgebra::{Matrix2, Vector2, Vector4}};
/// use foxhunt_filters::{Ekf, Imm, Transition};
///
/// /// The place itself.
/// #[derive(Clone)]
/// struct Place;
///
/// impl MeasurementModel<4, 2> for Place {
///     fn quantities(&self) -> [Quantity; 2] {
///         [Quantity::linear("east_m"), Quantity::linear("north_m")]
///     }
///     fn expected(&self, target: &State<4>, _: &Pose) -> Vector2<f64> {
///         target.xy()
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let prior = Estimate::isotropic(Vector4::zeros(), 10.0);
/// let still = RandomWalk { drift: Vector4::new(0.05, 0.05, 0.01, 0.01) };
/// let moving = ConstantVelocity { spectral_density: 0.09 };
/// // The motions are behind one type, so that the filters are of one type.
/// let motions: [&dyn MotionModel<4>; 2] = [&still, &moving];
/// let [still, moving] = motions.map(|motion| Ekf::new(motion, Place, prior));
/// let chain = Transition::sojourn(&[60.0, 20.0])?;
/// let mut imm = Imm::new([(0.5, still?), (0.5, moving?)], chain)?;
/// for second in 0..20 {
///     imm.predict(1.0)?;
///     let place = Vector2::new(2.0 * f64::from(second), 1.0);
///     let observation = Observation::new(0.0, Pose::default(), place, Matrix2::identity())?;
///     let _ = imm.update(&observation)?;
/// }
/// assert!(imm.probabilities().nth(1) > Some(0.95));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Imm<E, const N: usize, const M: usize> {
    pub(super) models: Vec<Component<E>>,
    /// Buffer where a step is prepared, to be taken as a whole or not at all.
    pub(super) spare: Vec<Component<E>>,
    pub(super) chain: Transition,
    belief: Estimate<N>,
    pub(super) axes: [Axis; N],
    innovation: Option<InnovationOf<E, M>>,
}

impl<E, const N: usize, const M: usize> Imm<E, N, M>
where
    E: Estimator<N, M> + Reinitialise<N> + Clone,
{
    /// The models with their first probabilities, over a state without angles.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when no model is given, a probability is negative or not
    /// finite, all are zero, or the chain has another number of modes;
    /// [`EstimatorError::NotFinite`] when an estimate is not.
    pub fn new(
        models: impl IntoIterator<Item = (f64, E)>,
        chain: Transition,
    ) -> Result<Self, EstimatorError> {
        let models = weighted(models)?;
        let axes = [Axis::Linear; N];
        let alike = models.len() == chain.modes();
        let modes = number(chain.modes());
        require(alike, "modes of the chain", modes, "as many as there are models")?;
        let belief = belief_of(&models, &axes)?;
        Ok(Self { models, spare: Vec::new(), chain, belief, axes, innovation: None })
    }

    /// Sets the state's axes, where some components are angles.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::NotFinite`] when the combined estimate is not.
    pub fn with_axes(self, axes: [Axis; N]) -> Result<Self, EstimatorError> {
        let belief = belief_of(&self.models, &axes)?;
        Ok(Self { axes, belief, ..self })
    }

    /// Adds the NIS of the mixture: the innovation's mean and covariance over all models,
    /// deviations taken about the observation.
    #[must_use]
    pub fn with_innovation(self, innovation: InnovationOf<E, M>) -> Self {
        Self { innovation: Some(innovation), ..self }
    }

    /// The probability of each mode, in their order.
    pub fn probabilities(&self) -> impl ExactSizeIterator<Item = f64> {
        self.models.iter().map(Component::weight)
    }

    /// The estimators, in their order.
    pub fn models(&self) -> impl ExactSizeIterator<Item = &E> {
        self.models.iter().map(|model| &model.estimator)
    }

    /// Makes `spare` the models as they go on after the chain has changed between them.
    fn prepare_mixed(&mut self, dt: f64) -> Result<(), EstimatorError> {
        let modes = self.models.len();
        let over = self.chain.over(dt);
        let now: Vec<(f64, Estimate<N>)> =
            self.models.iter().map(|m| (m.weight(), m.estimator.estimate())).collect();
        self.spare.clone_from(&self.models);
        for (j, model) in self.spare.iter_mut().enumerate() {
            let from = |i: usize| over[i * modes + j] * now[i].0;
            let total: f64 = (0..modes).map(from).sum();
            model.log_weight = libm::log(total);
            // The target does not come to this mode.
            if total <= 0.0 {
                continue;
            }
            let sources = (0..modes).map(|i| (from(i) / total, now[i].1));
            let mixed = combine(sources.filter(|(w, _)| *w > 0.0), &self.axes)?;
            model.estimator.reinitialise(&mixed)?;
        }
        Ok(())
    }

    /// Takes what was prepared.
    pub(super) fn take(&mut self) -> Result<(), EstimatorError> {
        self.belief = belief_of(&self.spare, &self.axes)?;
        mem::swap(&mut self.models, &mut self.spare);
        Ok(())
    }
}

impl<E, const N: usize, const M: usize> Estimator<N, M> for Imm<E, N, M>
where
    E: Estimator<N, M> + Reinitialise<N> + Clone,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        if dt <= 0.0 {
            return Ok(());
        }
        self.prepare_mixed(dt)?;
        let mut failure = EstimatorError::NotFinite { role: Role::Posterior };
        for model in &mut self.spare {
            if let Err(error) = model.estimator.predict(dt) {
                failure = error;
                model.log_weight = f64::NEG_INFINITY;
            }
        }
        normalise(&mut self.spare).ok_or(failure)?;
        self.take()
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        let nis =
            self.innovation.and_then(|innovation| nis_of(&self.models, innovation, observation));
        self.spare.clone_from(&self.models);
        let outcome = correct(&mut self.spare, observation)?;
        self.take()?;
        Ok(outcome.with_nis(nis))
    }

    fn estimate(&self) -> Estimate<N> {
        self.belief
    }

    fn quantities(&self) -> [Quantity; M] {
        self.models[0].estimator.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        for model in self.models.iter().filter(|m| m.log_weight > f64::NEG_INFINITY) {
            let share = model.weight();
            model.estimator.visit_samples(&mut |state, weight| visit(state, share * weight));
        }
    }
}

/// Every model goes on from this belief; their probabilities stay.
impl<E, const N: usize, const M: usize> Reinitialise<N> for Imm<E, N, M>
where
    E: Estimator<N, M> + Reinitialise<N> + Clone,
{
    fn reinitialise(&mut self, estimate: &Estimate<N>) -> Result<(), EstimatorError> {
        self.spare.clone_from(&self.models);
        self.spare.iter_mut().try_for_each(|model| model.estimator.reinitialise(estimate))?;
        self.take()
    }
}

/// Makes every row sum to 1.
fn rescale(matrix: &mut [f64], n: usize) {
    for row in matrix.chunks_mut(n) {
        let sum: f64 = row.iter().sum();
        row.iter_mut().for_each(|p| *p /= sum);
    }
}

fn product(a: &[f64], b: &[f64], n: usize) -> Vec<f64> {
    (0..n * n).map(|k| (0..n).map(|m| a[k / n * n + m] * b[m * n + k % n]).sum()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::abs_diff_eq;

    #[test]
    fn two_modes_relax_exponentially() {
        // P₁₁(t) = π₁ + (1 − π₁) e^(−(a + b) t) with a = 1/10, b = 1/40, π₁ = b /
        // (a + b).
        let chain = Transition::sojourn(&[10.0, 40.0]).expect("positive");
        for dt in [1e-6, 0.5, 8.0, 300.0, 1e300] {
            let over = chain.over(dt);
            let at_rest = 0.2;
            let left = libm::exp(-0.125 * dt);
            let expected =
                [at_rest + 0.8 * left, 0.8 - 0.8 * left, 0.2 - 0.2 * left, 0.8 + 0.2 * left];
            for (p, e) in over.iter().zip(expected) {
                assert!(abs_diff_eq!(*p, e, epsilon = 1e-12), "{dt} s: {over:?}, not {expected:?}");
            }
        }
    }

    #[test]
    fn two_steps_are_one_of_their_length() {
        let chain = Transition::sojourn(&[3.0, 20.0, f64::INFINITY]).expect("positive");
        let two = product(&chain.over(1.3), &chain.over(2.2), 3);
        let one = chain.over(3.5);
        assert!(two.iter().zip(&one).all(|(a, b)| (a - b).abs() < 1e-14), "{two:?} {one:?}");
        assert_eq!(&one[6..], [0.0, 0.0, 1.0], "what lasts for ever");
    }

    #[test]
    fn chains_that_are_none_are_refused() {
        for good in [[[0.9, 0.1], [0.3, 0.7]], [[1.0, 0.0], [0.5, 0.5]]] {
            assert!(Transition::per_step(&[&good[0], &good[1]]).is_ok(), "{good:?}");
        }
        for bad in [[&[0.9, 0.2][..], &[0.3, 0.7]], [&[1.1, -0.1], &[0.0, 1.0]], [&[1.0], &[1.0]]] {
            assert!(Transition::per_step(&bad).is_err(), "{bad:?}");
        }
        assert!(
            Transition::per_step(&[&[f64::NAN]]).is_err() && Transition::per_step(&[]).is_err()
        );
        for bad in [0.0, -1.0, f64::NAN] {
            assert!(Transition::sojourn(&[1.0, bad]).is_err(), "{bad}");
        }
        assert!(Transition::sojourn(&[]).is_err());
    }
}
