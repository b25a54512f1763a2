//! Models written once over any number, whose slopes are exact: forward differentiation by dual
//! numbers.

use nalgebra::{SMatrix, SVector};
use num_dual::{Dual64, DualNum};

use crate::{MeasurementModel, MotionModel, Pose, Quantity, State};

pub use num_dual;

/// A number that carries its derivatives or none: `f64`, or a dual number of the crate `num-dual`.
///
/// It has the operators and functions of `f64` (`sqrt`, `ln`, `atan2`, `sin_cos`, …, by the trait
/// [`DualNum`]), also with an `f64` on the right; `T::from` makes one of an `f64`.
pub trait Number: DualNum<Primitive = f64> + Copy {}

impl<T: DualNum<Primitive = f64> + Copy> Number for T {}

/// A measurement model written once over any [`Number`]; [`Differentiated`] makes a
/// [`MeasurementModel`] of it.
pub trait DualMeasurement<const N: usize, const M: usize> {
    /// The quantity of each component, as [`MeasurementModel::quantities`].
    fn quantities(&self) -> [Quantity; M];

    /// h(x; pose): the noise-free measurement.
    fn expected<T: Number>(&self, state: [T; N], receiver: &Pose) -> [T; M];
}

/// A motion written once over any [`Number`]; [`Differentiated`] makes a [`MotionModel`] of it.
pub trait DualMotion<const N: usize> {
    /// f(x, Δt): the state after `dt` seconds without noise.
    fn propagate<T: Number>(&self, state: [T; N], dt: f64) -> [T; N];

    /// L with L Lᵀ = Q(Δt), as [`MotionModel::noise_factor`].
    fn noise_factor(&self, state: &State<N>, dt: f64) -> SMatrix<f64, N, N>;
}

/// A model with exact Jacobians: N evaluations over dual numbers in place of the 2 N evaluations
/// of central differences.
///
/// ```
/// use foxhunt_core::{Differentiated, DualMeasurement, MeasurementModel, Number, Pose, Quantity};
/// use nalgebra::Vector2;
///
/// /// The distance over ground.
/// struct GroundRange;
///
/// impl DualMeasurement<2, 1> for GroundRange {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::RANGE]
///     }
///
///     fn expected<T: Number>(&self, [east, north]: [T; 2], receiver: &Pose) -> [T; 1] {
///         let east = east - receiver.position.x;
///         let north = north - receiver.position.y;
///         [(east * east + north * north).sqrt()]
///     }
/// }
///
/// let model = Differentiated(GroundRange);
/// let slope = model.jacobian(&Vector2::new(3.0, 4.0), &Pose::default());
/// assert!((slope[0] - 0.6).abs() < 1e-15 && (slope[1] - 0.8).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Differentiated<T>(
    /// The model over any number.
    pub T,
);

impl<H, const N: usize, const M: usize> MeasurementModel<N, M> for Differentiated<H>
where
    H: DualMeasurement<N, M>,
{
    fn quantities(&self) -> [Quantity; M] {
        self.0.quantities()
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> SVector<f64, M> {
        SVector::from(self.0.expected(numbers(state), receiver))
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, M, N> {
        slopes(state, |x| self.0.expected(x, receiver))
    }
}

impl<F, const N: usize> MotionModel<N> for Differentiated<F>
where
    F: DualMotion<N>,
{
    fn propagate(&self, state: &State<N>, dt: f64) -> State<N> {
        State::from(self.0.propagate(numbers(state), dt))
    }

    fn noise_factor(&self, state: &State<N>, dt: f64) -> SMatrix<f64, N, N> {
        self.0.noise_factor(state, dt)
    }

    fn jacobian(&self, state: &State<N>, dt: f64) -> SMatrix<f64, N, N> {
        slopes(state, |x| self.0.propagate(x, dt))
    }
}

fn numbers<const N: usize>(state: &State<N>) -> [f64; N] {
    core::array::from_fn(|row| state[row])
}

/// The derivatives of a map by one variable after the other.
#[inline]
fn slopes<const A: usize, const B: usize>(
    state: &State<A>,
    map: impl Fn([Dual64; A]) -> [Dual64; B],
) -> SMatrix<f64, B, A> {
    let constants: [Dual64; A] = core::array::from_fn(|row| Dual64::from_re(state[row]));
    let mut slopes = SMatrix::<f64, B, A>::zeros();
    for column in 0..A {
        let mut state = constants;
        state[column] = state[column].derivative();
        let image = map(state);
        slopes.set_column(column, &SVector::from_fn(|row, _| image[row].eps));
    }
    slopes
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use core::f64::consts::PI;

    use nalgebra::{Vector2, Vector5};

    use super::*;
    use crate::{CoordinatedTurn, numeric_jacobian};

    /// Level and bearing.
    struct LevelAndBearing;

    impl DualMeasurement<2, 2> for LevelAndBearing {
        fn quantities(&self) -> [Quantity; 2] {
            [Quantity::RSS, Quantity::BEARING]
        }

        fn expected<T: Number>(&self, [east, north]: [T; 2], receiver: &Pose) -> [T; 2] {
            let east = east - receiver.position.x;
            let north = north - receiver.position.y;
            let square = east * east + north * north + receiver.position.z.powi(2);
            [square.log10() * -13.825 - 29.06, north.atan2(east)]
        }
    }

    /// The coordinated turn by its textbook form, which has no limit at ω = 0.
    struct Turn;

    impl DualMotion<5> for Turn {
        fn propagate<T: Number>(&self, state: [T; 5], dt: f64) -> [T; 5] {
            let [x, y, vx, vy, rate] = state;
            let (sin, cos) = (rate * dt).sin_cos();
            let along = sin / rate;
            let across = (T::from(1.0) - cos) / rate;
            [
                x + along * vx - across * vy,
                y + across * vx + along * vy,
                cos * vx - sin * vy,
                sin * vx + cos * vy,
                rate,
            ]
        }

        fn noise_factor(&self, _state: &State<5>, dt: f64) -> SMatrix<f64, 5, 5> {
            SMatrix::identity() * dt.sqrt()
        }
    }

    #[test]
    fn slopes_are_those_by_hand_and_by_differences() {
        let receiver = Pose::at(-3.0, 2.0, 4.0);
        let model = Differentiated(LevelAndBearing);
        let state = Vector2::new(-60.0, 1.75);
        let exact = model.jacobian(&state, &receiver);
        let off = state - receiver.position.xy();
        let ground = off.norm_squared();
        let level = -27.65 / core::f64::consts::LN_10 / (ground + 16.0);
        let by_hand = [level * off.x, level * off.y, -off.y / ground, off.x / ground];
        let by_rows = [exact[(0, 0)], exact[(0, 1)], exact[(1, 0)], exact[(1, 1)]];
        for (ours, by_hand) in by_rows.into_iter().zip(by_hand) {
            assert_abs_diff_eq!(ours, by_hand, epsilon = 1e-15);
        }
        // Across the direction where angles wrap, too; ε^⅔ of differences.
        let differences =
            numeric_jacobian(&state, |x| model.expected(x, &receiver), |a, b| model.residual(a, b));
        assert!((exact - differences).norm() < 1e-9);
    }

    #[test]
    fn a_motion_has_the_slopes_of_the_library_s_own() {
        let own = CoordinatedTurn { spectral_density: 0.1, turn_rate_drift: 0.0 };
        let state = Vector5::new(1.0, -2.0, 3.0, 0.5, PI / 7.0);
        let dual = Differentiated(Turn);
        assert!((dual.propagate(&state, 1.3) - own.propagate(&state, 1.3)).norm() < 1e-13);
        let apart = MotionModel::<5>::jacobian(&dual, &state, 1.3) - own.jacobian(&state, 1.3);
        assert!(apart.norm() < 1e-13, "{apart}");
    }

    #[test]
    fn a_constant_has_no_slope() {
        struct Constant;
        impl DualMeasurement<2, 1> for Constant {
            fn quantities(&self) -> [Quantity; 1] {
                [Quantity::RANGE]
            }
            fn expected<T: Number>(&self, _state: [T; 2], _receiver: &Pose) -> [T; 1] {
                [T::from(3.0)]
            }
        }
        let slope = Differentiated(Constant).jacobian(&Vector2::new(1.0, 2.0), &Pose::default());
        assert!(slope.norm() <= 0.0);
    }
}
