use core::f64::consts::PI;

use foxhunt_core::angle::{self, Resultant};
use nalgebra::{Matrix3, Vector3};

use super::{CalibrationError, statistics::quantile};

/// A measured bearing whose true direction is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownBearing {
    /// The measured bearing, in radians in the world frame.
    pub measured: f64,
    /// The true direction from the receiver to the transmitter.
    pub truth: f64,
    /// Heading of the nose while the antenna looked there, in radians in the world frame.
    pub heading: f64,
}

/// An offset of bearings: measured minus true, Δ = a + b sin h + c cos h with the heading h.
///
/// The constant is the antenna's boresight and the yaw's zero together: bearings alone cannot
/// separate the two, and need not. The first harmonic is what hard iron does to a magnetometer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields, default))]
pub struct BearingOffset {
    /// a, in radians counter-clockwise.
    pub constant: f64,
    /// b, in radians.
    pub sin_heading: f64,
    /// c, in radians.
    pub cos_heading: f64,
}

impl BearingOffset {
    /// The offset at a heading, in radians counter-clockwise.
    #[must_use]
    pub fn at(&self, heading: f64) -> f64 {
        self.constant
            + self.sin_heading * libm::sin(heading)
            + self.cos_heading * libm::cos(heading)
    }

    /// The direction that a bearing measured at this heading stands for.
    #[must_use]
    pub fn correct(&self, measured: f64, heading: f64) -> f64 {
        angle::wrap(measured - self.at(heading))
    }

    /// Returns true if every number in it is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        [self.constant, self.sin_heading, self.cos_heading].iter().all(|value| value.is_finite())
    }
}

/// The terms of an offset of bearings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OffsetTerms {
    /// The constant a alone.
    Constant,
    /// The constant, and the first harmonic over the heading.
    Heading,
}

/// A fitted offset of bearings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingOffsetFit {
    /// The offset.
    pub offset: BearingOffset,
    /// The covariance of a, b and c in rad²; of what was not fitted 0.
    pub covariance: Matrix3<f64>,
    /// The fitted terms.
    pub terms: OffsetTerms,
    /// Number of bearings.
    pub points: usize,
    /// The spread of the residuals, in radians: the scale of a Student's t with four degrees of
    /// freedom, so that single outliers do not count for much.
    pub scale: f64,
    /// Root mean square of the residuals, outliers included, in radians.
    pub rms: f64,
}

impl BearingOffsetFit {
    /// The standard errors of a, b and c in radians; of what was not fitted 0.
    #[must_use]
    pub fn standard_errors(&self) -> Vector3<f64> {
        self.covariance.diagonal().map(libm::sqrt)
    }

    /// Half the interval of a, b and c that holds each with the given probability, in radians, by
    /// Student's t. `None` when `probability` is not in (0, 1).
    #[must_use]
    pub fn half_intervals(&self, probability: f64) -> Option<Vector3<f64>> {
        let t = quantile(count(self.points) - self.terms.count(), probability)?;
        Some(self.standard_errors() * t)
    }

    /// The probability of a first harmonic as large as this one if the heading did not matter,
    /// by the F test on b and c; `None` where they were not fitted.
    #[must_use]
    pub fn harmonic_p_value(&self) -> Option<f64> {
        if self.terms == OffsetTerms::Constant {
            return None;
        }
        let harmonic = nalgebra::Vector2::new(self.offset.sin_heading, self.offset.cos_heading);
        let covariance = self.covariance.fixed_view::<2, 2>(1, 1).into_owned();
        let statistic = harmonic.dot(&covariance.cholesky()?.solve(&harmonic));
        // F with 2 and m degrees of freedom: P(F > x) = (1 + 2x/m)^(−m/2), x half the statistic.
        let m = count(self.points) - self.terms.count();
        Some(libm::exp(-0.5 * m * libm::log1p(statistic / m)))
    }
}

impl OffsetTerms {
    fn count(self) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Heading => 3.0,
        }
    }

    fn row(self, heading: f64) -> Vector3<f64> {
        match self {
            Self::Constant => Vector3::x(),
            Self::Heading => Vector3::new(1.0, libm::sin(heading), libm::cos(heading)),
        }
    }
}

/// Degrees of freedom of the residuals' Student's t: few enough that a bearing to a reflection
/// does not turn the rest, enough that Gaussian errors lose little.
const TAIL: f64 = 4.0;

/// Fits the offset of bearings to bearings whose truth is known: an M-estimate with the scores of
/// a Student's t, all points alike, whatever σ they claim (Huber & Ronchetti 2009, §7; the
/// covariance is their eq. 7.81).
///
/// ```
/// use foxhunt_sensors::{KnownBearing, OffsetTerms, fit_bearing_offset};
/// # fn main() -> Result<(), foxhunt_sensors::CalibrationError> {
/// let bearing = |truth: f64, error: f64| {
///     KnownBearing { measured: truth + 0.1 + error, truth, heading: 0.0 }
/// };
/// let bearings = [bearing(0.0, 0.01), bearing(1.0, -0.01), bearing(3.1, 0.02), bearing(-2.0, -0.02)];
/// let fit = fit_bearing_offset(bearings, OffsetTerms::Constant)?;
/// assert!((fit.offset.constant - 0.1).abs() < 1e-9);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
///
/// Names the point that is not finite, or states what the points lack.
pub fn fit_bearing_offset<I>(
    points: I,
    terms: OffsetTerms,
) -> Result<BearingOffsetFit, CalibrationError>
where
    I: IntoIterator<Item = KnownBearing, IntoIter: Clone>,
{
    let points = points.into_iter();
    let (number, start) = begin(points.clone(), terms)?;
    // About the start, where the circle is a line.
    let errors = points.map(|p| (terms.row(p.heading), angle::wrap(p.measured - p.truth - start)));
    let freedom = count(number) - terms.count();
    let mut scale = starting_scale(errors.clone());
    let mut beta = Vector3::zeros();
    for _ in 0..200 {
        let mut normal = unfitted(terms);
        let mut right = Vector3::zeros();
        let mut squares = 0.0;
        for (row, error) in errors.clone() {
            let residual = error - row.dot(&beta);
            let weight = (TAIL + 1.0) / (TAIL + (residual / scale) * (residual / scale));
            normal += row * row.transpose() * weight;
            right += row * (weight * error);
            squares += weight * residual * residual;
        }
        let factor = normal.cholesky().ok_or(CalibrationError::Headings)?;
        let next = factor.solve(&right);
        let spread = libm::sqrt(squares / freedom).max(LEAST_SCALE);
        let moved = (next - beta).amax().max(libm::fabs(spread - scale));
        (beta, scale) = (next, spread);
        if moved <= 1e-12 {
            break;
        }
    }
    let mut scores = 0.0;
    let mut slopes = 0.0;
    let mut squares = 0.0;
    let mut design = unfitted(terms);
    for (row, error) in errors {
        let residual = error - row.dot(&beta);
        let square = (residual / scale) * (residual / scale);
        let weight = (TAIL + 1.0) / (TAIL + square);
        scores += weight * weight * square;
        slopes += (TAIL + 1.0) * (TAIL - square) / ((TAIL + square) * (TAIL + square));
        squares += residual * residual;
        design += row * row.transpose();
    }
    let slope = (slopes / count(number)).max(LEAST_SLOPE);
    let variance = scale * scale * scores / freedom / (slope * slope);
    let mut covariance =
        design.cholesky().ok_or(CalibrationError::Headings)?.solve(&Matrix3::identity()) * variance;
    if terms == OffsetTerms::Constant {
        covariance = Matrix3::from_diagonal(&Vector3::new(covariance[(0, 0)], 0.0, 0.0));
    }
    Ok(BearingOffsetFit {
        offset: BearingOffset {
            constant: angle::wrap(start + beta.x),
            sin_heading: beta.y,
            cos_heading: beta.z,
        },
        covariance: (covariance + covariance.transpose()) * 0.5,
        terms,
        points: number,
        scale,
        rms: libm::sqrt(squares / count(number)),
    })
}

/// Least scale of the errors: where they are exact, it keeps the weights finite.
const LEAST_SCALE: f64 = 1e-12;

/// Least slope of the scores: wild errors leave hardly any; the covariance then is large, not
/// wrong.
const LEAST_SLOPE: f64 = 0.05;

/// Headings whose sines and cosines leave the determinant of the design, per point, below this
/// span less than some 40°: the harmonic then is a guess far beyond them.
const LEAST_DETERMINANT: f64 = 1e-3;

/// Checks the points; their number and the mean direction of their errors.
fn begin(
    points: impl Iterator<Item = KnownBearing> + Clone,
    terms: OffsetTerms,
) -> Result<(usize, f64), CalibrationError> {
    let mut mean = Resultant::default();
    let mut number = 0;
    let mut design = unfitted(terms);
    for (index, point) in points.enumerate() {
        for (field, value) in [
            ("measured bearing", point.measured),
            ("true bearing", point.truth),
            ("heading", point.heading),
        ] {
            if !value.is_finite() {
                let requirement = "finite";
                return Err(CalibrationError::Field { index, field, value, requirement });
            }
        }
        mean.add(point.measured - point.truth, 1.0);
        let row = terms.row(point.heading);
        design += row * row.transpose();
        number = index + 1;
    }
    let needed = match terms {
        OffsetTerms::Constant => 3,
        OffsetTerms::Heading => 6,
    };
    if number < needed {
        return Err(CalibrationError::TooFew { points: number, needed });
    }
    if terms == OffsetTerms::Heading && (design / count(number)).determinant() < LEAST_DETERMINANT {
        return Err(CalibrationError::Headings);
    }
    // Errors all round the circle have a resultant of about 1/√n by chance; twice that is some 2 %.
    let least = 2.0 / libm::sqrt(count(number));
    let start = mean.direction(least.min(0.9));
    let resultant = mean.length();
    Ok((number, start.ok_or(CalibrationError::Scattered { resultant })?))
}

/// Half the mean distance from the start: a scale that outliers do not run away with.
fn starting_scale(errors: impl Iterator<Item = (Vector3<f64>, f64)>) -> f64 {
    let (sum, number) =
        errors.fold((0.0, 0.0), |(sum, n), (_, error)| (sum + error.abs(), n + 1.0));
    (0.5 * sum / number).clamp(LEAST_SCALE, PI)
}

/// Ones where nothing is fitted keep the normal matrix regular.
fn unfitted(terms: OffsetTerms) -> Matrix3<f64> {
    match terms {
        OffsetTerms::Constant => Matrix3::from_diagonal(&Vector3::new(0.0, 1.0, 1.0)),
        OffsetTerms::Heading => Matrix3::zeros(),
    }
}

#[expect(clippy::cast_precision_loss, reason = "points fit into memory many times over")]
fn count(points: usize) -> f64 {
    points as f64
}
