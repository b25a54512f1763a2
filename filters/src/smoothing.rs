//! Beliefs of earlier times, given what came later.

#[cfg(feature = "alloc")]
use alloc::vec::Vec;

use foxhunt_core::{Axis, Covariance, Estimate, EstimatorError, MotionModel, Role, State};
#[cfg(feature = "alloc")]
use foxhunt_core::{Correction, Estimator, Observation, Quantity, Smooth};

/// Smooths a run in place: estimators with their times in seconds, ascending, each a copy after the
/// last observation of its time. The last one stays as it is (fixed-interval smoothing).
///
/// ```
/// use foxhunt_core::{ConstantVelocity, Estimate, Estimator, MeasurementModel, Observation, Pose,
///     Quantity, State, nalgebra::{Matrix1, Vector1, Vector4}};
/// use foxhunt_filters::{Ekf, fixed_interval};
///
/// #[derive(Clone)]
/// struct East;
/// impl MeasurementModel<4, 1> for East {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::linear("x_m")]
///     }
///     fn expected(&self, x: &State<4>, _: &Pose) -> Vector1<f64> {
///         Vector1::new(x[0])
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let motion = ConstantVelocity { spectral_density: 0.01 };
/// let prior = Estimate::isotropic(Vector4::zeros(), 10.0);
/// let mut filter = Ekf::new(motion, East, prior)?;
/// let mut run = Vec::new();
/// for second in 0..10 {
///     let time = f64::from(second);
///     filter.predict(if second == 0 { 0.0 } else { 1.0 })?;
///     let east = Vector1::new(2.0 * time);
///     let variance = Matrix1::new(1.0);
///     let _ = filter.update(&Observation::new(time, Pose::default(), east, variance)?)?;
///     run.push((time, filter.clone()));
/// }
/// let filtered = run[3].1.estimate();
/// fixed_interval(&mut run)?;
/// assert!(run[3].1.estimate().covariance[(0, 0)] < 0.7 * filtered.covariance[(0, 0)]);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
///
/// The errors of [`Smooth::smooth`]; [`EstimatorError::TimeStep`] when times do not ascend. What
/// comes before the step that failed is then not smoothed.
#[cfg(feature = "alloc")]
pub fn fixed_interval<E: Smooth<N, M>, const N: usize, const M: usize>(
    run: &mut [(f64, E)],
) -> Result<(), EstimatorError> {
    for k in (1..run.len()).rev() {
        let (before, after) = run.split_at_mut(k);
        if let (Some((time, belief)), [(later_time, later), ..]) = (before.last_mut(), after) {
            belief.smooth(later, *later_time - *time)?;
        }
    }
    Ok(())
}

/// An estimator that keeps a copy of itself for every time of an observation, to be smoothed in the
/// end. Time counts the predicted seconds.
#[cfg(feature = "alloc")]
#[derive(Clone, Debug)]
pub struct Remembering<E> {
    estimator: E,
    elapsed: f64,
    run: Vec<(f64, E)>,
}

#[cfg(feature = "alloc")]
impl<E: Clone> Remembering<E> {
    /// Remembers nothing yet.
    #[must_use]
    pub fn new(estimator: E) -> Self {
        Self { estimator, elapsed: 0.0, run: Vec::new() }
    }

    /// The estimator inside.
    #[must_use]
    pub fn estimator(&self) -> &E {
        &self.estimator
    }

    /// Number of the times that are remembered.
    #[must_use]
    pub fn times(&self) -> usize {
        self.run.len()
    }

    /// The smoothed copies with their times, in seconds since the beginning.
    ///
    /// # Errors
    ///
    /// The errors of [`Smooth::smooth`].
    pub fn smoothed<const N: usize, const M: usize>(&self) -> Result<Vec<(f64, E)>, EstimatorError>
    where
        E: Smooth<N, M>,
    {
        let mut run = self.run.clone();
        fixed_interval(&mut run)?;
        Ok(run)
    }
}

#[cfg(feature = "alloc")]
impl<E, const N: usize, const M: usize> Estimator<N, M> for Remembering<E>
where
    E: Estimator<N, M> + Clone,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        self.estimator.predict(dt)?;
        self.elapsed += dt;
        Ok(())
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        let correction = self.estimator.update(observation)?;
        // Observations of one time are one step.
        if self.run.last().is_some_and(|(time, _)| *time >= self.elapsed) {
            let _ = self.run.pop();
        }
        self.run.push((self.elapsed, self.estimator.clone()));
        Ok(correction)
    }

    fn estimate(&self) -> Estimate<N> {
        self.estimator.estimate()
    }

    fn quantities(&self) -> [Quantity; M] {
        self.estimator.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        self.estimator.visit_samples(visit);
    }
}

/// Returns the beliefs at some times given all observations until the last: the Rauch, Tung &
/// Striebel smoother, linearised about the filtered means (Särkkä 2013, eqs. 8.6 and 9.2).
///
/// `filtered` are the times in seconds, ascending, and the Gaussian posteriors of a filter with
/// this motion at them. With F and Q those of the step from one to the next and P⁻ = F P Fᵀ +
/// Q, G = P Fᵀ P⁻⁻¹, the mean is x̂ + G (x̂ˢ₊ ⊖ f(x̂)) and the covariance, as a sum
/// of squares, (I − G F) P (I − G F)ᵀ + G (Q + Pˢ₊) Gᵀ. The last one stays as it is.
///
/// # Errors
///
/// [`EstimatorError::TimeStep`] when times do not ascend;
/// [`EstimatorError::NotPositiveDefinite`] when a predicted covariance is not.
#[cfg(feature = "alloc")]
pub fn rauch_tung_striebel<const N: usize>(
    motion: &(impl MotionModel<N> + ?Sized),
    filtered: &[(f64, Estimate<N>)],
) -> Result<Vec<(f64, Estimate<N>)>, EstimatorError> {
    let mut smoothed = filtered.to_vec();
    for k in (1..smoothed.len()).rev() {
        let (time, later) = smoothed[k];
        let (before, belief) = smoothed[k - 1];
        let step = Passage::of(motion, &belief, time - before)?;
        smoothed[k - 1].1 = step.back(&belief, &later, &motion.axes())?;
    }
    Ok(smoothed)
}

/// A step of time, linearised about the belief that it begins with:
/// x₊ = f(x̂) + F (x ⊖ x̂) + w.
#[derive(Clone, Copy, Debug)]
pub struct Passage<const N: usize> {
    /// f(x̂).
    pub(crate) mean: State<N>,
    /// F.
    pub(crate) transition: Covariance<N>,
    /// Q.
    pub(crate) noise: Covariance<N>,
}

impl<const N: usize> Passage<N> {
    /// The step of a motion over `dt` seconds.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::TimeStep`] for a `dt` that is negative or not finite.
    pub fn of(
        motion: &(impl MotionModel<N> + ?Sized),
        belief: &Estimate<N>,
        dt: f64,
    ) -> Result<Self, EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        let factor = motion.noise_factor(&belief.mean, dt);
        Ok(Self {
            mean: motion.propagate(&belief.mean, dt),
            transition: motion.jacobian(&belief.mean, dt),
            noise: factor * factor.transpose(),
        })
    }

    /// The belief after the step.
    #[cfg(feature = "alloc")]
    pub(crate) fn ahead(&self, belief: &Estimate<N>) -> Estimate<N> {
        let carried = self.transition * belief.covariance * self.transition.transpose();
        let mut covariance = carried + self.noise;
        covariance.fill_upper_triangle_with_lower_triangle();
        Estimate { mean: self.mean, covariance }
    }

    /// The belief before the step, given the smoothed one after it.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::NotPositiveDefinite`] when the predicted covariance is not.
    pub(crate) fn back(
        &self,
        belief: &Estimate<N>,
        later: &Estimate<N>,
        axes: &[Axis; N],
    ) -> Result<Estimate<N>, EstimatorError> {
        let Self { transition, noise, .. } = self;
        let carried = transition * belief.covariance;
        let predicted = (carried * transition.transpose() + noise)
            .cholesky()
            .ok_or(EstimatorError::NotPositiveDefinite { role: Role::Prior })?;
        let gain = predicted.solve(&carried).transpose();
        let news = Axis::difference(axes, &later.mean, &self.mean);
        let mean = belief.mean + gain * news;
        let kept = Covariance::<N>::identity() - gain * transition;
        let mut covariance = kept * belief.covariance * kept.transpose()
            + gain * (noise + later.covariance) * gain.transpose();
        covariance.fill_upper_triangle_with_lower_triangle();
        Ok(Estimate { mean: Axis::difference(axes, &mean, &State::zeros()), covariance })
    }
}

/// An estimator with one motion, whose belief a Gaussian stands for: what smoothing a mixture of
/// such estimators needs.
pub trait Passing<const N: usize> {
    /// A step of its motion over `dt` seconds from a belief.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::TimeStep`] for a `dt` that is negative or not finite.
    fn passage(&self, belief: &Estimate<N>, dt: f64) -> Result<Passage<N>, EstimatorError>;
}
