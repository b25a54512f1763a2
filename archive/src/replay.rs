//! Runs the receptions of a log through an estimator again.

use std::fmt;

use foxhunt_core::{BeaconId, Estimate, EstimatorError, Reception, Receptions, Remark};
use foxhunt_filters::consistency::{ChiSquaredAverage, Whiteness};
use foxhunt_hunt::{
    config::{ModelConfig, ModelError},
    hunt::{
        Event, Fix, FoundTransmitter, LearnedReceiver, Search, Track, TrackStep, Tracks,
        remarks_of_receivers,
    },
    log::{Log, LogHeader},
    registry::{EstimatorEntry, Registry, RegistryError, TrackRequest, beacon_seed},
};
use nalgebra::Vector3;

use crate::struck::{ReceptionId, Struck};

/// The result of a replay.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    /// Replayed fixes in the order of the beacons. A search that the log breaks off is included as
    /// far as it went, with the log's outcome if there is one.
    pub fixes: Vec<ReplayedFix>,
    /// Number of the log's estimates that were compared.
    pub compared: usize,
    /// Number of them that differ in any bit. Zero through the log's own configuration.
    pub different: usize,
}

/// A fix, replayed.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayedFix {
    /// The beacon.
    pub beacon: BeaconId,
    /// Name of the beacon.
    pub name: String,
    /// The estimate after its last reception.
    pub estimate: Estimate<2>,
    /// The place at the time of each reception that was used, given all of them; empty unless
    /// the replay is [smoothed](Replayer::finish_smoothed).
    pub smoothed: Vec<(f64, Estimate<2>)>,
    /// Time of the estimate, in seconds.
    pub time: f64,
    /// Number of receptions that went through the estimator.
    pub steps: u32,
    /// Normalised innovations squared of the receptions that have one, at 95 %.
    pub nis: ChiSquaredAverage,
    /// The autocorrelation of the normalised innovations, up to 5 receptions apart; empty for an
    /// estimator that does not keep them.
    pub whiteness: Whiteness,
    /// Number of receptions that the gate kept out.
    pub rejected: u32,
    /// Number of times that the innovations of the last receptions became larger than the estimator
    /// can explain.
    pub diverged: u32,
    /// Doubts about the place (docs/remarks.md); empty for [`replay_with`].
    pub remarks: Vec<Remark>,
    /// Errors that were learned of each receiver, with the drone's number; empty for an estimator
    /// that takes all receivers for alike.
    pub receivers: Vec<(usize, LearnedReceiver)>,
    /// The transmitters on its frequency, the most probable first; `None` for an estimator of one.
    pub transmitters: Option<Vec<FoundTransmitter>>,
    /// The fix of the log, if the search ended.
    pub logged: Option<Fix>,
}

/// A search of a log while it is replayed: when it began, or after a reception.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// Index of the search, in the order in which they began, from 0.
    pub search: usize,
    /// The track at this moment.
    pub track: &'a Track,
    /// Result of the reception; `None` at the beginning, and for a reception that was refused or is
    /// [struck](Struck).
    pub step: Option<TrackStep>,
}

/// Number of receptions over which the innovations are correlated: three drones receive five times
/// between two moves, and a short search has no more than some twenty.
const LAGS: usize = 5;

/// Replays a log through its own estimator, or through another one.
///
/// # Errors
///
/// The errors of [`Replayer::new`] and [`Replayer::event`].
pub fn replay(
    log: &Log,
    registry: &Registry,
    other: Option<&EstimatorEntry>,
) -> Result<Replay, ReplayError> {
    Replayer::new(&log.header, registry, other)?.all(log)
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
    Replayer::of_tracks(|search: &Search<'_>| tracks.begin(search)).all(log)
}

/// Replays a hunt event by event: from a log, or while it is flown.
pub struct Replayer<'a> {
    tracks: Box<dyn Tracks + 'a>,
    /// Estimator whose answers are examined in the end, and the law that it goes by.
    examined: Option<(EstimatorEntry, ModelConfig)>,
    struck: Struck,
    searches: Vec<ReplayedSearch>,
    /// Beacon of the last reception.
    received: Option<BeaconId>,
    compared: usize,
    different: usize,
}

impl fmt::Debug for Replayer<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Replayer")
            .field("struck", &self.struck)
            .field("searches", &self.searches)
            .finish_non_exhaustive()
    }
}

impl<'a> Replayer<'a> {
    /// Replays through the log's own estimator, or through another one.
    ///
    /// The log's own is rebuilt from its settings; one of a user's own code, of which the log holds
    /// the name alone, is that of the registry.
    ///
    /// # Errors
    ///
    /// [`ReplayError`] when the log's estimator is not registered, or takes all receptions at once,
    /// or the log's law of propagation is out of range.
    pub fn new(
        header: &LogHeader,
        registry: &Registry,
        other: Option<&EstimatorEntry>,
    ) -> Result<Self, ReplayError> {
        Self::of_estimator(header, registry, other, false)
    }

    /// Replays as [`new`](Self::new) does, and keeps the beliefs for
    /// [`finish_smoothed`](Self::finish_smoothed).
    ///
    /// # Errors
    ///
    /// The errors of [`new`](Self::new).
    pub fn smoothable(
        header: &LogHeader,
        registry: &Registry,
        other: Option<&EstimatorEntry>,
    ) -> Result<Self, ReplayError> {
        Self::of_estimator(header, registry, other, true)
    }

    fn of_estimator(
        header: &LogHeader,
        registry: &Registry,
        other: Option<&EstimatorEntry>,
        smoothable: bool,
    ) -> Result<Self, ReplayError> {
        let estimator = match other {
            Some(other) => other.clone(),
            None => estimator_of(header, registry)?,
        };
        estimator.require_stream()?;
        let model = header.model.build()?;
        let pulses = header.model.build_pulses()?;
        let reference = header.model.reference_m.map(Vector3::from);
        let seed = header.seed;
        let examined = Some((estimator.clone(), header.model.clone()));
        let replayer = Self::of_tracks(move |search: &Search<'_>| {
            let seed = beacon_seed(seed, search.beacon);
            let search = *search;
            let pulses = pulses.as_ref();
            let request = TrackRequest { search, model: &model, reference, pulses, seed };
            match smoothable {
                true => estimator.smoothable_track(&request),
                false => estimator.track(&request, true),
            }
        });
        Ok(Self { examined, ..replayer })
    }

    /// Replays through the given tracks.
    fn of_tracks(tracks: impl Tracks + 'a) -> Self {
        Self {
            tracks: Box::new(tracks),
            examined: None,
            struck: Struck::default(),
            searches: Vec::new(),
            received: None,
            compared: 0,
            different: 0,
        }
    }

    /// Leaves receptions out, as if they had never been received. The log's estimates, which know
    /// them, are not compared then.
    #[must_use]
    pub fn without(self, struck: Struck) -> Self {
        Self { struck, ..self }
    }

    /// Replays one event. Returns the search that it begins or of which it is a reception.
    ///
    /// # Errors
    ///
    /// [`ReplayError::Estimator`] when an estimator cannot be made.
    pub fn event(&mut self, event: &Event) -> Result<Option<Moment<'_>>, ReplayError> {
        match event {
            Event::BeaconStarted { time, beacon, name, prior, hunt_prior } => {
                let prior = hunt_prior.unwrap_or(*prior);
                let search = Search { beacon: *beacon, name, prior };
                let track = self
                    .tracks
                    .begin(&search)
                    .map_err(|source| ReplayError::Estimator { beacon: name.clone(), source })?;
                self.searches.push(ReplayedSearch::new(track, &search, *time));
                let search = self.searches.len() - 1;
                let track = self.searches.last().map(|begun| &begun.track);
                return Ok(track.map(|track| Moment { search, track, step: None }));
            }
            Event::Received { drone, first_position, reception, .. } => {
                return Ok(self.receive(*drone, *first_position, reception));
            }
            Event::Corrected { beacon, estimate, .. } if self.struck.is_empty() => {
                let Some(beacon) = beacon.or(self.received) else { return Ok(None) };
                let Some(search) = last_of(&mut self.searches, beacon) else { return Ok(None) };
                self.compared += 1;
                self.different += usize::from(!same_bits(&search.fix.estimate, estimate));
            }
            Event::BeaconFinished { fix, .. } => {
                if let Some(search) = last_of(&mut self.searches, fix.beacon) {
                    search.fix.logged = Some(fix.clone());
                }
            }
            _ => {}
        }
        Ok(None)
    }

    fn receive(
        &mut self,
        drone: usize,
        first_position: bool,
        reception: &Reception,
    ) -> Option<Moment<'_>> {
        self.received = Some(reception.beacon);
        let of_beacon = |search: &ReplayedSearch| search.fix.beacon == reception.beacon;
        let number = self.searches.iter().rposition(of_beacon)?;
        let ReplayedSearch { track, fix, receptions } = self.searches.get_mut(number)?;
        if self.struck.contains(&ReceptionId::new(drone, reception)) {
            return Some(Moment { search: number, track, step: None });
        }
        // What the estimator refuses now it refused in flight, or would have.
        let step = track.heard_by(drone).update(reception, first_position).ok();
        if self.examined.is_some() && matches!(step, Some(TrackStep::Updated { .. })) {
            receptions.push((drone, *reception));
        }
        if let Some(TrackStep::Updated { correction, degrees_of_freedom }) = step {
            fix.nis.extend(correction.nis().map(|nis| (nis, degrees_of_freedom)));
            fix.rejected += u32::from(correction.is_rejected());
        }
        fix.diverged += u32::from(track.alarm().is_some());
        fix.estimate = track.position();
        fix.time = fix.time.max(reception.time);
        fix.steps = track.steps();
        Some(Moment { search: number, track, step })
    }

    /// Returns the replayed fixes and the counts.
    #[must_use]
    pub fn finish(self) -> Replay {
        let examined = self.examined;
        let fix = |search: ReplayedSearch| search.into_fix(examined.as_ref());
        let fixes = self.searches.into_iter().map(fix).collect();
        Replay { fixes, compared: self.compared, different: self.different }
    }

    /// Returns the replayed fixes with their smoothed places, and the counts.
    ///
    /// # Errors
    ///
    /// [`ReplayError::Smoothing`] when an estimator has no smoother, or the replay was not begun as
    /// a [smoothable](Self::smoothable) one.
    pub fn finish_smoothed(self) -> Result<Replay, ReplayError> {
        let smoothed = self.searches.iter().map(|search| {
            search.track.smoothed().map_err(|source| ReplayError::Smoothing {
                estimator: self
                    .examined
                    .as_ref()
                    .map_or_else(String::new, |e| e.0.name.to_string()),
                beacon: search.fix.name.clone(),
                source,
            })
        });
        let smoothed = smoothed.collect::<Result<Vec<_>, _>>()?;
        let mut replay = self.finish();
        for (fix, smoothed) in replay.fixes.iter_mut().zip(smoothed) {
            fix.smoothed = smoothed;
        }
        Ok(replay)
    }

    fn all(mut self, log: &Log) -> Result<Replay, ReplayError> {
        for event in &log.events {
            let _ = self.event(event)?;
        }
        Ok(self.finish())
    }
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
    /// Receptions that went through the track, with the drones that made them, where the answer is
    /// examined.
    receptions: Vec<(usize, Reception)>,
}

impl ReplayedSearch {
    fn new(track: Track, search: &Search<'_>, time: f64) -> Self {
        let fix = ReplayedFix {
            beacon: search.beacon,
            name: search.name.to_owned(),
            estimate: track.prior(),
            smoothed: Vec::new(),
            time,
            steps: 0,
            nis: ChiSquaredAverage::default(),
            whiteness: Whiteness::new(LAGS),
            rejected: 0,
            diverged: 0,
            remarks: Vec::new(),
            receivers: Vec::new(),
            transmitters: None,
            logged: None,
        };
        Self { track, fix, receptions: Vec::new() }
    }

    fn into_fix(mut self, examined: Option<&(EstimatorEntry, ModelConfig)>) -> ReplayedFix {
        self.fix.receivers = self.track.learned_receivers();
        self.fix.transmitters = self.track.found();
        // Receptions of several transmitters do not have to fit one place.
        let one = self.fix.transmitters.is_none() && !self.receptions.is_empty();
        if let Some((estimator, model)) = examined.filter(|_| one) {
            let learned = &self.fix.receivers;
            let mut receptions = Receptions::default();
            for (drone, reception) in &self.receptions {
                let of_drone = learned.iter().find(|(receiver, _)| receiver == drone);
                receptions.push(match of_drone {
                    Some((_, receiver)) => receiver.corrected(reception),
                    None => *reception,
                });
            }
            let estimate = &self.fix.estimate;
            self.fix.remarks = estimator.remarks_in_flight(estimate, &receptions, model);
            let name = |drone: usize| format!("drone {}", drone.saturating_add(1));
            self.fix.remarks.extend(remarks_of_receivers(learned, name));
        }
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

/// Reason why a log cannot be replayed.
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
    Model(#[from] ModelError),
    /// An estimator could not be made.
    #[error("no estimator for beacon {beacon}")]
    Estimator {
        /// The beacon.
        beacon: String,
        /// The estimator's error.
        source: EstimatorError,
    },
    /// The estimator has no smoother.
    #[error("estimator {estimator:?} cannot smooth the track of beacon {beacon}: {source}")]
    Smoothing {
        /// The estimator's name.
        estimator: String,
        /// The beacon.
        beacon: String,
        /// The estimator's error.
        source: EstimatorError,
    },
}
