use foxhunt_core::{
    Correction, DynamicMeasurement, Estimate, Estimator, EstimatorError, Observation, Quantity,
    parameter::require,
};

use super::kalman::DynamicKalman;
use crate::{DynamicTransform, count::number};

/// Some components of a [`DynamicKalman`] as a static [`Estimator`], fed by one model.
///
/// All others, such as the offsets of stations, are estimated and not shown.
///
/// ```
/// use foxhunt_core::{DynamicEstimate, Estimate, Estimator, EstimatorError, MeasurementModel, On,
///     Pose, Quantity, RandomWalk, State, nalgebra::{Vector1, Vector3}};
/// use foxhunt_filters::{DynamicEkf, JointMotion};
///
/// /// East, by an instrument with an offset: x = (East, North, offset).
/// struct OffsetEast;
///
/// impl MeasurementModel<3, 1> for OffsetEast {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::linear("east_m")]
///     }
///     fn expected(&self, state: &State<3>, _receiver: &Pose) -> Vector1<f64> {
///         Vector1::new(state[0] + state[2])
///     }
/// }
///
/// let prior = Estimate::isotropic(Vector3::new(3.0, 4.0, 0.0), 2.0);
/// let motion = JointMotion::new().with::<3>(RandomWalk::uniform(0.1));
/// let joint = DynamicEkf::new(motion, prior.into())?;
/// let place: &dyn Estimator<2, 1> = &joint.part([0, 1], On::new(OffsetEast, [0, 1, 2]))?;
/// assert_eq!(place.estimate().mean, State::<2>::new(3.0, 4.0));
/// # Ok::<(), EstimatorError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Part<T, H, const N: usize, const M: usize> {
    filter: DynamicKalman<T>,
    measurement: H,
    components: [usize; N],
    quantities: [Quantity; M],
}

impl<T: DynamicTransform> DynamicKalman<T> {
    /// The filter as an [`Estimator`] of some components, by one model: for all that takes one,
    /// hunts and the laws of estimators included.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when a component does not exist, or the model has not `M`
    /// quantities.
    pub fn part<H: DynamicMeasurement, const N: usize, const M: usize>(
        self,
        components: [usize; N],
        measurement: H,
    ) -> Result<Part<T, H, N, M>, EstimatorError> {
        let own = measurement.quantities();
        let count = number(own.len());
        require(own.len() == M, "the model's quantities", count, "as many as are observed")?;
        let quantities = core::array::from_fn(|i| own[i]);
        let size = self.estimate().mean.len();
        for component in components {
            require(component < size, "a component", number(component), "one of the state")?;
        }
        Ok(Part { filter: self, measurement, components, quantities })
    }
}

impl<T, H, const N: usize, const M: usize> Part<T, H, N, M> {
    /// The whole filter.
    #[must_use]
    pub fn whole(&self) -> &DynamicKalman<T> {
        &self.filter
    }
}

impl<T, H, const N: usize, const M: usize> Estimator<N, M> for Part<T, H, N, M>
where
    T: DynamicTransform,
    H: DynamicMeasurement,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        self.filter.predict(dt)
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        self.filter.update(&self.measurement, &observation.into())
    }

    fn estimate(&self) -> Estimate<N> {
        self.filter.estimate().at(self.components).expect("checked when it was made")
    }

    fn quantities(&self) -> [Quantity; M] {
        self.quantities
    }
}
