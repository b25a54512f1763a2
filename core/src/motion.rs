//! Movement of a target: the trait and three models.

use nalgebra::{SMatrix, SVector};

use crate::{Axis, State, numeric_jacobian};

/// Below this angle of a turn, in radians, the slopes are summed as power series: their closed
/// forms take a difference of nearly equal numbers.
const SMALL: f64 = 0.1;

/// A motion model: how the target moves between two observations.
///
/// # Laws
///
/// Checked by `laws::motion_model`, feature `laws`: `propagate(x, 0) = x`,
/// `noise_factor(x, 0) = 0`, `propagated_change` agrees with the difference of two propagated
/// states, `jacobian` with finite differences and, where the motion `is_linear`, with `propagate`
/// itself; `move_columns` with `propagate` and `noise_factor`.
pub trait MotionModel<const N: usize> {
    /// f(x, Δt): the state after `dt` seconds without noise.
    fn propagate(&self, state: &State<N>, dt: f64) -> State<N>;

    /// L with L Lᵀ = Q(Δt).
    ///
    /// A factor is required and not Q, so that Q is positive semi-definite by construction and
    /// a particle is moved by L ξ with no factorisation.
    fn noise_factor(&self, state: &State<N>, dt: f64) -> SMatrix<f64, N, N>;

    /// f(x + δ, Δt) ⊖ f(x, Δt) with x the `state`, δ the `offset` and f(x, Δt) where x is
    /// `propagated` to; a linear motion saves the digits that the difference loses.
    fn propagated_change(
        &self,
        state: &State<N>,
        propagated: &State<N>,
        offset: &State<N>,
        dt: f64,
    ) -> State<N> {
        Axis::difference(&self.axes(), &self.propagate(&(state + offset), dt), propagated)
    }

    /// Returns true if f(x, Δt) = F x with the [`jacobian`](Self::jacobian) F: the image of a
    /// Gaussian is then exact under every filter, and costs no sigma points.
    fn is_linear(&self) -> bool {
        false
    }

    /// The geometry of each state component.
    fn axes(&self) -> [Axis; N] {
        [Axis::Linear; N]
    }

    /// ∂f/∂x; by central differences unless overridden.
    fn jacobian(&self, state: &State<N>, dt: f64) -> SMatrix<f64, N, N> {
        let axes = self.axes();
        numeric_jacobian(state, |x| self.propagate(x, dt), |a, b| Axis::difference(&axes, a, b))
    }

    /// x ← f(x, Δt) + L ξ for many states at once, held as one column for each component, as
    /// are their ξ; no angle is wrapped. All columns are of one length.
    ///
    /// One state after the other unless overridden. An override is a plain loop over the columns,
    /// and `#[inline(always)]`: a caller may then compile it for wider vectors.
    #[inline(always)]
    fn move_columns(&self, mut columns: [&mut [f64]; N], white: [&[f64]; N], dt: f64) {
        for i in 0..columns.first().map_or(0, |column| column.len()) {
            let state = State::from_fn(|row, _| columns[row][i]);
            let noise = self.noise_factor(&state, dt) * State::from_fn(|row, _| white[row][i]);
            let moved = self.propagate(&state, dt) + noise;
            columns.iter_mut().zip(&moved).for_each(|(column, value)| column[i] = *value);
        }
    }
}

/// An independent random walk of every state component: a target that stays, or drifts slowly.
///
/// f(x, Δt) = x, Q = diag(dᵢ²) Δt with the drift dᵢ in the component's unit per √second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RandomWalk<const N: usize> {
    /// The root of each component's spectral density, in its unit per √second.
    pub drift: SVector<f64, N>,
}

impl<const N: usize> RandomWalk<N> {
    /// Sets one drift for every component; 0 is a target that does not move at all.
    #[must_use]
    pub fn uniform(drift: f64) -> Self {
        Self { drift: SVector::repeat(drift) }
    }
}

impl<const N: usize> MotionModel<N> for RandomWalk<N> {
    fn propagate(&self, state: &State<N>, _dt: f64) -> State<N> {
        *state
    }

    fn propagated_change(
        &self,
        _state: &State<N>,
        _propagated: &State<N>,
        offset: &State<N>,
        _dt: f64,
    ) -> State<N> {
        *offset
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn noise_factor(&self, _state: &State<N>, dt: f64) -> SMatrix<f64, N, N> {
        SMatrix::from_diagonal(&(self.drift * libm::sqrt(dt)))
    }

    fn jacobian(&self, _state: &State<N>, _dt: f64) -> SMatrix<f64, N, N> {
        SMatrix::identity()
    }

    #[inline(always)]
    fn move_columns(&self, columns: [&mut [f64]; N], white: [&[f64]; N], dt: f64) {
        let root = libm::sqrt(dt);
        for ((column, white), drift) in columns.into_iter().zip(white).zip(&self.drift) {
            let drift = drift * root;
            column.iter_mut().zip(white).for_each(|(x, white)| *x += drift * white);
        }
    }
}

/// Nearly constant velocity on a line, in the plane or in space, driven by white acceleration:
/// x = (E, Ė), (E, N, Ė, Ṅ) or (E, N, U, Ė, Ṅ, U̇), by the size of the filter's state.
///
/// Q is the continuous-time one of Bar-Shalom, Li & Kirubarajan 2001, §6.2.2: per axis
/// q [Δt³/3, Δt²/2; Δt²/2, Δt].
///
/// ```
/// use foxhunt_core::{ConstantVelocity, MotionModel, State};
///
/// let motion = ConstantVelocity { spectral_density: 0.25 };
/// let factor = motion.noise_factor(&State::<6>::zeros(), 2.0);
/// let noise = factor * factor.transpose();
/// // The Up's velocity: q Δt.
/// assert!((noise[(5, 5)] - 0.5).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantVelocity {
    /// q in m²/s³: the power spectral density of the white acceleration on each axis. Over Δt
    /// seconds a velocity's variance grows by q Δt.
    pub spectral_density: f64,
}

macro_rules! constant_velocity {
    ($($axes:literal)+) => {
        $(
            impl MotionModel<{ 2 * $axes }> for ConstantVelocity {
                fn propagate(&self, state: &State<{ 2 * $axes }>, dt: f64) -> State<{ 2 * $axes }> {
                    transition(dt) * state
                }

                fn propagated_change(
                    &self,
                    _state: &State<{ 2 * $axes }>,
                    _propagated: &State<{ 2 * $axes }>,
                    offset: &State<{ 2 * $axes }>,
                    dt: f64,
                ) -> State<{ 2 * $axes }> {
                    transition(dt) * offset
                }

                fn is_linear(&self) -> bool {
                    true
                }

                fn noise_factor(
                    &self,
                    _state: &State<{ 2 * $axes }>,
                    dt: f64,
                ) -> SMatrix<f64, { 2 * $axes }, { 2 * $axes }> {
                    white_acceleration(self.spectral_density, dt)
                }

                fn jacobian(
                    &self,
                    _state: &State<{ 2 * $axes }>,
                    dt: f64,
                ) -> SMatrix<f64, { 2 * $axes }, { 2 * $axes }> {
                    transition(dt)
                }

                #[inline(always)]
                fn move_columns(
                    &self,
                    mut columns: [&mut [f64]; 2 * $axes],
                    white: [&[f64]; 2 * $axes],
                    dt: f64,
                ) {
                    let factor: SMatrix<f64, 2, 2> = white_acceleration(self.spectral_density, dt);
                    let (places, rates) = columns.split_at_mut($axes);
                    let (firsts, seconds) = white.split_at($axes);
                    for (axis, (place, rate)) in places.iter_mut().zip(rates).enumerate() {
                        let white = firsts[axis].iter().zip(seconds[axis]);
                        for ((x, v), (first, second)) in
                            place.iter_mut().zip(rate.iter_mut()).zip(white)
                        {
                            *x += *v * dt + factor[(0, 0)] * first;
                            *v += factor[(1, 0)] * first + factor[(1, 1)] * second;
                        }
                    }
                }
            }
        )+
    };
}

constant_velocity!(1 2 3);

/// A turn at a nearly constant rate, x = (E, N, Ė, Ṅ, ω) or, in space, (E, N, U, Ė, Ṅ, U̇,
/// ω).
///
/// The rate ω is in radians per second, positive counter-clockwise (Bar-Shalom, Li & Kirubarajan
/// 2001, §11.7.1).
///
/// The horizontal velocity turns by ω Δt and the position follows its arc; a rate of zero is a
/// straight line. The Up's velocity stays. White acceleration drives position and velocity as in
/// [`ConstantVelocity`], the rate does a random walk of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoordinatedTurn {
    /// q in m²/s³: the power spectral density of the white acceleration on each axis.
    pub spectral_density: f64,
    /// The drift of the turn rate, in rad s⁻¹ per √second.
    pub turn_rate_drift: f64,
}

impl CoordinatedTurn {
    /// The noise factor of P components of place and velocity and the rate behind them.
    fn factor<const P: usize, const N: usize>(&self, dt: f64) -> SMatrix<f64, N, N> {
        let mut factor = SMatrix::<f64, N, N>::zeros();
        let straight: SMatrix<f64, P, P> = white_acceleration(self.spectral_density, dt);
        factor.fixed_view_mut::<P, P>(0, 0).copy_from(&straight);
        factor[(P, P)] = self.turn_rate_drift * libm::sqrt(dt);
        factor
    }
}

impl MotionModel<5> for CoordinatedTurn {
    fn propagate(&self, state: &State<5>, dt: f64) -> State<5> {
        let turn = Turn::new(state[4], dt);
        let east = state[2];
        let north = state[3];
        State::from([
            state[0] + turn.along * east - turn.across * north,
            state[1] + turn.across * east + turn.along * north,
            turn.cos * east - turn.sin * north,
            turn.sin * east + turn.cos * north,
            state[4],
        ])
    }

    fn noise_factor(&self, _state: &State<5>, dt: f64) -> SMatrix<f64, 5, 5> {
        self.factor::<4, 5>(dt)
    }

    fn jacobian(&self, state: &State<5>, dt: f64) -> SMatrix<f64, 5, 5> {
        let turn = Turn::new(state[4], dt);
        let (along, across) = turn.slopes(dt);
        let east = state[2];
        let north = state[3];
        // By columns.
        SMatrix::from([
            [1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0, 0.0],
            [turn.along, turn.across, turn.cos, turn.sin, 0.0],
            [-turn.across, turn.along, -turn.sin, turn.cos, 0.0],
            [
                along * east - across * north,
                across * east + along * north,
                dt * (-turn.sin * east - turn.cos * north),
                dt * (turn.cos * east - turn.sin * north),
                1.0,
            ],
        ])
    }
}

/// Places of the horizontal components in a turning state of space.
const HORIZONTAL: [usize; 5] = [0, 1, 3, 4, 6];

impl MotionModel<7> for CoordinatedTurn {
    fn propagate(&self, state: &State<7>, dt: f64) -> State<7> {
        let plane = self.propagate(&State::from(HORIZONTAL.map(|row| state[row])), dt);
        let mut moved = *state;
        HORIZONTAL.into_iter().zip(&plane).for_each(|(row, value)| moved[row] = *value);
        moved[2] += state[5] * dt;
        moved
    }

    fn noise_factor(&self, _state: &State<7>, dt: f64) -> SMatrix<f64, 7, 7> {
        self.factor::<6, 7>(dt)
    }

    fn jacobian(&self, state: &State<7>, dt: f64) -> SMatrix<f64, 7, 7> {
        let plane = self.jacobian(&State::from(HORIZONTAL.map(|row| state[row])), dt);
        let mut jacobian = SMatrix::identity();
        for (i, row) in HORIZONTAL.into_iter().enumerate() {
            for (j, column) in HORIZONTAL.into_iter().enumerate() {
                jacobian[(row, column)] = plane[(i, j)];
            }
        }
        jacobian[(2, 5)] = dt;
        jacobian
    }
}

/// Effect of a turn by a = ω Δt on the plane.
struct Turn {
    angle: f64,
    sin: f64,
    cos: f64,
    /// sin a / ω: the way along the old velocity, per unit of it.
    along: f64,
    /// (1 − cos a) / ω: the way to its left.
    across: f64,
}

impl Turn {
    fn new(rate: f64, dt: f64) -> Self {
        let angle = rate * dt;
        let (sin, cos) = libm::sincos(angle);
        let half = 0.5 * angle;
        // 1 − cos a = 2 sin² (a / 2), without the difference.
        let along = dt * sinc(angle);
        let across = dt * libm::sin(half) * sinc(half);
        Self { angle, sin, cos, along, across }
    }

    /// ∂`along`/∂ω and ∂`across`/∂ω.
    fn slopes(&self, dt: f64) -> (f64, f64) {
        let a = self.angle;
        let square = self.angle * self.angle;
        let (along, across) = if a.abs() < SMALL {
            // The next terms are below 10⁻¹³ of these.
            let end = 1.0 - square / 28.0 * (1.0 - square / 54.0);
            let along = -a / 3.0 * (1.0 - square / 10.0 * end);
            let across = 0.5 - square / 8.0 * (1.0 - square / 18.0 * (1.0 - square / 40.0));
            (along, across)
        } else {
            ((a * self.cos - self.sin) / square, (a * self.sin - 1.0 + self.cos) / square)
        };
        (dt * dt * along, dt * dt * across)
    }
}

/// F of a constant velocity: places in the first half of the state, their rates in the second.
fn transition<const N: usize>(dt: f64) -> SMatrix<f64, N, N> {
    let mut transition = SMatrix::identity();
    (0..N / 2).for_each(|axis| transition[(axis, N / 2 + axis)] = dt);
    transition
}

/// L with L Lᵀ = Q of white acceleration of density q on each axis.
fn white_acceleration<const N: usize>(q: f64, dt: f64) -> SMatrix<f64, N, N> {
    let root = libm::sqrt(q) * libm::sqrt(dt);
    let place = dt / libm::sqrt(3.0) * root;
    let coupling = libm::sqrt(3.0) / 2.0 * root;
    let rate = 0.5 * root;
    let mut factor = SMatrix::zeros();
    for axis in 0..N / 2 {
        factor[(axis, axis)] = place;
        factor[(N / 2 + axis, axis)] = coupling;
        factor[(N / 2 + axis, N / 2 + axis)] = rate;
    }
    factor
}

/// sin x / x.
fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-9 { 1.0 } else { libm::sin(x) / x }
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use core::f64::consts::PI;

    use super::*;

    #[test]
    fn the_factor_is_one_of_q() {
        let dt = 1.7;
        let scale = 0.09;
        let motion = ConstantVelocity { spectral_density: scale };
        let l = motion.noise_factor(&State::<4>::zeros(), dt);
        let q = l * l.transpose();
        assert_abs_diff_eq!(q[(0, 0)], scale * dt * dt * dt / 3.0, epsilon = 1e-14);
        assert_abs_diff_eq!(q[(0, 2)], scale * dt * dt / 2.0, epsilon = 1e-14);
        assert_abs_diff_eq!(q[(2, 2)], scale * dt, epsilon = 1e-14);
        assert_abs_diff_eq!(q[(0, 1)], 0.0, epsilon = 1e-14);
        assert_abs_diff_eq!(q[(0, 3)], 0.0, epsilon = 1e-14);
    }

    #[test]
    fn space_is_three_lines() {
        let motion = ConstantVelocity { spectral_density: 0.16 };
        let state = State::from([1.0, -2.0, 3.0, 0.5, 0.25, -1.5]);
        let dt = 1.3;
        let moved = motion.propagate(&state, dt);
        let factor = motion.noise_factor(&state, dt);
        for axis in 0..3 {
            let line = State::from([state[axis], state[3 + axis]]);
            let own = motion.propagate(&line, dt);
            assert!((own - State::from([moved[axis], moved[3 + axis]])).norm() < 1e-15);
            let l = motion.noise_factor(&line, dt);
            let of_space = SMatrix::<f64, 2, 2>::from_fn(|row, column| {
                factor[(3 * row + axis, 3 * column + axis)]
            });
            assert!((of_space - l).norm() < 1e-15, "axis {axis}");
        }
        // Nothing couples the axes.
        let q = factor * factor.transpose();
        assert_abs_diff_eq!(q[(0, 1)], 0.0, epsilon = 1e-15);
        assert_abs_diff_eq!(q[(2, 3)], 0.0, epsilon = 1e-15);
    }

    #[test]
    fn a_climbing_turn_is_the_turn_and_the_climb() {
        let state = State::from([1.0, -1.0, 5.0, 2.0, 0.0, 0.5, PI / 4.0]);
        let moved = MODEL.propagate(&state, 4.0);
        let expected = State::from([1.0, -1.0 + 16.0 / PI, 7.0, -2.0, 0.0, 0.5, PI / 4.0]);
        assert!((moved - expected).norm() < 1e-13, "{moved}");
    }

    const MODEL: CoordinatedTurn =
        CoordinatedTurn { spectral_density: 0.09, turn_rate_drift: 0.02 };

    #[test]
    fn half_a_circle_ends_across() {
        // 2 m/s at π/4 rad/s: a circle of 8/π m radius, half of it in 4 s.
        let start = State::from([1.0, -1.0, 2.0, 0.0, PI / 4.0]);
        let end = MODEL.propagate(&start, 4.0);
        let expected = State::from([1.0, -1.0 + 16.0 / PI, -2.0, 0.0, PI / 4.0]);
        assert!((end - expected).norm() < 1e-13, "{end}");
    }

    #[test]
    fn the_slopes_are_smooth_through_no_turn() {
        // On both sides of the seam, and at it, the two forms agree.
        for rate in [0.0, 1e-12, -1e-6, 0.01, 0.0999, 0.1001, -0.1001, 1.3, -3.0] {
            let slope = Turn::new(rate, 1.0).slopes(1.0);
            let step = 1e-5;
            let ahead = Turn::new(rate + step, 1.0);
            let behind = Turn::new(rate - step, 1.0);
            let along = (ahead.along - behind.along) / (2.0 * step);
            let across = (ahead.across - behind.across) / (2.0 * step);
            // Truncation h²/6 and rounding ε/h, each about 10⁻¹¹.
            assert!(abs_diff_eq!(slope.0, along, epsilon = 1e-10), "{rate}: {} {along}", slope.0);
            assert!(abs_diff_eq!(slope.1, across, epsilon = 1e-10), "{rate}: {} {across}", slope.1);
        }
        let below = Turn::new(SMALL * (1.0 - 1e-15), 1.0);
        let above = Turn::new(SMALL, 1.0);
        assert_abs_diff_eq!(below.slopes(1.0).0, above.slopes(1.0).0, epsilon = 1e-13);
        assert_abs_diff_eq!(below.slopes(1.0).1, above.slopes(1.0).1, epsilon = 1e-13);
    }

    #[test]
    fn without_a_turn_it_is_constant_velocity() {
        let straight = crate::ConstantVelocity { spectral_density: 0.09 };
        let state = State::from([1.0, 2.0, -3.0, 0.5, 0.0]);
        let plane = state.fixed_rows::<4>(0).into_owned();
        let moved = MODEL.propagate(&state, 1.7).fixed_rows::<4>(0).into_owned();
        assert!((moved - straight.propagate(&plane, 1.7)).norm() < 1e-14);
        let factor = MODEL.noise_factor(&state, 1.7);
        let q = factor * factor.transpose();
        let l = straight.noise_factor(&plane, 1.7);
        assert!((q.fixed_view::<4, 4>(0, 0) - l * l.transpose()).norm() < 1e-14);
        assert_abs_diff_eq!(q[(4, 4)], 0.02 * 0.02 * 1.7, epsilon = 1e-16);
    }
}
