//! Flies simulated hunts.

use foxhunt_core::{BeaconId, Correction, Station};
use foxhunt_filters::multi::{Gospa, gospa};
use foxhunt_hunt::{
    hunt::{
        Agenda, BoxedSource, Devices, DriveError, Drone, Event, Fix, Hunt, HuntError, Tap, Tapped,
        boxed_source,
    },
    log::{LOG_VERSION, LogHeader, LoggedBeacon},
    registry::{EstimatorEntry, PartsError, Registry, RegistryError},
    scenario::{Scenario, SimulationConfig, SourcesError},
};
use foxhunt_sim::{SimError, World};
use nalgebra::Vector2;

/// The semi-major axis of the 95 % ellipse that [`SearchProgress`] is about, in metres.
const SEMI_MAJOR_M: f64 = 3.0;

/// The scenario and the parts of a simulation.
#[derive(Clone, Copy, Debug)]
pub struct Setup<'a> {
    /// The world, the drones and how they go about it.
    pub scenario: &'a Scenario,
    /// The estimator.
    pub estimator: &'a EstimatorEntry,
    /// The registry with the names in the scenario.
    pub registry: &'a Registry,
}

impl Setup<'_> {
    /// The header that a log of this hunt begins with.
    #[must_use]
    pub fn log_header(&self, seed: u64) -> LogHeader {
        let Self { scenario, estimator, .. } = self;
        let beacon = |b: foxhunt_sim::BeaconConfig| LoggedBeacon {
            truth: Some(Vector2::new(b.east_m, b.north_m)),
            name: b.name,
            course: b.course,
            others: b.others.iter().map(|other| other.place().xy()).collect(),
        };
        LogHeader {
            foxhunt_log: LOG_VERSION,
            scenario: scenario.name.clone(),
            seed,
            estimator_name: estimator.name.clone().into_owned(),
            estimator: estimator.settings().copied(),
            model: scenario.model.clone(),
            planner: Some(scenario.planner.clone()),
            beacons: scenario.world.drawn_beacons(seed).into_iter().map(beacon).collect(),
            epoch_unix_s: None,
            homes: Vec::new(),
            origin: None,
        }
    }

    /// Flies it and hands each event to `on_event` as it happens. The same setup and seed fly the
    /// same hunt.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] when the scenario cannot be built or the hunt cannot go on; whatever
    /// `on_event` returns ends the hunt, too.
    pub fn simulate<O: std::error::Error + Send + Sync + 'static>(
        &self,
        seed: u64,
        on_event: impl FnMut(&Event) -> Result<(), O>,
    ) -> Result<Simulated, SimulationError> {
        self.simulate_with(seed, |_, source| source, on_event, None)
    }

    /// Flies it, and `watch` is called with the true world at every tick at which anything happens:
    /// at each while a drone moves.
    ///
    /// # Errors
    ///
    /// The errors of [`simulate`](Self::simulate).
    pub fn simulate_watched<O: std::error::Error + Send + Sync + 'static>(
        &self,
        seed: u64,
        on_event: impl FnMut(&Event) -> Result<(), O>,
        mut watch: impl FnMut(&World),
    ) -> Result<Simulated, SimulationError> {
        self.simulate_with(seed, |_, source| source, on_event, Some(&mut watch))
    }

    /// Flies it, and `tap` is called with the turns of all drones, so that their samples can be
    /// kept.
    ///
    /// # Errors
    ///
    /// The errors of [`simulate`](Self::simulate).
    pub fn simulate_tapped<O: std::error::Error + Send + Sync + 'static>(
        &self,
        seed: u64,
        tap: &Tap,
        on_event: impl FnMut(&Event) -> Result<(), O>,
    ) -> Result<Simulated, SimulationError> {
        let tapped = |drone, source| boxed_source(Tapped::new(source, drone, tap.clone()));
        self.simulate_with(seed, tapped, on_event, None)
    }

    /// Flies it with sources that `wrap` has changed, each drone's.
    fn simulate_with<O: std::error::Error + Send + Sync + 'static>(
        &self,
        seed: u64,
        wrap: impl Fn(usize, BoxedSource) -> BoxedSource,
        on_event: impl FnMut(&Event) -> Result<(), O>,
        watch: Option<Watch<'_>>,
    ) -> Result<Simulated, SimulationError> {
        let Self { scenario, estimator, registry } = self;
        let world = World::new(&scenario.world, seed)?;
        let mut hunt = scenario.parts(registry, estimator, seed)?.build()?;
        let mut drones = Vec::with_capacity(world.drone_count());
        for (drone, source) in scenario.sources(registry, &world)?.into_iter().enumerate() {
            drones.push(Drone { source: wrap(drone, source), vehicle: world.vehicle(drone)? });
        }
        fly_with(&mut hunt, &world, &mut drones, scenario.simulation, on_event, watch)
    }
}

/// A function that is called with the true world.
type Watch<'a> = &'a mut dyn FnMut(&World);

/// The reason why a scenario could not be flown to its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// The world cannot be built.
    #[error("the world of the scenario: {0}")]
    World(#[from] SimError),
    /// The hunt cannot be put together.
    #[error("the scenario: {0}")]
    Parts(#[from] PartsError),
    /// The sources cannot be built.
    #[error("the scenario: {0}")]
    Sources(#[from] SourcesError),
    /// A name is not known.
    #[error("the scenario: {0}")]
    Name(#[from] RegistryError),
    /// The hunt cannot begin.
    #[error(transparent)]
    Hunt(#[from] HuntError),
    /// The hunt could not go on.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// The hunt took too long.
    #[error("the hunt was not over after {limit_s} simulated seconds (simulation.limit_s)")]
    TooLong {
        /// The limit.
        limit_s: f64,
    },
    /// The events could not be kept.
    #[error("the log: {0}")]
    Log(Box<dyn std::error::Error + Send + Sync>),
}

/// The result of a simulated hunt.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulated {
    /// The fixes, in the order of the beacons, and the truth.
    pub found: Vec<Found>,
    /// Duration of the hunt, in simulated seconds.
    pub duration_s: f64,
    /// The distance that each drone flew, in metres.
    pub path_m: Vec<f64>,
}

/// A fix against the truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The fix.
    pub fix: Fix,
    /// The beacon's true place at its last reception, which is when the estimate is of; East and
    /// North in metres. Where several transmitters share its frequency, the place of the one that
    /// is nearest to the estimate.
    pub truth: Vector2<f64>,
    /// The true places of all transmitters on its frequency.
    pub truths: Vec<Vector2<f64>>,
    /// The progress of the search.
    pub progress: SearchProgress,
    /// The normalised innovations squared of its receptions, with their degrees of freedom.
    pub nis: Vec<(f64, usize)>,
}

impl Found {
    /// Distance from the estimate to the truth, in metres.
    #[must_use]
    pub fn error_m(&self) -> f64 {
        (self.fix.estimate.mean - self.truth).norm()
    }

    /// The normalised estimation error squared; `None` when the covariance is not positive
    /// definite.
    #[must_use]
    pub fn nees(&self) -> Option<f64> {
        self.fix.estimate.nees(&self.truth)
    }

    /// Distance from the transmitters that were found to those that there are (Rahmathullah,
    /// García-Fernández & Svensson 2017) with c = 50 m, p = 2 and α = 2; `None` for an estimator
    /// of one transmitter, and where a place is not finite.
    #[must_use]
    pub fn gospa(&self) -> Option<Gospa> {
        let found = self.fix.transmitters.as_ref()?.iter().map(|found| found.estimate.mean);
        let found: Vec<_> = found.collect();
        gospa(&found, &self.truths, GOSPA_CUTOFF_M, GOSPA_ORDER).ok()
    }
}

/// Distance from which on a found transmitter is another one, and the order of GOSPA.
const GOSPA_CUTOFF_M: f64 = 50.0;
const GOSPA_ORDER: f64 = 2.0;

/// The progress of the search for one beacon, whatever its last estimate was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SearchProgress {
    /// The number of filter steps on this beacon after which the semi-major axis of its 95 %
    /// ellipse was below 3 m for the first time; `None` if it never was. A step is one reception.
    pub steps_to_3m: Option<u32>,
    /// Time until then in simulated seconds, from the moment at which the search began: for the
    /// first beacon, and for all where turns are shared, the beginning of the hunt.
    pub time_to_3m_s: Option<f64>,
    /// The distance that all drones together flew from the beginning of the search to its end, in
    /// metres. Where turns are shared, the same metres count for every beacon that is searched for.
    pub path_m: f64,
}

/// The record of a hunt while it is flown.
#[derive(Debug, Default)]
struct Record {
    searches: Vec<SearchRecord>,
}

#[derive(Clone, Debug, Default)]
struct SearchRecord {
    began: f64,
    path_before_m: f64,
    steps: u32,
    progress: SearchProgress,
    /// The time of the last reception.
    received: f64,
    nis: Vec<(f64, usize)>,
}

impl Record {
    fn search(&mut self, beacon: foxhunt_core::BeaconId) -> &mut SearchRecord {
        let index = usize::from(beacon.0);
        if self.searches.len() <= index {
            self.searches.resize_with(index + 1, SearchRecord::default);
        }
        &mut self.searches[index]
    }

    /// Takes note of an event.
    fn note(&mut self, event: &Event, world: &World) {
        match event {
            Event::BeaconStarted { time, beacon, .. } => {
                let path_before_m = flown_m(world);
                *self.search(*beacon) =
                    SearchRecord { began: *time, path_before_m, ..SearchRecord::default() };
            }
            Event::Received { reception, .. } => {
                let search = self.search(reception.beacon);
                search.received = reception.time.max(search.received);
            }
            Event::Corrected {
                time,
                beacon: Some(beacon),
                correction,
                degrees_of_freedom,
                estimate,
                ..
            } => {
                let search = self.search(*beacon);
                search.nis.extend(correction.nis().zip(*degrees_of_freedom));
                search.steps += u32::from(*correction != Correction::Empty);
                let small = estimate.ellipse(0.95).is_some_and(|e| e.semi_major < SEMI_MAJOR_M);
                if small && search.progress.steps_to_3m.is_none() {
                    search.progress.steps_to_3m = Some(search.steps);
                    search.progress.time_to_3m_s = Some(time - search.began);
                }
            }
            Event::BeaconFinished { fix, .. } => {
                let flown_m = flown_m(world);
                let search = self.search(fix.beacon);
                search.progress.path_m = flown_m - search.path_before_m;
            }
            _ => {}
        }
    }

    /// The result of the hunt.
    fn finish(mut self, fixes: &[Fix], world: &World) -> Result<Simulated, SimError> {
        let mut fixes: Vec<&Fix> = fixes.iter().collect();
        fixes.sort_by_key(|fix| fix.beacon);
        let mut found = Vec::with_capacity(fixes.len());
        for fix in fixes {
            let SearchRecord { received, progress, nis, .. } =
                std::mem::take(self.search(fix.beacon));
            let truths = world.transmitters_at(fix.beacon, received);
            let truths: Vec<_> = truths.iter().map(|place| place.xy()).collect();
            let off = |place: &&Vector2<f64>| (fix.estimate.mean - *place).norm();
            let nearest = truths.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
            let Some(&truth) = nearest else { continue };
            found.push(Found { fix: fix.clone(), truth, truths, progress, nis });
        }
        let path_m = (0..world.drone_count()).map(|drone| world.path_length(drone));
        Ok(Simulated { found, duration_s: world.time(), path_m: path_m.collect::<Result<_, _>>()? })
    }
}

/// Flies a hunt of any parts in a simulated world to its end. Beacons of the world that the hunt
/// does not know are added when they appear.
///
/// It goes from one event to the next, in whole ticks. A user's own devices are polled at every
/// tick unless they know their [next event](foxhunt_core::PatternSource::next_event) by the world's
/// clock; what comes of it is the same.
///
/// # Errors
///
/// [`SimulationError`] when the hunt cannot begin or go on, or takes too long; whatever
/// `on_event` returns ends the hunt, too.
pub fn fly<D: Devices, O: std::error::Error + Send + Sync + 'static>(
    hunt: &mut Hunt,
    world: &World,
    drones: &mut [D],
    config: SimulationConfig,
    on_event: impl FnMut(&Event) -> Result<(), O>,
) -> Result<Simulated, SimulationError> {
    fly_with(hunt, world, drones, config, on_event, None)
}

/// Flies a hunt of any parts, and `watch` is called with the true world at every tick at which
/// anything happens: at each while a drone moves.
///
/// # Errors
///
/// The errors of [`fly`].
pub fn fly_watched<D: Devices, O: std::error::Error + Send + Sync + 'static>(
    hunt: &mut Hunt,
    world: &World,
    drones: &mut [D],
    config: SimulationConfig,
    on_event: impl FnMut(&Event) -> Result<(), O>,
    mut watch: impl FnMut(&World),
) -> Result<Simulated, SimulationError> {
    fly_with(hunt, world, drones, config, on_event, Some(&mut watch))
}

fn fly_with<D: Devices, O: std::error::Error + Send + Sync + 'static>(
    hunt: &mut Hunt,
    world: &World,
    drones: &mut [D],
    config: SimulationConfig,
    mut on_event: impl FnMut(&Event) -> Result<(), O>,
    mut watch: Option<Watch<'_>>,
) -> Result<Simulated, SimulationError> {
    let mut record = Record::default();
    let stations = (0..world.drone_count())
        .map(|drone| Ok(Station::holding(world.pose(drone)?)))
        .collect::<Result<_, SimError>>()?;
    hunt.start(world.time(), stations)?;
    let mut agenda = Agenda::new(config.tick_s);
    loop {
        if let Some(watch) = &mut watch {
            watch(world);
        }
        agenda.drive(hunt, drones, world.time())?;
        let appears_at = add_who_appeared(hunt, world).map_err(DriveError::Hunt)?;
        while let Some(event) = hunt.poll_event() {
            record.note(&event, world);
            on_event(&event).map_err(|error| SimulationError::Log(Box::new(error)))?;
        }
        if hunt.is_finished() {
            return Ok(record.finish(hunt.fixes(), world)?);
        }
        if world.time() > config.limit_s {
            return Err(SimulationError::TooLong { limit_s: config.limit_s });
        }
        let undisturbed = agenda.undisturbed_until(hunt).unwrap_or(f64::NEG_INFINITY);
        world.allow_ahead(undisturbed.min(appears_at).min(config.limit_s), config.tick_s);
        let next = agenda.next_event().map_or(0.0, |event| event.min(appears_at));
        // Who watches sees drones that move at every tick.
        let next = if watch.is_some() && !world.rests() { 0.0 } else { next };
        world.advance_until(next.min(config.limit_s), config.tick_s)?;
    }
}

/// Adds the beacons that have appeared since to a hunt that is still on, and returns the time when
/// the next one appears, infinite if there is no such beacon.
fn add_who_appeared(hunt: &mut Hunt, world: &World) -> Result<f64, HuntError> {
    while let Ok(next) = u16::try_from(hunt.beacon_count()).map(BeaconId)
        && hunt.fixes().len() < hunt.beacon_count()
        && let Some(appears_at) = world.appears_after_s(next)
    {
        if appears_at > world.time() {
            return Ok(appears_at);
        }
        let Some(name) = world.beacon_name(next) else { break };
        hunt.add_beacon(world.time(), name)?;
    }
    Ok(f64::INFINITY)
}

/// The distance that all drones have flown together, in metres.
fn flown_m(world: &World) -> f64 {
    (0..world.drone_count()).filter_map(|drone| world.path_length(drone).ok()).sum()
}
