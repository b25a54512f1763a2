//! Flies simulated hunts.

mod record;

pub use record::{Found, SearchProgress, Simulated};

use foxhunt_core::{BeaconId, Station};
use foxhunt_hunt::{
    hunt::{
        Agenda, BoxedSource, Devices, DriveError, Drone, Event, Hunt, HuntError, Tap, Tapped,
        boxed_source,
    },
    log::{LOG_VERSION, LogHeader, LoggedBeacon},
    registry::{EstimatorEntry, PartsError, Registry, RegistryError},
    scenario::{Scenario, SimulationConfig, SourcesError},
};
use foxhunt_sim::{SimError, World};
use nalgebra::Vector2;

use record::Record;

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
