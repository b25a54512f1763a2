//! Runs the receptions of a log through an estimator again.

use crate::{
    config::{EstimatorConfig, NamedEstimator, beacon_seed},
    hunt::{Event, Fix, Heard, Track},
    log::Log,
};
use foxhunt_core::{BeaconId, Estimate, EstimatorError};
use foxhunt_filters::consistency::{ChiSquaredAverage, Monitored, Whiteness};
use foxhunt_sensors::AntennaError;

/// What a replay came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    /// What was found, in the order of the beacons; a search that the log breaks off is included
    /// as far as it went, with the outcome that the log has, or none.
    pub fixes: Vec<ReplayedFix>,
    /// How many estimates of the log were compared.
    pub compared: usize,
    /// How many of them differ in any bit. Zero through the log's own configuration.
    pub different: usize,
}

/// A fix, replayed.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayedFix {
    /// Which beacon.
    pub beacon: BeaconId,
    /// Its name.
    pub name: String,
    /// What is believed after its last reception.
    pub estimate: Estimate<2>,
    /// When that was, in seconds.
    pub time: f64,
    /// How many receptions went through the estimator.
    pub steps: u32,
    /// The normalised innovations squared of those that have one, at 95 %.
    pub nis: ChiSquaredAverage,
    /// The autocorrelation of the normalised innovations, up to 5 receptions apart.
    pub whiteness: Whiteness,
    /// How many the gate kept out.
    pub rejected: u32,
    /// How often the innovations of the last receptions became larger than the estimator can
    /// explain.
    pub diverged: u32,
    /// What the log says of the search, if it came to an end.
    pub logged: Option<Fix>,
}

/// How many receptions the innovations are compared over: three drones hear five times between
/// two moves, and a short search has no more than some twenty.
const LAGS: usize = 5;

/// Replays a log through its own estimator, or through another one.
///
/// # Errors
///
/// [`ReplayError`] when an estimator cannot be made.
pub fn replay(log: &Log, other: Option<&NamedEstimator>) -> Result<Replay, ReplayError> {
    let config: &EstimatorConfig = other.map_or(&log.header.estimator, |named| &named.config);
    let model = log.header.model.build()?;
    let mut replay = Replay { fixes: Vec::new(), compared: 0, different: 0 };
    let mut tracks: Vec<Track<Monitored<_, _, 2>, 2, 2>> = Vec::new();
    // Whose reception the last one was.
    let mut heard = None;
    for event in &log.events {
        match event {
            Event::BeaconStarted { time, beacon, name, prior } => {
                let seed = beacon_seed(log.header.seed, *beacon);
                let estimator = config
                    .build(model.clone(), prior, seed)
                    .map_err(|source| ReplayError::Estimator { beacon: name.clone(), source })?;
                tracks.push(Track::new(Monitored::new(estimator, model.clone()), config.track));
                replay.fixes.push(ReplayedFix {
                    beacon: *beacon,
                    name: name.clone(),
                    estimate: *prior,
                    time: *time,
                    steps: 0,
                    nis: ChiSquaredAverage::default(),
                    whiteness: Whiteness::new(LAGS),
                    rejected: 0,
                    diverged: 0,
                    logged: None,
                });
            }
            Event::Received { first_position, reception, .. } => {
                heard = replay.search(reception.beacon);
                let Some(index) = heard else { continue };
                let (track, fix) = (&mut tracks[index], &mut replay.fixes[index]);
                // What the estimator refuses now it refused in flight, or would have.
                if let Ok(Heard::Corrected(correction)) = track.hear(reception, *first_position) {
                    let degrees = config.track.degrees_of_freedom(reception, *first_position);
                    fix.nis.extend(correction.nis().map(|nis| (nis, degrees)));
                    fix.rejected += u32::from(correction.is_rejected());
                }
                fix.diverged += u32::from(track.alarm().is_some());
                fix.estimate = track.position();
                fix.time = fix.time.max(reception.time);
                fix.steps = track.steps();
            }
            Event::Corrected { estimate, .. } => {
                let Some(fix) = heard.map(|index| &replay.fixes[index]) else { continue };
                replay.compared += 1;
                replay.different += usize::from(!same_bits(&fix.estimate, estimate));
            }
            Event::BeaconFinished { fix, .. } => {
                if let Some(index) = replay.search(fix.beacon) {
                    replay.fixes[index].logged = Some(fix.clone());
                }
            }
            _ => {}
        }
    }
    for (fix, track) in replay.fixes.iter_mut().zip(&tracks) {
        fix.whiteness.add_run(track.estimator().innovations());
    }
    Ok(replay)
}

impl Replay {
    /// Which of the searches is the last that was begun for a beacon.
    fn search(&self, beacon: BeaconId) -> Option<usize> {
        self.fixes.iter().rposition(|fix| fix.beacon == beacon)
    }
}

fn same_bits(a: &Estimate<2>, b: &Estimate<2>) -> bool {
    let bits = |e: &Estimate<2>| {
        e.mean.iter().chain(e.covariance.iter()).map(|v| v.to_bits()).collect::<Vec<_>>()
    };
    bits(a) == bits(b)
}

/// Why a log cannot be replayed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The log's law of propagation is out of range.
    #[error("the model in the log's header: {0}")]
    Model(#[from] AntennaError),
    /// An estimator could not be made.
    #[error("no estimator for beacon {beacon}")]
    Estimator {
        /// The beacon.
        beacon: String,
        /// What is wrong.
        source: EstimatorError,
    },
}
