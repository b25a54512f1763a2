use nalgebra::{DMatrix, DVector};

use crate::{Covariance, Estimate, State};

/// An estimate of a state whose size is known at run time only, such as that of all targets or of
/// all stations together.
///
/// ```
/// use foxhunt_core::{DynamicEstimate, Estimate, nalgebra::{Vector1, Vector2}};
///
/// let target = Estimate::isotropic(Vector2::new(30.0, 40.0), 10.0);
/// let offset = Estimate::isotropic(Vector1::new(0.0), 3.0);
/// let stations = 5;
/// let joint = DynamicEstimate::independent(
///     std::iter::once(target.into()).chain((0..stations).map(|_| offset.into())),
/// );
/// assert_eq!(joint.mean.len(), 7);
/// assert_eq!(joint.at([0, 1]), Some(target));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DynamicEstimate {
    /// The mean.
    pub mean: DVector<f64>,
    /// The covariance about the mean.
    pub covariance: DMatrix<f64>,
}

impl DynamicEstimate {
    /// The estimate of a joint state whose parts are independent and stand one after the other.
    #[must_use]
    pub fn independent(parts: impl IntoIterator<Item = Self>) -> Self {
        let mut joint = Self { mean: DVector::zeros(0), covariance: DMatrix::zeros(0, 0) };
        for part in parts {
            let before = joint.mean.len();
            let size = part.mean.len();
            joint.mean = joint.mean.resize_vertically(before + size, 0.0);
            joint.mean.rows_mut(before, size).copy_from(&part.mean);
            joint.covariance = joint.covariance.resize(before + size, before + size, 0.0);
            joint.covariance.view_mut((before, before), (size, size)).copy_from(&part.covariance);
        }
        joint
    }

    /// The estimate of some components, in this order; `None` where one of them does not exist.
    #[must_use]
    pub fn at<const N: usize>(&self, components: [usize; N]) -> Option<Estimate<N>> {
        let dimension = self.mean.len();
        let exist = components.iter().all(|component| *component < dimension);
        (exist && self.covariance.shape() == (dimension, dimension)).then(|| Estimate {
            mean: State::from_fn(|i, _| self.mean[components[i]]),
            covariance: Covariance::from_fn(|i, j| self.covariance[(components[i], components[j])]),
        })
    }

    /// The normalised estimation error squared, as [`Estimate::nees`]; `None` where the covariance
    /// is not positive definite or the truth has another length.
    #[must_use]
    #[inline]
    pub fn nees(&self, truth: &DVector<f64>) -> Option<f64> {
        let dimension = self.mean.len();
        if truth.len() != dimension || self.covariance.shape() != (dimension, dimension) {
            return None;
        }
        let error = truth - &self.mean;
        Some(error.dot(&self.covariance.clone().cholesky()?.solve(&error)))
    }
}

impl<const N: usize> From<Estimate<N>> for DynamicEstimate {
    fn from(estimate: Estimate<N>) -> Self {
        let Estimate { mean, covariance } = estimate;
        Self {
            mean: DVector::from_column_slice(mean.as_slice()),
            covariance: DMatrix::from_column_slice(N, N, covariance.as_slice()),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector1, Vector2};

    use super::*;

    #[test]
    fn parts_come_out_as_they_went_in() {
        let first =
            Estimate { mean: Vector2::new(1.0, 2.0), covariance: Matrix2::new(4.0, 1.0, 1.0, 9.0) };
        let second = Estimate::isotropic(Vector1::new(-5.0), 0.5);
        let joint = DynamicEstimate::independent([first.into(), second.into()]);
        assert_eq!(joint.at([0, 1]), Some(first));
        assert_eq!(joint.at([2]), Some(second));
        let crossed = joint.at([2, 1]).expect("both exist");
        assert_eq!(crossed.mean, Vector2::new(-5.0, 2.0));
        assert_eq!(crossed.covariance, Matrix2::new(0.25, 0.0, 0.0, 9.0));
        assert_eq!(joint.at([3]), None);
    }

    #[test]
    fn the_nees_is_that_of_the_static_estimate() {
        let estimate =
            Estimate { mean: Vector2::new(1.0, 2.0), covariance: Matrix2::new(4.0, 1.0, 1.0, 9.0) };
        let joint = DynamicEstimate::from(estimate);
        let own = estimate.nees(&Vector2::new(3.0, -1.0)).expect("definite");
        let dynamic = joint.nees(&DVector::from_vec(alloc::vec![3.0, -1.0])).expect("definite");
        assert!((own - dynamic).abs() < 1e-14);
        assert_eq!(joint.nees(&DVector::zeros(3)), None);
    }
}
