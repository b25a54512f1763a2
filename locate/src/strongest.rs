use foxhunt_core::{Estimate, Receptions};
use foxhunt_filters::{Censoring, ShadowedReading};
use nalgebra::{Matrix2, Vector2};

use super::{LocateConfig, LocateError, Located, Locator, located::levels_and_silences};

/// The place of the strongest level; its covariance is the spread of the strongest tenth of all
/// levels about it, silences counted with them. A baseline: it needs no law of propagation, and
/// finds nothing beyond the flight.
#[derive(Clone, Copy, Debug)]
pub struct Strongest;

impl Locator for Strongest {
    fn locate(&self, receptions: &Receptions, _: &LocateConfig) -> Result<Located, LocateError> {
        let mut levels: Vec<_> = levels_and_silences(receptions)?.collect();
        let place = |at: &ShadowedReading| at.receiver.position.xy();
        levels.sort_by(|a, b| b.censoring.cmp(&a.censoring).then(b.value.total_cmp(&a.value)));
        let strongest = place(levels.first().ok_or(LocateError::NoLevels)?);
        let is_silence = |reading: &&ShadowedReading| reading.censoring == Censoring::Below;
        let received = levels.len() - levels.iter().filter(is_silence).count();
        let tenth = levels.get(..received.min(levels.len().div_ceil(10))).unwrap_or_default();
        let spread = |sum: Matrix2<f64>, at: &ShadowedReading| {
            let apart: Vector2<f64> = place(at) - strongest;
            sum + apart * apart.transpose()
        };
        let count = u32::try_from(tenth.len()).unwrap_or(u32::MAX);
        let covariance = tenth.iter().fold(Matrix2::zeros(), spread) / f64::from(count)
            + Matrix2::identity() * LEAST_SIGMA_M * LEAST_SIGMA_M;
        Ok(Located {
            observations: levels.len(),
            ..Located::at(Estimate { mean: strongest, covariance })
        })
    }
}

/// The mean of the receivers' places, each weighed by the amplitude that it received, which free
/// space makes one over the distance (Blumenthal et al. 2007); its covariance is that of a weighted
/// mean. A baseline: it finds nothing beyond the receivers.
#[derive(Clone, Copy, Debug)]
pub struct WeightedCentroid;

impl Locator for WeightedCentroid {
    fn locate(&self, receptions: &Receptions, _: &LocateConfig) -> Result<Located, LocateError> {
        let levels: Vec<ShadowedReading> =
            levels_and_silences(receptions)?.filter(|r| r.censoring != Censoring::Below).collect();
        let most = levels.iter().map(|r| r.value).fold(f64::NEG_INFINITY, f64::max);
        let weighed = |r: &ShadowedReading| {
            (libm::pow(10.0_f64, (r.value - most) / 20.0), r.receiver.position.xy())
        };
        let weighed: Vec<(f64, Vector2<f64>)> = levels.iter().map(weighed).collect();
        let total: f64 = weighed.iter().map(|(weight, _)| weight).sum();
        let sum: Vector2<f64> = weighed.iter().map(|(weight, place)| place * *weight).sum();
        let mean = sum / total;
        let square = |sum: Matrix2<f64>, (weight, place): &(f64, Vector2<f64>)| {
            let apart = (place - mean) * *weight;
            sum + apart * apart.transpose()
        };
        let covariance = weighed.iter().fold(Matrix2::zeros(), square) / (total * total)
            + Matrix2::identity() * LEAST_SIGMA_M * LEAST_SIGMA_M;
        Ok(Located { observations: levels.len(), ..Located::at(Estimate { mean, covariance }) })
    }
}

/// σ of a place that a satellite receiver gives, in metres: where there is one strongest level
/// alone, its place is no better known.
const LEAST_SIGMA_M: f64 = 3.0;
