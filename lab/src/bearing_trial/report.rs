use foxhunt_filters::consistency::Coverage;
use foxhunt_sensors::Correlation;
use serde::Serialize;
use statrs::statistics::{Data, OrderStatistics, Statistics};

/// The results of a campaign of bearings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BearingReport {
    /// The case's name.
    pub campaign: String,
    /// The number of turns that each extractor read.
    pub runs: u32,
    /// The seed of the first turn; turn i has this plus i.
    pub seed: u64,
    /// The root mean square of the Cramér-Rao bound with a known antenna, an unknown level and no
    /// reflection, in degrees.
    pub bound_deg: f64,
    /// The extractors, in the order of the call.
    pub extractors: Vec<ExtractorReport>,
}

/// The results of one extractor. Figures that so few bearings do not give are absent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExtractorReport {
    /// The extractor's name.
    pub extractor: String,
    /// The root mean square error in degrees.
    pub rms_deg: Option<f64>,
    /// The median of the error's magnitude in degrees.
    pub median_deg: Option<f64>,
    /// The root mean square of σ in degrees.
    pub sigma_deg: Option<f64>,
    /// The root mean square of error over σ: 1 for an honest one, more for an over-confident one.
    pub sigma_ratio: Option<f64>,
    /// The share of errors within 1.96 σ, the 95 % interval of a Gaussian; σ is that of all
    /// competing directions together where there are several.
    pub coverage_95: Option<f64>,
    /// The 95 % interval of the true share.
    pub coverage_95_interval: Option<[f64; 2]>,
    /// The number of errors that exceed 4 σ.
    pub beyond_4_sigma: u32,
    /// The number of turns with more than one direction.
    pub ambiguous: u32,
    /// Pearson's correlation of σ and the error's magnitude (Pritzl 2018, eq. 4.3).
    pub correlation: Option<f64>,
    /// The probability of a correlation as far from 0 by chance: two-sided, by Student's t.
    pub correlation_p: Option<f64>,
    /// The mean error of the level in dB against the direct wave's.
    pub level_bias_db: Option<f64>,
    /// The number of turns without a bearing.
    pub refused: u32,
}

/// One bearing against the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BearingError {
    /// The error in radians, with its sign.
    pub(super) error: f64,
    pub(super) sigma: f64,
    pub(super) ambiguous: bool,
    pub(super) level_error_db: f64,
}

impl ExtractorReport {
    /// The statistics of some turns, `None` where there was no bearing.
    pub(super) fn of(name: &str, turns: &[Option<BearingError>]) -> Self {
        let found: Vec<&BearingError> = turns.iter().flatten().collect();
        let column = |value: fn(&BearingError) -> f64| -> Vec<f64> {
            found.iter().map(|f| value(f)).collect()
        };
        let count = |holds: fn(&BearingError) -> bool| {
            u32::try_from(found.iter().filter(|f| holds(f)).count()).unwrap_or(u32::MAX)
        };
        let some = |value: f64| Some(value).filter(|value| value.is_finite());
        let magnitudes = column(|f| f.error.abs().to_degrees());
        let sigmas = column(|f| f.sigma.to_degrees());
        let mut coverage = Coverage::new(0.95, 0.95).expect("both are in (0, 1)");
        for one in &found {
            coverage.add(one.error.abs() <= 1.96 * one.sigma);
        }
        let correlation = Correlation::of(sigmas.iter().copied().zip(magnitudes.iter().copied()));
        let refused = u32::try_from(turns.len() - found.len()).unwrap_or(u32::MAX);
        Self {
            extractor: name.to_owned(),
            rms_deg: some(magnitudes.as_slice().quadratic_mean()),
            median_deg: (!found.is_empty()).then(|| Data::new(magnitudes.clone()).median()),
            sigma_deg: some(sigmas.as_slice().quadratic_mean()),
            sigma_ratio: some(column(|f| f.error / f.sigma).as_slice().quadratic_mean()),
            coverage_95: coverage.share(),
            coverage_95_interval: coverage.interval(),
            beyond_4_sigma: count(|f| f.error.abs() > 4.0 * f.sigma),
            ambiguous: count(|f| f.ambiguous),
            correlation: correlation.map(|c| c.coefficient),
            correlation_p: correlation.map(|c| c.p_value),
            level_bias_db: some(column(|f| f.level_error_db).as_slice().mean()),
            refused,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(error: f64, sigma: f64) -> Option<BearingError> {
        Some(BearingError { error, sigma, ambiguous: false, level_error_db: 0.5 })
    }

    #[test]
    fn figures_are_those_of_the_errors() {
        let turns = [found(0.1, 0.1), found(-0.3, 0.1), None, found(0.5, 0.1), found(0.1, 0.2)];
        let report = ExtractorReport::of("x", &turns);
        let close = |a: Option<f64>, b: f64| a.is_some_and(|a| (a - b).abs() < 1e-9);
        assert!(close(report.rms_deg, 0.3_f64.to_degrees()), "{report:?}");
        assert!(close(report.sigma_ratio, ((1.0_f64 + 9.0 + 25.0 + 0.25) / 4.0).sqrt()));
        assert!(close(report.coverage_95, 0.5) && close(report.level_bias_db, 0.5));
        assert_eq!((report.refused, report.beyond_4_sigma), (1, 1));
        assert_eq!(ExtractorReport::of("x", &[None]).rms_deg, None);
        assert_eq!(ExtractorReport::of("x", &[None]).correlation, None);
    }
}
