use foxhunt_core::angle::{self, Resultant};
use nalgebra::{SMatrix, SVector};

use super::{CalibrationError, KnownBearing};

/// Largest number of harmonics: a ring of elements and a mast make few, reflections near by more.
pub const MOST_HARMONICS: usize = 8;

/// Number of coefficients: a constant, a sine and a cosine of each harmonic.
const TERMS: usize = 2 * MOST_HARMONICS + 1;

type Terms = SVector<f64, TERMS>;
type Covariance = SMatrix<f64, TERMS, TERMS>;

/// The deviation of an array of antennas that does not turn: measured minus true direction over the
/// measured one, which is counted from the array's nose,
/// Δ(θ) = a + Σ sₖ sin kθ + cₖ cos kθ.
#[derive(Clone, Debug, PartialEq)]
pub struct Deviation {
    terms: Terms,
    covariance: Covariance,
    harmonics: usize,
}

impl Deviation {
    /// Takes a constant and the sine and cosine of each harmonic in radians counter-clockwise, and
    /// the covariance of all in rad², row by row; one without rows is that of a known deviation.
    ///
    /// Returns `None` for more than [`MOST_HARMONICS`] harmonics, for a covariance of another size,
    /// and for numbers that are not finite or make no covariance.
    #[must_use]
    pub fn new(constant: f64, harmonics: &[[f64; 2]], rows: &[impl AsRef<[f64]>]) -> Option<Self> {
        let count = 2 * harmonics.len() + 1;
        let is_square = rows.len() == count && rows.iter().all(|row| row.as_ref().len() == count);
        if harmonics.len() > MOST_HARMONICS || !(rows.is_empty() || is_square) {
            return None;
        }
        let own = core::iter::once(constant).chain(harmonics.iter().flatten().copied());
        let terms = Terms::from_iterator(own.chain(core::iter::repeat(0.0)).take(TERMS));
        let mut covariance = Covariance::zeros();
        for (row, own) in rows.iter().enumerate() {
            for (column, value) in own.as_ref().iter().enumerate() {
                covariance[(row, column)] = *value;
            }
        }
        let is_finite = terms.iter().chain(&covariance).all(|value| value.is_finite());
        let most = covariance.amax();
        let is_symmetric = (covariance - covariance.transpose()).amax() <= 1e-9 * most;
        // Rounding of a file's digits may leave a variance a little below zero.
        let nudged = covariance + Covariance::identity() * (1e-9 * most).max(f64::MIN_POSITIVE);
        let is_covariance = is_finite && is_symmetric && nudged.cholesky().is_some();
        is_covariance.then_some(Self { terms, covariance, harmonics: harmonics.len() })
    }

    /// Returns the constant in radians counter-clockwise.
    #[must_use]
    pub fn constant(&self) -> f64 {
        self.terms[0]
    }

    /// The sine and the cosine of each harmonic, in radians.
    pub fn harmonics(&self) -> impl ExactSizeIterator<Item = [f64; 2]> {
        (0..self.harmonics).map(|k| [self.terms[2 * k + 1], self.terms[2 * k + 2]])
    }

    /// The rows of the covariance of constant, sines and cosines, in rad².
    pub fn covariance(&self) -> impl Iterator<Item = impl Iterator<Item = f64>> {
        let count = 2 * self.harmonics + 1;
        (0..count).map(move |row| (0..count).map(move |column| self.covariance[(row, column)]))
    }

    /// Returns the deviation of a measured direction, in radians from the array's nose.
    #[must_use]
    pub fn at(&self, direction: f64) -> f64 {
        self.terms.dot(&row(direction))
    }

    /// Returns σ of the deviation of a measured direction, as the calibration knows it.
    #[must_use]
    pub fn sigma_at(&self, direction: f64) -> f64 {
        let row = row(direction);
        libm::sqrt(row.dot(&(self.covariance * row)).max(0.0))
    }

    /// Returns the factor from an error of a measured direction to that of the corrected one,
    /// |1 − Δ′(θ)|. It is above 1 where the deviation falls as the measured direction rises:
    /// there several true directions look alike.
    #[must_use]
    pub fn stretch_at(&self, direction: f64) -> f64 {
        stretch(&self.terms, &row(direction))
    }

    /// Returns the direction that a measured bearing stands for, and σ of the correction; the
    /// array's nose looks to `heading`.
    #[must_use]
    pub fn correct(&self, measured: f64, heading: f64) -> (f64, f64) {
        let direction = measured - heading;
        (angle::wrap(measured - self.at(direction)), self.sigma_at(direction))
    }
}

/// A fitted deviation.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviationFit {
    /// The deviation, with as many harmonics as the bearings bear; none where a constant is as
    /// probable.
    pub deviation: Deviation,
    /// Number of bearings.
    pub points: usize,
    /// Number of bearings that are no part of the fit, as of reflections.
    pub outliers: usize,
    /// σ of a new measured bearing, in radians, outliers left out; of the corrected one
    /// [`Deviation::stretch_at`] times that.
    pub sigma: f64,
    /// Root mean square of the errors after the correction, outliers left out, in radians.
    pub rms: f64,
    /// Degrees of freedom of `sigma`.
    pub freedom: f64,
    /// Gain in the logarithm of the evidence over a constant.
    pub log_gain: f64,
}

/// Gain in the log-evidence over a constant from which on harmonics are taken: 20 to 1.
const LEAST_GAIN: f64 = 3.0;

/// Fewest bearings that harmonics are fitted to.
const LEAST_POINTS: usize = 6;

/// Prior variance of the constant over σ²: as good as flat.
const FLAT: f64 = 1e6;

/// Scales of the harmonics' prior over σ: powers of two from this one on.
const LEAST_SCALE: f64 = 0.25;
const SCALES: u8 = 12;

/// Degrees of freedom of the weights by which outliers are found.
const TAIL: f64 = 4.0;

/// Outliers lie farther from the deviation than this many σ.
const OUTLYING: f64 = 4.0;

/// Least scale of the errors in radians: it keeps the weights of exact bearings finite.
const LEAST_SIGMA: f64 = 1e-5;

/// Fits the deviation of an array that does not turn to bearings of known truth.
///
/// The coefficients have the prior N(0, (τ/k)²), so that a gap between the directions is bridged
/// smoothly and is uncertain by as much as the deviation varies. The number of harmonics and τ are
/// those of the largest evidence (MacKay 1992), σ integrated out; harmonics are taken if that is
/// 20 times the evidence of a constant. Bearings beyond 4 σ, found with the weights of a Student's
/// t, are left out.
///
/// # Errors
///
/// Names the point that is not finite, or states what the points lack.
pub fn fit_deviation(points: &[KnownBearing]) -> Result<DeviationFit, CalibrationError> {
    let number = points.len();
    let mut mean = Resultant::default();
    for (index, point) in points.iter().enumerate() {
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
    }
    if number < LEAST_POINTS {
        return Err(CalibrationError::TooFew { points: number, needed: LEAST_POINTS });
    }
    let resultant = mean.length();
    let start = mean.direction(0.3).ok_or(CalibrationError::Scattered { resultant })?;
    // About the start, where the circle is a line.
    let errors = points.iter().map(|point| {
        let error = angle::wrap(point.measured - point.truth - start);
        (row(point.measured - point.heading), error)
    });
    let most = MOST_HARMONICS.min((number - LEAST_POINTS) / 2 + 1);
    let mut scale = f64::INFINITY;
    let mut best = chosen(errors.clone().map(|(row, error)| (row, error, 1.0)), most);
    for _ in 0..30 {
        let before = scale;
        scale = spread(errors.clone().map(|(row, error)| error - row.dot(&best.terms)), number);
        let weighted = errors.clone().map(|(row, error)| {
            let over = (error - row.dot(&best.terms)) / scale;
            (row, error, (TAIL + 1.0) / (TAIL + over * over))
        });
        best = chosen(weighted, most);
        if (scale - before).abs() <= 1e-6 * scale {
            break;
        }
    }
    let limit = OUTLYING * scale;
    let terms = best.terms;
    let kept = errors.filter(|(row, error)| (error - row.dot(&terms)).abs() <= limit);
    let best = chosen(kept.clone().map(|(row, error)| (row, error, 1.0)), most);
    let mut squares = 0.0;
    let mut unstretched = 0.0;
    let mut count = 0;
    for (row, error) in kept {
        let residual = error - row.dot(&best.terms);
        squares += residual * residual;
        unstretched += libm::pow(residual / stretch(&best.terms, &row), 2.0);
        count += 1;
    }
    let freedom = (as_f64(count) - best.spent).max(1.0);
    let least = LEAST_SIGMA * LEAST_SIGMA;
    let variance = (squares / freedom).max(least);
    // Student's t with so many degrees of freedom has a variance larger by this.
    let tail = if freedom > 3.0 { freedom / (freedom - 2.0) } else { 3.0 };
    let mut terms = best.terms;
    terms[0] = angle::wrap(terms[0] + start);
    let covariance = best.inverse * (variance * tail);
    Ok(DeviationFit {
        deviation: Deviation {
            terms,
            covariance: 0.5 * (covariance + covariance.transpose()),
            harmonics: best.harmonics,
        },
        points: number,
        outliers: number - count,
        sigma: libm::sqrt((unstretched / freedom).max(least) * tail),
        rms: libm::sqrt(squares / as_f64(count.max(1))),
        freedom,
        log_gain: best.log_gain,
    })
}

/// Coefficients of the largest evidence.
struct Chosen {
    harmonics: usize,
    terms: Terms,
    /// Covariance of the terms over σ²; zero beyond the harmonics.
    inverse: Covariance,
    /// Degrees of freedom that the terms take.
    spent: f64,
    log_evidence: f64,
    log_gain: f64,
}

/// Returns the fit with the number of harmonics and the scale of their prior that the errors, each
/// with its weight, make most probable.
fn chosen(errors: impl Iterator<Item = (Terms, f64, f64)>, most: usize) -> Chosen {
    let mut normal = Covariance::zeros();
    let mut right = Terms::zeros();
    let mut square = 0.0;
    let mut count = 0.0;
    for (row, error, weight) in errors {
        normal += row * row.transpose() * weight;
        right += row * (weight * error);
        square += weight * error * error;
        count += weight;
    }
    let of = |harmonics: usize, scale: f64| {
        let mut variances = Terms::zeros();
        variances[0] = FLAT;
        for k in 1..=harmonics {
            let own = scale / as_f64(k);
            variances[2 * k - 1] = own * own;
            variances[2 * k] = own * own;
        }
        let is_used = |term: usize| term <= 2 * harmonics;
        let used = Covariance::from_fn(|i, j| {
            let own = if is_used(i) && is_used(j) { normal[(i, j)] } else { 0.0 };
            let prior = if is_used(i) { 1.0 / variances[i] } else { 1.0 };
            own + if i == j { prior } else { 0.0 }
        });
        let factor = used.cholesky()?;
        let own = Terms::from_fn(|i, _| if is_used(i) { right[i] } else { 0.0 });
        let terms = factor.solve(&own);
        let left = (square - own.dot(&terms)).max(count * LEAST_SIGMA * LEAST_SIGMA);
        let log_variances = variances.iter().filter(|variance| **variance > 0.0);
        let log_variances: f64 = log_variances.map(|variance| libm::log(*variance)).sum();
        let log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|l| libm::log(*l)).sum();
        let inverse = factor.inverse();
        let inverse =
            Covariance::from_fn(
                |i, j| {
                    if is_used(i) && is_used(j) { inverse[(i, j)] } else { 0.0 }
                },
            );
        let log_evidence =
            -0.5 * (count - 1.0) * libm::log(left) - log_determinant - 0.5 * log_variances;
        let spent = (inverse * normal).trace();
        Some(Chosen { harmonics, terms, inverse, spent, log_evidence, log_gain: 0.0 })
    };
    let nothing = || Chosen {
        harmonics: 0,
        terms: Terms::zeros(),
        inverse: Covariance::zeros(),
        spent: 0.0,
        log_evidence: f64::NEG_INFINITY,
        log_gain: 0.0,
    };
    let constant = of(0, 1.0).unwrap_or_else(nothing);
    let scales = (0..SCALES).map(|power| LEAST_SCALE * libm::pow(2.0, f64::from(power)));
    let tried = scales.flat_map(|scale| (1..=most).map(move |k| (k, scale)));
    let best = tried
        .filter_map(|(harmonics, scale)| of(harmonics, scale))
        .max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence));
    match best {
        Some(best) if best.log_evidence - constant.log_evidence > LEAST_GAIN => {
            Chosen { log_gain: best.log_evidence - constant.log_evidence, ..best }
        }
        _ => constant,
    }
}

/// 1.4826 times the median of the absolute errors: σ of a normal distribution.
fn spread(errors: impl Iterator<Item = f64> + Clone, count: usize) -> f64 {
    // By bisection, as nothing is allocated here.
    let most = errors.clone().map(f64::abs).fold(0.0, f64::max);
    let mut bounds = (0.0, most);
    for _ in 0..40 {
        let middle = 0.5 * (bounds.0 + bounds.1);
        let below = errors.clone().filter(|error| error.abs() <= middle).count();
        bounds = if 2 * below >= count { (bounds.0, middle) } else { (middle, bounds.1) };
    }
    (1.4826 * bounds.1).max(LEAST_SIGMA)
}

/// Least factor of errors: below it the fit of a steep deviation is no guide.
const LEAST_STRETCH: f64 = 0.2;

/// Factor from an error of a measured direction to that of the corrected one, by the derivative of
/// the deviation at the regressors of a direction.
fn stretch(terms: &Terms, row: &Terms) -> f64 {
    let slope =
        |k: usize| as_f64(k) * (terms[2 * k - 1] * row[2 * k] - terms[2 * k] * row[2 * k - 1]);
    (1.0 - (1..=MOST_HARMONICS).map(slope).sum::<f64>()).abs().max(LEAST_STRETCH)
}

/// The terms' regressors at a direction.
fn row(direction: f64) -> Terms {
    let mut row = Terms::zeros();
    row[0] = 1.0;
    for k in 1..=MOST_HARMONICS {
        row[2 * k - 1] = libm::sin(as_f64(k) * direction);
        row[2 * k] = libm::cos(as_f64(k) * direction);
    }
    row
}

#[expect(clippy::cast_precision_loss, reason = "points fit into memory many times over")]
fn as_f64(count: usize) -> f64 {
    count as f64
}
