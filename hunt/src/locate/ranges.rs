use foxhunt_core::{Level, Measured, Quantity, Reception};
use foxhunt_filters::{
    BatchSolver, SlantRange, SlantRangeDifference, multilaterate, spherical_intersection,
};
use foxhunt_sensors::{LogDistance, Propagation, RangeDifference};
use nalgebra::{Matrix1, Vector1, Vector3};

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
        let fix = multilaterate(&ranges, &beyond, config.target_up_m)?;
        let observations = ranges.len() + beyond.len();
        Ok(Located {
            observations,
            rivals: rivals(&fix.rivals),
            regions_95: regions_with_rivals(&fix),
            ..Located::at(fix.estimate)
        })
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
