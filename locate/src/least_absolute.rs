use foxhunt_core::{Estimate, Receptions};
use foxhunt_filters::{BatchError, Censoring, ShadowedReading};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::{
    Area, LocateConfig, LocateError, Located, Locator, Power,
    located::{levels_and_silences, several_places},
    loss_db,
};

/// The place, the exponent and P₀ of a log-distance law for which the absolute residuals of the
/// levels have the least sum: what most people fit. A baseline: its covariance (Koenker & Bassett
/// 1978, theorem 4.2, with Laplace's density) takes levels for independent, which those along a
/// flight are not. A silence has a residual where a level above its floor is expected (Powell
/// 1984, "censored regression").
#[derive(Clone, Copy, Debug)]
pub struct LeastAbsolute;

/// The exponents that a law may have.
const EXPONENTS: core::ops::RangeInclusive<f64> = 1.0..=5.0;

/// One fit's levels, and what is known.
struct Fit<'a> {
    levels: &'a [ShadowedReading],
    up: f64,
    reference_dbm: Option<f64>,
    exponent: Option<f64>,
}

impl Fit<'_> {
    /// −10 log₁₀ of each range.
    fn attenuations(&self, place: Vector2<f64>) -> impl Iterator<Item = f64> {
        let place = place.push(self.up);
        self.levels.iter().map(move |r| loss_db(&(place - r.receiver.position)))
    }

    /// The mean absolute residual of a place and an exponent, with the best P₀.
    fn cost(&self, at: &Vector3<f64>) -> f64 {
        let exponent = self.exponent.unwrap_or(at.z);
        let levels = self.levels.iter().zip(self.attenuations(at.xy()));
        // Without P₀; of a censored level the residual of its limit.
        let residuals: Vec<(f64, Censoring)> =
            levels.map(|(r, x)| (r.value - exponent * x, r.censoring)).collect();
        let middle = self.reference_dbm.unwrap_or_else(|| best_reference(&residuals));
        let possible = self.exponent.is_some() || EXPONENTS.contains(&at.z);
        let beyond = if possible { 0.0 } else { f64::INFINITY };
        beyond + mean_absolute(&residuals, middle)
    }

    /// The least cost from a start on, by steps along the axes that halve where none helps
    /// (Hooke & Jeeves 1961).
    fn descend(&self, start: Vector3<f64>, step_m: f64) -> (Vector3<f64>, f64) {
        let mut at = start;
        let mut step = Vector3::new(step_m, step_m, 0.4);
        let mut cost = self.cost(&at);
        // Levels that are nearly alike fit ever better from ever farther away.
        for _ in 0..MOST_ROUNDS {
            if step.x < 0.05 {
                break;
            }
            let mut improved = false;
            for axis in 0..3 {
                for sign in [1.0, -1.0] {
                    let mut next = at;
                    next[axis] += sign * step[axis];
                    let next_cost = self.cost(&next);
                    if next_cost < cost * (1.0 - 1e-9) {
                        (at, cost, improved) = (next, next_cost, true);
                    }
                }
            }
            if !improved {
                step *= 0.5;
            }
        }
        (at, cost)
    }
}

/// The mean absolute residual about a middle; a censored level has none where it is expected on
/// its side of the limit.
fn mean_absolute(residuals: &[(f64, Censoring)], middle: f64) -> f64 {
    let absolute = |&(residual, censoring): &(f64, Censoring)| {
        let off: f64 = residual - middle;
        match censoring {
            Censoring::Below => (-off).max(0.0),
            Censoring::None => off.abs(),
            Censoring::Above => off.max(0.0),
        }
    };
    mean(residuals.iter().map(absolute))
}

/// The middle with the least mean absolute residual: where as many levels lie above as lie below,
/// each limit counted on the side on which it costs.
fn best_reference(residuals: &[(f64, Censoring)]) -> f64 {
    let mut sorted = residuals.to_vec();
    sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    // The slope below all of them; an exact residual turns it by 2, a censored one by 1.
    let falls = sorted.iter().map(|(_, censoring)| i64::from(*censoring != Censoring::Below));
    let mut slope = -falls.sum::<i64>();
    for (residual, censoring) in &sorted {
        slope += if *censoring == Censoring::None { 2 } else { 1 };
        if slope >= 0 {
            return *residual;
        }
    }
    sorted.last().map_or(0.0, |last| last.0)
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = u32::try_from(values.len()).unwrap_or(u32::MAX);
    values.sum::<f64>() / f64::from(count)
}

impl Locator for LeastAbsolute {
    fn locate(
        &self,
        receptions: &Receptions,
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        let levels: Vec<_> = levels_and_silences(receptions)?.collect();
        let have = levels.iter().filter(|reading| reading.is_exact()).count();
        if have < 5 {
            return Err(BatchError::TooFew { what: "levels", have, need: 5 }.into());
        }
        several_places("levels", levels.iter().map(|reading| reading.receiver))?;
        let (reference_dbm, exponent) = match (config.power, config.power.law()) {
            (_, Some((reference_dbm, exponent))) => (Some(reference_dbm), Some(exponent)),
            (Power::FreeReference { exponent }, None) => (None, Some(exponent)),
            _ => (None, None),
        };
        let fit = Fit { levels: &levels, up: config.target_up_m, reference_dbm, exponent };
        let area = Area::about(receptions, config.margin_m);
        let mut starts: Vec<(Vector3<f64>, f64)> = area
            .lattice(STARTS)
            .map(|place| place.push(config.power.exponent()))
            .map(|start| (start, fit.cost(&start)))
            .collect();
        starts.sort_by(|a, b| a.1.total_cmp(&b.1));
        let step_m = area.side() / f64::from(STARTS);
        let ends = starts.iter().take(DESCENTS).map(|start| fit.descend(start.0, step_m));
        let (best, _) = ends
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .filter(|(_, cost)| cost.is_finite())
            .ok_or(BatchError::Flat { rcond: 0.0 })?;
        // Censored levels, which have no residual as a rule, say nothing of the fit.
        let received: Vec<_> =
            levels.iter().filter(|reading| reading.is_exact()).copied().collect();
        let fit = Fit { levels: &received, ..fit };
        let cost = fit.cost(&best);
        // Σ g gᵀ of the residuals' gradients, without their mean, which is P₀'s.
        let gradient = |step: Vector2<f64>| {
            let exponent = exponent.unwrap_or(best.z);
            let (ahead, behind) =
                (fit.attenuations(best.xy() + step), fit.attenuations(best.xy() - step));
            let slope: Vec<f64> =
                ahead.zip(behind).map(|(a, b)| 0.5 * exponent * (a - b)).collect();
            slope
        };
        let mut columns = [
            gradient(Vector2::x()),
            gradient(Vector2::y()),
            if exponent.is_some() {
                vec![0.0; received.len()]
            } else {
                fit.attenuations(best.xy()).collect()
            },
        ];
        if reference_dbm.is_none() {
            for column in &mut columns {
                let middle = mean(column.iter().copied());
                column.iter_mut().for_each(|value| *value -= middle);
            }
        }
        let product = |i: usize, j: usize| -> f64 {
            columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum()
        };
        let mut information = Matrix3::from_fn(product);
        if exponent.is_some() {
            information[(2, 2)] = 1.0;
        }
        let inverse = information.cholesky().ok_or(BatchError::Flat { rcond: 0.0 })?.inverse();
        let inverse = inverse.fixed_view::<2, 2>(0, 0).into_owned();
        let mut covariance = inverse * (cost * cost);
        if let Some(law) = config.power.centroid() {
            let level: Vec<f64> = vec![1.0; received.len()];
            let slope = fit.attenuations(best.xy()).map(|loss| loss - law.loss).collect();
            let errors = [(level, law.variance.sqrt()), (slope, law.exponent_sigma)];
            let moved = errors.map(|(column, sigma): (Vec<f64>, f64)| {
                let along = |axis: usize| -> f64 {
                    columns[axis].iter().zip(&column).map(|(a, b)| a * b).sum()
                };
                inverse * Vector2::new(along(0), along(1)) * sigma
            });
            covariance += moved.map(|step| step * step.transpose()).iter().sum::<Matrix2<f64>>();
        }
        Ok(Located {
            observations: levels.len(),
            ..Located::at(Estimate { mean: best.xy(), covariance })
        })
    }
}

/// Number of starts along each side of the area.
const STARTS: u8 = 15;

/// Maximum number of rounds of a descent, each of which tries a step along every axis.
const MOST_ROUNDS: u16 = 400;

/// Number of starts, the best, from which a descent begins.
const DESCENTS: usize = 6;
