use nalgebra::{DMatrix, SMatrix, SVector};

use super::{
    dynamic, fixed,
    models::{DynamicMeasurement, DynamicMotion},
};
use crate::{Axis, MeasurementModel, MotionModel, Pose, Quantity, State};

/// A dynamic model at one size, as a static one: it then runs under every estimator, and the laws
/// of models hold for it.
///
/// ```
/// use foxhunt_core::{AtSize, DynamicMeasurement, MeasurementModel, Pose, Quantity,
///     nalgebra::{DVector, Vector3}};
///
/// struct Sum;
///
/// impl DynamicMeasurement for Sum {
///     fn quantities(&self) -> Vec<Quantity> {
///         vec![Quantity::linear("sum_m")]
///     }
///     fn expected(&self, state: &DVector<f64>, _receiver: &Pose) -> DVector<f64> {
///         DVector::from_element(1, state.sum())
///     }
/// }
///
/// let of_three: &dyn MeasurementModel<3, 1> = &AtSize(Sum);
/// assert_eq!(of_three.expected(&Vector3::new(1.0, 2.0, 3.0), &Pose::default())[0], 6.0);
/// ```
///
/// # Panics
///
/// Its methods, where the model has another number of components at this size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtSize<T>(pub T);

/// The whole state is that of the model; the components that it names are not looked at.
impl<H: DynamicMeasurement, const N: usize, const M: usize> MeasurementModel<N, M> for AtSize<H> {
    fn quantities(&self) -> [Quantity; M] {
        let own = self.0.quantities();
        core::array::from_fn(|i| own[i])
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> SVector<f64, M> {
        fixed(&self.0.expected(&dynamic(state), receiver))
    }

    fn residual(&self, z: &SVector<f64, M>, expected: &SVector<f64, M>) -> SVector<f64, M> {
        fixed(&self.0.residual(&dynamic(z), &dynamic(expected)))
    }

    fn expected_parts(
        &self,
        state: &State<N>,
        expected: &SVector<f64, M>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> [SVector<f64, M>; 2] {
        let expected = dynamic(expected);
        let parts = self.0.expected_parts(&dynamic(state), &expected, &dynamic(offset), receiver);
        parts.map(|part| fixed(&part))
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, M, N> {
        matrix(&self.0.jacobian(&dynamic(state), receiver))
    }
}

/// A noise of more than `N` columns is refused: a static model has a square factor.
impl<F: DynamicMotion, const N: usize> MotionModel<N> for AtSize<F> {
    fn propagate(&self, state: &State<N>, dt: f64) -> State<N> {
        fixed(&self.0.propagate(&dynamic(state), dt))
    }

    fn noise_factor(&self, state: &State<N>, dt: f64) -> SMatrix<f64, N, N> {
        let factor = self.0.noise_factor(&dynamic(state), dt);
        let columns = factor.ncols();
        assert!(columns <= N, "a noise of {columns} columns for {N} components");
        matrix(&factor.resize_horizontally(N, 0.0))
    }

    fn is_linear(&self) -> bool {
        self.0.is_linear()
    }

    fn axes(&self) -> [Axis; N] {
        let own = self.0.axes(N);
        core::array::from_fn(|i| own[i])
    }

    fn jacobian(&self, state: &State<N>, dt: f64) -> SMatrix<f64, N, N> {
        matrix(&self.0.jacobian(&dynamic(state), dt))
    }
}

fn matrix<const R: usize, const C: usize>(matrix: &DMatrix<f64>) -> SMatrix<f64, R, C> {
    assert_eq!(matrix.shape(), (R, C), "the size of a model's matrix");
    SMatrix::from_column_slice(matrix.as_slice())
}

#[cfg(all(test, feature = "laws"))]
mod tests {
    use alloc::{vec, vec::Vec};

    use nalgebra::{DVector, Matrix2, Vector2, Vector4};

    use super::*;
    use crate::{ConstantVelocity, CoordinatedTurn, Fixed, Observation, On, laws};

    /// Range and bearing of a target, written for a state of any length.
    struct RangeBearing;

    impl DynamicMeasurement for RangeBearing {
        fn quantities(&self) -> Vec<Quantity> {
            vec![Quantity::RANGE, Quantity::BEARING]
        }

        fn expected(&self, state: &DVector<f64>, receiver: &Pose) -> DVector<f64> {
            let east = state[0] - receiver.position.x;
            let north = state[1] - receiver.position.y;
            DVector::from_vec(vec![libm::hypot(east, north), libm::atan2(north, east)])
        }
    }

    #[test]
    fn models_keep_the_laws_there_and_back() {
        let state = Vector4::new(30.0, -20.0, 1.0, 0.5);
        let straight = Fixed::<_, 4>(ConstantVelocity { spectral_density: 0.2 });
        laws::motion_model(&AtSize(straight), &state, 1.5);
        let turn = CoordinatedTurn { spectral_density: 0.2, turn_rate_drift: 0.01 };
        let turning = State::from([30.0, -20.0, 1.0, 0.5, 0.1]);
        laws::motion_model(&AtSize(Fixed::<_, 5>(turn)), &turning, 1.5);

        let noise = Matrix2::from_diagonal(&Vector2::new(4.0, 0.01));
        let z = Observation::new(0.0, Pose::at(1.0, 2.0, 3.0), Vector2::new(40.0, -0.7), noise);
        let z = z.expect("proper");
        laws::measurement_model::<4, 2>(&AtSize(RangeBearing), &state, &z);
        let twice = AtSize(On::<_, 4, 2>::new(AtSize(RangeBearing), [0, 1, 2, 3]));
        laws::measurement_model::<4, 2>(&twice, &state, &z);
    }
}
