use foxhunt_core::{Correction, Estimate, Estimator, EstimatorError, Observation, Quantity, State};

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
/// let moving = Ekf::new(ConstantVelocity { acceleration_density: 0.1 }, East, prior)?;
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
