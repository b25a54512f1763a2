use foxhunt_core::{ConstantVelocity, Observation};
use foxhunt_filters::PosteriorCramerRao;
use foxhunt_sensors::{BearingMixture, BearingOnly};
use nalgebra::{Matrix1, Matrix4, Vector1};

use super::{TargetConfig, TargetMotion, Trial, draw::Draw};

/// More trajectories than this change an average by less than is shown.
const MOST: usize = 500;

/// The bound on the root mean square error of the place after each bearing, in metres, from the
/// trajectories that were drawn (Tichavský, Muravchik & Nehorai 1998).
///
/// Nothing where there is no such bound: where the prior has no density with a slope, as that of a
/// room, and where the target does not move as the estimators take it to.
pub(super) fn bounds(trial: &Trial, seeds: impl Iterator<Item = u64>) -> Vec<Option<f64>> {
    let of_bearings = trial.differences.is_none();
    let Some(motion) = trial.moving().filter(|_| of_bearings && as_modelled(trial)) else {
        return Vec::new();
    };
    let draws: Vec<Draw> = seeds.take(MOST).map(|seed| Draw::new(trial, seed)).collect();
    recursion(trial, &motion, &draws).unwrap_or_default()
}

/// Returns true if the truth moves as the estimators assume.
fn as_modelled(trial: &Trial) -> bool {
    let assumed = match trial.motion {
        TargetMotion::Still => 0.0,
        TargetMotion::ConstantVelocity { acceleration_density } => acceleration_density,
    };
    let true_density = match trial.target {
        TargetConfig::Line { acceleration_density, .. } => acceleration_density,
        TargetConfig::FromPrior => 0.0,
        TargetConfig::Circle { .. } => return false,
    };
    (assumed - true_density).abs() <= 1e-12 * assumed
}

fn recursion(trial: &Trial, motion: &ConstantVelocity, draws: &[Draw]) -> Option<Vec<Option<f64>>> {
    let bearings = &trial.bearings;
    // All that counts of a density about a location is its Fisher information.
    let density =
        BearingMixture::new(bearings.outlier_share, bearings.bias_rad, bearings.sigma_rad).ok()?;
    let noise = Matrix1::new(1.0 / density.fisher_information());
    let first = draws.first()?;
    let count = f64::from(u32::try_from(draws.len()).ok()?);
    let at_first = draws.iter().map(|draw| draw.prior.information(&draw.truth[0]));
    let information: Matrix4<f64> = at_first.sum::<Option<Matrix4<f64>>>()? / count;
    let mut bound = PosteriorCramerRao::from_information(information).ok()?;
    let states = |k: usize| draws.iter().map(move |draw| draw.truth[k]);
    let mut bounds = Vec::with_capacity(first.truth.len());
    for k in 0..first.truth.len() {
        if k > 0 {
            bound.predict(motion, states(k - 1), bearings.interval_s).ok()?;
        }
        if k > 0 || !first.prior.holds_first_bearing() {
            let observations = draws.iter().map(|draw| {
                let reception = &draw.receptions[k];
                let angle = reception.bearing.map_or(0.0, |bearing| bearing.angle);
                Observation::new(reception.time, reception.receiver, Vector1::new(angle), noise)
            });
            let observations = observations.collect::<Result<Vec<_>, _>>().ok()?;
            bound.update(&BearingOnly::new(), states(k).zip(observations)).ok()?;
        }
        let covariance = bound.covariance().ok();
        let rms = covariance.map(|c| (c[(0, 0)] + c[(1, 1)]).sqrt());
        bounds.push(rms.filter(|rms| rms.is_finite()));
    }
    Some(bounds)
}
