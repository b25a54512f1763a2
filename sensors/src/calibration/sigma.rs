use super::{CalibrationError, Correlation};

/// The error of a bearing whose truth is known, and the σ that it was given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingError {
    /// Measured minus true, in radians.
    pub error: f64,
    /// The σ that the extractor gave it, in radians.
    pub sigma: f64,
}

/// Comparison of the σ of bearings with their errors, and its correction: σ² → (scale · σ)² +
/// floor².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SigmaFit {
    /// Factor on σ.
    pub scale: f64,
    /// Interval that holds the scale with 95 %.
    pub scale_interval: [f64; 2],
    /// Error to be added in squares, in radians, for all that no σ knew of, such as multipath.
    pub floor: f64,
    /// Interval that holds the floor with 95 %, in radians.
    pub floor_interval: [f64; 2],
    /// Number of bearings.
    pub points: usize,
    /// The root of the mean of (error/σ)², as σ was given: 1 where it is honest.
    pub rms_ratio: f64,
    /// The share of errors within 1.96 σ, as σ was given.
    pub coverage_95: f64,
    /// The share of errors within 1.96 σ after scale and floor.
    pub fitted_coverage_95: f64,
    /// The correlation of σ and |error| (Pritzl 2018, eq. 4.3); `None` where one of them does not
    /// vary.
    pub correlation: Option<f64>,
    /// The probability of a correlation as large if there were none, by Student's t with n − 2
    /// degrees of freedom.
    pub correlation_p_value: Option<f64>,
}

/// The quantile of χ² with one degree of freedom at 95 %, halved: the largest drop of the
/// log-likelihood below its maximum within a parameter's interval (Wilks 1938).
const DROP_95: f64 = 0.5 * 3.841_458_820_694_124;

/// Errors of less than a ten-thousandth of their σ, in squares, are rounding and no noise.
const NO_ERROR: f64 = 1e-8;

/// Number of standard deviations that hold 95 % of a Gaussian.
const REACH_95: f64 = 1.959_963_984_540_054;

/// Fits a scale and an additive floor to the σ of bearings whose errors are known: the maximum of
/// the likelihood of errors that are Gaussian with (scale · σ)² + floor², and intervals from the
/// profile likelihood. Where all σ are the same the two cannot be separated, and the floor is 0.
///
/// # Errors
///
/// Names the point that is out of its range, or states what the points lack.
pub fn fit_sigma<I>(points: I) -> Result<SigmaFit, CalibrationError>
where
    I: IntoIterator<Item = BearingError, IntoIter: Clone>,
{
    let points = points.into_iter();
    let sums = Sums::new(points.clone())?;
    let squares = points.clone().map(|p| (p.error * p.error, p.sigma * p.sigma));
    // In units of the mean squared σ and of the mean squared error, so that searches know where
    // to look: v = α σ²/σ̄² + β.
    let unit = sums.squared_sigma / sums.n;
    let typical = sums.squared_error / sums.n;
    let likelihood = Likelihood { squares, unit, typical };
    let separable = sums.sigma_variation() > 1e-3;
    let best_floor = |alpha: f64| {
        if separable { maximum(|beta| likelihood.at(alpha, beta)).0 } else { 0.0 }
    };
    let of_scale = |alpha: f64| likelihood.at(alpha, best_floor(alpha));
    let (alpha, peak) = maximum(of_scale);
    let beta = best_floor(alpha);
    let of_floor = |beta: f64| likelihood.at(maximum(|alpha| likelihood.at(alpha, beta)).0, beta);
    let scale = |alpha: f64| libm::sqrt(alpha * typical / unit);
    let floor = |beta: f64| libm::sqrt(beta * typical);
    let floor_interval =
        if separable { interval(of_floor, beta, peak - DROP_95).map(floor) } else { [0.0, 0.0] };
    let variance = |sigma: f64| (alpha * sigma * sigma / unit + beta) * typical;
    let within = |p: &BearingError, sigma: f64| p.error.abs() <= REACH_95 * sigma;
    let correlation = Correlation::of(points.clone().map(|p| (p.sigma, p.error.abs())));
    let share = |inside: usize| count(inside) / sums.n;
    Ok(SigmaFit {
        scale: scale(alpha),
        scale_interval: interval(of_scale, alpha, peak - DROP_95).map(scale),
        floor: floor(beta),
        floor_interval,
        points: sums.points,
        rms_ratio: libm::sqrt(sums.squared_ratio / sums.n),
        coverage_95: share(points.clone().filter(|p| within(p, p.sigma)).count()),
        fitted_coverage_95: share(
            points.filter(|p| within(p, libm::sqrt(variance(p.sigma)))).count(),
        ),
        correlation: correlation.map(|c| c.coefficient),
        correlation_p_value: correlation.map(|c| c.p_value),
    })
}

/// Sums over the points.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    points: usize,
    n: f64,
    sigma: f64,
    squared_sigma: f64,
    squared_error: f64,
    squared_ratio: f64,
}

impl Sums {
    fn new(points: impl Iterator<Item = BearingError>) -> Result<Self, CalibrationError> {
        const NEEDED: usize = 5;
        let mut sums = Self::default();
        for (index, BearingError { error, sigma }) in points.enumerate() {
            for (field, value, holds, requirement) in [
                ("error", error, error.is_finite(), "finite"),
                ("σ", sigma, sigma > 0.0 && sigma.is_finite(), "a positive number"),
            ] {
                if !holds {
                    return Err(CalibrationError::Field { index, field, value, requirement });
                }
            }
            sums.points = index + 1;
            sums.sigma += sigma;
            sums.squared_sigma += sigma * sigma;
            sums.squared_error += error * error;
            sums.squared_ratio += (error / sigma) * (error / sigma);
        }
        sums.n = count(sums.points);
        if sums.points < NEEDED {
            return Err(CalibrationError::TooFew { points: sums.points, needed: NEEDED });
        }
        if sums.squared_error <= NO_ERROR * sums.squared_sigma {
            return Err(CalibrationError::NoError);
        }
        Ok(sums)
    }

    /// The coefficient of variation of σ.
    fn sigma_variation(&self) -> f64 {
        let mean = self.sigma / self.n;
        libm::sqrt((self.squared_sigma / self.n - mean * mean).max(0.0)) / mean
    }
}

/// The log-likelihood of variances (α σ²/`unit` + β) `typical`.
struct Likelihood<I> {
    squares: I,
    unit: f64,
    typical: f64,
}

impl<I: Iterator<Item = (f64, f64)> + Clone> Likelihood<I> {
    fn at(&self, alpha: f64, beta: f64) -> f64 {
        let one = |(error, sigma): (f64, f64)| {
            let variance = (alpha * sigma / self.unit + beta).max(f64::MIN_POSITIVE);
            -0.5 * (libm::log(variance) + error / (self.typical * variance))
        };
        self.squares.clone().map(one).sum()
    }
}

/// Both α and β are looked for from 0 to this: a thousandfold the errors' own size.
const MOST: f64 = 1e3;

/// Place and value of the maximum of a function of one hump over [0, [`MOST`]]: golden section over
/// the fourth root, which spreads the small values.
fn maximum(function: impl Fn(f64) -> f64) -> (f64, f64) {
    let at = |root: f64| root * root * root * root;
    let ratio = 0.5 * (libm::sqrt(5.0) - 1.0);
    let mut low = 0.0;
    let mut high = libm::sqrt(libm::sqrt(MOST));
    let mut inner = [high - ratio * (high - low), low + ratio * (high - low)];
    let mut values = inner.map(|root| function(at(root)));
    for _ in 0..32 {
        if values[0] >= values[1] {
            high = inner[1];
            inner = [high - ratio * (high - low), inner[0]];
            values = [function(at(inner[0])), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + ratio * (high - low)];
            values = [values[1], function(at(inner[1]))];
        }
    }
    let place = at(0.5 * (low + high));
    let value = function(at(0.5 * (low + high)));
    let edge = function(0.0);
    if edge >= value { (0.0, edge) } else { (place, value) }
}

/// Places where a function of one hump about `peak` passes `level`, on either side; the end of the
/// range where it does not.
fn interval(function: impl Fn(f64) -> f64, peak: f64, level: f64) -> [f64; 2] {
    [0.0, MOST].map(|end| {
        if function(end) >= level {
            return end;
        }
        let mut inside = peak;
        let mut outside = end;
        for _ in 0..24 {
            let middle = 0.5 * (inside + outside);
            if function(middle) >= level {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    })
}

#[expect(clippy::cast_precision_loss, reason = "points fit into memory many times over")]
fn count(points: usize) -> f64 {
    points as f64
}
