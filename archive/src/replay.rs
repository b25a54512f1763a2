//! Runs the receptions of a log through an estimator again.

use foxhunt_core::{BeaconId, Estimate, EstimatorError};
use foxhunt_filters::consistency::{ChiSquaredAverage, Whiteness};
use foxhunt_hunt::{
    hunt::{Event, Fix, Search, Track, TrackStep, Tracks},
    log::{Log, LogHeader},
    registry::{EstimatorEntry, Registry, RegistryError, TrackRequest, beacon_seed},
};
use foxhunt_sensors::AntennaError;
use nalgebra::Vector3;

/// The result of a replay.
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
    /// The autocorrelation of the normalised innovations, up to 5 receptions apart; empty for an
    /// estimator that does not keep them.
    pub whiteness: Whiteness,
    /// How many the gate kept out.
    pub rejected: u32,
    /// How often the innovations of the last receptions became larger than the estimator can
    /// explain.
    pub diverged: u32,
    /// The fix of the log, if the search ended.
    pub logged: Option<Fix>,
}

/// A search of a log while it is replayed: when it began, or after a reception.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// Which of the log's events it is, from 0.
    pub event: usize,
    /// Which search, in the order in which they began, from 0.
    pub search: usize,
    /// What is believed now.
    pub track: &'a Track,
    /// What became of the reception; none at the beginning, and where it was refused.
    pub step: Option<TrackStep>,
}

/// Over how many receptions the innovations are correlated: three drones receive five times between
/// two moves, and a short search has no more than some twenty.
const LAGS: usize = 5;

/// Replays a log through its own estimator, or through another one.
///
/// The log's own is rebuilt from its settings; one of a user's own code, of which the log holds the
/// name alone, is that of the registry.
///
/// # Errors
///
/// [`ReplayError`] when the log's estimator is not registered, or an estimator cannot be made.
pub fn replay(
    log: &Log,
    registry: &Registry,
    other: Option<&EstimatorEntry>,
) -> Result<Replay, ReplayError> {
    replay_watched(log, registry, other, &mut |_| ())
}

/// Replays a log, as [`replay`] does, and `watch` is called with each search when it begins and
/// after each of its receptions.
///
/// # Errors
///
/// Those of [`replay`].
pub fn replay_watched(
    log: &Log,
    registry: &Registry,
    other: Option<&EstimatorEntry>,
    watch: &mut dyn FnMut(Moment<'_>),
) -> Result<Replay, ReplayError> {
    let estimator = match other {
        Some(other) => other.clone(),
        None => estimator_of(&log.header, registry)?,
    };
    estimator.require_stream()?;
    let model = log.header.model.build()?;
    let reference = log.header.model.reference_m.map(Vector3::from);
    let mut tracks = |search: &Search<'_>| {
        let seed = beacon_seed(log.header.seed, search.beacon);
        let request = TrackRequest { search: *search, model: &model, reference, seed };
        estimator.track(&request, true)
    };
    replay_moments(log, &mut tracks, watch)
}

/// Replays a log through given tracks.
///
/// ```
/// use std::path::Path;
///
/// use foxhunt_archive::replay::replay_with;
/// use foxhunt_core::RandomWalk;
/// use foxhunt_filters::Ukf;
/// use foxhunt_hunt::{
///     hunt::{Search, Track, TrackConfig},
///     log::Log,
/// };
/// use foxhunt_sensors::{LogDistance, RssBearing};
///
/// let text = concat!(
///     r#"{"foxhunt_log":6,"scenario":"field","seed":1,"estimator_name":"mine","#,
///     r#""model":{"reference_dbm":-29.06,"exponent":2.765},"beacons":[]}"#,
/// );
/// let log = Log::parse(text, Path::new("flight.jsonl"))?;
/// let model = RssBearing::new(LogDistance::new(-29.06, 2.765)?);
/// let mut tracks = |search: &Search<'_>| {
///     let filter = Ukf::new(RandomWalk::uniform(0.02), model, search.prior)?;
///     Ok(Track::monitored(filter, model, TrackConfig::default()))
/// };
/// let replay = replay_with(&log, &mut tracks)?;
/// assert_eq!((replay.fixes.len(), replay.different), (0, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// [`ReplayError::Estimator`] when a track cannot be made.
pub fn replay_with(log: &Log, tracks: &mut dyn Tracks) -> Result<Replay, ReplayError> {
    replay_moments(log, tracks, &mut |_| ())
}

fn replay_moments(
    log: &Log,
    tracks: &mut dyn Tracks,
    watch: &mut dyn FnMut(Moment<'_>),
) -> Result<Replay, ReplayError> {
    let mut searches: Vec<ReplayedSearch> = Vec::new();
    let mut compared = 0;
    let mut different = 0;
    // Of which beacon the last reception was.
    let mut received = None;
    for (index, event) in log.events.iter().enumerate() {
        match event {
            Event::BeaconStarted { time, beacon, name, prior, hunt_prior } => {
                let prior = hunt_prior.unwrap_or(*prior);
                let search = Search { beacon: *beacon, name, prior };
                let track = tracks
                    .begin(&search)
                    .map_err(|source| ReplayError::Estimator { beacon: name.clone(), source })?;
                let number = searches.len();
                watch(Moment { event: index, search: number, track: &track, step: None });
                searches.push(ReplayedSearch::new(track, &search, *time));
            }
            Event::Received { first_position, reception, .. } => {
                received = Some(reception.beacon);
                let of_beacon = |search: &ReplayedSearch| search.fix.beacon == reception.beacon;
                let Some(number) = searches.iter().rposition(of_beacon) else { continue };
                let Some(search) = searches.get_mut(number) else { continue };
                let ReplayedSearch { track, fix } = search;
                // What the estimator refuses now it refused in flight, or would have.
                let step = track.update(reception, *first_position).ok();
                if let Some(TrackStep::Updated { correction, degrees_of_freedom }) = step {
                    fix.nis.extend(correction.nis().map(|nis| (nis, degrees_of_freedom)));
                    fix.rejected += u32::from(correction.is_rejected());
                }
                fix.diverged += u32::from(track.alarm().is_some());
                fix.estimate = track.position();
                fix.time = fix.time.max(reception.time);
                fix.steps = track.steps();
                watch(Moment { event: index, search: number, track, step });
            }
            Event::Corrected { beacon, estimate, .. } => {
                let Some(beacon) = beacon.or(received) else { continue };
                let Some(search) = last_of(&mut searches, beacon) else { continue };
                compared += 1;
                different += usize::from(!same_bits(&search.fix.estimate, estimate));
            }
            Event::BeaconFinished { fix, .. } => {
                if let Some(search) = last_of(&mut searches, fix.beacon) {
                    search.fix.logged = Some(fix.clone());
                }
            }
            _ => {}
        }
    }
    let fixes = searches.into_iter().map(ReplayedSearch::into_fix).collect();
    Ok(Replay { fixes, compared, different })
}

/// The estimator that a log was made with.
fn estimator_of(header: &LogHeader, registry: &Registry) -> Result<EstimatorEntry, ReplayError> {
    let name = &header.estimator_name;
    if let Some(settings) = header.estimator {
        return Ok(EstimatorEntry::of_settings(name.clone(), "as the log has it", "", settings));
    }
    match registry.estimator(name) {
        Ok(entry) => Ok(entry.clone()),
        Err(_) => Err(ReplayError::NotRegistered { estimator: name.clone() }),
    }
}

/// The last search that was begun for a beacon.
fn last_of(searches: &mut [ReplayedSearch], beacon: BeaconId) -> Option<&mut ReplayedSearch> {
    searches.iter_mut().rfind(|search| search.fix.beacon == beacon)
}

/// A search of the log, replayed so far.
#[derive(Debug)]
struct ReplayedSearch {
    track: Track,
    fix: ReplayedFix,
}

impl ReplayedSearch {
    fn new(track: Track, search: &Search<'_>, time: f64) -> Self {
        let fix = ReplayedFix {
            beacon: search.beacon,
            name: search.name.to_owned(),
            estimate: track.prior(),
            time,
            steps: 0,
            nis: ChiSquaredAverage::default(),
            whiteness: Whiteness::new(LAGS),
            rejected: 0,
            diverged: 0,
            logged: None,
        };
        Self { track, fix }
    }

    fn into_fix(mut self) -> ReplayedFix {
        self.track.add_innovations_to(&mut self.fix.whiteness);
        self.fix
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
    /// The log holds the name of its estimator and no settings, and the registry has no such name.
    #[error(
        "the log holds no settings of its estimator {estimator:?}; register that name, or replay \
         it through another estimator"
    )]
    NotRegistered {
        /// The estimator's name.
        estimator: String,
    },
    /// The estimator takes all receptions at once.
    #[error(transparent)]
    Name(#[from] RegistryError),
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
