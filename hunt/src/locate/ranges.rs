use foxhunt_core::{Estimate, Level, Measured, Quantity, Reception, Remark};
use foxhunt_filters::{
    BatchError, BatchFix, BatchSolver, Marginal, SlantRange, SlantRangeDifference, multilaterate,
    multilaterate_with_offset, spherical_intersection,
};
use foxhunt_sensors::{LogDistance, Propagation, RangeDifference};
use nalgebra::{Matrix1, Vector1, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{
    LocateConfig, LocateError, Located, Locator, Power,
    located::{regions_with_rivals, rivals},
};

/// The place from ranges: measured ones, or those that levels have by a known law of propagation
/// (`filters::multilaterate`); a silence is farther away than its floor would be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Multilateration;

impl Locator for Multilateration {
    fn locate(
        &self,
        receptions: &[Reception],
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        let measured = |r: &Reception| {
            let range = r.measured.get(Quantity::RANGE)?;
            let receiver = r.receiver.position;
            Some(SlantRange { receiver, range: range.value, sigma: range.sigma })
        };
        let mut ranges: Vec<SlantRange> = receptions.iter().filter_map(measured).collect();
        let mut beyond = Vec::new();
        if ranges.is_empty() {
            let Power::Known { reference_dbm, exponent } = config.power else {
                return Err(LocateError::NoPower);
            };
            let law = LogDistance::new(reference_dbm, exponent)?;
            let range = |r: &Reception, level: Option<Level>| {
                Some(range_of(level?, r.receiver.position, &law))
            };
            ranges = receptions.iter().filter_map(|r| range(r, r.level)).collect();
            beyond = receptions.iter().filter_map(|r| range(r, r.silence)).collect();
        }
        if ranges.is_empty() {
            return Err(LocateError::NoLevels);
        }
        let observations = ranges.len() + beyond.len();
        let ranges = by_place(&ranges);
        let up = config.target_up_m;
        let alone = consistent(&ranges, up, |ranges| multilaterate(ranges, &beyond, up))?;
        let mut located = match with_offset(&ranges, &beyond, up, &alone) {
            Some(shared) => of_shared_offset(&shared),
            None => alone.located(),
        };
        located.observations = observations;
        Ok(located)
    }
}

/// Returns one range for each place of a receiver, the mean of its own, as a wall or a detour
/// changes all of them alike.
fn by_place(ranges: &[SlantRange]) -> Vec<SlantRange> {
    let mut sorted: Vec<&SlantRange> = ranges.iter().collect();
    let key = |r: &SlantRange| (r.receiver.x, r.receiver.y, r.receiver.z);
    let order = |a: &(f64, f64, f64), b: &(f64, f64, f64)| {
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
    };
    sorted.sort_by(|a, b| order(&key(a), &key(b)));
    let mean = |of_place: &[&SlantRange]| {
        let weight = |r: &&SlantRange| 1.0 / (r.sigma * r.sigma);
        let total: f64 = of_place.iter().map(weight).sum();
        let sum: f64 = of_place.iter().map(|r| weight(r) * r.range).sum();
        let receiver = of_place.first()?.receiver;
        Some(SlantRange { receiver, range: sum / total, sigma: total.sqrt().recip() })
    };
    sorted.chunk_by(|a, b| key(a) == key(b)).filter_map(mean).collect()
}

/// Misfits less probable than this are more than their σ make.
const MISFIT_P: f64 = 0.05;

/// Logarithm of the likelihood that an offset has to gain before ranges are taken to share one.
const GAIN_OF_OFFSET: f64 = 5.0;

/// Solution whose ranges scatter as their σ say, once these are widened by what is common to no two
/// of them.
struct Consistent<const N: usize> {
    fix: BatchFix<N>,
    /// Standard deviation by which the ranges are widened, in metres.
    spread_m: f64,
    /// Factor on the covariance that the knowledge of the spread from few ranges is worth.
    factor: f64,
    log_likelihood: f64,
}

impl Consistent<2> {
    fn located(&self) -> Located {
        let mut fix = self.fix.clone();
        fix.estimate.covariance *= self.factor;
        fix.rival_estimates.iter_mut().for_each(|rival| rival.covariance *= self.factor);
        Located {
            rivals: rivals(&fix.rivals),
            regions_95: regions_with_rivals(&fix),
            ..Located::at(fix.estimate)
        }
    }
}

/// Solves ranges again with σ² + τ², τ² such that the misfit is what is expected of them (Paule &
/// Mandel 1982), where it is improbable under their σ alone.
fn consistent<const N: usize>(
    ranges: &[SlantRange],
    up: f64,
    solve: impl Fn(&[SlantRange]) -> Result<BatchFix<N>, BatchError>,
) -> Result<Consistent<N>, BatchError> {
    let mut fix = solve(ranges)?;
    let degrees = f64::from(u32::try_from(ranges.len().saturating_sub(N)).unwrap_or(u32::MAX));
    let residuals = |fix: &BatchFix<N>| -> Vec<(f64, f64)> {
        let mean = &fix.estimate.mean;
        let place = mean.fixed_rows::<2>(0).into_owned();
        let offset = mean.get(2).copied().unwrap_or(0.0);
        let residual = |r: &SlantRange| {
            let expected = (place.push(up) - r.receiver).norm() + offset;
            ((r.range - expected).powi(2), r.sigma * r.sigma)
        };
        ranges.iter().map(residual).collect()
    };
    let mut spread = 0.0;
    let mut factor = 1.0;
    for _ in 0..20 {
        let squares = residuals(&fix);
        let misfit: f64 = squares.iter().map(|(square, variance)| square / variance).sum();
        let p = ChiSquared::new(degrees).map_or(1.0, |law| law.sf(misfit));
        let next = if p < MISFIT_P { spread_of(&squares, degrees) } else { 0.0 };
        let settled = (next - spread).abs() <= 1e-3 * next;
        spread = next;
        let widen = |r: &SlantRange| SlantRange { sigma: (r.sigma.powi(2) + spread).sqrt(), ..*r };
        let wider: Vec<SlantRange> = ranges.iter().map(widen).collect();
        if spread > 0.0 {
            fix = solve(&wider)?;
            // The variance of Student's t.
            factor = degrees / (degrees - 2.0).max(0.5);
        }
        if settled {
            break;
        }
    }
    let log_likelihood = fix.log_posterior;
    Ok(Consistent { fix, spread_m: spread.sqrt(), factor, log_likelihood })
}

/// Returns the variance that makes the misfit what is expected, from squared residuals and their
/// variances.
fn spread_of(squares: &[(f64, f64)], degrees: f64) -> f64 {
    let misfit =
        |spread: f64| squares.iter().map(|(square, own)| square / (own + spread)).sum::<f64>();
    let sum: f64 = squares.iter().map(|(square, _)| square).sum();
    let mut bounds = (0.0, sum / degrees.max(1.0));
    for _ in 0..60 {
        let middle = 0.5 * (bounds.0 + bounds.1);
        bounds = if misfit(middle) > degrees { (middle, bounds.1) } else { (bounds.0, middle) };
    }
    bounds.1
}

/// Returns the solution with an offset that all ranges share, where that explains them far better;
/// limits of silent receivers have no part in it.
fn with_offset(
    ranges: &[SlantRange],
    beyond: &[SlantRange],
    up: f64,
    alone: &Consistent<2>,
) -> Option<Consistent<3>> {
    if alone.spread_m <= 0.0 || !beyond.is_empty() || ranges.len() < 5 {
        return None;
    }
    let shared = consistent(ranges, up, |ranges| multilaterate_with_offset(ranges, up)).ok()?;
    (shared.log_likelihood > alone.log_likelihood + GAIN_OF_OFFSET).then_some(shared)
}

fn of_shared_offset(shared: &Consistent<3>) -> Located {
    let Estimate { mean, covariance } = &shared.fix.estimate;
    let place = Estimate {
        mean: mean.xy(),
        covariance: covariance.fixed_view::<2, 2>(0, 0) * shared.factor,
    };
    let offset = Marginal { mean: mean.z, sd: (covariance[(2, 2)] * shared.factor).sqrt() };
    let longer = if offset.mean > 0.0 { "long" } else { "short" };
    let text = format!(
        "the ranges meet if all of them are too {longer} by the same {:.2} m (σ {:.2} m), and that \
         is taken off; calibrate the ranging, or check the places of the receivers",
        offset.mean.abs(),
        offset.sd
    );
    Located {
        rivals: rivals(&shared.fix.rivals),
        range_offset_m: Some(offset),
        remarks: vec![Remark::new("ranges-share-offset", text)],
        ..Located::at(place)
    }
}

/// The range at which a law has a level; its σ to first order.
fn range_of(level: Level, receiver: Vector3<f64>, law: &LogDistance) -> SlantRange {
    let decades = (law.rss_dbm(1.0) - level.rss_dbm) / (10.0 * law.exponent());
    let range = 10.0_f64.powf(decades);
    let sigma = range * level.sigma_db * std::f64::consts::LN_10 / (10.0 * law.exponent());
    SlantRange { receiver, range, sigma }
}

/// The place from range differences to a reference receiver: spherical intersection, from where
/// least squares go on (`filters::spherical_intersection`).
#[derive(Clone, Copy, Debug)]
pub(crate) struct RangeDifferences;

impl Locator for RangeDifferences {
    fn locate(
        &self,
        receptions: &[Reception],
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        let quantity = Quantity::RANGE_DIFFERENCE;
        let reference = config.reference_m.ok_or(LocateError::NoReference)?;
        let mut differences = Vec::new();
        let mut observations = Vec::new();
        for (index, reception) in receptions.iter().enumerate() {
            let Some(&Measured { value, sigma, .. }) = reception.measured.get(quantity) else {
                continue;
            };
            let receiver = reception.receiver.position;
            differences.push(SlantRangeDifference { receiver, difference: value, sigma });
            let noise = Matrix1::new(sigma * sigma);
            let observation = foxhunt_core::Observation::new(
                reception.time,
                reception.receiver,
                Vector1::new(value),
                noise,
            );
            observations.push(observation.map_err(|source| LocateError::Reception {
                index,
                time: reception.time,
                source: source.into(),
            })?);
        }
        if differences.is_empty() {
            return Err(LocateError::NoQuantity { quantity });
        }
        let up = config.target_up_m;
        let starts = spherical_intersection(reference, &differences, up)?;
        let model = RangeDifference::new(reference)?.with_target_up(up)?;
        let fix = BatchSolver::new(model).solve(&observations, &starts)?;
        let observations = differences.len();
        Ok(Located {
            observations,
            rivals: rivals(&fix.rivals),
            regions_95: regions_with_rivals(&fix),
            ..Located::at(fix.estimate)
        })
    }
}
