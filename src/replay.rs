//! Runs the receptions of a log through an estimator again.

use foxhunt_core::{BeaconId, Estimate, EstimatorError};
use foxhunt_filters::consistency::{ChiSquaredAverage, Monitored, Whiteness};
use foxhunt_sensors::ParameterError;
use nalgebra::SVector;

use crate::{
    config::{EstimatorConfig, NamedEstimator, beacon_seed},
    hunt::{Event, Fix, Heard, Track},
    log::Log,
};

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
    /// How many receptions went through the estimator.
    pub steps: u32,
    /// The normalised innovations squared of those that have one, at 95 %.
    pub nis: ChiSquaredAverage,
    /// The autocorrelation of the normalised innovations, up to 5 receptions apart.
    pub whiteness: Whiteness,
    /// How many the gate kept out.
    pub rejected: u32,
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
    let mut track: Option<Track<Monitored<_, _, 2>, 2, 2>> = None;
    for event in &log.events {
        match event {
            Event::BeaconStarted { beacon, name, prior, .. } => {
                replay.weigh(track.as_ref().map(|track| track.estimator().innovations()));
                let seed = beacon_seed(log.header.seed, *beacon);
                let estimator = config
                    .build(model, prior, seed)
                    .map_err(|source| ReplayError::Estimator { beacon: name.clone(), source })?;
                track = Some(Track::new(Monitored::new(estimator, model), config.track));
                replay.fixes.push(ReplayedFix {
                    beacon: *beacon,
                    name: name.clone(),
                    estimate: *prior,
                    steps: 0,
                    nis: ChiSquaredAverage::default(),
                    whiteness: Whiteness::new(LAGS),
                    rejected: 0,
                    logged: None,
                });
            }
            Event::Received { first_position, reception, .. } => {
                let (Some(track), Some(fix)) = (&mut track, replay.fixes.last_mut()) else {
                    continue;
                };
                // What the estimator refuses now it refused in flight, or would have.
                if let Ok(Heard::Corrected(correction)) = track.hear(reception, *first_position) {
                    let degrees = config.track.degrees_of_freedom(reception, *first_position);
                    fix.nis.extend(correction.nis().map(|nis| (nis, degrees)));
                    fix.rejected += u32::from(correction.is_rejected());
                }
                fix.estimate = track.position();
                fix.steps = track.steps();
            }
            Event::Corrected { estimate, .. } => {
                let Some(fix) = replay.fixes.last() else { continue };
                replay.compared += 1;
                replay.different += usize::from(!same_bits(&fix.estimate, estimate));
            }
            Event::BeaconFinished { fix, .. } => {
                if let Some(replayed) = replay.fixes.last_mut() {
                    replayed.logged = Some(fix.clone());
                }
            }
            _ => {}
        }
    }
    replay.weigh(track.as_ref().map(|track| track.estimator().innovations()));
    Ok(replay)
}

impl Replay {
    /// Notes how white the innovations of the last search are.
    fn weigh(&mut self, innovations: Option<&[SVector<Option<f64>, 2>]>) {
        if let (Some(fix), Some(innovations)) = (self.fixes.last_mut(), innovations) {
            fix.whiteness.add_run(innovations);
        }
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
    Model(#[from] ParameterError),
    /// An estimator could not be made.
    #[error("no estimator for beacon {beacon}")]
    Estimator {
        /// The beacon.
        beacon: String,
        /// What is wrong.
        source: EstimatorError,
    },
}
