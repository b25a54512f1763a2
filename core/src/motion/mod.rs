mod constant_velocity;
mod coordinated_turn;
mod random_walk;

use nalgebra::SMatrix;

pub use constant_velocity::ConstantVelocity;
pub use coordinated_turn::CoordinatedTurn;
pub use random_walk::RandomWalk;

use crate::{Axis, State, numeric_jacobian};

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

    /// x ← f(x, Δt) + L ξ for many states at once, held as one column for each component, as are
    /// their ξ; no angle is wrapped. All columns are of one length.
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
