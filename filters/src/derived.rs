//! Estimators over others: one that hands over to the next, and the leading part of a larger state.

use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, Observation, Quantity, Smooth, State,
};

/// Begins as one estimator and goes on as another, which starts from the moments of the first.
///
/// A Kalman filter loses most to linearisation at its first updates, where the prior is wide: a
/// first bearing is a cone, a first level a ring. Taken in by a [`GridFilter`](crate::GridFilter)
/// these become a prior that is nearly Gaussian.
///
/// The second one begins after a number of observations were fused; where it cannot be made from
/// the moments of the first, that one goes on until the next.
///
/// ```
/// use foxhunt_core::{Estimate, Estimator, MeasurementModel, Observation, Pose, Quantity,
///     RandomWalk, State, nalgebra::{Matrix1, Vector1, Vector2}};
/// use foxhunt_filters::{Ekf, GridConfig, GridFilter, Handover};
///
/// /// The bearing of the target, in radians counter-clockwise from East.
/// #[derive(Clone, Copy)]
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
/// let still = RandomWalk::uniform(0.01);
/// let prior = Estimate::isotropic(Vector2::zeros(), 50.0);
/// let grid = GridFilter::new(still, BearingOnly, prior, GridConfig::default())?;
/// let mut filter = Handover::new(grid, 2, move |first| Ekf::new(still, BearingOnly, first));
/// for (north, bearing) in [(0.0, 0.3), (40.0, -0.5)] {
///     let (receiver, variance) = (Pose::at(-40.0, north, 0.0), Matrix1::new(0.01));
///     let _ = filter.update(&Observation::new(0.0, receiver, Vector1::new(bearing), variance)?)?;
/// }
/// assert!(filter.has_handed_over());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Handover<S, E, B> {
    stage: Stage<S, E>,
    /// Observations still to be fused by the first.
    left: u32,
    build: B,
}

impl<S, E, B> Handover<S, E, B> {
    /// Begins as `first`; goes on after `observations` as what `build` makes of its moments.
    pub fn new(first: S, observations: u32, build: B) -> Self {
        Self { stage: Stage::First(first), left: observations, build }
    }

    /// Returns true if the second estimator has taken over.
    pub fn has_handed_over(&self) -> bool {
        matches!(self.stage, Stage::Second(_))
    }
}

impl<S, E, B, const N: usize, const M: usize> Estimator<N, M> for Handover<S, E, B>
where
    S: Estimator<N, M>,
    E: Estimator<N, M>,
    B: Fn(Estimate<N>) -> Result<E, EstimatorError>,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        match &mut self.stage {
            Stage::First(first) => first.predict(dt),
            Stage::Second(second) => second.predict(dt),
        }
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        let first = match &mut self.stage {
            Stage::First(first) => first,
            Stage::Second(second) => return second.update(observation),
        };
        let correction = first.update(observation)?;
        if matches!(correction, Correction::Fused { .. }) {
            self.left = self.left.saturating_sub(1);
        }
        if self.left == 0
            && let Ok(second) = (self.build)(first.estimate())
        {
            self.stage = Stage::Second(second);
        }
        Ok(correction)
    }

    fn estimate(&self) -> Estimate<N> {
        match &self.stage {
            Stage::First(first) => first.estimate(),
            Stage::Second(second) => second.estimate(),
        }
    }

    fn quantities(&self) -> [Quantity; M] {
        match &self.stage {
            Stage::First(first) => first.quantities(),
            Stage::Second(second) => second.quantities(),
        }
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        match &self.stage {
            Stage::First(first) => first.visit_samples(visit),
            Stage::Second(second) => second.visit_samples(visit),
        }
    }
}

/// Smooths what each of the two estimated as that one does. At the seam, the second one is made of
/// what the first believed then, and so on to the beginning of the run: the first one's state need
/// not hold what the second one's does, such as a velocity.
impl<S, E, B, const N: usize, const M: usize> Smooth<N, M> for Handover<S, E, B>
where
    S: Smooth<N, M>,
    E: Smooth<N, M>,
    B: Fn(Estimate<N>) -> Result<E, EstimatorError>,
{
    fn smooth(&mut self, later: &Self, dt: f64) -> Result<(), EstimatorError> {
        match (&mut self.stage, &later.stage) {
            (Stage::First(first), Stage::First(later)) => first.smooth(later, dt),
            (Stage::Second(second), Stage::Second(later)) => second.smooth(later, dt),
            (Stage::First(first), Stage::Second(later)) => {
                let mut second = (self.build)(first.estimate())?;
                second.smooth(later, dt)?;
                self.stage = Stage::Second(second);
                Ok(())
            }
            (Stage::Second(_), Stage::First(_)) => Err(EstimatorError::Unsupported {
                what: "smoothing by a belief from before the handover",
            }),
        }
    }
}

/// The active estimator.
#[derive(Clone, Debug)]
enum Stage<S, E> {
    First(S),
    Second(E),
}

/// An estimator of `N` components that shows only the first `K`: the further ones, such
/// as a velocity or a transmitter's power, are estimated and not shown.
///
/// ```
/// # use foxhunt_core::{ConstantVelocity, Estimate, Estimator, EstimatorError,
/// #     MeasurementModel, Pose, Quantity, State, nalgebra::{Vector1, Vector4}};
/// # struct East;
/// # impl MeasurementModel<4, 1> for East {
/// #     fn quantities(&self) -> [Quantity; 1] { [Quantity::linear("x_m")] }
/// #     fn expected(&self, x: &State<4>, _: &Pose) -> Vector1<f64> { Vector1::new(x[0]) }
/// # }
/// use foxhunt_filters::{Ekf, Leading};
///
/// let prior = Estimate::isotropic(Vector4::new(3.0, 4.0, 0.1, 0.2), 1.0);
/// let moving = Ekf::new(ConstantVelocity { spectral_density: 0.01 }, East, prior)?;
/// let place: &dyn Estimator<2, 1> = &Leading::new(moving);
/// assert_eq!(place.estimate().mean, State::<2>::new(3.0, 4.0));
/// # Ok::<(), EstimatorError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Leading<E, const N: usize>(E);

impl<E, const N: usize> Leading<E, N> {
    /// The view of an estimator of `N` components.
    #[must_use]
    pub fn new(whole: E) -> Self {
        Self(whole)
    }

    /// The whole estimator.
    #[must_use]
    pub fn whole(&self) -> &E {
        &self.0
    }
}

impl<E, const N: usize, const K: usize, const M: usize> Estimator<K, M> for Leading<E, N>
where
    E: Estimator<N, M>,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        self.0.predict(dt)
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        self.0.update(observation)
    }

    fn estimate(&self) -> Estimate<K> {
        const { assert!(K <= N, "the whole state holds all that is shown") };
        let Estimate { mean, covariance } = self.0.estimate();
        Estimate {
            mean: mean.fixed_rows::<K>(0).into_owned(),
            covariance: covariance.fixed_view::<K, K>(0, 0).into_owned(),
        }
    }

    fn quantities(&self) -> [Quantity; M] {
        self.0.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<K>, f64)) {
        self.0.visit_samples(&mut |state, weight| {
            visit(&state.fixed_rows::<K>(0).into_owned(), weight);
        });
    }
}

impl<E, const N: usize, const K: usize, const M: usize> Smooth<K, M> for Leading<E, N>
where
    E: Smooth<N, M>,
{
    fn smooth(&mut self, later: &Self, dt: f64) -> Result<(), EstimatorError> {
        self.0.smooth(&later.0, dt)
    }
}
