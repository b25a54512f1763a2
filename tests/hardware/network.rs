//! A hunt on several computers in simulated time: lost, doubled and late messages, a drone and the
//! side that fuses started again, and every estimate to the bit.

use approx::abs_diff_eq;
use std::{cell::RefCell, collections::BTreeSet, path::Path, rc::Rc};

use foxhunt::{
    core::{BeaconId, Estimate, PatternSource, Reception, Sweep},
    hardware::link::{
        Delivery, FusionLink, Impaired, Impairment, LinkError, MemoryDrone, MemoryFusion, Order,
        Report, UnixTime, memory_network,
    },
    hunt::{BoxedSource, DeviceError, Event, Fix, Search, boxed_source},
    log::{Log, LogWriter},
    network::{DroneNode, DroneNodeConfig, FusionNode, FusionNodeConfig, Past, uniform_draws},
    registry::{EstimatorEntry, HuntExtractor, Registry, TrackRequest, beacon_seed},
    replay::replay,
    scenario::Scenario,
    sim::{SimClock, SimVehicle, World},
    simulation::Setup,
};

/// UNIX time of the hunt's time 0.
const EPOCH: UnixTime = UnixTime::whole(1_760_000_000);

/// Everything that the side that fuses received, used or not.
type Delivered = Rc<RefCell<Vec<(usize, Delivery)>>>;

/// A link that remembers what it has delivered.
struct Tapped<L>(L, Delivered);

impl<L: FusionLink> FusionLink for Tapped<L> {
    fn send(&mut self, drone: usize, order: &Order) -> Result<(), LinkError> {
        self.0.send(drone, order)
    }

    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
        let report = self.0.receive()?;
        if let Some((drone, Report::Delivery(delivery))) = &report {
            self.1.borrow_mut().push((*drone, (**delivery).clone()));
        }
        Ok(report)
    }
}

type Draws = Box<dyn FnMut() -> f64>;
type Drone = DroneNode<
    BoxedSource,
    SimVehicle,
    HuntExtractor,
    Impaired<MemoryDrone, SimClock, Draws, Report>,
>;

/// The clock of a drone's computer, by the world's.
#[derive(Clone, Copy, Debug, Default)]
struct OwnClock {
    offset_s: f64,
    /// Relative drift of its rate; positive if it runs faster.
    drift: f64,
    /// Step of its setting and the time of that, in seconds.
    set: Option<(f64, f64)>,
}

impl OwnClock {
    fn own(&self, time: f64) -> f64 {
        let set_s = self.set.filter(|(_, when)| time >= *when).map_or(0.0, |(by_s, _)| by_s);
        time * (1.0 + self.drift) + self.offset_s + set_s
    }
}

/// True ends of each drone's turns.
type Ended = Rc<RefCell<Vec<(usize, f64)>>>;

/// A source whose turns end by the clock of its drone's computer.
struct ByOwnClock {
    source: BoxedSource,
    clock: OwnClock,
    drone: usize,
    ended: Ended,
}

impl PatternSource for ByOwnClock {
    type Error = DeviceError;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), DeviceError> {
        self.source.begin(beacons)
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, DeviceError> {
        let Some(sweep) = self.source.poll()? else { return Ok(None) };
        self.ended.borrow_mut().push((self.drone, sweep.time));
        Ok(Some(Sweep { time: self.clock.own(sweep.time), ..sweep }))
    }
}

/// A field of three drones and the network between their computers and the one that fuses.
struct Field {
    registry: Registry,
    scenario: Scenario,
    world: World,
    links: (Vec<MemoryDrone>, MemoryFusion),
    impairment: Impairment,
    delivered: Delivered,
    clocks: [OwnClock; 3],
    ended: Ended,
    seed: u64,
}

impl Field {
    fn new(impairment: Impairment, seed: u64) -> Self {
        let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
        let world = World::new(&scenario.world, seed).expect("a proper world");
        let links = memory_network(world.drone_count());
        let registry = Registry::builtin();
        let delivered = Delivered::default();
        Self {
            registry,
            scenario,
            world,
            links,
            impairment,
            delivered,
            clocks: [OwnClock::default(); 3],
            ended: Ended::default(),
            seed,
        }
    }

    fn draws(&self, of: u64) -> Draws {
        Box::new(uniform_draws(self.seed.wrapping_mul(1000) + of))
    }

    fn estimator(&self) -> &EstimatorEntry {
        self.registry.estimator(&self.scenario.estimator).expect("it has a name")
    }

    /// The node of a drone, as it is after its computer was switched on.
    fn drone(&self, drone: usize) -> Drone {
        let sources = self.scenario.sources(&self.registry, &self.world).expect("proper sources");
        let source = sources.into_iter().nth(drone).expect("as many as drones");
        let clock = self.clocks[drone];
        let ended = Rc::clone(&self.ended);
        let source = boxed_source(ByOwnClock { source, clock, drone, ended });
        let link = self.links.0[drone].clone();
        let clock = self.world.clock();
        let draws = self.draws(u64::try_from(drone).expect("few"));
        let link = Impaired::new(link, self.impairment, clock, draws).expect("in range");
        let vehicle = self.world.vehicle(drone).expect("it is there");
        let Scenario { extractor, bearings, .. } = &self.scenario;
        let extractor = self.registry.hunt_extractor(extractor, *bearings).expect("in range");
        let config = DroneNodeConfig::default();
        DroneNode::new(source, vehicle, extractor, link, EPOCH, config).expect("in range")
    }

    /// Flies to the end; `faults` names at every tick which side starts again: a drone, or, past
    /// the drones, the side that fuses, which forgets the events of its last step.
    fn fly(&self, mut faults: impl FnMut(f64, &[Event]) -> Option<usize>) -> Log {
        let Self { scenario, registry, .. } = self;
        let setup = Setup { scenario, estimator: self.estimator(), registry };
        let fusion = |past: Option<Past>| {
            let clock = self.world.clock();
            let link = Impaired::new(self.links.1.clone(), self.impairment, clock, self.draws(99));
            let link = Tapped(link.expect("in range"), self.delivered.clone());
            let parts = scenario.parts(registry, setup.estimator, self.seed).expect("known names");
            let hunt = parts.build().expect("a proper hunt");
            let config = FusionNodeConfig::default();
            FusionNode::new(hunt, 3, link, EPOCH, past, config).expect("in range")
        };
        let mut drones: Vec<Drone> = (0..3).map(|drone| self.drone(drone)).collect();
        let mut node = fusion(None);
        let mut text = Vec::new();
        let mut events = Vec::new();
        let mut homes = Vec::new();
        let path = Path::new("network.jsonl");
        loop {
            let time = self.world.time();
            for (drone, clock) in drones.iter_mut().zip(&self.clocks) {
                drone.step(clock.own(time)).expect("memory takes everything");
            }
            node.step(time).expect("the hunt goes on");
            let fault = faults(time, &events);
            if fault == Some(3) {
                let log = Log::parse(std::str::from_utf8(&text).expect("JSON"), path);
                let past = Past { homes: homes.clone(), events: log.expect("its own").events };
                node = fusion(Some(past));
            } else if let Some(drone) = fault {
                drones[drone] = self.drone(drone);
            }
            while let Some(event) = node.poll_event() {
                if text.is_empty() {
                    homes = node.homes().to_vec();
                    let header = setup.log_header(self.seed);
                    LogWriter::new(&mut text, &header).expect("memory takes everything");
                }
                serde_json::to_writer(&mut text, &event).expect("memory takes everything");
                text.push(b'\n');
                events.push(event);
            }
            if node.is_finished(time) {
                return Log::parse(std::str::from_utf8(&text).expect("JSON"), path)
                    .expect("its own");
            }
            self.world.advance(0.05).expect("time passes");
            assert!(time < 20_000.0, "the hunt does not end");
        }
    }

    /// Asserts that the receptions that came are in the log, and that the log's estimates are good.
    fn judge(&self, log: &Log) {
        let mut logged = BTreeSet::new();
        let mut fixes: Vec<&Fix> = Vec::new();
        for event in &log.events {
            match event {
                Event::Received { drone, reception, .. } => {
                    let name = (*drone, reception.beacon, reception.time.to_bits());
                    assert!(logged.insert(name), "counted twice: drone {drone}, {reception:?}");
                }
                Event::BeaconFinished { fix, .. } => fixes.push(fix),
                _ => {}
            }
        }
        let over = |beacon| {
            let end = |event: &Event| match event {
                Event::BeaconFinished { time, fix } if fix.beacon == beacon => Some(*time),
                _ => None,
            };
            log.events.iter().find_map(end).expect("every search ends")
        };
        let mut came = BTreeSet::new();
        for (drone, delivery) in self.delivered.borrow().iter() {
            let time = delivery.ended.since(EPOCH);
            // One that was made, or came, when its search was over is of no use to anybody.
            if delivery.reception.is_ok() && time + 5.0 < over(delivery.beacon) {
                came.insert((*drone, delivery.beacon, time.to_bits()));
            }
        }
        assert!(came.len() > 40, "{} receptions", came.len());
        let lost: Vec<_> = came.difference(&logged).collect();
        assert!(lost.is_empty(), "delivered and lost: {lost:?}");

        let replayed = replay(log, &self.registry, None).expect("its own estimator");
        assert!(replayed.compared > 40 && replayed.different == 0, "{replayed:?}");
        assert_eq!(fixes.len(), 2);
        for fix in fixes {
            let one = self.one_process(log, fix);
            assert_eq!(bits(&one), bits(&fix.estimate), "{}", fix.name);
            let truth = self.world.truth(fix.beacon).expect("it is there").xy();
            let miss = (fix.estimate.mean - truth).norm();
            assert!(miss < 6.0, "{} is {miss} m off", fix.name);
        }
    }

    /// The fix of a fresh estimator that is given the delivered receptions as they were.
    fn one_process(&self, log: &Log, fix: &Fix) -> Estimate<2> {
        let model = self.scenario.model.build().expect("in range");
        let mut track = None;
        for event in &log.events {
            match event {
                Event::BeaconStarted { beacon, name, prior, hunt_prior, .. }
                    if *beacon == fix.beacon =>
                {
                    let prior = hunt_prior.unwrap_or(*prior);
                    let seed = beacon_seed(self.seed, *beacon);
                    let search = Search { beacon: *beacon, name, prior };
                    let request =
                        TrackRequest { search, model: &model, reference: None, pulses: None, seed };
                    track = Some(self.estimator().track(&request, false).expect("in range"));
                }
                Event::Received { drone, first_position, reception, .. }
                    if reception.beacon == fix.beacon =>
                {
                    let delivered = self.as_delivered(*drone, reception);
                    let track = track.as_mut().expect("its search began before");
                    let _ = track.heard_by(*drone).update(&delivered, *first_position);
                }
                _ => {}
            }
        }
        track.expect("its search began").position()
    }

    /// A logged reception as it came over the link.
    fn as_delivered(&self, drone: usize, logged: &Reception) -> Reception {
        let delivered = self.delivered.borrow();
        let same = |(of, delivery): &&(usize, Delivery)| {
            let time = delivery.ended.since(EPOCH).to_bits();
            (*of, delivery.beacon, time) == (drone, logged.beacon, logged.time.to_bits())
        };
        let (_, delivery) = delivered.iter().find(same).expect("it came over the link");
        let made = delivery.reception.as_ref().expect("a reception");
        Reception { time: delivery.ended.since(EPOCH), ..*made }
    }
}

fn bits(estimate: &Estimate<2>) -> Vec<u64> {
    estimate.mean.iter().chain(estimate.covariance.iter()).map(|v| v.to_bits()).collect()
}

const ROUGH: Impairment = Impairment { loss: 0.2, doubled: 0.2, late_s: 3.0 };

fn received(events: &[Event]) -> usize {
    events.iter().filter(|event| matches!(event, Event::Received { .. })).count()
}

#[test]
fn a_good_network_carries_the_hunt() {
    let field = Field::new(Impairment::default(), 1);
    let log = field.fly(|_, _| None);
    field.judge(&log);
}

#[test]
fn loss_delay_and_doubles_change_no_bit_of_what_was_delivered() {
    let field = Field::new(ROUGH, 2);
    let log = field.fly(|_, _| None);
    let came = field.delivered.borrow().len();
    field.judge(&log);
    assert!(came > received(&log.events), "nothing came twice");
}

#[test]
fn a_drone_that_begins_anew_finds_out_what_it_is_to_do() {
    let field = Field::new(ROUGH, 3);
    let mut kills = vec![11, 5];
    let log = field.fly(|_, events| {
        (kills.last().is_some_and(|count| received(events) >= *count)).then(|| {
            kills.pop();
            1
        })
    });
    assert!(kills.is_empty());
    field.judge(&log);
    let of_it = |event: &&Event| matches!(event, Event::Received { drone: 1, .. });
    assert!(log.events.iter().filter(of_it).count() > 10, "it takes part no more");
}

#[test]
fn a_fusion_that_begins_anew_goes_on_from_its_log() {
    let field = Field::new(ROUGH, 4);
    let mut kills = vec![40, 23, 7];
    let log = field.fly(|_, events| {
        (kills.last().is_some_and(|count| received(events) >= *count)).then(|| {
            kills.pop();
            3
        })
    });
    assert!(kills.is_empty());
    field.judge(&log);
    let resumed = log.events.iter().filter(|e| matches!(e, Event::Resumed { .. })).count();
    assert_eq!(resumed, 3);
    let started = log.events.iter().filter(|e| matches!(e, Event::BeaconStarted { .. })).count();
    assert_eq!(started, 2, "what is believed was not begun anew");
}

/// The fixes of a log, in the order of their beacons, and the receptions of each drone.
fn outcome(log: &Log) -> (Vec<&Fix>, Vec<(usize, BeaconId, f64)>) {
    let mut fixes = Vec::new();
    let mut receptions = Vec::new();
    for event in &log.events {
        match event {
            Event::BeaconFinished { fix, .. } => fixes.push(fix),
            Event::Received { drone, reception, .. } => {
                receptions.push((*drone, reception.beacon, reception.time));
            }
            _ => {}
        }
    }
    fixes.sort_by_key(|fix| fix.beacon.0);
    (fixes, receptions)
}

/// The offsets that a log names for a drone, each with its uncertainty and the jumps until then.
fn offsets(log: &Log, of: usize) -> Vec<(f64, f64, f64, u32)> {
    let offset = |event: &Event| match *event {
        Event::ClockOffset { time, drone, offset_s, uncertainty_s, jumps } if drone == of => {
            Some((time, offset_s, uncertainty_s, jumps))
        }
        _ => None,
    };
    log.events.iter().filter_map(offset).collect()
}

#[test]
fn clocks_that_differ_change_no_fix() {
    let good = Field::new(Impairment::default(), 5).fly(|_, _| None);
    let mut field = Field::new(Impairment::default(), 5);
    field.clocks[0].offset_s = -3.2;
    field.clocks[1].offset_s = 5.0;
    // As much as bad quartz.
    field.clocks[2] = OwnClock { offset_s: 0.4, drift: 1e-4, set: None };
    let log = field.fly(|_, _| None);
    field.judge(&log);
    let ((fixes, receptions), (expected, as_expected)) = (outcome(&log), outcome(&good));
    assert_eq!(receptions.len(), as_expected.len());
    let ended = field.ended.borrow();
    for ((drone, beacon, time), other) in receptions.iter().zip(&as_expected) {
        assert_eq!((*drone, *beacon), (other.0, other.1));
        // Nodes read their clocks at ticks of 0.05 s: on the way there two pass, and back two.
        let truly = |(of, ended): &&(usize, f64)| of == drone && (ended - time).abs() < 0.1;
        assert!(ended.iter().any(|ended| truly(&ended)), "drone {drone}: no turn ended at {time}");
    }
    for (fix, good) in fixes.iter().zip(&expected) {
        let apart_m = (fix.estimate.mean - good.estimate.mean).norm();
        assert!(apart_m < 0.01, "{}: {apart_m} m apart", fix.name);
    }
    for (drone, expected) in [3.2, -5.0].into_iter().enumerate() {
        let logged = offsets(&log, drone);
        assert!(!logged.is_empty(), "drone {drone}: the log names no offset");
        for (_, offset_s, uncertainty_s, jumps) in logged {
            assert!((offset_s - expected).abs() <= uncertainty_s, "drone {drone}: {offset_s}");
            assert!(uncertainty_s < 0.09 && jumps == 0, "drone {drone}: {uncertainty_s}");
        }
    }
    for (time, offset_s, uncertainty_s, _) in offsets(&log, 2) {
        let expected = -0.4 - 1e-4 * time;
        assert!(abs_diff_eq!(offset_s, expected, epsilon = uncertainty_s), "{time} s: {offset_s}");
    }
}

#[test]
fn a_clock_that_is_set_is_noticed() {
    let mut field = Field::new(ROUGH, 6);
    field.clocks[1] = OwnClock { offset_s: 1.0, drift: 0.0, set: Some((-7.0, 90.0)) };
    let log = field.fly(|_, _| None);
    field.judge(&log);
    let logged = offsets(&log, 1);
    let (when, offset_s, uncertainty_s, jumps) = *logged.last().expect("the log names it");
    assert_eq!(jumps, 1);
    assert!(abs_diff_eq!(offset_s, 6.0, epsilon = uncertainty_s), "{logged:?}");
    assert!((90.0..150.0).contains(&when), "{logged:?}");
    let of_it =
        |event: &&Event| matches!(event, Event::Received { drone: 1, time, .. } if *time > when);
    assert!(log.events.iter().filter(of_it).count() > 5, "it takes part no more");
}
