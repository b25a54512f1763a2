//! A hunt on several computers in simulated time: lost, doubled and late messages, a drone and the
//! side that fuses begun anew, and every estimate to the bit.

use std::{cell::RefCell, collections::BTreeSet, path::Path, rc::Rc};

use foxhunt::{
    core::{Estimate, Reception},
    hardware::link::{
        Delivery, FusionLink, Impaired, Impairment, LinkError, MemoryDrone, MemoryFusion, Order,
        Report, UnixTime, memory_network,
    },
    hunt::{BoxedSource, Event, Fix, Search},
    log::{Log, LogWriter},
    network::{DroneNode, DroneNodeConfig, FusionNode, FusionNodeConfig, Past, uniform_draws},
    registry::{EstimatorEntry, HuntExtractor, Registry, TrackRequest, beacon_seed},
    replay::replay,
    scenario::Scenario,
    sim::{SimClock, SimVehicle, World},
    simulation::Setup,
};

/// When the hunt's time is 0.
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

/// A field of three drones and the network between their computers and the one that fuses.
struct Field {
    registry: Registry,
    scenario: Scenario,
    world: World,
    links: (Vec<MemoryDrone>, MemoryFusion),
    impairment: Impairment,
    delivered: Delivered,
    seed: u64,
}

impl Field {
    fn new(impairment: Impairment, seed: u64) -> Self {
        let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
        let world = World::new(&scenario.world, seed).expect("a proper world");
        let links = memory_network(world.drone_count());
        let registry = Registry::builtin();
        let delivered = Delivered::default();
        Self { registry, scenario, world, links, impairment, delivered, seed }
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
        let (link, clock) = (self.links.0[drone].clone(), self.world.clock());
        let draws = self.draws(u64::try_from(drone).expect("few"));
        let link = Impaired::new(link, self.impairment, clock, draws).expect("in range");
        let vehicle = self.world.vehicle(drone).expect("it is there");
        let Scenario { extractor, bearings, .. } = &self.scenario;
        let extractor = self.registry.hunt_extractor(extractor, *bearings).expect("in range");
        let config = DroneNodeConfig::default();
        DroneNode::new(source, vehicle, extractor, link, EPOCH, config).expect("in range")
    }

    /// Flies to the end; `faults` names at every tick which side begins anew: a drone, or, past
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
        let (mut text, mut events, mut homes) = (Vec::new(), Vec::new(), Vec::new());
        let path = Path::new("network.jsonl");
        loop {
            let time = self.world.time();
            for drone in &mut drones {
                drone.step(time).expect("memory takes everything");
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

    /// Which of the receptions that came are in the log, and what the log's estimates are worth.
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
                    let request = TrackRequest { search, model: &model, reference: None, seed };
                    track = Some(self.estimator().track(&request, false).expect("in range"));
                }
                Event::Received { drone, first_position, reception, .. }
                    if reception.beacon == fix.beacon =>
                {
                    let delivered = self.as_delivered(*drone, reception);
                    let track = track.as_mut().expect("its search began before");
                    let _ = track.update(&delivered, *first_position);
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
