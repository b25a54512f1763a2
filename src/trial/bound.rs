use foxhunt_core::{ConstantVelocity, Observation};
use foxhunt_filters::PosteriorCramerRao;
use foxhunt_sensors::{BearingMixture, BearingOnly};
use nalgebra::{Matrix1, Matrix4, Vector4};

use super::{TargetConfig, TargetMotion, Trial, TrialError, draw::Draw};

/// More trajectories than this change an average by less than is told.
const MOST: usize = 500;

/// The bound on the root mean square error of the place after each bearing, in metres, from the
/// trajectories that were drawn (Tichavský, Muravchik & Nehorai 1998).
///
/// Nothing where there is no such bound: where the prior has no density with a slope, as that of a
/// room, and where the target does not move as the estimators take it to.
///
/// # Errors
///
/// [`TrialError`] when what is heard cannot be drawn.
pub(super) fn bounds(
    trial: &Trial,
    seeds: impl Iterator<Item = u64>,
) -> Result<Vec<Option<f64>>, TrialError> {
    let Some(motion) = trial.moving().filter(|_| as_modelled(trial)) else {
        return Ok(Vec::new());
    };
    let draws = seeds.take(MOST).map(|seed| Draw::new(trial, seed));
    let draws = draws.collect::<Result<Vec<_>, _>>()?;
    Ok(recursion(trial, &motion, &draws).unwrap_or_default())
}

/// Whether the truth moves as the estimators are told.
fn as_modelled(trial: &Trial) -> bool {
    let told = match trial.motion {
        TargetMotion::Still => 0.0,
        TargetMotion::ConstantVelocity { acceleration_density } => acceleration_density,
    };
    let true_density = match trial.target {
        TargetConfig::Line { acceleration_density, .. } => acceleration_density,
        TargetConfig::FromPrior => 0.0,
        TargetConfig::Circle { .. } => return false,
    };
    (told - true_density).abs() <= 1e-12 * told
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
            let heard = draws.iter().map(|draw| {
                let o = &draw.heard[k];
                Observation::new(o.time(), *o.receiver(), *o.value(), noise)
            });
            let heard = heard.collect::<Result<Vec<_>, _>>().ok()?;
            bound.update(&BearingOnly::new(), states(k).zip(heard)).ok()?;
        }
        let covariance = bound.covariance().ok();
        let rms = covariance.map(|c| (c[(0, 0)] + c[(1, 1)]).sqrt());
        bounds.push(rms.filter(|rms| rms.is_finite()));
    }
    Some(bounds)
}

/// J of a prior that is Gaussian in range, bearing, speed and course, at a state.
pub(super) fn polar_information(
    place: [f64; 2],
    velocity: [f64; 2],
    sigmas: [f64; 4],
) -> Matrix4<f64> {
    let mut information = Matrix4::zeros();
    for (at, [x, y], along, turn) in
        [(0, place, sigmas[0], sigmas[1]), (2, velocity, sigmas[2], sigmas[3])]
    {
        // The gradients of length and direction, each over its σ.
        let length = x.hypot(y);
        let mut gradient = Vector4::zeros();
        (gradient[at], gradient[at + 1]) = (x / length / along, y / length / along);
        information += gradient * gradient.transpose();
        (gradient[at], gradient[at + 1]) =
            (-y / length / length / turn, x / length / length / turn);
        information += gradient * gradient.transpose();
    }
    information
}
