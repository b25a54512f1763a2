use alloc::{vec, vec::Vec};

use foxhunt_core::Estimate;
use nalgebra::{Matrix2, Vector2};

use super::{
    BearingLine, BearingWeights,
    line::check,
    moments::{reach, reciprocal_condition},
    weights::inverse_concentration,
};
use crate::batch::{BatchError, positive};

/// Triangulation by maximum likelihood for von Mises errors, or by M-estimation
/// (Lenth 1981, "On finding the source of a signal", Technometrics 23(2), 149-154).
///
/// Bearings θᵢ taken at pᵢ have one unknown concentration κ. With nᵢ = (sin θᵢ, −cos θᵢ) and
/// mᵢ = (sin μᵢ, −cos μᵢ) / dᵢ², scaled by the distance dᵢ as the paper's s* and c* are, the
/// stationary place solves Σ wᵢ mᵢ nᵢᵀ x = Σ wᵢ mᵢ nᵢᵀ pᵢ (eq. 2.6), which is iterated; κ follows from the
/// weighted mean cosine of the errors (eq. 2.10). The covariance is κ⁻¹ times the inverse of the
/// symmetric part of that matrix.
///
/// ```
/// use foxhunt_core::nalgebra::Vector2;
/// use foxhunt_filters::{BearingLine, Lenth1981};
/// let heard = [(0.0, 0.0, 0.80), (100.0, 0.0, 2.30), (50.0, -40.0, 1.59), (0.0, 90.0, -0.72)];
/// let lines = heard.map(|(x, y, bearing)| BearingLine { receiver: Vector2::new(x, y), bearing });
/// let fix = Lenth1981::maximum_likelihood().locate(&lines)?;
/// assert!((fix.position.mean - Vector2::new(48.0, 49.0)).norm() < 3.0);
/// # Ok::<(), foxhunt_filters::BatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lenth1981 {
    weights: BearingWeights,
    kappa: Option<f64>,
    most_iterations: u32,
}

/// Where lines of bearing meet.
#[derive(Clone, Debug, PartialEq)]
pub struct BearingFix {
    /// The place with its covariance, East and North in metres.
    pub position: Estimate<2>,
    /// The concentration κ of the errors, about 1/σ² in rad⁻². Bearings that meet in a point
    /// leave it unbounded; it is told as 10¹² then, σ = 1 µrad.
    pub kappa: f64,
    /// What each bearing counted, in [0, 1].
    pub weights: Vec<f64>,
    /// How many iterations it took.
    pub iterations: u32,
}

/// Where the iteration has settled: a step below this share of the receivers' extent.
const SETTLED: f64 = 1e-12;

/// The largest κ.
const MOST_KAPPA: f64 = 1e12;

impl Lenth1981 {
    /// Bearings that all count alike; at most 1000 iterations.
    #[must_use]
    pub fn maximum_likelihood() -> Self {
        Self { weights: BearingWeights::Even, kappa: None, most_iterations: 1000 }
    }

    /// The M-estimator with the given weights; the paper's example has c = 1.5.
    ///
    /// # Errors
    ///
    /// [`BatchError::Setting`] when c is not a positive number.
    pub fn with_weights(self, weights: BearingWeights) -> Result<Self, BatchError> {
        Ok(Self { weights: weights.check()?, ..self })
    }

    /// The same with a κ that is known, in rad⁻²; two bearings are enough then.
    ///
    /// # Errors
    ///
    /// [`BatchError::Setting`] when it is not a positive number.
    pub fn with_kappa(self, kappa: f64) -> Result<Self, BatchError> {
        Ok(Self { kappa: Some(positive("kappa", kappa)?), ..self })
    }

    /// The same with another limit to the iterations.
    #[must_use]
    pub fn with_most_iterations(self, most_iterations: u32) -> Self {
        Self { most_iterations, ..self }
    }

    /// The place where the bearings meet best.
    ///
    /// # Errors
    ///
    /// [`BatchError::TooFew`] below three bearings, two with a known κ; [`BatchError::Value`]
    /// for a number that is not finite; [`BatchError::Flat`] when the bearings are parallel;
    /// [`BatchError::RanAway`] when the iteration left every bounded region,
    /// [`BatchError::NotConverged`] when it did not settle, and [`BatchError::Contradiction`]
    /// when it did where the bearings do not point.
    pub fn locate(&self, lines: &[BearingLine]) -> Result<BearingFix, BatchError> {
        check(lines.iter(), if self.kappa.is_some() { 2 } else { 3 })?;
        let extent = reach(lines.iter().map(|line| line.receiver));
        let mut weights = vec![1.0; lines.len()];
        // The start takes all distances for equal (Lenth 1981, §2).
        let even: Vec<_> = lines.iter().map(BearingLine::normal).collect();
        let mut place = solve(lines, &weights, &even)?;
        for iterations in 1..=self.most_iterations {
            let distance_m = (place - extent.centre).norm();
            if distance_m.is_nan() || distance_m > extent.limit {
                return Err(BatchError::RanAway { distance_m, limit_m: extent.limit });
            }
            let kappa = self.weigh(lines, &place, &mut weights);
            let next = solve(lines, &weights, &moments(lines, &place))?;
            let step = (next - place).norm();
            place = next;
            if step <= SETTLED * extent.radius {
                return self.fix(lines, place, weights, kappa, iterations);
            }
        }
        Err(BatchError::NotConverged { iterations: self.most_iterations })
    }

    /// κ at a place, and the weights that follow.
    fn weigh(&self, lines: &[BearingLine], place: &Vector2<f64>, weights: &mut [f64]) -> f64 {
        let mean = mean_cosine(lines, place, weights);
        let inverse = inverse_concentration(mean).max(1.0 / MOST_KAPPA);
        let kappa = self.kappa.unwrap_or(1.0 / inverse);
        for (line, weight) in lines.iter().zip(weights) {
            *weight = self
                .weights
                .of(libm::sqrt(libm::fmax(0.0, 2.0 * kappa * (1.0 - line.cosine(place)))));
        }
        kappa
    }

    fn fix(
        &self,
        lines: &[BearingLine],
        place: Vector2<f64>,
        weights: Vec<f64>,
        kappa: f64,
        iterations: u32,
    ) -> Result<BearingFix, BatchError> {
        let matrix = normal_matrix(lines, &weights, &moments(lines, &place));
        let symmetric: Matrix2<f64> = (matrix + matrix.transpose()) * 0.5;
        let mean_cosine = mean_cosine(lines, &place, &weights);
        let factor = symmetric.cholesky().filter(|_| mean_cosine > 0.0);
        let factor = factor.ok_or(BatchError::Contradiction { mean_cosine })?;
        let covariance = factor.solve(&Matrix2::identity()) / kappa;
        let position =
            Estimate { mean: place, covariance: (covariance + covariance.transpose()) * 0.5 };
        Ok(BearingFix { position, kappa, weights, iterations })
    }
}

/// Σ w cos e / Σ w; −1 where no bearing counts.
fn mean_cosine(lines: &[BearingLine], place: &Vector2<f64>, weights: &[f64]) -> f64 {
    let total: f64 = weights.iter().sum();
    let weighted = lines.iter().zip(weights).map(|(line, w)| w * line.cosine(place));
    if total > 0.0 { weighted.sum::<f64>() / total } else { -1.0 }
}

/// The paper's (s*, −c*): the normal of the sight line over the distance squared.
fn moments(lines: &[BearingLine], place: &Vector2<f64>) -> Vec<Vector2<f64>> {
    let moment = |line: &BearingLine| {
        let way = place - line.receiver;
        let distance = way.norm().max(f64::MIN_POSITIVE);
        Vector2::new(way.y / distance, -way.x / distance) / distance / distance
    };
    lines.iter().map(moment).collect()
}

fn normal_matrix(lines: &[BearingLine], weights: &[f64], m: &[Vector2<f64>]) -> Matrix2<f64> {
    let mut matrix = Matrix2::zeros();
    for ((line, w), m) in lines.iter().zip(weights).zip(m) {
        matrix += m * line.normal().transpose() * *w;
    }
    matrix
}

/// The place where Σ w m nᵀ (x − p) = 0.
fn solve(
    lines: &[BearingLine],
    weights: &[f64],
    m: &[Vector2<f64>],
) -> Result<Vector2<f64>, BatchError> {
    let matrix = normal_matrix(lines, weights, m);
    let rcond = reciprocal_condition(&matrix);
    // About the first receiver, so that a frame far from its origin costs no digits.
    let origin = lines.first().map_or_else(Vector2::zeros, |line| line.receiver);
    let mut right = Vector2::zeros();
    for ((line, w), m) in lines.iter().zip(weights).zip(m) {
        right += m * (w * line.normal().dot(&(line.receiver - origin)));
    }
    if rcond < 1e-14 {
        return Err(BatchError::Flat { rcond });
    }
    let step = matrix.lu().solve(&right).ok_or(BatchError::Flat { rcond: 0.0 })?;
    Ok(origin + step)
}
