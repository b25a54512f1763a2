//! Whole flights of emulated devices with which things go wrong, in the world's time, in memory.

use std::error::Error;

use foxhunt_hardware::Shared;
use foxhunt_hunt::{
    hunt::{BoxedSource, Event, FlightStage},
    registry::Registry,
    scenario::Scenario,
};
use foxhunt_sim::{CableFaults, Interval, PilotOrder, World};
use foxhunt_wire::mavlink::Autopilot;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use super::{
    BoxedAircraft, DroneFaults, EmulatedField, EmulatedFieldConfig, Ending, FlightRules, Mission,
};

/// A flight of the scenario `pritzl-6.1` within a fence, with emulated devices.
#[derive(Clone, Debug, PartialEq)]
pub struct EmulatedFlight {
    /// The devices, and what goes wrong with them.
    pub field: EmulatedFieldConfig,
    /// Rules of the flight.
    pub rules: FlightRules,
    /// The seed of the world.
    pub seed: u64,
    /// Time at which the pilot breaks it off, in seconds; never where absent.
    pub abort_s: Option<f64>,
}

/// The result of an emulated flight.
#[derive(Clone, Debug, PartialEq)]
pub struct EmulatedFlown {
    /// The last report of each drone.
    pub drones: Vec<ReportedMode>,
    /// The modes of each drone, in their order.
    pub modes: Vec<Vec<String>>,
    /// True height of each drone at the end, in metres.
    pub up_m: Vec<f64>,
    /// Number of ended searches.
    pub found: usize,
    /// Reason why the flight did not end as planned.
    pub failure: Option<String>,
    /// Duration of the flight, in seconds.
    pub duration_s: f64,
    /// The nearest two drones that took our orders, over ground, in metres.
    pub nearest_m: f64,
    /// The farthest that one that took our orders was from the middle, East or North, in metres.
    pub farthest_m: f64,
}

/// Last report of a drone.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ReportedMode {
    /// The autopilot's mode.
    pub mode: String,
    /// True if it takes our orders.
    pub is_commanded: bool,
}

/// Reason why a flight with emulated devices could not be flown to its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EmulatedFlightError {
    /// It could not begin.
    #[error("the flight cannot begin")]
    Setup(#[source] Box<dyn Error + Send + Sync>),
    /// An emulated device could not be served.
    #[error("{device} failed")]
    Device {
        /// Name of the device.
        device: String,
        /// Cause of the failure.
        source: std::io::Error,
    },
    /// It does not end.
    #[error("the flight is not over after {limit_s} simulated seconds")]
    NoEnd {
        /// The limit.
        limit_s: f64,
    },
}

/// A flight that takes longer waits for somebody, in seconds.
const LONG_S: f64 = 900.0;

/// One that takes longer does not end, in seconds.
const LIMIT_S: f64 = 3600.0;

/// Time after a flight for failsafes to bring down drones that are still up, in seconds.
const AFTER_S: f64 = 120.0;

/// A drone that is lower than this has landed, in metres.
const LANDED_M: f64 = 0.3;

/// Least distance between two drones, in metres.
const SEPARATION_M: f64 = 2.0;

impl EmulatedFlight {
    /// Half the side of the fence, in metres.
    pub const FENCE_M: f64 = 60.0;

    /// The flight of a seed: autopilot, what goes wrong with cables, links and autopilots, what the
    /// pilots do, and how it ends. A pilot who has the last drone need not give it back, so that
    /// each flight is broken off at last.
    #[must_use]
    pub fn draw(seed: u64) -> Self {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let autopilot = if random.random() { Autopilot::ArduPilot } else { Autopilot::Px4 };
        let faults = (0..3).map(|_| draw_faults(&mut random, autopilot)).collect();
        let field = EmulatedFieldConfig { autopilot, faults, ..EmulatedFieldConfig::default() };
        let endings = [Ending::Return, Ending::Land];
        let rules = FlightRules {
            at_end: endings[random.random_range(0..2)],
            on_abort: endings[random.random_range(0..2)],
            ..FlightRules::default()
        };
        let aborts = random.random::<f64>() < 0.3;
        let abort_s = aborts.then(|| random.random_range(1.0..200.0));
        Self { field, rules, seed, abort_s: abort_s.or(Some(LONG_S)) }
    }

    /// Flies it, until failsafes have brought down the drones that are still up.
    ///
    /// # Errors
    ///
    /// [`EmulatedFlightError`] when it cannot begin, a device fails, or it does not end.
    pub fn fly(&self, registry: &Registry) -> Result<EmulatedFlown, EmulatedFlightError> {
        let mut scenario = Scenario::find("pritzl-6.1").map_err(setup)?;
        let f = Self::FENCE_M;
        scenario.hunt.airspace.fence_m = vec![[-f, -f], [f, -f], [f, f], [-f, f]];
        // What is of interest is over then.
        scenario.hunt.stop.time_s = Some(100.0);
        let world = World::new(&scenario.world, self.seed).map_err(setup)?;
        let (mut field, mut ports) =
            EmulatedField::in_memory(&scenario, &world, &self.field).map_err(setup)?;
        let mut flight = field.flight().clone();
        let takeoff_up_m = flight.flight.takeoff_up_m;
        flight.flight = FlightRules { takeoff_up_m, ..self.rules };
        let estimator = flight.estimator(registry).map_err(setup)?;
        let hunt = flight.parts(registry, estimator, self.seed).build().map_err(setup)?;
        let goal = flight.goal(registry).map_err(setup)?;
        let drones = flight.open(&mut ports, &world.clock(), 0.0, goal.as_ref(), None);
        let drones = drones.map_err(setup)?;
        let mut mission: Mission<Shared<BoxedAircraft>, BoxedSource> =
            Mission::new(flight.flight, hunt, drones, world.time()).map_err(setup)?;
        let count = world.drone_count();
        let mut flown = EmulatedFlown {
            drones: vec![ReportedMode::default(); count],
            modes: vec![Vec::new(); count],
            up_m: Vec::new(),
            found: 0,
            failure: None,
            duration_s: 0.0,
            nearest_m: f64::INFINITY,
            farthest_m: 0.0,
        };
        let mut until = f64::INFINITY;
        while world.time() < until {
            world.advance(scenario.simulation.tick_s).map_err(setup)?;
            let mut failed = None;
            field.serve(|device, source| {
                failed.get_or_insert((device.to_owned(), source));
            });
            if let Some((device, source)) = failed {
                return Err(EmulatedFlightError::Device { device, source });
            }
            if self.abort_s.is_some_and(|at| world.time() >= at) && !mission.is_over() {
                mission.abort(world.time(), "the pilot breaks off");
            }
            if !mission.is_over() {
                mission.step(world.time());
            } else if until.is_infinite() {
                (flown.duration_s, until) = (world.time(), world.time() + AFTER_S);
            }
            if world.time() > LIMIT_S {
                return Err(EmulatedFlightError::NoEnd { limit_s: LIMIT_S });
            }
            while let Some(event) = mission.poll_event() {
                flown.note(event);
            }
            if mission.stage() == FlightStage::Hunting {
                flown.look(&world);
            }
        }
        flown.up_m =
            (0..count).filter_map(|drone| Some(world.pose(drone).ok()?.position.z)).collect();
        flown.found = mission.hunt().fixes().len();
        flown.failure = mission.failure().map(str::to_owned);
        Ok(flown)
    }
}

impl EmulatedFlown {
    fn note(&mut self, event: Event) {
        let Event::Aircraft { drone, mode, commanded, .. } = event else { return };
        let (Some(modes), Some(last)) = (self.modes.get_mut(drone), self.drones.get_mut(drone))
        else {
            return;
        };
        if modes.last() != Some(&mode) {
            modes.push(mode.clone());
        }
        *last = ReportedMode { mode, is_commanded: commanded };
    }

    /// Notes the true places of the drones that take our orders: the farthest, and the nearest
    /// pair.
    fn look(&mut self, world: &World) {
        let commanded = self.drones.iter().enumerate().filter(|(_, drone)| drone.is_commanded);
        let ours: Vec<_> =
            commanded.filter_map(|(drone, _)| Some(world.pose(drone).ok()?.position)).collect();
        for (index, one) in ours.iter().enumerate() {
            self.farthest_m = self.farthest_m.max(one.x.abs()).max(one.y.abs());
            for other in &ours[..index] {
                self.nearest_m = self.nearest_m.min((one - other).xy().norm());
            }
        }
    }

    /// Returns the violations of these rules: drones that take our orders come down and keep fence
    /// and separation, and the flight ends unless a pilot has a drone.
    #[must_use]
    pub fn violations(&self) -> Vec<String> {
        let mut violations = Vec::new();
        let mut pilots = 0;
        for (index, (drone, up_m)) in self.drones.iter().zip(&self.up_m).enumerate() {
            // What the pilot flies stays where he has it.
            let ours = ["GUIDED", "OFFBOARD", "TAKEOFF"].contains(&drone.mode.as_str());
            pilots += u32::from(*up_m >= LANDED_M);
            if *up_m >= LANDED_M && ours {
                let number = index + 1;
                violations.push(format!("drone {number} is {up_m} m up in mode {}", drone.mode));
            }
        }
        if self.duration_s >= LONG_S && pilots == 0 {
            violations.push(format!("it took {} s and no pilot had a drone", self.duration_s));
        }
        if self.farthest_m > EmulatedFlight::FENCE_M {
            violations.push(format!("a drone was {} m out", self.farthest_m));
        }
        if self.nearest_m < SEPARATION_M {
            violations.push(format!("two drones were {} m apart", self.nearest_m));
        }
        violations
    }
}

fn setup(error: impl Error + Send + Sync + 'static) -> EmulatedFlightError {
    EmulatedFlightError::Setup(Box::new(error))
}

/// Modes that pilots of an autopilot choose.
#[must_use]
pub fn pilot_modes(autopilot: Autopilot) -> &'static [&'static str] {
    match autopilot {
        Autopilot::ArduPilot => {
            &["STABILIZE", "ALT_HOLD", "LOITER", "POSHOLD", "BRAKE", "AUTO", "RTL", "LAND"]
        }
        Autopilot::Px4 => &["ALTITUDE", "POSITION", "HOLD", "MISSION", "RETURN", "LAND"],
    }
}

/// The faults of a drone, drawn at random.
fn draw_faults(random: &mut Xoshiro256PlusPlus, autopilot: Autopilot) -> DroneFaults {
    let mut interval = |longest: f64| {
        let from_s: f64 = random.random_range(5.0..250.0);
        vec![Interval { from_s, to_s: Some(from_s + random.random_range(0.5..longest)) }]
    };
    let mut faults = DroneFaults::default();
    let (radio, rotator, garbage, silence) =
        (interval(30.0), interval(30.0), interval(30.0), interval(40.0));
    let mut happens = |share: f64| random.random::<f64>() < share;
    if happens(0.3) {
        faults.radio = CableFaults { pulled: radio, garbage };
    }
    if happens(0.3) {
        faults.rotator.pulled = rotator;
    }
    if happens(0.4) {
        faults.vehicle.silent = silence;
    }
    if happens(0.5) {
        let all = pilot_modes(autopilot);
        let at_s = random.random_range(5.0..250.0);
        let mode = all[random.random_range(0..all.len())].to_owned();
        faults.vehicle.pilot.push(PilotOrder { at_s, mode });
        if random.random::<f64>() < 0.4 {
            let back = if autopilot == Autopilot::Px4 { "HOLD" } else { "GUIDED" };
            let at_s = at_s + random.random_range(1.0..60.0);
            faults.vehicle.pilot.push(PilotOrder { at_s, mode: back.into() });
        }
    }
    faults
}
