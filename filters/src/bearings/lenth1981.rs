//! Robust triangulation under von Mises errors (Lenth 1981).

use alloc::{vec, vec::Vec};

use foxhunt_core::{Ellipse, Estimate, parameter::positive};
use nalgebra::{Matrix2, Vector2};

use super::{BearingLine, check, reach, reciprocal_condition};
use crate::batch::BatchError;

/// Step of a settled iteration, as a share of the receivers' extent, or of the distance from their
/// mean where that is larger.
const SETTLED: f64 = 1e-12;

/// The largest κ.
const MOST_KAPPA: f64 = 1e12;

/// Weights of bearings that stray (Lenth 1981, eq. 4.5 to 4.7), by their standardised error t =
/// √(2κ (1 − cos e)): about the error in standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum BearingWeights {
    /// All alike: the maximum likelihood of von Mises errors.
    Even,
    /// Huber's: 1 up to `c`, then c/t. Usual is 1.5.
    Huber {
        /// Standardised error at which the weight begins to fall.
        c: f64,
    },
    /// Andrews's sine: sin(t/c) / (t/c) up to πc, then nothing. Usual is 1.5.
    Andrews {
        /// The scale of the sine.
        c: f64,
    },
}

impl BearingWeights {
    fn check(self) -> Result<Self, BatchError> {
        match self {
            Self::Even => {}
            Self::Huber { c } | Self::Andrews { c } => {
                positive("c", c)?;
            }
        }
        Ok(self)
    }

    /// The weight of a standardised error t ≥ 0.
    fn of(&self, t: f64) -> f64 {
        match *self {
            Self::Huber { c } if t > c => c / t,
            Self::Andrews { c } if t >= core::f64::consts::PI * c => 0.0,
            Self::Andrews { c } if t > 1e-8 * c => libm::sin(t / c) / (t / c),
            _ => 1.0,
        }
    }
}

/// Triangulation by maximum likelihood for von Mises errors, or by M-estimation (Lenth 1981, "On
/// finding the source of a signal", Technometrics 23(2), 149-154).
///
/// Bearings θᵢ taken at pᵢ have one unknown concentration κ. With nᵢ = (sin θᵢ, −cos θᵢ) and mᵢ =
/// (sin μᵢ, −cos μᵢ) / dᵢ², scaled by the distance dᵢ as the paper's s* and c* are, the stationary
/// place solves Σ wᵢ mᵢ nᵢᵀ x = Σ wᵢ mᵢ nᵢᵀ pᵢ (eq. 2.6), which is iterated; κ follows from the
/// weighted mean cosine of the errors (eq. 2.10). The covariance is κ⁻¹ times the inverse of the
/// symmetric part of that matrix.
///
/// Coordinates are taken about the receivers' mean, in units of their extent, so that neither the
/// origin nor the scale of the frame matters.
///
/// Where κ is estimated, the paper's covariance is too small for few bearings: take an ellipse
/// from [`BearingFix::ellipse`].
///
/// ```
/// use foxhunt_core::nalgebra::Vector2;
/// use foxhunt_filters::{BearingLine, Lenth1981};
/// let bearings = [(0.0, 0.0, 0.80), (100.0, 0.0, 2.30), (50.0, -40.0, 1.59), (0.0, 90.0, -0.72)];
/// let line = |(x, y, bearing)| BearingLine { receiver: Vector2::new(x, y), bearing };
/// let lines = bearings.map(line);
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
    /// [`BatchError::Parameter`] when c is not a positive number.
    pub fn with_weights(self, weights: BearingWeights) -> Result<Self, BatchError> {
        Ok(Self { weights: weights.check()?, ..self })
    }

    /// Sets a known κ, in rad⁻²; two bearings are enough then.
    ///
    /// # Errors
    ///
    /// [`BatchError::Parameter`] when it is not a positive number.
    pub fn with_kappa(self, kappa: f64) -> Result<Self, BatchError> {
        Ok(Self { kappa: Some(positive("kappa", kappa)?), ..self })
    }

    /// Sets the limit to the iterations.
    #[must_use]
    pub fn with_most_iterations(self, most_iterations: u32) -> Self {
        Self { most_iterations, ..self }
    }

    /// The place where the bearings meet best.
    ///
    /// # Errors
    ///
    /// [`BatchError::TooFew`] below three bearings, two with a known κ; [`BatchError::Value`] for a
    /// number that is not finite; [`BatchError::Flat`] when the bearings are parallel;
    /// [`BatchError::RanAway`] when the iteration left every bounded region,
    /// [`BatchError::NotConverged`] when it did not settle, and [`BatchError::Contradiction`] when
    /// it did where the bearings do not point.
    pub fn locate(&self, lines: &[BearingLine]) -> Result<BearingFix, BatchError> {
        check(lines.iter(), if self.kappa.is_some() { 2 } else { 3 })?;
        let extent = reach(lines.iter().map(|line| line.receiver));
        if extent.radius <= 0.0 {
            // All bearings are from one place.
            return Err(BatchError::Flat { rcond: 0.0 });
        }
        let relative = |line: &BearingLine| BearingLine {
            receiver: (line.receiver - extent.centre) / extent.radius,
            ..*line
        };
        let lines: Vec<BearingLine> = lines.iter().map(relative).collect();
        let lines = lines.as_slice();
        let mut weights = vec![1.0; lines.len()];
        // The start takes all distances for equal (Lenth 1981, eq. 2.6).
        let even: Vec<_> = lines.iter().map(BearingLine::normal).collect();
        let mut place = solve(lines, &weights, &even)?;
        for iterations in 1..=self.most_iterations {
            let distance_m = place.norm() * extent.radius;
            if distance_m.is_nan() || distance_m > extent.limit {
                return Err(BatchError::RanAway { distance_m, limit_m: extent.limit });
            }
            let kappa = self.weigh(lines, &place, &mut weights);
            let next = solve(lines, &weights, &moments(lines, &place))?;
            let step = (next - place).norm();
            place = next;
            if step <= SETTLED * place.norm().max(1.0) {
                let fix = self.fix(lines, place, weights, kappa, iterations)?;
                let mean = fix.position.mean * extent.radius + extent.centre;
                let covariance = fix.position.covariance * (extent.radius * extent.radius);
                return Ok(BearingFix { position: Estimate { mean, covariance }, ..fix });
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
        let degrees = weights.iter().sum::<f64>() - 2.0;
        let degrees_of_freedom = self.kappa.is_none().then_some(degrees);
        Ok(BearingFix { position, kappa, weights, iterations, degrees_of_freedom })
    }
}

/// Place where lines of bearing meet.
#[derive(Clone, Debug, PartialEq)]
pub struct BearingFix {
    /// The place with its covariance, East and North in metres. Where κ was estimated, this is
    /// the covariance of the paper, for many bearings; see [`ellipse`](Self::ellipse).
    pub position: Estimate<2>,
    /// The concentration κ of the errors, about 1/σ² in rad⁻². Bearings that meet in a point
    /// leave it unbounded; it is then given as 10¹², σ = 1 µrad.
    pub kappa: f64,
    /// Weight of each bearing, in [0, 1].
    pub weights: Vec<f64>,
    /// Number of iterations.
    pub iterations: u32,
    /// The degrees of freedom of an estimated κ: the sum of the weights less two; `None` where κ
    /// was given.
    pub degrees_of_freedom: Option<f64>,
}

impl BearingFix {
    /// The ellipse that holds the target with the given probability.
    ///
    /// With n bearings of weights that sum to W, 1/κ is estimated with ν = W − 2 degrees of
    /// freedom, and from W rather than ν squares. So the ellipse is that of the quantile 2 F₂,ν
    /// in place of χ²₂, over the covariance times W / ν. Where κ was given it is that of
    /// χ²₂.
    ///
    /// `None` where no degree of freedom is left, the covariance is not positive definite, or
    /// `probability` is not in (0, 1).
    #[must_use]
    pub fn ellipse(&self, probability: f64) -> Option<Ellipse> {
        let Some(degrees) = self.degrees_of_freedom else {
            return self.position.ellipse(probability);
        };
        if !(degrees > 0.0 && probability > 0.0 && probability < 1.0) {
            return None;
        }
        let log_outside = libm::log1p(-probability);
        // The quantiles in closed form: F₂,ν is (ν / 2) ((1 − p)^(−2 / ν) − 1), χ²₂
        // −2 ln(1 − p).
        let twice_f = degrees * libm::expm1(-2.0 * log_outside / degrees);
        let scale = twice_f / (-2.0 * log_outside) * (degrees + 2.0) / degrees;
        let covariance = self.position.covariance * scale;
        Estimate { covariance, ..self.position }.ellipse(probability)
    }
}

/// 1/κ for a mean cosine C̄ of the errors (Lenth 1981, eq. 2.10, his approximation of the inverse
/// of I₁(κ)/I₀(κ)).
fn inverse_concentration(mean_cosine: f64) -> f64 {
    let c = mean_cosine;
    let apart = 1.0 - c;
    2.0 * apart + apart * apart * (0.48794 - 0.82905 * c - 1.3915 * c * c) / c
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
    let mut right = Vector2::zeros();
    for ((line, w), m) in lines.iter().zip(weights).zip(m) {
        right += m * (w * line.normal().dot(&line.receiver));
    }
    if rcond < 1e-14 {
        return Err(BatchError::Flat { rcond });
    }
    matrix.lu().solve(&right).ok_or(BatchError::Flat { rcond: 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn the_concentration_is_that_of_the_paper() {
        // 2 (1 − C) + (1 − C)² (0.48794 − 0.82905 C − 1.3915 C²) / C, by hand.
        assert_abs_diff_eq!(inverse_concentration(0.8), 0.346_707, epsilon = 1e-12);
        assert_abs_diff_eq!(inverse_concentration(0.5), 0.862_77, epsilon = 1e-12);
    }

    #[test]
    fn weights_fall_where_the_paper_lets_them() {
        let huber = BearingWeights::Huber { c: 1.5 };
        assert_abs_diff_eq!(huber.of(1.4), 1.0, epsilon = 1e-15);
        assert_abs_diff_eq!(huber.of(3.0), 0.5, epsilon = 1e-15);
        let andrews = BearingWeights::Andrews { c: 1.5 };
        let quarter = 0.75 * core::f64::consts::PI;
        assert_abs_diff_eq!(andrews.of(quarter), core::f64::consts::FRAC_2_PI, epsilon = 1e-15);
        assert!(andrews.of(2.0 * quarter + 1e-9) < 1e-9 && andrews.of(9.0) <= 0.0);
        assert_abs_diff_eq!(andrews.of(0.0), 1.0, epsilon = 1e-15);
    }

    #[test]
    fn the_concentration_is_near_the_ratio_of_bessel_functions() {
        // I₁(κ)/I₀(κ) (Mardia & Jupp 2000, appendix 1).
        for (kappa, ratio) in [(1.0, 0.446_40), (2.0, 0.697_77), (5.0, 0.893_38), (10.0, 0.948_60)]
        {
            let found = 1.0 / inverse_concentration(ratio);
            assert_abs_diff_eq!(found / kappa, 1.0, epsilon = 0.03);
        }
    }
}
