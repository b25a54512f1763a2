//! Gaussian filters of states whose size is known at run time only.
//!
//! Functions without type parameters are `#[inline]`, so that a program that has no such state does
//! not compile them.

mod dense;
mod image;
mod joint;
mod kalman;
mod part;

pub use joint::JointMotion;
pub use kalman::{DynamicCkf, DynamicEkf, DynamicInnovation, DynamicKalman, DynamicUkf};
pub use part::Part;

use alloc::borrow::Cow;

use foxhunt_core::{Axis, DynamicEstimate, EstimatorError, Role, parameter::require};
use nalgebra::{DMatrix, DVector};

use crate::count::number;

/// Least share of a variance that may remain given other components: below it, six of its sixteen
/// digits are lost. It is the limit of the static filters.
const LEAST: f64 = 1e-6;

/// The moments, and a factor of the covariance only where the covariance's own digits would not do.
#[derive(Clone, Debug)]
struct Belief {
    estimate: DynamicEstimate,
    factor: Option<DMatrix<f64>>,
    /// A lower bound of the share of each variance that remains given the components before it.
    share: f64,
}

impl Belief {
    /// The belief with these moments.
    #[inline]
    fn new(estimate: DynamicEstimate, role: Role) -> Result<Self, EstimatorError> {
        let DynamicEstimate { mean, covariance } = &estimate;
        let size = mean.len();
        let square = covariance.shape() == (size, size);
        let rows = number(covariance.nrows());
        require(square, "the covariance's rows", rows, "as many as the mean has, and columns too")?;
        if !dense::is_finite(mean) || !dense::is_finite(covariance) {
            return Err(EstimatorError::NotFinite { role });
        }
        let skew = (covariance - covariance.transpose()).norm();
        let factor = dense::cholesky(covariance).filter(|_| skew <= 1e-9 * covariance.norm());
        let factor = factor.ok_or(EstimatorError::NotPositiveDefinite { role })?;
        let share = least_share(&factor, &covariance.diagonal());
        let plain = share > LEAST;
        Ok(Self { estimate, factor: (!plain).then_some(factor), share })
    }

    /// The belief with these moments if no variance, given the components before it, fell below
    /// [`LEAST`] of `variances`.
    #[inline]
    fn plain(estimate: DynamicEstimate, variances: &DVector<f64>) -> Option<Self> {
        let factor = dense::cholesky(&estimate.covariance)?;
        let plain = dense::is_finite(&estimate.mean) && least_share(&factor, variances) > LEAST;
        let share = least_share(&factor, &estimate.covariance.diagonal());
        plain.then_some(Self { estimate, factor: None, share })
    }

    /// The belief with these moments after an update that took from no direction's variance more
    /// than leaves the share `kept` of it, under the condition of [`plain`](Self::plain).
    ///
    /// P⁺ − `kept` P is then positive semi-definite. What remains of a component's variance given
    /// others only grows with the covariance, so that it is `kept` times as large as before at
    /// least. Most updates therefore need no factor: n of them take n³ operations, not n⁴.
    #[inline]
    fn updated(&self, estimate: DynamicEstimate, kept: f64) -> Option<Self> {
        let share = self.share * kept;
        if share > LEAST && dense::is_finite(&estimate.mean) {
            return Some(Self { estimate, factor: None, share });
        }
        Self::plain(estimate, &self.estimate.covariance.diagonal())
    }

    /// The belief with the covariance L Lᵀ of a lower triangular L without negative diagonal.
    #[inline]
    fn of_factor(
        mean: DVector<f64>,
        factor: DMatrix<f64>,
        axes: &[Axis],
    ) -> Result<Self, EstimatorError> {
        let role = Role::Posterior;
        let mean = wrapped(mean, axes);
        let mut covariance = &factor * factor.transpose();
        covariance.fill_upper_triangle_with_lower_triangle();
        if !dense::is_finite(&mean) || !dense::is_finite(&covariance) {
            return Err(EstimatorError::NotFinite { role });
        }
        if factor.diagonal().iter().any(|d| *d <= 0.0) {
            return Err(EstimatorError::NotPositiveDefinite { role });
        }
        if let Some(own) = dense::cholesky(&covariance) {
            let share = least_share(&own, &covariance.diagonal());
            let factor = (share <= LEAST).then_some(factor);
            return Ok(Self { estimate: DynamicEstimate { mean, covariance }, factor, share });
        }
        // A rounded square of a thin factor is made definite by a few units in the last place of
        // its variances (Higham 2002, §10.1); the factor stays as it is.
        let last_places = 1.0 + 8.0 * number(mean.len()) * f64::EPSILON;
        (0..mean.len()).for_each(|i| covariance[(i, i)] *= last_places);
        let estimate = DynamicEstimate { mean, covariance };
        Ok(Self { estimate, factor: Some(factor), share: 0.0 })
    }

    #[inline]
    fn estimate(&self) -> &DynamicEstimate {
        &self.estimate
    }

    /// The factor, where it is kept.
    #[inline]
    fn factor(&self) -> Option<&DMatrix<f64>> {
        self.factor.as_ref()
    }

    /// A factor of the covariance, kept or not.
    #[inline]
    fn root(&self) -> Result<Cow<'_, DMatrix<f64>>, EstimatorError> {
        if let Some(factor) = &self.factor {
            return Ok(Cow::Borrowed(factor));
        }
        let indefinite = EstimatorError::NotPositiveDefinite { role: Role::Prior };
        dense::cholesky(&self.estimate.covariance).map(Cow::Owned).ok_or(indefinite)
    }

    /// A factor of the covariance of some components.
    #[inline]
    fn root_at(&self, components: &[usize]) -> Result<DMatrix<f64>, EstimatorError> {
        if let Some(factor) = &self.factor {
            return Ok(dense::lower_root(factor.select_rows(components)));
        }
        let covariance = self.estimate.covariance.select_rows(components);
        let indefinite = EstimatorError::NotPositiveDefinite { role: Role::Prior };
        dense::cholesky(&covariance.select_columns(components)).ok_or(indefinite)
    }

    /// The belief of this state and of further components that are independent of it.
    #[inline]
    fn and(&self, further: &Self) -> Result<Self, EstimatorError> {
        let parts = [self.estimate.clone(), further.estimate.clone()];
        let estimate = DynamicEstimate::independent(parts);
        if self.factor.is_none() && further.factor.is_none() {
            return Ok(Self { estimate, factor: None, share: self.share.min(further.share) });
        }
        let size = self.estimate.mean.len();
        let whole = estimate.mean.len();
        let mut factor = DMatrix::zeros(whole, whole);
        factor.view_mut((0, 0), (size, size)).copy_from(&*self.root()?);
        let rest = (whole - size, whole - size);
        factor.view_mut((size, size), rest).copy_from(&*further.root()?);
        Ok(Self { estimate, factor: Some(factor), share: 0.0 })
    }

    /// The belief of some components alone, in ascending order.
    #[inline]
    fn at(&self, components: &[usize]) -> Self {
        let mean = self.estimate.mean.select_rows(components);
        let covariance = self.estimate.covariance.select_rows(components);
        let covariance = covariance.select_columns(components);
        let factor = self.factor.as_ref();
        let factor = factor.map(|factor| dense::lower_root(factor.select_rows(components)));
        // Fewer components before it leave a component no less.
        Self { estimate: DynamicEstimate { mean, covariance }, factor, share: self.share }
    }
}

/// The vector with each angle in one turn.
#[inline]
fn wrapped(mut mean: DVector<f64>, axes: &[Axis]) -> DVector<f64> {
    mean.iter_mut().zip(axes).for_each(|(value, axis)| *value = axis.minus(*value, 0.0));
    mean
}

/// Returns true if each share of a variance that remains exceeds [`LEAST`].
#[inline]
fn pivots_exceed(factor: &DMatrix<f64>, variances: &DVector<f64>) -> bool {
    least_share(factor, variances) > LEAST
}

/// The least share of `variances` that the squares of a Cholesky factor's diagonal are; these are
/// each component's variance given those before it.
#[inline]
fn least_share(factor: &DMatrix<f64>, variances: &DVector<f64>) -> f64 {
    let shares = (0..variances.len()).map(|i| factor[(i, i)] * factor[(i, i)] / variances[i]);
    shares.fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A covariance of five components, and its change by a measurement of their sum with this
    /// variance; the share that is kept of the sum's own.
    fn measured(noise: f64) -> (Belief, DynamicEstimate, f64) {
        let covariance = DMatrix::from_fn(5, 5, |i, j| match i == j {
            true => 1.0 + number(i),
            false => 0.3,
        });
        let cross = covariance.column_sum();
        let square = cross.sum() + noise;
        let after = &covariance - &cross * cross.transpose() / square;
        let prior = DynamicEstimate { mean: DVector::zeros(5), covariance };
        let belief = Belief::new(prior, Role::Prior).expect("definite");
        let after = DynamicEstimate { mean: DVector::zeros(5), covariance: after };
        (belief, after, noise / square)
    }

    #[test]
    fn the_share_that_remains_is_a_lower_bound() {
        for noise in [100.0, 1.0, 1e-3] {
            let (belief, after, kept) = measured(noise);
            let updated = belief.updated(after.clone(), kept).expect("far from singular");
            let factor = dense::cholesky(&after.covariance).expect("definite");
            let exact = least_share(&factor, &after.covariance.diagonal());
            assert!(updated.share <= exact && updated.share > LEAST, "{noise}: {exact}");
            assert!(updated.factor().is_none());
            // Steps that are each far from singular end at a covariance that is not.
            let rest = [kept; 3].iter().fold(updated, |belief, kept| {
                belief.updated(after.clone(), *kept).expect("far from singular")
            });
            assert!(rest.share > LEAST, "{noise}");
        }
        let (belief, after, kept) = measured(1e-9);
        assert!(belief.updated(after, kept).is_none());
    }
}
