//! Nodes with emulated radios, motors and autopilots behind ports: a hunt on several computers by
//! the pilot's rules, over signed messages, with strangers in the network.

use std::{cell::RefCell, fs, path::PathBuf, rc::Rc, thread, time::Duration};

use foxhunt::{
    fly::{
        BoxedAircraft, DroneFaults, EmulatedField, EmulatedFieldConfig, Ending, FlightConfig,
        SystemPorts,
    },
    hardware::link::{
        CarriedDrone, CarriedFusion, Carrier, DroneLink, LinkError, MemoryCarrier, Report, Stage,
        Status, TeamKey, UnixTime, memory_carriers,
    },
    hunt::{BoxedSource, Event, Fix},
    log::{Log, LogWriter},
    network::{DroneNodeConfig, FlownNode, FusionNode, FusionNodeConfig, Past},
    registry::{HuntExtractor, Registry},
    replay::replay,
    scenario::Scenario,
    sim::{AutopilotFaults, PilotOrder, World},
};
use nalgebra::Vector2;

const EPOCH: UnixTime = UnixTime::whole(1_760_000_000);

/// Messages that were sent, whoever took them.
type Wiretap = Rc<RefCell<Vec<(usize, Vec<u8>)>>>;

/// A carrier of which a stranger records what is sent.
struct Recorded<C>(C, Wiretap);

impl<C: Carrier> Carrier for Recorded<C> {
    fn send(&mut self, drone: usize, payload: Vec<u8>) -> Result<(), LinkError> {
        self.1.borrow_mut().push((drone, payload.clone()));
        self.0.send(drone, payload)
    }

    fn receive(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        self.0.receive()
    }
}

type Drone = FlownNode<BoxedAircraft, BoxedSource, HuntExtractor, Link>;
type Link = CarriedDrone<Recorded<MemoryCarrier>>;
type Fusion = FusionNode<CarriedFusion<Recorded<MemoryCarrier>>>;

/// Emulated devices, and the network between the computers.
struct Rig {
    registry: Registry,
    scenario: Scenario,
    flight: FlightConfig,
    world: World,
    field: EmulatedField,
    carriers: (Vec<MemoryCarrier>, MemoryCarrier),
    reports: Wiretap,
    orders: Wiretap,
    key: TeamKey,
    folder: PathBuf,
    seed: u64,
    // The log, as a file would have it.
    text: Vec<u8>,
    homes: Vec<nalgebra::Vector3<f64>>,
    events: Vec<Event>,
}

impl Drop for Rig {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

impl Rig {
    fn new(name: &str, seed: u64, faults: Vec<DroneFaults>) -> Self {
        let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
        let world = World::new(&scenario.world, seed).expect("a world");
        let config = EmulatedFieldConfig { faults, ..EmulatedFieldConfig::default() };
        let folder = std::env::temp_dir().join(format!("foxhunt-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("there is room");
        let field = EmulatedField::new(&scenario, &world, &config, &folder).expect("ports");
        let mut flight = field.flight().clone();
        flight.flight.at_end = Ending::Land;
        Self {
            registry: Registry::builtin(),
            carriers: memory_carriers(scenario.world.drones.len()),
            scenario,
            flight,
            world,
            field,
            reports: Wiretap::default(),
            orders: Wiretap::default(),
            key: TeamKey::generate().expect("randomness"),
            folder,
            seed,
            text: Vec::new(),
            homes: Vec::new(),
            events: Vec::new(),
        }
    }

    /// The node of a drone, as it is after its computer was switched on.
    fn drone(&self, drone: usize, take_over: bool) -> Drone {
        let carrier = Recorded(self.carriers.0[drone].clone(), Rc::clone(&self.reports));
        let link = CarriedDrone::new(carrier, drone, Some(self.key.clone())).expect("randomness");
        let FlightConfig { drones, extractor, bearings, .. } = &self.flight;
        let clock = self.world.clock();
        let mut ports = SystemPorts::new(self.world.clock());
        let open = drones[drone].open(&self.flight, None, &mut ports, &clock, 0.0, None);
        let open = open.expect("devices");
        let extractor = self.registry.hunt_extractor(extractor, *bearings).expect("in range");
        let rules = self.flight.flight;
        let config = DroneNodeConfig::default();
        let mut node =
            FlownNode::new(drone, open, extractor, link, EPOCH, rules, config).expect("in range");
        if take_over {
            node.allow_take_over();
        }
        node
    }

    fn drones(&self) -> Vec<Option<Drone>> {
        (0..self.flight.drones.len()).map(|drone| Some(self.drone(drone, false))).collect()
    }

    fn fusion(&self) -> Fusion {
        let carrier = Recorded(self.carriers.1.clone(), Rc::clone(&self.orders));
        let drones = self.flight.drones.len();
        let link = CarriedFusion::new(carrier, drones, Some(self.key.clone()));
        let estimator = self.flight.estimator(&self.registry).expect("it is known");
        let parts = self.flight.parts(&self.registry, estimator, self.seed);
        let hunt = parts.build().expect("a hunt");
        let past = (!self.text.is_empty())
            .then(|| Past { homes: self.homes.clone(), events: self.log().events });
        let config = FusionNodeConfig::default();
        FusionNode::new(hunt, drones, link.expect("randomness"), EPOCH, past, config)
            .expect("in range")
    }

    fn log(&self) -> Log {
        let text = std::str::from_utf8(&self.text).expect("JSON");
        Log::parse(text, std::path::Path::new("nodes.jsonl")).expect("its own")
    }

    /// Lets a tick pass for devices and nodes; the short sleep lets the kernel hand on what was
    /// written to the ports.
    fn pass(&mut self, drones: &mut [Option<Drone>], fusion: &mut Option<Fusion>) {
        self.world.advance(self.scenario.simulation.tick_s).expect("time passes");
        self.field.serve(|_, _| ());
        let time = self.world.time();
        for node in drones.iter_mut().flatten() {
            // A refusal is counted; nothing else fails in memory.
            if let Err(error) = node.step(time) {
                assert!(error.to_string().contains("refused"), "{error}");
            }
            while node.poll_event().is_some() {}
        }
        if let Some(node) = fusion {
            node.step(time).expect("the hunt goes on");
            while let Some(event) = node.poll_event() {
                if self.text.is_empty() {
                    self.homes = node.homes().to_vec();
                    let estimator = self.flight.estimator(&self.registry).expect("it is known");
                    let header = self.flight.log_header(estimator, self.seed, Some(EPOCH.sec));
                    LogWriter::new(&mut self.text, &header).expect("memory takes everything");
                }
                serde_json::to_writer(&mut self.text, &event).expect("memory takes everything");
                self.text.push(b'\n');
                self.events.push(event);
            }
        }
        thread::sleep(Duration::from_micros(30));
    }

    fn up_m(&self, drone: usize) -> f64 {
        self.world.pose(drone).expect("it is there").position.z
    }

    fn received(&self) -> usize {
        self.events.iter().filter(|event| matches!(event, Event::Received { .. })).count()
    }

    fn fixes(&self) -> Vec<Fix> {
        let fix = |event: &Event| match event {
            Event::BeaconFinished { fix, .. } => Some(fix.clone()),
            _ => None,
        };
        self.events.iter().filter_map(fix).collect()
    }

    /// Every estimate of the log is that of one process, to the bit, and near the truth.
    fn judge(&self) {
        let replayed = replay(&self.log(), &self.registry, None).expect("its own estimator");
        assert!(replayed.compared > 20 && replayed.different == 0, "{replayed:?}");
        let fixes = self.fixes();
        assert_eq!(fixes.len(), self.scenario.world.beacons.len());
        for fix in &fixes {
            let beacon = &self.scenario.world.beacons[usize::from(fix.beacon.0)];
            let truth = Vector2::new(beacon.east_m, beacon.north_m);
            let nees = fix.estimate.nees(&truth).expect("a proper covariance");
            let error_m = (fix.estimate.mean - truth).norm();
            // χ² of two degrees of freedom: 1 in 10 000 is above 18.4.
            assert!(nees < 18.4, "{}: NEES {nees:.1}, {error_m:.2} m", fix.name);
        }
    }

    /// Sends messages of strangers to all ends: garbage, too long, forged and recorded ones.
    fn molest(&self, forger: &mut Forger) {
        let end_of = |drone: usize| self.carriers.0[drone].clone();
        let mut to_drones = self.carriers.1.clone();
        for drone in 0..self.flight.drones.len() {
            let garbage = [&b"foxhunt1"[..], b"", b"foxhunt1 \xff\xff 1 2 3\n{}", &[b'x'; 70_000]];
            for payload in garbage {
                end_of(drone).send(drone, payload.to_vec()).expect("memory");
                to_drones.send(drone, payload.to_vec()).expect("memory");
            }
        }
        forger.send();
        let replayed = |tap: &Wiretap| {
            let tap = tap.borrow();
            let step = (tap.len() / 20).max(1);
            tap.iter().step_by(step).cloned().collect::<Vec<_>>()
        };
        for (drone, payload) in replayed(&self.reports) {
            end_of(drone).send(drone, payload).expect("memory");
        }
        for (drone, payload) in replayed(&self.orders) {
            // Also to another one.
            to_drones.send((drone + 1) % 3, payload.clone()).expect("memory");
            to_drones.send(drone, payload).expect("memory");
        }
    }
}

/// A node of another team, that poses as drone 1.
struct Forger(Vec<CarriedDrone<MemoryCarrier>>);

impl Forger {
    fn new(carrier: &MemoryCarrier) -> Self {
        let keys = [Some(TeamKey::generate().expect("randomness")), None];
        let link = |key| CarriedDrone::new(carrier.clone(), 1, key).expect("randomness");
        Self(keys.into_iter().map(link).collect())
    }

    fn send(&mut self) {
        for link in &mut self.0 {
            let failure = "all is lost".to_owned();
            let status = Status { stage: Stage::Over, failure, ..Status::default() };
            link.send(&Report::Status(status)).expect("memory");
        }
    }
}

#[test]
fn drones_and_fusion_begun_anew_among_strangers_find_the_same() {
    let mut rig = Rig::new("flown-nodes", 1, Vec::new());
    let mut forger = Forger::new(&rig.carriers.0[1]);
    let mut drones = rig.drones();
    let mut fusion = Some(rig.fusion());
    let mut killed = None;
    let mut resumed = false;
    while !fusion.as_ref().is_some_and(|node| node.is_finished(rig.world.time())) {
        rig.pass(&mut drones, &mut fusion);
        let time = rig.world.time();
        assert!(time < 7200.0, "the hunt does not end");
        if (time * 20.0).round() % 200.0 == 0.0 {
            rig.molest(&mut forger);
        }
        // The node of a drone is killed for two seconds, shorter than its autopilot's failsafe.
        if killed.is_none() && rig.received() >= 7 {
            (drones[1], killed) = (None, Some(time));
        }
        if drones[1].is_none() && killed.is_some_and(|when| time > when + 2.0) {
            drones[1] = Some(rig.drone(1, true));
        }
        // So is the one that fuses, for five.
        if !resumed && rig.received() >= 14 {
            fusion = None;
            for _ in 0..100 {
                rig.pass(&mut drones, &mut fusion);
            }
            (fusion, resumed) = (Some(rig.fusion()), true);
        }
    }
    assert!(killed.is_some() && resumed);
    assert_eq!(fusion.and_then(|node| node.failure().map(str::to_owned)), None);
    rig.judge();
    let after = rig.received() - 14;
    let of_it = |event: &&Event| matches!(event, Event::Received { drone: 1, .. });
    let its = rig.events.iter().filter(of_it).count();
    assert!(after > 5 && its > rig.received() / 6, "drone 1 takes part no more: {its}");
    // Every stranger was named, and none followed.
    for why in ["no message of a foxhunt node", "too long", "not signed;", "not signed with"] {
        let named = |event: &&Event| match event {
            Event::DeviceFailed { drone: None, reason, .. } => reason.contains(why),
            _ => false,
        };
        let times = rig.events.iter().filter(named).count();
        assert!((1..40).contains(&times), "{why}: {times} events");
    }
    let forged = |event: &&Event| format!("{event:?}").contains("all is lost");
    assert_eq!(rig.events.iter().filter(forged).count(), 0);
    for (drone, node) in drones.iter().enumerate() {
        assert!(rig.up_m(drone) < 0.3, "drone {drone} is {} m up", rig.up_m(drone));
        assert_eq!(node.as_ref().map(FlownNode::stage), Some(Stage::Over), "drone {drone}");
    }
}

#[test]
fn drones_without_orders_come_back_and_the_pilots_keep_theirs() {
    let pilot = vec![PilotOrder { at_s: 60.0, mode: "LOITER".into() }];
    let vehicle = AutopilotFaults { pilot, ..AutopilotFaults::default() };
    let faults = vec![DroneFaults { vehicle, ..DroneFaults::default() }];
    let mut rig = Rig::new("flown-silent", 3, faults);
    let mut drones = rig.drones();
    let mut fusion = Some(rig.fusion());
    while rig.world.time() < 90.0 {
        rig.pass(&mut drones, &mut fusion);
    }
    let stages = |drones: &[Option<Drone>]| {
        drones.iter().flatten().map(FlownNode::stage).collect::<Vec<_>>()
    };
    assert_eq!(stages(&drones), [Stage::Away, Stage::Flying, Stage::Flying]);
    // The fusing node is gone for long.
    let gone = fusion.take();
    while rig.world.time() < 145.0 {
        rig.pass(&mut drones, &mut fusion);
    }
    assert_eq!(stages(&drones), [Stage::Away, Stage::Flying, Stage::Flying], "they hold");
    while rig.world.time() < 220.0 {
        rig.pass(&mut drones, &mut fusion);
    }
    assert!(rig.up_m(0) > 2.0, "the pilot's drone was brought down");
    assert_eq!(stages(&drones)[1..], [Stage::Over, Stage::Over]);
    assert!(rig.up_m(1) < 0.3 && rig.up_m(2) < 0.3);
    let why = drones[1].as_ref().map(|node| node.reason().to_owned());
    assert!(why.as_ref().is_some_and(|why| why.contains("no order has come for 60 s")), "{why:?}");
    // When it is back there is nobody left to search with, but the one that its pilot has.
    fusion = gone;
    while rig.world.time() < 230.0 {
        rig.pass(&mut drones, &mut fusion);
    }
    assert!(rig.up_m(1) < 0.3 && rig.up_m(2) < 0.3, "one took off again");
    drones[0].as_mut().expect("it is there").abort(rig.world.time(), "its pilot has it for good");
    while rig.world.time() < 540.0 && fusion.as_ref().is_some_and(|node| node.failure().is_none()) {
        rig.pass(&mut drones, &mut fusion);
    }
    assert_eq!(fusion.as_ref().and_then(|node| node.failure()), Some("no drone is left"));
    assert!(rig.up_m(0) > 2.0, "the pilot's drone was brought down");
}

#[test]
fn none_takes_off_before_all_are_ready_and_the_operator_lets_them() {
    let mut rig = Rig::new("flown-ready", 4, Vec::new());
    let mut drones = rig.drones();
    let mut fusion = Some(rig.fusion());
    fusion.as_mut().expect("it is there").wait_for_go(true);
    let late = drones[2].take();
    while rig.world.time() < 30.0 {
        rig.pass(&mut drones, &mut fusion);
    }
    assert!(!fusion.as_ref().is_some_and(FusionNode::is_ready), "one is missing");
    drones[2] = late;
    while rig.world.time() < 60.0 {
        rig.pass(&mut drones, &mut fusion);
    }
    assert!(fusion.as_ref().is_some_and(FusionNode::is_ready), "nobody lets them");
    assert!((0..3).all(|drone| rig.up_m(drone) < 0.3), "somebody took off");
    // A drone whose pilot keeps it on the ground ends it for all.
    fusion.as_mut().expect("it is there").go();
    while rig.world.time() < 61.0 {
        rig.pass(&mut drones, &mut fusion);
    }
    drones[0].as_mut().expect("it is there").abort(rig.world.time(), "its pilot breaks off");
    while rig.world.time() < 150.0 {
        rig.pass(&mut drones, &mut fusion);
    }
    let failure = fusion.as_ref().and_then(|node| node.failure()).unwrap_or_default();
    assert!(failure.contains("drone 0, counted from 0, does not take part"), "{failure}");
    assert!((0..3).all(|drone| rig.up_m(drone) < 0.3), "somebody is up");
    assert!(fusion.is_some_and(|node| node.is_finished(rig.world.time())));
}
