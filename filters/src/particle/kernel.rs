use foxhunt_core::{Axis, State, angle};
use nalgebra::SMatrix;
use rand::Rng;

use super::white::{CHUNK, white};
use crate::count::number;

/// Sets the copies of a particle apart and keeps both moments of the cloud (Liu & West 2001):
/// x' = x̂ + √(1 − h²) (x ⊖ x̂) + h L ξ.
pub(super) struct Kernel<const N: usize> {
    axes: [Axis; N],
    mean: State<N>,
    spread: SMatrix<f64, N, N>,
    shrinkage: f64,
}

impl<const N: usize> Kernel<N> {
    /// The kernel about a cloud of this mean and the covariance L Lᵀ; none for a bandwidth of 0.
    pub(super) fn new(
        mean: &State<N>,
        factor: &SMatrix<f64, N, N>,
        bandwidth: f64,
        axes: [Axis; N],
    ) -> Option<Self> {
        (bandwidth > 0.0).then(|| Self {
            axes,
            mean: *mean,
            spread: factor * bandwidth,
            shrinkage: libm::sqrt(1.0 - bandwidth * bandwidth),
        })
    }

    /// A draw from about a particle; an angle of it is not wrapped.
    pub(super) fn draw(&self, state: &State<N>, rng: &mut impl Rng) -> State<N> {
        let deviation = Axis::difference(&self.axes, state, &self.mean);
        self.mean + deviation * self.shrinkage + self.spread * white(rng)
    }

    /// Draws from about columns of particles, given the draws from N(0, I).
    #[inline(always)]
    pub(super) fn spread_columns(&self, columns: &mut [&mut [f64]; N], white: &[[f64; CHUNK]; N]) {
        for (row, column) in columns.iter_mut().enumerate() {
            let mean = self.mean[row];
            let axis = self.axes[row];
            for x in column.iter_mut() {
                let deviation = match axis {
                    Axis::Linear => *x - mean,
                    Axis::Angle => angle::wrap(*x - mean),
                };
                *x = mean + deviation * self.shrinkage;
            }
            for (white, factor) in white.iter().zip(&self.spread.row(row)) {
                column.iter_mut().zip(white).for_each(|(x, white)| *x += factor * white);
            }
        }
    }
}

/// The bandwidth that is best for a Gaussian (Silverman 1986, §4.3.2), below 1.
pub(super) fn silverman(dimension: usize, count: usize) -> f64 {
    let n = number(dimension);
    let count = number(count);
    libm::pow(4.0 / ((n + 2.0) * count), 1.0 / (n + 4.0)).min(0.99)
}
