//! Scores of estimators on fixes whose truth is known.

use foxhunt::{
    Spread,
    calibration::{ConformalFactors, Deviation},
    core::{Remark, nalgebra::Vector2},
    filters::consistency::Coverage,
    locate::{FoundOffset, Located},
};
use serde::Serialize;

use crate::error::CliError;

/// An estimator's answer to a fix.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Answer {
    pub estimator: String,
    /// Error in metres; absent if it found no place, for the reason of `failure`.
    pub error_m: Option<f64>,
    pub nees: Option<f64>,
    /// True if the 95 % ellipse holds the truth.
    pub inside_95: Option<bool>,
    /// True if the region that is shown holds the truth: that of the posterior where the ellipse is
    /// a poor picture of it.
    pub in_region_95: Option<bool>,
    /// -ln of the density at the truth, in 1/m².
    pub log_score: Option<f64>,
    /// True if the ellipse by the user's recordings holds the truth, for --conformal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_conformal_ellipse_95: Option<bool>,
    /// True if the circle by the user's recordings holds the truth, for --conformal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_conformal_circle_95: Option<bool>,
    /// Deviation of the truth in units of the ellipse.
    #[serde(skip)]
    pub deviation: Option<Deviation>,
    /// Offset between the clocks of levels and path, where it was found and taken off.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock_offset: Option<FoundOffset>,
    /// Doubts about the place.
    pub remarks: Vec<Remark>,
    pub failure: Option<String>,
}

/// An estimator over all fixes.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    pub estimator: String,
    pub fixes: usize,
    /// Fixes that it found no place for.
    pub failed: usize,
    pub median_error_m: Option<f64>,
    /// Interval that holds the median of the errors with 95 % (by order statistics).
    pub median_interval_m: Option<[f64; 2]>,
    pub mean_error_m: Option<f64>,
    pub mean_nees: Option<f64>,
    pub median_nees: Option<f64>,
    /// Mean of the log scores, each at most [`WORST_SCORE`].
    pub mean_log_score: Option<f64>,
    /// Number of 95 % ellipses that hold the truth.
    pub inside_95: usize,
    /// Interval that holds the share of ellipses that hold the truth with 95 % (Clopper & Pearson
    /// 1934).
    pub coverage_interval: Option<[f64; 2]>,
    /// Number of shown 95 % regions that hold the truth, and number of all.
    pub in_regions_95: [usize; 2],
    /// The interval of `coverage_interval` for the regions.
    pub region_interval: Option<[f64; 2]>,
    /// Number of answers without a remark whose 95 % region holds the truth, and number of all.
    pub unremarked_95: [usize; 2],
    /// The interval of `coverage_interval` for the answers without a remark.
    pub unremarked_interval: Option<[f64; 2]>,
    /// Number of ellipses by the user's recordings that hold the truth, and number of all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_conformal_ellipses_95: Option<[usize; 2]>,
    /// The interval of `coverage_interval` for these ellipses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub conformal_ellipse_interval: Option<[f64; 2]>,
    /// Number of circles by the user's recordings that hold the truth, and number of all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_conformal_circles_95: Option<[usize; 2]>,
    /// The interval of `coverage_interval` for these circles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub conformal_circle_interval: Option<[f64; 2]>,
    /// Number of fixes in which the estimator judged first is nearer than this one.
    pub first_is_nearer: Option<usize>,
}

/// Largest log score that a mean takes, in nats: one answer that is sure and wrong would hide all
/// others.
const WORST_SCORE: f64 = 100.0;

impl Answer {
    /// Scores a place; without a truth nothing but its remarks counts.
    pub fn new(estimator: &str, located: &Located, truth: Option<&Vector2<f64>>) -> Self {
        Self {
            estimator: estimator.to_owned(),
            error_m: truth.map(|truth| (located.estimate.mean - truth).norm()),
            nees: truth.and_then(|truth| located.estimate.nees(truth)),
            inside_95: truth.and_then(|truth| located.ellipse_95_holds(truth)),
            in_region_95: truth.and_then(|truth| located.region_95_holds(truth)),
            log_score: truth.and_then(|truth| located.log_score(truth)),
            in_conformal_ellipse_95: None,
            in_conformal_circle_95: None,
            deviation: truth.and_then(|truth| Deviation::new(located, truth)),
            clock_offset: located.clock_offset,
            remarks: located.remarks.clone(),
            failure: None,
        }
    }

    /// Judges the regions by the user's recordings too.
    pub fn with_conformal(self, factors: Option<&ConformalFactors>) -> Self {
        let held = factors.zip(self.deviation).map(|(factors, of)| factors.hold(&of));
        Self {
            in_conformal_ellipse_95: held.map(|[ellipse, _]| ellipse),
            in_conformal_circle_95: held.map(|[_, circle]| circle),
            ..self
        }
    }

    /// Records the reason why there is no place.
    pub fn failed(estimator: &str, reason: String) -> Self {
        Self {
            estimator: estimator.to_owned(),
            error_m: None,
            nees: None,
            inside_95: None,
            in_region_95: None,
            log_score: None,
            in_conformal_ellipse_95: None,
            in_conformal_circle_95: None,
            deviation: None,
            clock_offset: None,
            remarks: Vec::new(),
            failure: Some(reason),
        }
    }
}

impl Summary {
    /// Summarises every estimator over all fixes, in the order of their first answers. The first
    /// answer of a fix is that of the estimator that is judged.
    pub fn of_each<'a, I>(fixes: impl Fn() -> I) -> Result<Vec<Self>, CliError>
    where
        I: Iterator<Item = &'a [Answer]>,
    {
        let mut names: Vec<&str> = Vec::new();
        for answer in fixes().flatten() {
            if !names.contains(&answer.estimator.as_str()) {
                names.push(&answer.estimator);
            }
        }
        let of = |name: &&str| {
            let own = |answers: &'a [Answer]| {
                let answer = answers.iter().find(|answer| answer.estimator == *name)?;
                Some((answer, answers.first()))
            };
            Self::of(name, fixes().filter_map(own))
        };
        names.iter().map(of).collect()
    }

    /// Summarises answers, each beside that of the estimator which is judged first.
    pub fn of<'a>(
        name: &str,
        answers: impl Iterator<Item = (&'a Answer, Option<&'a Answer>)>,
    ) -> Result<Self, CliError> {
        let coverage = || Coverage::new(0.95, 0.95).map_err(CliError::failure);
        let mut ellipses = coverage()?;
        let mut regions = coverage()?;
        let mut unremarked = Held::new()?;
        let mut own_ellipses = Held::new()?;
        let mut own_circles = Held::new()?;
        let mut errors = Vec::new();
        let mut nees = Vec::new();
        let mut scores = Vec::new();
        let mut is_first = false;
        let [mut failed, mut inside, mut in_regions, mut nearer] = [0; 4];
        for (answer, first) in answers {
            failed += usize::from(answer.failure.is_some());
            errors.extend(answer.error_m);
            nees.extend(answer.nees);
            scores.extend(answer.log_score.map(|score| score.min(WORST_SCORE)));
            if let Some(held) = answer.inside_95 {
                ellipses.add(held);
                inside += usize::from(held);
            }
            if let Some(held) = answer.in_region_95 {
                regions.add(held);
                in_regions += usize::from(held);
                if answer.remarks.is_empty() {
                    unremarked.add(held);
                }
            }
            answer.in_conformal_ellipse_95.into_iter().for_each(|held| own_ellipses.add(held));
            answer.in_conformal_circle_95.into_iter().for_each(|held| own_circles.add(held));
            is_first |= first.is_some_and(|first| first.estimator == name);
            let first_m = first.and_then(|first| first.error_m);
            nearer += usize::from(matches!((first_m, answer.error_m), (Some(a), Some(b)) if a < b));
        }
        let spread = Spread::of(&errors);
        let of_nees = Spread::of(&nees);
        Ok(Self {
            estimator: name.to_owned(),
            fixes: errors.len() + failed,
            failed,
            median_error_m: spread.map(|spread| spread.p50),
            median_interval_m: median_interval(&mut errors),
            mean_error_m: spread.map(|spread| spread.mean),
            mean_nees: of_nees.map(|spread| spread.mean),
            median_nees: of_nees.map(|spread| spread.p50),
            mean_log_score: Spread::of(&scores).map(|spread| spread.mean),
            inside_95: inside,
            coverage_interval: ellipses.interval(),
            in_regions_95: [in_regions, regions.count()],
            region_interval: regions.interval(),
            unremarked_95: unremarked.of(),
            unremarked_interval: unremarked.coverage.interval(),
            in_conformal_ellipses_95: own_ellipses.of_any(),
            conformal_ellipse_interval: own_ellipses.coverage.interval(),
            in_conformal_circles_95: own_circles.of_any(),
            conformal_circle_interval: own_circles.coverage.interval(),
            first_is_nearer: (!is_first).then_some(nearer),
        })
    }
}

/// Number of regions that hold the truth.
struct Held {
    inside: usize,
    coverage: Coverage,
}

impl Held {
    fn new() -> Result<Self, CliError> {
        let coverage = Coverage::new(0.95, 0.95).map_err(CliError::failure)?;
        Ok(Self { inside: 0, coverage })
    }

    fn add(&mut self, held: bool) {
        self.coverage.add(held);
        self.inside += usize::from(held);
    }

    /// Returns the number of regions that hold the truth, and of all.
    fn of(&self) -> [usize; 2] {
        [self.inside, self.coverage.count()]
    }

    /// Returns the number of regions that hold the truth, and of all; `None` without regions.
    fn of_any(&self) -> Option<[usize; 2]> {
        Some(self.of()).filter(|[_, count]| *count > 0)
    }
}

/// Returns the interval of a median: the order statistics between which it lies with 95 %, as the
/// number of values below it is binomial with a half. `None` for fewer than six values, which are
/// too few.
fn median_interval(values: &mut [f64]) -> Option<[f64; 2]> {
    values.sort_by(f64::total_cmp);
    // Twice the largest number of values that are below the median with at most 2.5 %.
    let count = values.len();
    let half = 0.5_f64.powi(i32::try_from(count).ok()?);
    let mut term = half;
    let mut sum = 0.0;
    let mut below = 0;
    if half > 0.0 {
        while sum + term <= 0.025 && below < count {
            sum += term;
            let at = f64::from(u32::try_from(below).ok()?);
            term *= (f64::from(u32::try_from(count).ok()?) - at) / (at + 1.0);
            below += 1;
        }
    } else {
        // Beyond a thousand values the normal approximation is exact to a rank.
        let count = f64::from(u32::try_from(count).ok()?);
        while f64::from(u32::try_from(below).ok()?) + 1.0 < 0.5 * count - 0.98 * count.sqrt() {
            below += 1;
        }
    }
    let low = values.get(below.checked_sub(1)?)?;
    Some([*low, *values.get(count - below)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_lie_between_the_ranks_of_the_tables() {
        // Conover 1999, table A3 for the median: ranks 2 and 9 of 10, 1 and 6 of 6.
        let mut values: Vec<f64> = (1..=10).rev().map(f64::from).collect();
        assert_eq!(median_interval(&mut values), Some([2.0, 9.0]));
        assert_eq!(median_interval(&mut values[..6]), Some([1.0, 6.0]));
        assert_eq!(median_interval(&mut values[..5]), None);
        let mut many: Vec<f64> = (1..=1000).map(f64::from).collect();
        assert_eq!(median_interval(&mut many), Some([469.0, 532.0]));
    }
}
