//! The law of received power over range, fitted to points; and why nothing can be calibrated.

use foxhunt_core::{Ellipse, Estimate, parameter::ParameterError};
use nalgebra::{Matrix2, Vector2};

use super::statistics::quantile;
use crate::LogDistance;

/// Reason that nothing can be calibrated from the points.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The parameters and a residual need more points.
    #[error("there are {points} points to calibrate from; at least {needed} are needed")]
    TooFew {
        /// Number of points.
        points: usize,
        /// Number of points that are needed.
        needed: usize,
    },
    /// All points lie at one range: power and exponent cannot be separated.
    #[error("all points lie at {range} m; the exponent needs different ranges")]
    OneRange {
        /// That range, in metres.
        range: f64,
    },
    /// A range is not a positive number.
    #[error("the range of point {index} is {range} m, not a positive number")]
    Range {
        /// Index of the point, from 0.
        index: usize,
        /// The range, in metres.
        range: f64,
    },
    /// A power is NaN or infinite.
    #[error("the power of point {index} is {rss_dbm} dBm, not a finite number")]
    Rss {
        /// Index of the point, from 0.
        index: usize,
        /// The power, in dBm.
        rss_dbm: f64,
    },
    /// The bound on the exponent is not a positive number.
    #[error("the bound on the exponent is {bound}, not a positive number")]
    Bound {
        /// The bound.
        bound: f64,
    },
    /// A bearing, a heading, an error or a σ is out of its range.
    #[error("the {field} of point {index} is {value}, not {requirement}")]
    Field {
        /// Index of the point, from 0.
        index: usize,
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        value: f64,
        /// The requirement that the value does not meet.
        requirement: &'static str,
    },
    /// The bearings' errors cancel: they single out no offset.
    #[error("the bearings' errors single out no offset (resultant length {resultant:.3})")]
    Scattered {
        /// Mean resultant length of the bearings' errors, from 0 (none) to 1 (sharp).
        resultant: f64,
    },
    /// The headings are too much alike for an offset that depends on them.
    #[error("the headings span too little of the circle to fit how the offset depends on them")]
    Headings,
    /// All errors are 0, or rounding beside their σ: there is no scale to find.
    #[error(
        "the errors are negligible beside their standard deviations, so no scale can be fitted"
    )]
    NoError,
    /// The fitted parameters make no station.
    #[error("the station: {0}")]
    Station(ParameterError),
}

/// A log-distance law fitted to points of range and power, and how well they fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathLossFit {
    /// P₀: the power at one metre, in dBm.
    pub reference_dbm: f64,
    /// γ, the path-loss exponent.
    pub exponent: f64,
    /// Number of points.
    pub points: usize,
    /// The root of the mean squared residual, in dB.
    pub rmse_db: f64,
    /// The estimate of the noise's standard deviation in dB: the root of the squared residuals over
    /// the degrees of freedom.
    pub sigma_db: f64,
    /// The covariance of P₀ and γ, in dB² and dB. Where the bound holds γ it is that of P₀
    /// alone, on condition of γ, and zero elsewhere.
    pub covariance: Matrix2<f64>,
    /// True if γ was held by its upper bound.
    pub at_bound: bool,
}

impl PathLossFit {
    /// The fitted law.
    ///
    /// # Errors
    ///
    /// If the exponent is not positive: power must fall with range.
    pub fn law(&self) -> Result<LogDistance, ParameterError> {
        LogDistance::new(self.reference_dbm, self.exponent)
    }

    /// The standard error of P₀ in dB; on condition of γ where γ is at its bound.
    #[must_use]
    pub fn reference_error_db(&self) -> f64 {
        libm::sqrt(self.covariance[(0, 0)])
    }

    /// The standard error of γ; 0 where γ is at its bound.
    #[must_use]
    pub fn exponent_error(&self) -> f64 {
        libm::sqrt(self.covariance[(1, 1)])
    }

    /// The interval that holds P₀ in dBm with the given probability, by Student's t; on condition
    /// of γ where γ is at its bound. `None` when `probability` is not in (0, 1).
    #[must_use]
    pub fn reference_interval(&self, probability: f64) -> Option<[f64; 2]> {
        self.interval(self.reference_dbm, self.reference_error_db(), probability)
    }

    /// The interval that holds γ with the given probability, by Student's t. `None` where γ is at
    /// its bound, or `probability` is not in (0, 1).
    #[must_use]
    pub fn exponent_interval(&self, probability: f64) -> Option<[f64; 2]> {
        let free = !self.at_bound;
        free.then(|| self.interval(self.exponent, self.exponent_error(), probability)).flatten()
    }

    /// The ellipse that holds P₀ and γ together with the given probability: all (P₀, γ) with
    /// eᵀ C⁻¹ e ≤ 2 F₂,ₙ₋₂, e their difference from the fit, C the covariance (Draper & Smith 1998,
    /// §5.4).
    ///
    /// The ellipse's plane has P₀ in dB along the first axis and γ along the second; its lengths
    /// and orientation refer to that plane. `None` where γ is at its bound and only P₀ is
    /// uncertain, where the points lie on the law, or where `probability` is not in (0, 1).
    #[must_use]
    pub fn region(&self, probability: f64) -> Option<Ellipse> {
        if self.at_bound || !(probability > 0.0 && probability < 1.0) {
            return None;
        }
        // The quantile of F with 2 and m degrees of freedom, twice, is m ((1 − p)^(−2/m) − 1); a
        // Gaussian's ellipse has −2 ln(1 − p) in its place.
        let tail = -libm::log1p(-probability);
        let m = self.freedom();
        let widening = m * libm::expm1(2.0 * tail / m) / (2.0 * tail);
        let mean = Vector2::new(self.reference_dbm, self.exponent);
        Estimate { mean, covariance: self.covariance * widening }.ellipse(probability)
    }

    /// The correlation of P₀ and γ, in [−1, 1]; 0 where γ is at its bound.
    #[must_use]
    pub fn correlation(&self) -> f64 {
        let product = self.reference_error_db() * self.exponent_error();
        if product > 0.0 { self.covariance[(0, 1)] / product } else { 0.0 }
    }

    /// The degrees of freedom that are left for the noise.
    fn freedom(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "points fit into memory many times over")]
        let points = self.points as f64;
        if self.at_bound { points - 1.0 } else { points - 2.0 }
    }

    fn interval(&self, value: f64, error: f64, probability: f64) -> Option<[f64; 2]> {
        let reach = quantile(self.freedom(), probability)? * error;
        Some([value - reach, value + reach])
    }
}

/// Fits P = P₀ − 10 γ log₁₀ d by least squares to points of range in metres and mean power in dBm,
/// with γ at most `max_exponent` if there is one (Pritzl 2018, §7.1, and 3.0 in §7.2).
///
/// ```
/// use foxhunt_sensors::fit_log_distance;
/// # fn main() -> Result<(), foxhunt_sensors::CalibrationError> {
/// let fit = fit_log_distance([(1.0, -30.0), (10.0, -50.0), (100.0, -70.0)], None)?;
/// assert!((fit.exponent - 2.0).abs() < 1e-12 && (fit.reference_dbm + 30.0).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
///
/// Names the point that is not a range and a power, or states what the points lack.
pub fn fit_log_distance<I>(
    points: I,
    max_exponent: Option<f64>,
) -> Result<PathLossFit, CalibrationError>
where
    I: IntoIterator<Item = (f64, f64), IntoIter: Clone>,
{
    if let Some(bound) = max_exponent.filter(|b| !(*b > 0.0 && b.is_finite())) {
        return Err(CalibrationError::Bound { bound });
    }
    let points = points.into_iter();
    check(points.clone())?;
    // y = P₀ + γ x with x = −10 log₁₀ d, about the means.
    let abscissa = |range: f64| -10.0 * libm::log10(range);
    let pairs = points.clone().map(|(range, y)| (abscissa(range), y));
    let count = pairs.clone().count();
    #[expect(clippy::cast_precision_loss, reason = "points fit into memory many times over")]
    let n = count as f64;
    let (sum_x, sum_y) = pairs.clone().fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
    let mean_x = sum_x / n;
    let mean_y = sum_y / n;
    let (sxx, sxy) = pairs.clone().fold((0.0, 0.0), |(xx, xy), (x, y)| {
        (xx + (x - mean_x) * (x - mean_x), xy + (x - mean_x) * (y - mean_y))
    });
    // A spread of a ten-billionth of a dB in range is rounding.
    if sxx <= n * 1e-20 {
        return Err(CalibrationError::OneRange { range: libm::exp10(-0.1 * mean_x) });
    }

    let free = sxy / sxx;
    let bound = max_exponent.filter(|bound| free > *bound);
    let exponent = bound.unwrap_or(free);
    let reference_dbm = mean_y - exponent * mean_x;
    let squares: f64 = pairs
        .map(|(x, y)| {
            let residual = y - mean_y - exponent * (x - mean_x);
            residual * residual
        })
        .sum();
    let freedom = if bound.is_some() { n - 1.0 } else { n - 2.0 };
    let variance = squares / freedom;
    let covariance = if bound.is_some() {
        Matrix2::new(variance / n, 0.0, 0.0, 0.0)
    } else {
        let shared = -mean_x / sxx;
        Matrix2::new(1.0 / n + mean_x * mean_x / sxx, shared, shared, 1.0 / sxx) * variance
    };
    Ok(PathLossFit {
        reference_dbm,
        exponent,
        points: count,
        rmse_db: libm::sqrt(squares / n),
        sigma_db: libm::sqrt(variance),
        covariance,
        at_bound: bound.is_some(),
    })
}

fn check(points: impl Iterator<Item = (f64, f64)>) -> Result<(), CalibrationError> {
    const NEEDED: usize = 3;
    let mut count = 0;
    for (index, (range, rss_dbm)) in points.enumerate() {
        if !(range > 0.0 && range.is_finite()) {
            return Err(CalibrationError::Range { index, range });
        }
        if !rss_dbm.is_finite() {
            return Err(CalibrationError::Rss { index, rss_dbm });
        }
        count = index + 1;
    }
    if count < NEEDED {
        return Err(CalibrationError::TooFew { points: count, needed: NEEDED });
    }
    Ok(())
}
