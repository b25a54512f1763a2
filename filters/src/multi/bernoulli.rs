//! Existence and place of one transmitter that may be absent.

use foxhunt_core::{
    Axis, Estimate, Estimator, EstimatorError, Observation, State,
    parameter::{ParameterError, not_negative, probability},
};

use super::{
    Associations, Density, Detection, Reduction, proper,
    scan::{Before, condition},
};

/// Appearance and disappearance of a transmitter, as a Markov chain of two states in continuous
/// time: it is switched on at the rate β while it is absent, and off at the rate δ while it is
/// there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lifetime {
    birth: f64,
    death: f64,
}

impl Lifetime {
    /// A chain with these rates of birth and death, in 1/s; 0 and 0 (the default) is a transmitter
    /// that stays as it is.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] when a rate is negative or not finite.
    pub fn new(birth: f64, death: f64) -> Result<Self, ParameterError> {
        not_negative("the rate of birth", birth)?;
        not_negative("the rate of death", death)?;
        Ok(Self { birth, death })
    }

    /// The probabilities that an absent transmitter is there `dt` seconds later, and that a present
    /// one still is.
    #[must_use]
    pub fn transition(&self, dt: f64) -> [f64; 2] {
        let rate = self.birth + self.death;
        if rate <= 0.0 {
            return [0.0, 1.0];
        }
        let changed = -libm::expm1(-rate * dt) / rate;
        [self.birth * changed, 1.0 - self.death * changed]
    }
}

/// The Bernoulli filter (Ristic, Vo, Vo & Farina 2013): the probability that one transmitter is
/// there at all, and its density if it is, over any estimator.
///
/// Each scan holds any number of observations, one of which at most is the transmitter's; the
/// others are clutter. The density is a sum over association histories, each with a copy of the
/// estimator ([`Reduction`]).
///
/// ```
/// use foxhunt_core::{Estimate, MeasurementModel, Observation, Pose, Quantity, RandomWalk, State,
///     nalgebra::{Matrix1, Vector1, Vector2}};
/// use foxhunt_filters::{Ekf, multi::{BernoulliFilter, Detection}};
///
/// /// The distance of the target, in metres.
/// #[derive(Clone)]
/// struct Range;
///
/// impl MeasurementModel<2, 1> for Range {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::RANGE]
///     }
///     fn expected(&self, target: &State<2>, receiver: &Pose) -> Vector1<f64> {
///         Vector1::new((target - receiver.position.xy()).norm())
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let prior = Estimate::isotropic(Vector2::new(50.0, 0.0), 10.0);
/// let ekf = Ekf::new(RandomWalk::uniform(0.1), Range, prior)?;
/// let detection = Detection::new(0.9, 0.5, [200.0])?;
/// let mut filter = BernoulliFilter::new(0.5, ekf, detection)?;
/// let range = |value| {
///     Observation::new(0.0, Pose::default(), Vector1::new(value), Matrix1::new(1.0))
/// };
/// filter.update(&[])?;
/// assert!(filter.existence() < 0.1);
/// for _ in 0..4 {
///     filter.predict(1.0)?;
///     filter.update(&[range(52.0)?, range(170.0)?])?;
/// }
/// assert!(filter.existence() > 0.95);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct BernoulliFilter<E, const N: usize, const M: usize> {
    existence: f64,
    density: Density<E>,
    birth: E,
    detection: Detection<M>,
    lifetime: Lifetime,
    reduction: Reduction<E, N>,
    axes: [Axis; N],
    belief: Estimate<N>,
}

impl<E, const N: usize, const M: usize> BernoulliFilter<E, N, M>
where
    E: Estimator<N, M> + Clone,
{
    /// A transmitter that is there with the probability `existence`, with the density of `prior` if
    /// it is; it neither appears nor disappears, and the state has no angles.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when `existence` is not a probability;
    /// [`EstimatorError`] when the estimate of `prior` is not finite and positive definite.
    pub fn new(existence: f64, prior: E, detection: Detection<M>) -> Result<Self, EstimatorError> {
        probability("the probability of existence", existence)?;
        let belief = proper(prior.estimate())?;
        Ok(Self {
            existence,
            density: Density::new(prior.clone()),
            birth: prior,
            detection,
            lifetime: Lifetime::default(),
            reduction: Reduction::default(),
            axes: [Axis::Linear; N],
            belief,
        })
    }

    /// Sets appearance and disappearance. A transmitter that appears has the density of the prior.
    #[must_use]
    pub fn with_lifetime(self, lifetime: Lifetime) -> Self {
        Self { lifetime, ..self }
    }

    /// Sets the rules that keep the number of association histories small.
    #[must_use]
    pub fn with_reduction(self, reduction: Reduction<E, N>) -> Self {
        Self { reduction, ..self }
    }

    /// Sets the state's axes, where some components are angles.
    #[must_use]
    pub fn with_axes(self, axes: [Axis; N]) -> Self {
        Self { axes, ..self }
    }

    /// Carries existence and density `dt` seconds forward (Ristic et al. 2013, eq. 28 and 29).
    ///
    /// # Errors
    ///
    /// [`EstimatorError::TimeStep`] for a `dt` that is negative or not finite, and the estimators'
    /// errors. On any error the belief is left as it was.
    pub fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        if dt <= 0.0 {
            return Ok(());
        }
        let [born, survived] = self.lifetime.transition(dt);
        let born = (1.0 - self.existence) * born;
        let survived = self.existence * survived;
        let mut density = self.density.clone();
        density.predict(dt)?;
        if born > 0.0 {
            density =
                Density::sum([(born, Density::new(self.birth.clone())), (survived, density)])?;
            density.reduce(&self.reduction, &self.axes)?;
        }
        self.take(born + survived, density)
    }

    /// Conditions existence and density on the observations of one scan, of which there may be
    /// none (Ristic et al. 2013, eq. 32 and 33).
    ///
    /// The result has one track, the transmitter.
    ///
    /// # Errors
    ///
    /// The errors of reduction. On any error the belief is left as it was.
    pub fn update(
        &mut self,
        observations: &[Observation<M>],
    ) -> Result<Associations, EstimatorError> {
        let before = [Before { existence: self.existence, density: &self.density }];
        let (after, associations) =
            condition(&before, observations, &self.detection, &self.reduction, &self.axes)?;
        for track in after {
            self.take(track.existence, track.density)?;
        }
        Ok(associations)
    }

    /// Conditions existence and density on silence: an observation that holds nothing but a limit
    /// ([`Observation::below`]). The probability that a transmitter stays below the limit is the
    /// evidence of the estimator's model; a model without limits leaves everything as it was.
    ///
    /// # Errors
    ///
    /// The estimators' errors. On any error the belief is left as it was.
    pub fn update_silent(&mut self, silence: &Observation<M>) -> Result<(), EstimatorError> {
        let mut density = self.density.clone();
        let log_silent = density.condition(silence)?;
        density.reduce(&self.reduction, &self.axes)?;
        let present = self.existence * libm::exp(log_silent);
        let either = present + 1.0 - self.existence;
        // Certain existence stays certain, however improbable the silence.
        let existence = if either > 0.0 { present / either } else { self.existence };
        self.take(existence, density)
    }

    /// Probability that the transmitter is there.
    #[must_use]
    pub fn existence(&self) -> f64 {
        self.existence
    }

    /// Mean and covariance of the transmitter's state, if it is there.
    #[must_use]
    pub fn estimate(&self) -> Estimate<N> {
        self.belief
    }

    /// Calls `visit` with states and weights that stand for the density of the transmitter, if it
    /// is there; the weights sum to 1.
    pub fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        self.density.visit_samples(visit);
    }

    fn take(&mut self, existence: f64, density: Density<E>) -> Result<(), EstimatorError> {
        self.belief = proper(density.estimate(&self.axes)?)?;
        self.existence = existence.clamp(0.0, 1.0);
        self.density = density;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Two steps are one step of their sum.
        #[test]
        fn the_chain_is_a_semigroup(
            birth in 0.0..2.0_f64, death in 0.0..2.0_f64, a in 0.0..3.0_f64, b in 0.0..3.0_f64,
        ) {
            let chain = Lifetime::new(birth, death).expect("proper");
            let step = |existence: f64, dt: f64| {
                let [born, survived] = chain.transition(dt);
                (1.0 - existence) * born + existence * survived
            };
            for start in [0.0, 0.3, 1.0] {
                let twice = step(step(start, a), b);
                prop_assert!(abs_diff_eq!(twice, step(start, a + b), epsilon = 1e-12));
            }
        }
    }

    #[test]
    fn rates_have_their_effect() {
        let chain = Lifetime::new(0.0, 0.5).expect("proper");
        let [born, survived] = chain.transition(2.0);
        assert_abs_diff_eq!(born, 0.0);
        assert_abs_diff_eq!(survived, libm::exp(-1.0), epsilon = 1e-15);
        let [born, survived] = Lifetime::default().transition(1e9);
        assert!(born <= 0.0 && survived >= 1.0);
        assert!(Lifetime::new(-1.0, 0.0).is_err() && Lifetime::new(0.0, f64::NAN).is_err());
    }
}
