use alloc::vec::Vec;

use nalgebra::{DMatrix, DVector, Vector3};

use crate::{Observation, ObservationError, Pose};

/// Numbers of any count, measured by one receiver at one time, of which any may be missing.
///
/// It is an [`Observation`] whose size is known at run time only, and is made of one with `from`.
/// Limits and competing directions are not carried over: a component below a limit is missing, and
/// a bearing has the moments of all its directions. Kalman filters use no more of them either.
#[derive(Clone, Debug, PartialEq)]
pub struct DynamicObservation {
    time: f64,
    receiver: Pose,
    value: DVector<f64>,
    noise: DMatrix<f64>,
    present: Vec<usize>,
    receiver_sigma: Option<Vector3<f64>>,
}

impl DynamicObservation {
    /// An observation with every component present.
    ///
    /// # Errors
    ///
    /// The errors of [`Observation::new`], and [`ObservationError::Size`] when the covariance has
    /// not as many rows and columns as there are components.
    #[inline]
    pub fn new(
        time: f64,
        receiver: Pose,
        value: DVector<f64>,
        noise: DMatrix<f64>,
    ) -> Result<Self, ObservationError> {
        let components = value.len();
        let (rows, columns) = noise.shape();
        if rows != components || columns != components {
            return Err(ObservationError::Size { components, rows, columns });
        }
        let variances = (0..components).map(|i| noise[(i, i)]);
        ObservationError::check(time, &receiver, value.iter().copied().zip(variances))?;
        let symmetric = (&noise - noise.transpose()).norm() <= 1e-9 * noise.norm();
        if !symmetric || noise.clone().cholesky().is_none() {
            return Err(ObservationError::Covariance);
        }
        let present = (0..components).collect();
        Ok(Self { time, receiver, value, noise, present, receiver_sigma: None })
    }

    /// Removes one component; one that does not exist is missing already.
    #[must_use]
    #[inline]
    pub fn without(mut self, component: usize) -> Self {
        self.present.retain(|own| *own != component);
        self
    }

    /// Sets the standard deviations of the receiver's own place: East, North and Up in metres, 0
    /// where it is known.
    ///
    /// # Errors
    ///
    /// [`ObservationError::ReceiverSigma`] when one is negative or not finite.
    #[inline]
    pub fn with_receiver_sigma(self, sigma: Vector3<f64>) -> Result<Self, ObservationError> {
        ObservationError::check_receiver_sigma(&sigma)?;
        Ok(Self { receiver_sigma: Some(sigma), ..self })
    }

    /// The time of the observation, in seconds.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The receiver's pose.
    #[must_use]
    pub fn receiver(&self) -> &Pose {
        &self.receiver
    }

    /// σ of the receiver's own place, if it is uncertain.
    #[must_use]
    pub fn receiver_sigma(&self) -> Option<&Vector3<f64>> {
        self.receiver_sigma.as_ref()
    }

    /// The numbers; a missing component holds the value that it was given, which must not be read.
    #[must_use]
    pub fn value(&self) -> &DVector<f64> {
        &self.value
    }

    /// The covariance of the noise, with the rows and columns of missing components, which must not
    /// be read.
    #[must_use]
    pub fn noise(&self) -> &DMatrix<f64> {
        &self.noise
    }

    /// The indices of the components that are present, in ascending order.
    #[must_use]
    pub fn present(&self) -> &[usize] {
        &self.present
    }

    /// Returns true if no component is present.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.present.is_empty()
    }
}

impl<const M: usize> From<&Observation<M>> for DynamicObservation {
    fn from(observation: &Observation<M>) -> Self {
        let noise = observation.noise();
        Self {
            time: observation.time(),
            receiver: *observation.receiver(),
            value: DVector::from_column_slice(observation.value().as_slice()),
            noise: DMatrix::from_column_slice(M, M, noise.as_slice()),
            present: (0..M).filter(|component| observation.has(*component)).collect(),
            receiver_sigma: observation.receiver_sigma().copied(),
        }
    }
}

impl<const M: usize> From<Observation<M>> for DynamicObservation {
    fn from(observation: Observation<M>) -> Self {
        Self::from(&observation)
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use nalgebra::{Matrix2, Vector2};

    use super::*;

    #[test]
    fn improper_numbers_are_refused() {
        let make = |time, value: f64, noise: DMatrix<f64>| {
            let values = DVector::from_vec(vec![value, 0.0]);
            DynamicObservation::new(time, Pose::default(), values, noise)
        };
        let unit = || DMatrix::<f64>::identity(2, 2);
        assert!(make(0.0, 1.0, unit()).is_ok());
        assert!(matches!(make(f64::NAN, 1.0, unit()), Err(ObservationError::Time { .. })));
        let infinite = make(0.0, f64::INFINITY, unit());
        assert!(matches!(infinite, Err(ObservationError::Value { component: 0, .. })));
        let size = ObservationError::Size { components: 2, rows: 3, columns: 3 };
        assert_eq!(make(0.0, 1.0, DMatrix::identity(3, 3)), Err(size));
        let skew = DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.0, 1.0]);
        assert_eq!(make(0.0, 1.0, skew), Err(ObservationError::Covariance));
        let indefinite = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0]);
        assert_eq!(make(0.0, 1.0, indefinite), Err(ObservationError::Covariance));
        let flat = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.0]);
        let variance = ObservationError::Variance { component: 1, variance: 0.0 };
        assert_eq!(make(0.0, 1.0, flat), Err(variance));
    }

    #[test]
    fn it_is_the_static_observation_at_run_time() {
        let noise = Matrix2::new(4.0, 1.0, 1.0, 9.0);
        let value = Vector2::new(1.0, 2.0);
        let sigma = Vector3::new(0.5, 0.0, 2.0);
        let own = Observation::new(3.0, Pose::at(1.0, 2.0, 3.0), value, noise).expect("proper");
        let own = own.with_receiver_sigma(sigma).expect("proper");
        let dynamic = DynamicObservation::from(&own);
        assert_eq!(dynamic.present(), [0, 1]);
        assert_eq!((dynamic.time(), dynamic.receiver()), (own.time(), own.receiver()));
        assert_eq!(dynamic.receiver_sigma(), Some(&sigma));
        assert_eq!(dynamic.noise()[(0, 1)].to_bits(), 1.0_f64.to_bits());
        assert_eq!(DynamicObservation::from(own.without(0)).present(), [1]);
        assert!(dynamic.without(0).without(7).without(1).is_empty());
    }
}
