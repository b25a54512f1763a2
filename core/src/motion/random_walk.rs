use nalgebra::{SMatrix, SVector};

use crate::{MotionModel, State};

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
