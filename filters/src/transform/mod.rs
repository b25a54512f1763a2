mod cubature;
mod image;
mod pairs;
mod taylor;
mod unscented;

use foxhunt_core::{Estimate, EstimatorError};

pub use cubature::Cubature;
pub use image::{Image, Map, Moments};
pub use taylor::Taylor;
pub use unscented::{Kappa, Unscented};

use crate::Gaussian;

/// Propagation of a Gaussian through a map. It is the only difference between the Kalman filters.
pub trait Transform {
    /// Returns the moments of `map(x)`, and its covariance with x.
    fn image<const A: usize, const B: usize>(
        &self,
        source: &Gaussian<A>,
        map: &impl Map<A, B>,
    ) -> Image<A, B>;

    /// Returns the moments without factors, where `source` is far from singular; `None` where it is
    /// singular.
    #[inline(always)]
    fn moments<const A: usize, const B: usize>(
        &self,
        source: &Estimate<A>,
        map: &impl Map<A, B>,
    ) -> Option<Moments<A, B>> {
        let source = Gaussian::factored(*source)?;
        Some(self.image(&source, map).moments(&source))
    }

    /// Checks that the transform's parameters suit states of `dimension` components; called once,
    /// when a filter is made.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] names the parameter that does not.
    fn check(&self, dimension: usize) -> Result<(), EstimatorError> {
        let _ = dimension;
        Ok(())
    }
}
