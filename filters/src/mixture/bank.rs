use alloc::vec::Vec;
use core::mem;

use foxhunt_core::{
    Axis, Correction, Estimate, Estimator, EstimatorError, Observation, Quantity, Role, State,
    parameter::require,
};

use super::{Component, InnovationOf, belief_of, correct, nis_of, normalise, weighted};

/// A weighted sum of estimators that know nothing of one another: a mixture belief.
///
/// Each component goes its own way; an observation multiplies its weight by its evidence
/// p(z | component) (Alspach & Sorenson 1972, eq. 3.9; with one filter for each hypothesis,
/// Magill 1965). The estimate has the mixture's mean and covariance, and as evidence
/// Σ wᵢ p(z | component i).
///
/// - A component that fails is dropped; only where all fail, the bank does, and is as it was.
/// - A component whose own gate keeps an observation out keeps its belief. A gate has no
///   density: the component is weighed by exp(−NIS / 2) over the widest normaliser 1 / √|2π S|
///   of the components that let it in. Where all keep it out, the bank does.
/// - A component lighter than 10⁻⁶ of the heaviest is dropped, see
///   [`with_pruning`](Self::with_pruning).
///
/// ```
/// use foxhunt_core::{Correction, Estimate, Estimator, MeasurementModel, Observation, Pose,
///     Quantity, RandomWalk, State, nalgebra::{Matrix1, Vector1, Vector2}};
/// use foxhunt_filters::{Bank, Ekf};
///
/// /// The distance of the target, in metres.
/// #[derive(Clone)]
/// struct Range;
///
/// impl MeasurementModel<2, 1> for Range {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::linear("x_m")]
///     }
///     fn expected(&self, target: &State<2>, receiver: &Pose) -> Vector1<f64> {
///         Vector1::new((target - receiver.position.xy()).norm())
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // The target is at one of two places.
/// let at = |east| {
///     let prior = Estimate::isotropic(Vector2::new(east, 0.0), 2.0);
///     Ekf::new(RandomWalk::uniform(0.0), Range, prior).map(|filter| (0.5, filter))
/// };
/// let mut bank = Bank::new([at(-20.0)?, at(30.0)?])?.with_innovation(Ekf::innovation);
/// let (receiver, range, variance) = (Pose::default(), Vector1::new(29.0), Matrix1::new(4.0));
/// let correction = bank.update(&Observation::new(0.0, receiver, range, variance)?)?;
/// assert!(matches!(correction, Correction::Fused { nis: Some(_), .. }));
/// assert!(bank.estimate().mean.x > 28.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Bank<E, const N: usize, const M: usize> {
    components: Vec<Component<E>>,
    /// Buffer where a step is prepared, to be taken as a whole or not at all.
    spare: Vec<Component<E>>,
    belief: Estimate<N>,
    axes: [Axis; N],
    log_least: f64,
    innovation: Option<InnovationOf<E, M>>,
}

impl<E: Estimator<N, M> + Clone, const N: usize, const M: usize> Bank<E, N, M> {
    /// A bank of these estimators with weights in proportion to these, over a state without
    /// angles.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when no component is given, a weight is negative or not
    /// finite, or all are zero; [`EstimatorError::NotFinite`] when a component's estimate is not.
    pub fn new(components: impl IntoIterator<Item = (f64, E)>) -> Result<Self, EstimatorError> {
        let components = weighted(components)?;
        let axes = [Axis::Linear; N];
        let belief = prior_of(&components, &axes)?;
        let log_least = libm::log(1e-6);
        let innovation = None;
        Ok(Self { components, spare: Vec::new(), belief, axes, log_least, innovation })
    }

    /// Sets the state's axes, where some components are angles.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::NotFinite`] when the combined estimate is not.
    pub fn with_axes(self, axes: [Axis; N]) -> Result<Self, EstimatorError> {
        let belief = prior_of(&self.components, &axes)?;
        Ok(Self { axes, belief, ..self })
    }

    /// The bank with the NIS of its mixture: the innovation's mean and covariance
    /// over all components, deviations taken about the observation.
    #[must_use]
    pub fn with_innovation(self, innovation: InnovationOf<E, M>) -> Self {
        Self { innovation: Some(innovation), ..self }
    }

    /// Sets the share of the heaviest component below which components are dropped after each
    /// update: 0 drops only what is impossible.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when it is not in [0, 1).
    pub fn with_pruning(self, least: f64) -> Result<Self, EstimatorError> {
        require((0.0..1.0).contains(&least), "pruning", least, "in [0, 1)")?;
        Ok(Self { log_least: libm::log(least), ..self })
    }

    /// The weights, which sum to 1, and the estimators.
    pub fn components(&self) -> impl ExactSizeIterator<Item = (f64, &E)> {
        self.components.iter().map(|c| (c.weight(), &c.estimator))
    }

    /// Returns the number of components.
    #[must_use]
    pub fn len(&self) -> usize {
        self.components.len()
    }

    /// Returns true if there is no component: never.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.components.is_empty()
    }

    pub(super) fn axes(&self) -> &[Axis; N] {
        &self.axes
    }

    /// Puts other components in place of these, if together they are a belief.
    pub(super) fn replace(
        &mut self,
        components: impl IntoIterator<Item = (f64, E)>,
    ) -> Result<(), EstimatorError> {
        let components = weighted(components)?;
        self.belief = belief_of(&components, &self.axes)?;
        self.components = components;
        Ok(())
    }

    /// Takes what was prepared, less what is too light.
    fn take(&mut self) -> Result<(), EstimatorError> {
        let heaviest = self.spare.iter().map(|c| c.log_weight).fold(f64::NEG_INFINITY, f64::max);
        let least = heaviest + self.log_least;
        self.spare.retain(|c| c.log_weight >= least && c.log_weight > f64::NEG_INFINITY);
        let lost = EstimatorError::NotFinite { role: Role::Posterior };
        normalise(&mut self.spare).ok_or(lost)?;
        self.belief = belief_of(&self.spare, &self.axes)?;
        mem::swap(&mut self.components, &mut self.spare);
        Ok(())
    }
}

impl<E: Estimator<N, M> + Clone, const N: usize, const M: usize> Estimator<N, M> for Bank<E, N, M> {
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        if dt <= 0.0 {
            return Ok(());
        }
        self.spare.clone_from(&self.components);
        let mut failure = None;
        self.spare.retain_mut(|c| c.estimator.predict(dt).map_err(|e| failure = Some(e)).is_ok());
        match failure {
            Some(error) if self.spare.is_empty() => Err(error),
            _ => self.take(),
        }
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        let nis = self
            .innovation
            .and_then(|innovation| nis_of(&self.components, innovation, observation));
        self.spare.clone_from(&self.components);
        let outcome = correct(&mut self.spare, observation)?;
        self.take()?;
        Ok(outcome.with_nis(nis))
    }

    fn estimate(&self) -> Estimate<N> {
        self.belief
    }

    fn quantities(&self) -> [Quantity; M] {
        self.components[0].estimator.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        for (share, estimator) in self.components() {
            estimator.visit_samples(&mut |state, weight| visit(state, share * weight));
        }
    }
}

/// The moments of components that nothing has been fused into.
fn prior_of<E: Estimator<N, M>, const N: usize, const M: usize>(
    components: &[Component<E>],
    axes: &[Axis; N],
) -> Result<Estimate<N>, EstimatorError> {
    belief_of(components, axes).map_err(|_| EstimatorError::NotFinite { role: Role::Prior })
}
