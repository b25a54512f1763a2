//! One run of a trial with one estimator, and the track that follows the target.

use foxhunt_core::{BeaconId, ConstantVelocity, Estimate, EstimatorError, Quantity, RandomWalk};
use foxhunt_hunt::{
    config::{
        AnyModel, AnyMotion, EstimatorConfig, FilterConfig, FilterOf, GateConfig, IntoDyn,
        OutlierConfig, Prior as _,
    },
    hunt::{Components, Search, TimeStep, Track, TrackConfig, TrackStep, WithoutBearing},
    registry::{EstimatorEntry, Need, TrackRequest, beacon_seed},
};
use foxhunt_sensors::{BearingOnly, LogDistance, RangeDifference, RssBearing};
use nalgebra::{Vector2, Vector3};

use super::{
    DifferencesConfig, TargetMotion, Trial, TrialError,
    draw::Draw,
    prior::{Leading, Prior},
};

/// One run of a trial with one estimator.
#[derive(Clone, Debug, PartialEq)]
pub struct TrialRun {
    /// The target's place at each bearing, East and North in metres.
    pub truth: Vec<Vector2<f64>>,
    /// The estimate after each bearing; shorter than `truth` if the estimator could not go on.
    pub estimates: Vec<Estimate<2>>,
    /// The normalised innovation squared of each bearing that has one.
    pub nis: Vec<f64>,
    /// The number of bearings that went through the estimator.
    pub steps: u32,
}

impl TrialRun {
    /// Returns true if the estimator could not go on.
    #[must_use]
    pub fn failed(&self) -> bool {
        self.estimates.len() < self.truth.len()
    }
}

/// Runs a trial once; the same trial, estimator and seed give the same run, and every estimator
/// gets the same bearings.
///
/// # Errors
///
/// [`TrialError`] when the estimator cannot be built or does not suit the trial. One that cannot
/// go on ends the run, which [`TrialRun::failed`] is about.
pub fn run_trial(
    trial: &Trial,
    estimator: &EstimatorEntry,
    seed: u64,
) -> Result<TrialRun, TrialError> {
    let draw = Draw::new(trial, seed);
    let own_seed = beacon_seed(seed, BeaconId(0));
    Ok(follow(&draw, track(trial, estimator, &draw.prior, own_seed)?))
}

fn follow(draw: &Draw, mut track: Track) -> TrialRun {
    let truth = draw.truth.iter().map(|state| state.xy()).collect();
    let mut run = TrialRun { truth, estimates: Vec::new(), nis: Vec::new(), steps: 0 };
    for (k, reception) in draw.receptions.iter().enumerate() {
        if k > 0 || !draw.prior.holds_first_bearing() {
            let Ok(TrackStep::Updated { correction, .. }) = track.update(reception, false) else {
                break;
            };
            run.nis.extend(correction.nis());
            run.steps += 1;
        }
        run.estimates.push(track.position());
    }
    run
}

/// Builds the track of one run.
///
/// An estimator of the library's parts is that of its name, with what a trial brings itself:
/// motion, prior, number of particles, the share of outliers, and a start from the prior instead of
/// a grid. Without outliers it has no gate, which would keep out bearings that are far from what a
/// poor linearisation expects. One of a user's own is built as for a hunt.
///
/// # Errors
///
/// [`TrialError`] when it cannot be built, or has a setting that a trial cannot honour.
fn track(
    trial: &Trial,
    entry: &EstimatorEntry,
    prior: &Prior,
    seed: u64,
) -> Result<Track, TrialError> {
    let track = match entry.settings() {
        Some(settings) => of_settings(trial, entry, settings, prior, seed)?,
        None => {
            entry.require_stream()?;
            own(trial, entry, prior, seed)?
        }
    };
    // The first prediction is to the first bearing that is not part of the prior.
    Ok(track.starting_at(0.0))
}

fn own(
    trial: &Trial,
    entry: &EstimatorEntry,
    prior: &Prior,
    seed: u64,
) -> Result<Track, TrialError> {
    let needs = entry.needs();
    match trial.differences {
        None if needs.bearing == Need::Unused => {
            return unsuited(trial, entry, "other measurements than bearings");
        }
        Some(_) if needs.others != [Quantity::RANGE_DIFFERENCE] => {
            return unsuited(trial, entry, "other measurements than range differences");
        }
        _ => {}
    }
    let moments: Estimate<2> = Leading(prior).moments();
    // Levels are missing, so that any law will do.
    let model = RssBearing::new(LogDistance::new(-30.0, 2.0)?).into();
    let search = Search { beacon: BeaconId(0), name: "target", prior: moments };
    let reference = trial.differences.map(|differences| reference(&differences));
    let request = TrackRequest { search, model: &model, reference, pulses: None, seed };
    Ok(entry.track(&request, false)?)
}

/// Place of the second receiver: East, North and Up in metres.
fn reference(differences: &DifferencesConfig) -> Vector3<f64> {
    Vector2::from(differences.reference_m).push(0.0)
}

fn unsuited(
    trial: &Trial,
    entry: &EstimatorEntry,
    needs: &'static str,
) -> Result<Track, TrialError> {
    Err(TrialError::Unsuited {
        estimator: entry.name.clone().into_owned(),
        trial: trial.name.clone(),
        needs,
    })
}

fn of_settings(
    trial: &Trial,
    entry: &EstimatorEntry,
    settings: &EstimatorConfig,
    prior: &Prior,
    seed: u64,
) -> Result<Track, TrialError> {
    let unsuited = |needs| unsuited(trial, entry, needs);
    if settings.power_sigma_db.is_some() || settings.exponent_sigma.is_some() {
        return unsuited("levels (power_sigma_db)");
    }
    if settings.track.components == Components::RssOnly {
        return unsuited("levels (track.components)");
    }
    if settings.track.time_step == TimeStep::PerReception {
        return unsuited("steps that count receptions (track.time_step)");
    }
    if trial.differences.is_some() && settings.track.components == Components::BearingOnly {
        return unsuited("bearings (track.components)");
    }
    if settings.lag_s.is_some() {
        return unsuited("receptions that come late (lag_s)");
    }
    match trial.motion {
        TargetMotion::Still if settings.moving.is_some() => unsuited("a target that moves"),
        TargetMotion::Still => build::<2>(trial, settings, still().into_dyn(), prior, seed),
        TargetMotion::ConstantVelocity { spectral_density } => {
            let motion = ConstantVelocity { spectral_density }.into_dyn();
            build::<4>(trial, settings, motion, prior, seed)
        }
    }
}

fn build<const N: usize>(
    trial: &Trial,
    settings: &EstimatorConfig,
    motion: AnyMotion<N>,
    prior: &Prior,
    seed: u64,
) -> Result<Track, TrialError>
where
    BearingOnly: IntoDyn<AnyModel<N, 1>>,
    FilterConfig: FilterOf<N, 1>,
    RangeDifference: IntoDyn<AnyModel<N, 1>>,
{
    if let Some(differences) = &trial.differences {
        let model = RangeDifference::new(reference(differences))?;
        let filter = settings.filter.with_particles(trial.particles).with_gate(GateConfig::Open);
        let estimator = filter.build(motion, model.into_dyn(), &Leading(prior), seed)?;
        let config = TrackConfig { without_bearing: WithoutBearing::UseLevel, ..settings.track };
        return Ok(Track::new::<N, 1>(estimator, config));
    }
    let bearings = &trial.bearings;
    let share = bearings.outlier_share;
    let mut model = BearingOnly::new().with_bias(bearings.bias_rad)?;
    let mut filter = settings.filter.with_particles(trial.particles);
    if share > 0.0 {
        model = model.with_outliers(share)?;
        let support = std::f64::consts::TAU;
        filter = filter
            .with_gate(GateConfig::Probability(0.999))
            .with_outliers_of_sum(OutlierConfig { share, support });
    } else {
        filter = filter.with_gate(GateConfig::Open);
    }
    let estimator: Result<_, EstimatorError> =
        filter.build(motion, model.into_dyn(), &Leading(prior), seed);
    Ok(Track::new::<N, 1>(estimator?, settings.track))
}

/// The motion of a still target's two components: not at all.
fn still() -> RandomWalk<2> {
    RandomWalk::uniform(0.0)
}
