//! A drawn flight on emulated autopilots, in the world's time.

use std::{cell::RefCell, fmt, rc::Rc};

use foxhunt_core::{BeaconId, Clock, PatternSource, Sweep};
use foxhunt_field::fly::{Ending, FlightRules, FlownDrone, Mission};
use foxhunt_hardware::{MavlinkConfig, MavlinkOrigin, MavlinkVehicle, Shared};
use foxhunt_hunt::{
    hunt::{BoxedSource, DeviceError, Event},
    registry::Registry,
    scenario::Scenario,
};
use foxhunt_sim::{AutopilotConfig, EmulatedAutopilot, Emulator, SimClock, World};
use foxhunt_wire::{mavlink::Codec, memory_pair};

use super::{
    drawn::{BREAKS_OFF_S, Drawn, What},
    judge::Judge,
    wire::{Far, Heard, Tapped},
};

/// Seconds from one step to the next.
const TICK_S: f64 = 0.1;

/// Time that the drones may take to leave, in seconds.
const LEAVING_S: f64 = 100.0;

/// Time that failsafes have after a flight, in seconds.
const AFTER_S: f64 = 70.0;

/// A drone lower than this has landed, in metres.
const LANDED_M: f64 = 0.3;

type Aircraft = Shared<MavlinkVehicle<Tapped, SimClock>>;

/// A source whose radio fails now and then.
struct Failing {
    source: BoxedSource,
    clock: SimClock,
    fails: Vec<(f64, f64)>,
}

#[derive(Debug)]
struct Failed;

impl fmt::Display for Failed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the radio has failed")
    }
}

impl std::error::Error for Failed {}

impl Failing {
    fn check(&self) -> Result<(), DeviceError> {
        let now = self.clock.now();
        match self.fails.iter().any(|(from, to)| (*from..*to).contains(&now)) {
            true => Err(DeviceError::new(Failed)),
            false => Ok(()),
        }
    }
}

impl PatternSource for Failing {
    type Error = DeviceError;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), DeviceError> {
        self.check()?;
        self.source.begin(beacons)
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, DeviceError> {
        self.check()?;
        self.source.poll()
    }
}

/// The world, its autopilots, and the flight on them.
struct Field<'a> {
    drawn: &'a Drawn,
    scenario: Scenario,
    registry: Registry,
    world: World,
    emulated: Vec<EmulatedAutopilot<Far>>,
    far: Vec<Far>,
    heard: Vec<Rc<RefCell<Heard>>>,
    judges: Vec<Judge>,
    wrong: Vec<String>,
    returning: usize,
}

/// Outcome of a flight.
#[derive(Clone, Debug)]
pub(super) struct Flown {
    /// The rules that it broke.
    pub(super) wrong: Vec<String>,
    /// The mode of each drone at the end, and how high it is, in metres.
    pub(super) ends: Vec<(String, f64)>,
    /// The flight's own words at its end.
    pub(super) words: String,
    /// Time at which it was over, in seconds.
    pub(super) over_s: f64,
    /// The most drones that returned at once.
    pub(super) returning: usize,
}

/// Flies it.
pub(super) fn fly(drawn: &Drawn) -> Flown {
    let mut field = Field::new(drawn);
    let mut mission = field.begin(false);
    let mut done = vec![false; drawn.happenings.len()];
    let mut absent_until: Option<f64> = None;
    let limit = BREAKS_OFF_S + 2.0 * LEAVING_S + 60.0;
    let mut end = f64::INFINITY;
    while field.world.time() < end {
        field.serve();
        // What is given back to nobody when the flight is over is its pilot's.
        if end.is_infinite() {
            field.watch();
        }
        let now = field.world.time();
        for (done, happening) in done.iter_mut().zip(&drawn.happenings) {
            if *done || now < f64::from(happening.at) * 0.1 {
                continue;
            }
            *done = true;
            match happening.what {
                What::BreaksOff => mission.abort(now, "the pilot breaks off"),
                What::Word => {
                    mission.clear_to_take_off(now);
                    field.judges.iter_mut().for_each(Judge::clear);
                }
                What::Killed(tenths) if !mission.is_over() => {
                    absent_until = Some(now + f64::from(tenths) * 0.1);
                }
                _ => {}
            }
        }
        if let Some(until) = absent_until {
            if now < until {
                continue;
            }
            absent_until = None;
            mission = field.begin(true);
        }
        if now >= BREAKS_OFF_S && !mission.is_over() {
            mission.abort(now, "the pilot breaks off");
        }
        if !mission.is_over() {
            mission.step(now);
            field.judge();
            while let Some(event) = mission.poll_event() {
                if let Event::Received { drone, .. } = event
                    && field.judges[drone].has_been_taken(now)
                {
                    let number = drone + 1;
                    let wrong = format!("{now:.1} s: a reception of drone-{number} counts");
                    field.wrong.push(wrong);
                }
            }
            if now > limit {
                field
                    .wrong
                    .push(format!("it is not over after {now:.0} s: {:?}", mission.failure()));
                break;
            }
        } else if end.is_infinite() {
            end = now + AFTER_S;
        }
    }
    let words = mission.failure().unwrap_or("as planned").to_owned();
    field.finish(words, end - AFTER_S)
}

impl<'a> Field<'a> {
    fn new(drawn: &'a Drawn) -> Self {
        let mut scenario = Scenario::find("pritzl-6.1").expect("it is built in");
        let first = scenario.world.drones.first().expect("a drone").clone();
        scenario.world.drones = (0..drawn.drones)
            .map(|drone| {
                let mut placed = first.clone();
                #[expect(clippy::cast_precision_loss, reason = "five at most")]
                let north_m = 6.0 * drone as f64;
                placed.north_m += north_m;
                placed
            })
            .collect();
        // The way home and the landing are over before the pilot breaks off.
        scenario.hunt.stop.time_s = Some(if drawn.flies_home { 10.0 } else { 60.0 });
        scenario.hunt.return_home = drawn.flies_home;
        let world = World::new(&scenario.world, 1).expect("a world");
        let mut field = Self {
            drawn,
            scenario,
            registry: Registry::builtin(),
            world,
            emulated: Vec::new(),
            far: Vec::new(),
            heard: Vec::new(),
            judges: Vec::new(),
            wrong: Vec::new(),
            returning: 0,
        };
        for drone in 0..drawn.drones {
            let (_, far) = memory_pair();
            let far = Far(Rc::new(RefCell::new(far)));
            let config = AutopilotConfig {
                autopilot: drawn.autopilot,
                system_id: u8::try_from(drone + 1).expect("five at most"),
                faults: drawn.faults(drone),
                ..AutopilotConfig::default()
            };
            let emulated = EmulatedAutopilot::new(config, &field.world, drone, far.clone());
            let emulated = emulated.expect("an autopilot");
            field.judges.push(Judge::new(drawn.autopilot, &emulated));
            field.emulated.push(emulated);
            field.far.push(far);
            field.heard.push(Rc::default());
        }
        field
    }

    /// Starts foxhunt, which may take over what is in the air.
    fn begin(&mut self, again: bool) -> Mission<Aircraft, Failing> {
        let estimator = self.registry.estimator("ekf").expect("it is known");
        let sources = self.scenario.sources(&self.registry, &self.world).expect("sources");
        let origin = AutopilotConfig::default().origin;
        let origin = Some(MavlinkOrigin { lat_deg: origin.lat_deg, lon_deg: origin.lon_deg });
        let mut drones = Vec::new();
        for (drone, source) in sources.into_iter().enumerate() {
            let (near, far) = memory_pair();
            *self.far[drone].0.borrow_mut() = far;
            *self.heard[drone].borrow_mut() = Heard::default();
            self.judges[drone].begin_again();
            let clock = self.world.clock();
            let tapped = Tapped {
                stream: near,
                autopilot: self.drawn.autopilot,
                heard: Rc::clone(&self.heard[drone]),
                clock: clock.clone(),
                codecs: [Codec::new(254, 1), Codec::new(254, 1)],
            };
            let config = MavlinkConfig {
                origin,
                pose_rate_hz: 2.0,
                status_rate_hz: 1.0,
                pose_timeout_s: 2.0,
                ..MavlinkConfig::default()
            };
            let vehicle = MavlinkVehicle::new(config, tapped, clock.clone()).expect("a driver");
            let fails = self.drawn.happenings.iter().filter(|of| of.is_of(self.drawn, drone));
            let fails = fails.filter_map(|of| match of.what {
                What::Deafened(tenths) => {
                    Some((f64::from(of.at) * 0.1, f64::from(of.at + tenths) * 0.1))
                }
                _ => None,
            });
            let source = Failing { source, clock, fails: fails.collect() };
            let name = format!("drone-{}", drone + 1);
            drones.push(FlownDrone::new(name, Shared::new(vehicle), source));
        }
        let parts = self.scenario.parts(&self.registry, estimator, 1).expect("parts");
        let hunt = parts.build().expect("a hunt");
        let ending = if self.drawn.lands { Ending::Land } else { Ending::Return };
        let rules = FlightRules {
            at_end: ending,
            on_abort: ending,
            leaving_timeout_s: LEAVING_S,
            ..FlightRules::default()
        };
        let mut mission = Mission::new(rules, hunt, drones, self.world.time()).expect("a flight");
        if again {
            mission.allow_take_over();
        }
        mission
    }

    fn serve(&mut self) {
        self.world.advance(TICK_S).expect("time passes");
        for emulated in &mut self.emulated {
            emulated.serve().expect("memory");
        }
    }

    fn up_m(&self, drone: usize) -> f64 {
        self.world.pose(drone).expect("a drone").position.z
    }

    fn watch(&mut self) {
        let home = self.drawn.autopilot.return_to_launch();
        let returns = |of: &&EmulatedAutopilot<Far>| of.mode() == home && of.is_airborne();
        self.returning = self.returning.max(self.emulated.iter().filter(returns).count());
        for drone in 0..self.drawn.drones {
            let up_m = self.up_m(drone);
            let emulated = &self.emulated[drone];
            self.judges[drone].watch(self.world.time(), self.drawn, drone, emulated, up_m);
        }
    }

    fn judge(&mut self) {
        for (drone, (judge, heard)) in self.judges.iter_mut().zip(&self.heard).enumerate() {
            let wrong = judge.judge(self.world.time(), heard);
            self.wrong
                .extend(wrong.into_iter().map(|wrong| format!("drone-{}: {wrong}", drone + 1)));
        }
    }

    /// Whatever is up at the end is in the hands of somebody, and is named.
    fn finish(mut self, words: String, over_s: f64) -> Flown {
        let mut ends = Vec::new();
        for drone in 0..self.drawn.drones {
            let up_m = self.up_m(drone);
            let judge = &self.judges[drone];
            let name = format!("drone-{}", drone + 1);
            let mode = self.emulated[drone].mode();
            ends.push((mode.to_string(), up_m));
            if up_m < LANDED_M {
                continue;
            }
            let whose = judge.is_taken() || judge.by_station || judge.stopped;
            if !whose && judge.engaged {
                self.wrong.push(format!("{name} is {up_m:.1} m up in {mode}, nobody's: {words}"));
            } else if judge.engaged && !words.contains(&name) {
                self.wrong.push(format!("{name} is {up_m:.1} m up in {mode}, not named: {words}"));
            }
        }
        Flown { wrong: self.wrong, ends, words, over_s, returning: self.returning }
    }
}
