//! Flies one simulated hunt from a scenario.

use foxhunt_core::{
    BeaconId, BearingExtractor, Estimate, Estimator, EstimatorError, FormationPlanner, Observation,
    ObservationError, PatternSource, Reception, Station,
};
use foxhunt_sim::{SimError, World};
use nalgebra::Vector2;

mod milestones;

pub use milestones::SearchProgress;

use milestones::Milestones;

use crate::{
    config::NamedEstimator,
    hunt::{DriveError, Event, Fix, Hunt, HuntError, PartsError, drive},
    log::{LOG_VERSION, LogHeader, LoggedBeacon},
    scenario::{Scenario, SimulationConfig},
};

/// What a simulated hunt came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulated {
    /// What was found, in the order of the beacons, and what is true.
    pub found: Vec<Found>,
    /// How long it took, in simulated seconds.
    pub duration_s: f64,
    /// How far each drone flew, in metres.
    pub path_m: Vec<f64>,
}

/// A fix against the truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The fix.
    pub fix: Fix,
    /// Where the beacon truly was when it was last heard, which is when the estimate is of; East
    /// and North in metres.
    pub truth: Vector2<f64>,
    /// How the search came along.
    pub progress: SearchProgress,
}

impl Found {
    /// From the estimate to the truth, in metres.
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
}

/// The header that a log of this hunt begins with.
#[must_use]
pub fn log_header(scenario: &Scenario, estimator: &NamedEstimator, seed: u64) -> LogHeader {
    let beacon = |b: foxhunt_sim::BeaconConfig| LoggedBeacon {
        truth: Some(Vector2::new(b.east_m, b.north_m)),
        name: b.name,
        course: b.course,
    };
    LogHeader {
        foxhunt_log: LOG_VERSION,
        scenario: scenario.name.clone(),
        seed,
        estimator_name: estimator.name.to_owned(),
        estimator: estimator.config,
        model: scenario.model.clone(),
        planner: Some(scenario.planner.clone()),
        beacons: scenario.world.drawn_beacons(seed).into_iter().map(beacon).collect(),
        epoch_unix_s: None,
        homes: Vec::new(),
    }
}

/// Flies a scenario and hands each event to `on_event` as it happens. The same scenario,
/// estimator and seed fly the same hunt.
///
/// # Errors
///
/// [`SimulationError`] when the scenario cannot be built or the hunt cannot go on; whatever
/// `on_event` returns ends the hunt, too.
pub fn simulate<O: std::error::Error + Send + Sync + 'static>(
    scenario: &Scenario,
    estimator: &NamedEstimator,
    seed: u64,
    on_event: impl FnMut(&Event) -> Result<(), O>,
) -> Result<Simulated, SimulationError> {
    simulate_watched(scenario, estimator, seed, on_event, |_| ())
}

/// The same, and `watch` looks at the world at every tick, as it truly is.
///
/// # Errors
///
/// Those of [`simulate`].
pub fn simulate_watched<O: std::error::Error + Send + Sync + 'static>(
    scenario: &Scenario,
    estimator: &NamedEstimator,
    seed: u64,
    mut on_event: impl FnMut(&Event) -> Result<(), O>,
    watch: impl FnMut(&World),
) -> Result<Simulated, SimulationError> {
    let world = World::new(&scenario.world, seed)?;
    let mut hunt = scenario.parts(&estimator.config, seed).build()?;
    let mut sources = scenario.sources(&world)?;
    let beacons = scenario.world.beacons.len();
    let mut heard = vec![0.0; beacons];
    let mut milestones = Milestones::new(beacons);
    let drones = 0..world.drone_count();
    let path = || drones.clone().map(|drone| world.path_length(drone));
    let keep = |event: &Event| {
        if let Event::Received { reception, .. } = event
            && let Some(last) = heard.get_mut(usize::from(reception.beacon.0))
        {
            *last = reception.time.max(*last);
        }
        milestones.note(event, || path().filter_map(Result::ok).sum());
        on_event(event)
    };
    fly_watched(&mut hunt, &world, &mut sources, scenario.simulation, keep, watch)?;

    let mut fixes: Vec<&Fix> = hunt.fixes().iter().collect();
    fixes.sort_by_key(|fix| fix.beacon);
    let found = fixes.into_iter().filter_map(|fix| {
        let index = usize::from(fix.beacon.0);
        let truth = world.truth_at(fix.beacon, *heard.get(index)?)?.xy();
        Some(Found { fix: fix.clone(), truth, progress: milestones.of(index)? })
    });
    let found = found.collect();
    let path_m = path().collect::<Result<_, _>>()?;
    Ok(Simulated { found, duration_s: world.time(), path_m })
}

/// Flies a hunt of any parts in a simulated world to its end, with a source for every drone. Beacons
/// of the world that the hunt does not know are taken in when they appear.
///
/// # Errors
///
/// [`SimulationError`] when the hunt cannot begin or go on, or takes too long; whatever
/// `on_event` returns ends the hunt, too.
pub fn fly<X, P, F, E, S, O, const N: usize, const M: usize>(
    hunt: &mut Hunt<X, P, F, E, N, M>,
    world: &World,
    sources: &mut [S],
    config: SimulationConfig,
    on_event: impl FnMut(&Event) -> Result<(), O>,
) -> Result<(), SimulationError>
where
    X: BearingExtractor,
    P: FormationPlanner,
    F: FnMut(&Estimate<2>) -> Result<E, EstimatorError>,
    E: Estimator<N, M>,
    S: PatternSource,
    O: std::error::Error + Send + Sync + 'static,
    Observation<M>: for<'a> TryFrom<&'a Reception, Error = ObservationError>,
{
    fly_watched(hunt, world, sources, config, on_event, |_| ())
}

/// The same, and `watch` looks at the world at every tick.
fn fly_watched<X, P, F, E, S, O, const N: usize, const M: usize>(
    hunt: &mut Hunt<X, P, F, E, N, M>,
    world: &World,
    sources: &mut [S],
    config: SimulationConfig,
    mut on_event: impl FnMut(&Event) -> Result<(), O>,
    mut watch: impl FnMut(&World),
) -> Result<(), SimulationError>
where
    X: BearingExtractor,
    P: FormationPlanner,
    F: FnMut(&Estimate<2>) -> Result<E, EstimatorError>,
    E: Estimator<N, M>,
    S: PatternSource,
    O: std::error::Error + Send + Sync + 'static,
    Observation<M>: for<'a> TryFrom<&'a Reception, Error = ObservationError>,
{
    let stations = (0..world.drone_count())
        .map(|drone| Ok(Station::holding(world.pose(drone)?)))
        .collect::<Result<_, SimError>>()?;
    let mut fleet = world.fleet();
    hunt.start(world.time(), stations)?;
    loop {
        watch(world);
        drive(hunt, sources, &mut fleet, world.time())?;
        take_in_who_appeared(hunt, world).map_err(DriveError::Hunt)?;
        while let Some(event) = hunt.poll_event() {
            on_event(&event).map_err(|error| SimulationError::Log(Box::new(error)))?;
        }
        if hunt.is_finished() {
            return Ok(());
        }
        if world.time() > config.limit_s {
            return Err(SimulationError::TooLong { limit_s: config.limit_s });
        }
        world.advance(config.tick_s)?;
    }
}

/// Tells a hunt that is still on of the beacons that have appeared since.
fn take_in_who_appeared<X, P, F, E, const N: usize, const M: usize>(
    hunt: &mut Hunt<X, P, F, E, N, M>,
    world: &World,
) -> Result<(), HuntError>
where
    X: BearingExtractor,
    P: FormationPlanner,
    F: FnMut(&Estimate<2>) -> Result<E, EstimatorError>,
    E: Estimator<N, M>,
    Observation<M>: for<'a> TryFrom<&'a Reception, Error = ObservationError>,
{
    while let Ok(next) = u16::try_from(hunt.beacon_count()).map(BeaconId)
        && hunt.fixes().len() < hunt.beacon_count()
        && world.appears_after_s(next).is_some_and(|appears| appears <= world.time())
        && let Some(name) = world.beacon_name(next)
    {
        hunt.take_in(world.time(), name)?;
    }
    Ok(())
}

/// Why a scenario could not be flown to its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// The world cannot be built.
    #[error("the world of the scenario: {0}")]
    World(#[from] SimError),
    /// The hunt cannot be put together.
    #[error("the scenario: {0}")]
    Parts(#[from] PartsError),
    /// The hunt cannot begin.
    #[error(transparent)]
    Hunt(#[from] HuntError),
    /// The hunt could not go on.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// It took too long.
    #[error("the hunt was not over after {limit_s} simulated seconds (simulation.limit_s)")]
    TooLong {
        /// The limit.
        limit_s: f64,
    },
    /// The events could not be kept.
    #[error("the log: {0}")]
    Log(Box<dyn std::error::Error + Send + Sync>),
}
