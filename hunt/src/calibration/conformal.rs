//! Regions by conformal prediction: the answers to recordings with a known truth say by what factor
//! ellipses have to grow or shrink, whatever is wrong with the model.

use std::{fs, path::Path};

use foxhunt_core::Ellipse;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::{document, locate::Located};

/// Version of the file that this program writes and reads.
pub const CONFORMAL_VERSION: u32 = 1;

/// Coverage of the regions.
const COVERAGE: f64 = 0.95;

/// Least number of fixes that has a quantile for the coverage: ⌈(n + 1) · 0.95⌉ ≤ n.
pub const LEAST_CONFORMAL_FIXES: usize = 19;

/// Deviation of a true place from an answer, in units of the answer's 95 % ellipse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// Factor by which the ellipse has to be scaled so that its border meets the true place.
    pub ellipse: f64,
    /// Distance over the root mean square of the semi-axes.
    pub circle: f64,
}

impl Deviation {
    /// Returns the deviation; `None` for an answer without an ellipse.
    #[must_use]
    pub fn new(located: &Located, truth: &Vector2<f64>) -> Option<Self> {
        let circle = (located.estimate.mean - truth).norm() / radius(&located.ellipse_95()?);
        let ellipse = located.ellipses_away(truth)?;
        (ellipse.is_finite() && circle.is_finite()).then_some(Self { ellipse, circle })
    }
}

/// Returns the root mean square of the semi-axes.
fn radius(ellipse: &Ellipse) -> f64 {
    libm::hypot(ellipse.semi_major, ellipse.semi_minor) * std::f64::consts::FRAC_1_SQRT_2
}

/// Factors by which the regions of an estimator hold the transmitter with 95 %, by split conformal
/// prediction (Vovk, Gammerman & Shafer 2005; Lei et al. 2018): the ⌈(n + 1) · 0.95⌉-th smallest
/// deviation of n fixes. A fix that is exchangeable with those is held with at least 95 %.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConformalFactors {
    /// Name of the estimator.
    pub estimator: String,
    /// Number of fixes with a known truth that the factors come from.
    pub fixes: usize,
    /// Factor of the ellipse's semi-axes.
    pub ellipse: f64,
    /// Radius of the circle over the root mean square of the semi-axes.
    pub circle: f64,
}

/// Regions that hold the transmitter with 95 % by the user's own recordings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ConformalRegions {
    /// Number of fixes with a known truth that the regions come from.
    pub fixes: usize,
    /// Scaled ellipse.
    pub ellipse: Ellipse,
    /// Radius of the circle, in metres.
    pub circle_m: f64,
}

impl ConformalFactors {
    /// Takes the factors from deviations of fixes whose truth is known.
    ///
    /// # Errors
    ///
    /// [`ConformalError::TooFew`] for fewer than [`LEAST_CONFORMAL_FIXES`].
    pub fn new(estimator: &str, deviations: &[Deviation]) -> Result<Self, ConformalError> {
        let fixes = deviations.len();
        let too_few = || ConformalError::TooFew { estimator: estimator.to_owned(), fixes };
        let quantile = |of: fn(&Deviation) -> f64| {
            let mut values: Vec<f64> = deviations.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            // ⌈(n + 1) · 19 / 20⌉ in whole numbers, which do not round.
            let rank = ((fixes + 1) * 19).div_ceil(20);
            values.get(rank.checked_sub(1)?).copied()
        };
        let ellipse = quantile(|deviation| deviation.ellipse).ok_or_else(too_few)?;
        let circle = quantile(|deviation| deviation.circle).ok_or_else(too_few)?;
        Ok(Self { estimator: estimator.to_owned(), fixes, ellipse, circle })
    }

    /// Returns the regions about an answer of the estimator; `None` for one without an ellipse.
    #[must_use]
    pub fn regions(&self, located: &Located) -> Option<ConformalRegions> {
        let own = located.ellipse_95()?;
        let ellipse = Ellipse {
            semi_major: own.semi_major * self.ellipse,
            semi_minor: own.semi_minor * self.ellipse,
            orientation: own.orientation,
        };
        Some(ConformalRegions { fixes: self.fixes, ellipse, circle_m: radius(&own) * self.circle })
    }

    /// Returns whether the ellipse and the circle about an answer hold a place that deviates so
    /// from it.
    #[must_use]
    pub fn hold(&self, deviation: &Deviation) -> [bool; 2] {
        [deviation.ellipse <= self.ellipse, deviation.circle <= self.circle]
    }
}

/// Conformal factors as a file: `judge --calibrate` writes it, `--conformal` reads it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConformalFile {
    /// [`CONFORMAL_VERSION`] of the program that wrote it.
    foxhunt_conformal: u32,
    /// Coverage that the factors are for.
    coverage: f64,
    /// Factors of each estimator.
    #[serde(rename = "factors")]
    pub estimators: Vec<ConformalFactors>,
}

impl ConformalFile {
    /// Returns a file of the factors.
    #[must_use]
    pub fn new(estimators: Vec<ConformalFactors>) -> Self {
        Self { foxhunt_conformal: CONFORMAL_VERSION, coverage: COVERAGE, estimators }
    }

    /// Reads a file.
    ///
    /// # Errors
    ///
    /// [`ConformalError`] names the file, and the line or the number that is wrong.
    pub fn read(path: &Path) -> Result<Self, ConformalError> {
        let file = path.display().to_string();
        let text = fs::read_to_string(path)
            .map_err(|source| ConformalError::Read { file: file.clone(), source })?;
        Self::parse(&text, &file)
    }

    /// Reads TOML; `file` is its name in errors.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn parse(text: &str, file: &str) -> Result<Self, ConformalError> {
        let read: Self = document::from_toml(text)
            .map_err(|source| ConformalError::Parse { file: file.to_owned(), source })?;
        let wrong = |what: String| ConformalError::Value { file: file.to_owned(), what };
        if read.foxhunt_conformal != CONFORMAL_VERSION {
            return Err(wrong(format!(
                "foxhunt_conformal is {}; this program reads {CONFORMAL_VERSION}",
                read.foxhunt_conformal
            )));
        }
        if (read.coverage - COVERAGE).abs() > 1e-9 {
            return Err(wrong(format!("coverage is {}; it must be {COVERAGE}", read.coverage)));
        }
        for ConformalFactors { estimator, fixes, ellipse, circle } in &read.estimators {
            if *fixes < LEAST_CONFORMAL_FIXES {
                return Err(ConformalError::TooFew { estimator: estimator.clone(), fixes: *fixes });
            }
            for (name, value) in [("ellipse", *ellipse), ("circle", *circle)] {
                if !(value.is_finite() && value >= 0.0) {
                    return Err(wrong(format!(
                        "{name} of {estimator} is {value}; it must be finite and not negative"
                    )));
                }
            }
        }
        Ok(read)
    }

    /// Returns the factors of an estimator.
    ///
    /// # Errors
    ///
    /// [`ConformalError::OtherEstimator`] where the file has none of this name.
    pub fn of(&self, estimator: &str) -> Result<&ConformalFactors, ConformalError> {
        let own = self.estimators.iter().find(|factors| factors.estimator == estimator);
        own.ok_or_else(|| {
            let names = self.estimators.iter().map(|factors| factors.estimator.as_str());
            ConformalError::OtherEstimator {
                estimator: estimator.to_owned(),
                known: names.collect::<Vec<_>>().join(", "),
            }
        })
    }

    /// Returns the file as TOML.
    ///
    /// # Errors
    ///
    /// The error of the TOML writer.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        document::to_toml(self)
    }
}

/// Reasons why there are no conformal regions.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConformalError {
    /// Too few fixes for the coverage.
    #[error(
        "{estimator} has {fixes} fixes with a known truth and an ellipse; 95 % by your own \
         recordings needs at least {LEAST_CONFORMAL_FIXES}"
    )]
    TooFew {
        /// Name of the estimator.
        estimator: String,
        /// Number of fixes.
        fixes: usize,
    },
    /// The factors are of other estimators.
    #[error("the factors are of {known}, the answer is of {estimator}; name one with --estimator")]
    OtherEstimator {
        /// Name of the estimator.
        estimator: String,
        /// Names of the estimators that have factors.
        known: String,
    },
    /// The file cannot be read.
    #[error("{file}: cannot be read: {source}")]
    Read {
        /// Name of the file.
        file: String,
        /// Reason.
        source: std::io::Error,
    },
    /// The file is not one that `judge --calibrate` wrote; the source names line, field and value.
    #[error("{file}: not a file of judge --calibrate: {source}")]
    Parse {
        /// Name of the file.
        file: String,
        /// Line, field and value.
        source: toml::de::Error,
    },
    /// A value is out of its range.
    #[error("{file}: {what}")]
    Value {
        /// Name of the file.
        file: String,
        /// Field and value.
        what: String,
    },
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use foxhunt_core::Estimate;
    use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
    use rand_distr::StandardNormal;

    use super::*;

    fn deviations(count: u32) -> Vec<Deviation> {
        let of = |rank: u32| Deviation { ellipse: f64::from(rank), circle: 2.0 * f64::from(rank) };
        // Not in order.
        (1..=count).rev().map(of).collect()
    }

    #[test]
    fn the_factor_is_the_order_statistic() {
        // ⌈20 · 0.95⌉ = 19 of 19, ⌈40 · 0.95⌉ = 38 of 39, ⌈100 · 0.95⌉ = 95 of 99.
        for (count, rank) in [(19, 19.0), (39, 38.0), (99, 95.0)] {
            let factors = ConformalFactors::new("a", &deviations(count)).expect("enough");
            assert_eq!((factors.ellipse, factors.circle), (rank, 2.0 * rank));
        }
        let error = ConformalFactors::new("bearing-grid", &deviations(18)).expect_err("too few");
        let text = error.to_string();
        assert!(text.contains("bearing-grid has 18 fixes") && text.contains("19"), "{text}");
    }

    #[test]
    fn a_file_is_read_to_the_bit_and_wrong_ones_are_refused() {
        let mut factors = ConformalFactors::new("a", &deviations(39)).expect("enough");
        factors.ellipse = 0.1 + 0.2;
        let file = ConformalFile::new(vec![factors]);
        let text = file.to_toml().expect("plain numbers");
        assert_eq!(ConformalFile::parse(&text, "c.toml").expect("as written"), file);
        assert_eq!(file.of("a").expect("it has it").fixes, 39);
        let other = file.of("lenth1981").expect_err("not there").to_string();
        assert!(other.contains("of a, the answer is of lenth1981"), "{other}");
        for (from, to, part) in [
            ("foxhunt_conformal = 1", "foxhunt_conformal = 2", "this program reads 1"),
            ("fixes = 39", "fixes = 5", "needs at least 19"),
            ("circle = 76.0", "circle = -1.0", "circle of a is -1"),
            ("circle = 76.0", "circle = nan", "circle of a is NaN"),
            ("coverage = 0.95", "coverage = 0.5", "coverage is 0.5"),
            ("circle", "cycle", "c.toml"),
        ] {
            assert!(text.contains(from), "{text}");
            let wrong = text.replace(from, to);
            let error = ConformalFile::parse(&wrong, "c.toml").expect_err(to).to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn regions_are_those_of_the_deviation() {
        let estimate = Estimate {
            mean: Vector2::new(10.0, 20.0),
            covariance: nalgebra::Matrix2::new(90.0, 40.0, 40.0, 30.0),
        };
        let located = Located::at(estimate);
        let truth = Vector2::new(45.0, 15.0);
        let deviation = Deviation::new(&located, &truth).expect("it has an ellipse");
        let Deviation { ellipse, circle } = deviation;
        // χ²₂ at 95 % is 5.9915.
        let nees = estimate.nees(&truth).expect("positive definite");
        assert_abs_diff_eq!(ellipse.powi(2) * 5.991_464, nees, epsilon = 1e-4);
        let factors = ConformalFactors { estimator: "a".to_owned(), fixes: 19, ellipse, circle };
        assert_eq!(factors.hold(&deviation), [true, true]);
        let regions = factors.regions(&located).expect("it has an ellipse");
        assert_abs_diff_eq!(regions.circle_m, (truth - estimate.mean).norm(), epsilon = 1e-9);
        let scaled = Located { own_ellipse_95: Some(regions.ellipse), ..Located::at(estimate) };
        assert_abs_diff_eq!(scaled.ellipses_away(&truth).expect("an ellipse"), 1.0, epsilon = 1e-9);
        // By no finite factor does one without a width meet the truth.
        let thin = Ellipse { semi_major: 30.0, semi_minor: f64::from_bits(1), orientation: 0.0 };
        let thin = Located { own_ellipse_95: Some(thin), ..Located::at(estimate) };
        assert!(Deviation::new(&thin, &truth).is_none());
    }

    /// True errors are twice as large as the ellipses say. In 2,000 draws of 39 fixes to calibrate
    /// and one to judge 95 % of the conformal regions hold: ⌈40 · 0.95⌉ / 40, within 3.29 σ of a
    /// binomial number. 1 - exp(-5.99 / 8) = 53 % of the ellipses do.
    #[test]
    fn conformal_regions_hold_where_sigma_is_wrong_by_a_factor_of_2() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(21);
        let mut draw = || {
            let sigma = 10.0 + 90.0 * rng.random::<f64>();
            let ratio = 0.2 + 0.8 * rng.random::<f64>();
            let mut error = |sigma: f64| 2.0 * sigma * rng.sample::<f64, _>(StandardNormal);
            let truth = Vector2::new(error(sigma), error(ratio * sigma));
            let variances = Vector2::new(sigma, ratio * sigma).map(|sigma| sigma * sigma);
            let covariance = nalgebra::Matrix2::from_diagonal(&variances);
            let located = Located::at(Estimate { mean: Vector2::zeros(), covariance });
            let deviation = Deviation::new(&located, &truth).expect("positive definite");
            (deviation, located.ellipse_95_holds(&truth) == Some(true))
        };
        let trials = 2000;
        let mut held = [0.0; 3];
        for _ in 0..trials {
            let own: Vec<Deviation> = (0..39).map(|_| draw().0).collect();
            let factors = ConformalFactors::new("a", &own).expect("enough");
            let (deviation, in_ellipse) = draw();
            let [ellipse, circle] = factors.hold(&deviation);
            for (sum, holds) in held.iter_mut().zip([ellipse, circle, in_ellipse]) {
                *sum += f64::from(u8::from(holds));
            }
        }
        let count = f64::from(trials);
        let [ellipse, circle, own] = held.map(|held| held / count);
        let expected = 38.0 / 40.0;
        let interval = 3.29 * f64::sqrt(expected * (1.0 - expected) / count);
        for share in [ellipse, circle] {
            assert!(abs_diff_eq!(share, expected, epsilon = interval), "{share} ± {interval}");
        }
        let expected = 1.0 - f64::exp(-5.991_464 / 8.0);
        let interval = 3.29 * f64::sqrt(expected * (1.0 - expected) / count);
        assert_abs_diff_eq!(own, expected, epsilon = interval);
    }
}
