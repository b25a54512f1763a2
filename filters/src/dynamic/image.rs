//! Gaussians of any size through maps.

use foxhunt_core::{DynamicMeasurement, DynamicMotion, EstimatorError, Pose, parameter::require};
use nalgebra::{DMatrix, DVector};

use super::dense;
use crate::{TransformRule, count::number};

/// A map of a vector of any size.
pub(super) trait DynamicMap {
    fn value(&self, x: &DVector<f64>) -> DVector<f64>;

    fn jacobian(&self, x: &DVector<f64>) -> DMatrix<f64>;

    /// The odd and the even part of the change over an offset from `x`, whose image is `image`.
    fn parts(
        &self,
        x: &DVector<f64>,
        image: &DVector<f64>,
        offset: &DVector<f64>,
    ) -> [DVector<f64>; 2];
}

/// f(·, Δt).
pub(super) struct OverTime<'a>(pub &'a dyn DynamicMotion, pub f64);

impl DynamicMap for OverTime<'_> {
    fn value(&self, x: &DVector<f64>) -> DVector<f64> {
        self.0.propagate(x, self.1)
    }

    fn jacobian(&self, x: &DVector<f64>) -> DMatrix<f64> {
        self.0.jacobian(x, self.1)
    }

    fn parts(
        &self,
        x: &DVector<f64>,
        image: &DVector<f64>,
        offset: &DVector<f64>,
    ) -> [DVector<f64>; 2] {
        self.0.propagated_parts(x, image, offset, self.1)
    }
}

/// h(·; pose).
pub(super) struct AtReceiver<'a, H: ?Sized>(pub &'a H, pub &'a Pose);

impl<H: ?Sized + DynamicMeasurement> DynamicMap for AtReceiver<'_, H> {
    fn value(&self, x: &DVector<f64>) -> DVector<f64> {
        self.0.expected(x, self.1)
    }

    fn jacobian(&self, x: &DVector<f64>) -> DMatrix<f64> {
        self.0.jacobian(x, self.1)
    }

    fn parts(
        &self,
        x: &DVector<f64>,
        image: &DVector<f64>,
        offset: &DVector<f64>,
    ) -> [DVector<f64>; 2] {
        self.0.expected_parts(x, image, offset, self.1)
    }
}

/// The image y of a Gaussian x ~ N(x̂, L Lᵀ): y ≈ ŷ + A (x − x̂) + e, e ~ N(0, W Wᵀ).
pub(super) struct Image {
    pub mean: DVector<f64>,
    pub slope: Slope,
    /// W, a row for each component; it has no columns where nothing is left unexplained.
    pub unexplained: DMatrix<f64>,
}

/// The regression of the image on the state.
pub(super) enum Slope {
    /// A itself, the Jacobian at the mean.
    Direct(DMatrix<f64>),
    /// V = Lᵀ Aᵀ, which sigma points give, and L.
    Whitened { cross: DMatrix<f64>, root: DMatrix<f64> },
}

impl Image {
    /// The image under a rule. `root` makes L, which the slope at the mean does not need.
    pub(super) fn new(
        rule: TransformRule,
        mean: &DVector<f64>,
        root: impl FnOnce() -> Result<DMatrix<f64>, EstimatorError>,
        map: &impl DynamicMap,
    ) -> Result<Self, EstimatorError> {
        match rule {
            TransformRule::Slope => {
                let value = map.value(mean);
                let unexplained = DMatrix::zeros(value.len(), 0);
                Ok(Self { mean: value, slope: Slope::Direct(map.jacobian(mean)), unexplained })
            }
            TransformRule::Pairs { square, kurtosis } => {
                Self::of_pairs([square, kurtosis], mean, root()?, map)
            }
        }
    }

    /// The image by pairs of points x̂ ± c lᵢ, with the formulas of the static transforms: the
    /// slopes are the rows of V, and W has a column for the curvature along each lᵢ.
    fn of_pairs(
        [square, kurtosis]: [f64; 2],
        mean: &DVector<f64>,
        root: DMatrix<f64>,
        map: &impl DynamicMap,
    ) -> Result<Self, EstimatorError> {
        let centre = map.value(mean);
        let dimension = mean.len();
        let spread = libm::sqrt(square);
        let mut cross = DMatrix::zeros(dimension, centre.len());
        let mut bent = DMatrix::zeros(centre.len(), dimension);
        for i in 0..dimension {
            let offset = root.column(i) * spread;
            let [odd, even] = map.parts(mean, &centre, &offset);
            for part in [&odd, &even] {
                let own = number(part.len());
                require(part.len() == centre.len(), "the size of a change", own, "the model's")?;
            }
            cross.set_row(i, &(odd / spread).transpose());
            bent.set_column(i, &(even / spread));
        }
        let curvature: DVector<f64> = bent.column_sum() / spread;
        let count = number(dimension);
        let common = &curvature * (libm::sqrt(kurtosis / count) - spread / count);
        bent.column_iter_mut().for_each(|mut each| each += &common);
        let slope = Slope::Whitened { cross, root };
        Ok(Self { mean: centre + curvature, slope, unexplained: bent })
    }

    /// Returns true if each part has one row for each of `components`, and a column for each of the
    /// `dimension` components of the state.
    #[inline]
    pub(super) fn fits(&self, components: usize, dimension: usize) -> bool {
        let slope = match &self.slope {
            Slope::Direct(slope) => slope.shape() == (components, dimension),
            Slope::Whitened { cross, .. } => cross.shape() == (dimension, components),
        };
        slope && self.mean.len() == components
    }
}

impl Slope {
    /// Aᵀ.
    #[inline]
    pub(super) fn transposed(&self) -> DMatrix<f64> {
        match self {
            Self::Direct(slope) => slope.transpose(),
            Self::Whitened { cross, root } => dense::solve_transposed(root, cross.clone()),
        }
    }

    /// A R for rows R of a factor of the whole covariance: with R Rᵀ = L Lᵀ.
    #[inline]
    pub(super) fn carried(&self, rows: DMatrix<f64>) -> DMatrix<f64> {
        match self {
            Self::Direct(slope) => slope * rows,
            // L⁻¹ R has orthonormal rows, whatever the condition of L.
            Self::Whitened { cross, root } => cross.tr_mul(&dense::solve_lower(root, rows)),
        }
    }

    /// The regression of some components of the image.
    #[inline]
    pub(super) fn of(self, present: &[usize]) -> Self {
        match self {
            Self::Direct(slope) => Self::Direct(slope.select_rows(present)),
            Self::Whitened { cross, root } => {
                Self::Whitened { cross: cross.select_columns(present), root }
            }
        }
    }
}
