use alloc::vec::Vec;
use core::mem;

use foxhunt_core::{
    Axis, Correction, Estimate, Estimator, EstimatorError, Observation, Quantity, Role, State,
    parameter::require,
};

use super::{
    Reinitialise, Transition,
    component::{self, Component, InnovationOf, Outcome},
    moments,
};
use crate::count::number;

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
/// let moving = ConstantVelocity { acceleration_density: 0.3 };
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
    models: Vec<Component<E>>,
    /// Buffer where a step is prepared, to be taken as a whole or not at all.
    spare: Vec<Component<E>>,
    chain: Transition,
    belief: Estimate<N>,
    axes: [Axis; N],
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
        let models = component::weighted(models)?;
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
            let mixed = moments::combine(sources.filter(|(w, _)| *w > 0.0), &self.axes)?;
            model.estimator.reinitialise(&mixed)?;
        }
        Ok(())
    }

    /// Takes what was prepared.
    fn take(&mut self) -> Result<(), EstimatorError> {
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
        component::normalise(&mut self.spare).ok_or(failure)?;
        self.take()
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        let nis = self
            .innovation
            .and_then(|innovation| component::nis(&self.models, innovation, observation));
        self.spare.clone_from(&self.models);
        let corrected = component::correct(&mut self.spare, observation)?;
        self.take()?;
        Ok(match corrected {
            Outcome::Fused(log_evidence) => {
                Correction::Fused { nis, log_evidence, effective_sample_size: None }
            }
            Outcome::Rejected { nis, limit } => Correction::Rejected { nis, limit },
        })
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

fn belief_of<E: Estimator<N, M>, const N: usize, const M: usize>(
    models: &[Component<E>],
    axes: &[Axis; N],
) -> Result<Estimate<N>, EstimatorError> {
    moments::combine(component::estimates(models), axes)
}
