use alloc::vec::Vec;

use foxhunt_core::{Estimate, State};

/// The result of a [`BatchSolver`](super::BatchSolver).
#[derive(Clone, Debug, PartialEq)]
pub struct BatchFix<const N: usize> {
    /// The optimum, and the inverse of the information there. With a prior, and observations that
    /// leave a curved direction open, such as the ring of levels from one place, the covariance is
    /// the prior's spread about the optimum instead. Without a prior such observations are refused
    /// as [`BatchError::Flat`](super::BatchError::Flat).
    pub estimate: Estimate<N>,
    /// ln p(Z | x̂) + ln p(x̂), the second where there is a prior. With a robust loss the
    /// normaliser is still the Gaussian's, so compare it among fixes of one loss only.
    pub log_posterior: f64,
    /// The residuals' misfit: Σ w q / (n − N) with n the components present and q an
    /// observation's squared residual in its own standard deviations. About 1 where the sigmas are
    /// right; `None` where n ≤ N.
    pub reduced_chi_squared: Option<f64>,
    /// Weight of each observation, in the order in which they came.
    pub weights: Vec<f64>,
    /// The observations whose angles were left out, since they were made at the optimum's own
    /// place.
    pub silenced: Vec<usize>,
    /// The other optima that starts led to, each with its ln p(Z | x) p(x) less that of the best:
    /// where it is near 0, the observations do not distinguish the two.
    pub rivals: Vec<(State<N>, f64)>,
    /// The rivals in the same order, each with the covariance about itself.
    pub rival_estimates: Vec<Estimate<N>>,
    /// Number of iterations from the winning start.
    pub iterations: u32,
    /// Number of starts that settled in the same optimum, and number of all starts.
    pub agreeing_starts: (usize, usize),
}
