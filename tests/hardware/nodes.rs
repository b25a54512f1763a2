//! The nodes of a hunt on several computers, each against a link in the test's own hands.

use std::{cell::Cell, fmt, rc::Rc};

use foxhunt::{
    core::Level,
    hardware::link::{
        Delivery, DroneLink, FusionLink, Impaired, Impairment, LinkError, MemoryFusion, Order,
        Report, Turn, UnixTime, memory_network,
    },
    network::{
        DroneNode, DroneNodeConfig, FusionNode, FusionNodeConfig, NetworkError, uniform_draws,
    },
    prelude::*,
    sensors::Pritzl2018,
};
use nalgebra::Vector3;

const EPOCH: UnixTime = UnixTime::whole(1_760_000_000);

fn at(seconds: f64) -> UnixTime {
    EPOCH.after(seconds).expect("some seconds")
}

/// The error of a device whose cable is out.
#[derive(Debug)]
struct Unplugged;

impl fmt::Display for Unplugged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the cable is out")
    }
}

impl std::error::Error for Unplugged {}

/// A drone's devices, which count their orders.
#[derive(Clone, Default)]
struct Devices {
    unplugged: Rc<Cell<bool>>,
    sent: Rc<Cell<u32>>,
    landed: Rc<Cell<u32>>,
    begun: Rc<Cell<u32>>,
}

impl Devices {
    fn count(&self, counter: &Cell<u32>) -> Result<(), Unplugged> {
        if self.unplugged.get() {
            return Err(Unplugged);
        }
        counter.set(counter.get() + 1);
        Ok(())
    }
}

impl Vehicle for Devices {
    type Error = Unplugged;

    fn pose(&mut self) -> Result<Pose, Unplugged> {
        Ok(Pose::at(1.0, 2.0, 3.0))
    }

    fn go_to(&mut self, _: &Waypoint) -> Result<(), Unplugged> {
        self.count(&self.sent)
    }

    fn land(&mut self) -> Result<(), Unplugged> {
        self.count(&self.landed)
    }
}

impl PatternSource for Devices {
    type Error = Unplugged;

    fn begin(&mut self, _: &[BeaconId]) -> Result<(), Unplugged> {
        self.count(&self.begun)
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, Unplugged> {
        Ok(None)
    }
}

/// The last failure that a drone has reported.
fn failure(fusion: &mut impl FusionLink) -> String {
    let mut last = String::new();
    while let Some((_, report)) = fusion.receive().expect("memory") {
        if let Report::Status(status) = report {
            last = status.failure;
        }
    }
    last
}

#[test]
fn a_drone_does_each_thing_once_and_what_fails_again() {
    let (drones, mut fusion) = memory_network(1);
    let devices = Devices::default();
    let source = devices.clone();
    let vehicle = devices.clone();
    let link = drones[0].clone();
    let config = DroneNodeConfig::default();
    let extractor = Pritzl2018::default();
    let mut node =
        DroneNode::new(source, vehicle, extractor, link, EPOCH, config).expect("in range");
    let goal = Some(Waypoint { position: Vector3::new(5.0, 6.0, 7.0) });
    let turn = Turn { number: 10, beacons: vec![BeaconId(0)] };
    let order = Order { number: 10, goal, turn, ..Order::default() };
    devices.unplugged.set(true);
    fusion.send(0, &order).expect("memory");
    node.step(0.0).expect("memory");
    assert!(failure(&mut fusion).contains("the cable is out"));
    devices.unplugged.set(false);
    node.step(0.5).expect("memory");
    assert_eq!(devices.sent.get(), 0, "it is tried again after a second");
    // Sent again, and one that is older.
    let old = Order { number: 9, land: true, ..Order::default() };
    for order in [&order, &old, &order] {
        fusion.send(0, order).expect("memory");
    }
    for tenth in 11..30 {
        node.step(0.1 * f64::from(tenth)).expect("memory");
    }
    assert_eq!((devices.sent.get(), devices.begun.get(), devices.landed.get()), (1, 1, 0));
    assert_eq!(failure(&mut fusion), "");
    let land = Order { number: 11, land: true, ..order };
    for _ in 0..3 {
        fusion.send(0, &land).expect("memory");
        node.step(4.0).expect("memory");
    }
    assert_eq!((devices.sent.get(), devices.begun.get(), devices.landed.get()), (1, 1, 1));
    assert!(matches!(node.step(f64::NAN), Err(NetworkError::Time { .. })));
}

/// The hunt of a scenario with the reference's filter.
fn hunt_of(scenario: &Scenario) -> Hunt {
    let registry = Registry::builtin();
    let estimator = registry.estimator("ekf-pritzl2018").expect("it has a name");
    let parts = scenario.parts(&registry, estimator, 1).expect("known names");
    parts.build().expect("a proper hunt")
}

fn delivery(beacon: u16, ended: UnixTime) -> Report {
    let beacon = BeaconId(beacon);
    let reception = Reception {
        beacon,
        time: 0.0,
        receiver: Pose::at(1.0, 2.0, 3.0),
        level: Some(Level { rss_dbm: -60.0, sigma_db: 6.0 }),
        bearing: Some(Bearing { angle: 1.0, sigma: 0.5, confidence: 1.0 }),
        ..Reception::default()
    };
    Report::Delivery(Box::new(Delivery { beacon, ended, reception: Ok(reception) }))
}

#[test]
fn a_reception_is_taken_once_logged_first_and_not_before_or_after_its_time() {
    let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    let (mut drones, fusion) = memory_network(3);
    let hunt = hunt_of(&scenario);
    let config = FusionNodeConfig::default();
    let mut node = FusionNode::new(hunt, 3, fusion, EPOCH, None, config).expect("in range");
    // One that comes before the hunt has begun is not named as taken.
    drones[0].send(&delivery(0, at(0.0))).expect("memory");
    node.step(0.0).expect("memory");
    assert_eq!((node.silent(0.0), node.homes().len()), (vec![0, 1, 2], 0));
    let places = scenario.world.drones.iter();
    for (link, place) in drones.iter_mut().zip(places) {
        let pose = Pose::at(place.east_m, place.north_m, place.up_m);
        link.send(&Report::Pose { at: at(0.9), pose }).expect("memory");
    }
    node.step(1.0).expect("memory");
    assert_eq!((node.silent(1.0).len(), node.homes().len()), (0, 3));
    while node.poll_event().is_some() {}
    // Of the future, of a beacon whose turn has not come, and of now, twice.
    for (beacon, ended) in [(0, 9.0), (1, 1.0), (0, 1.0), (0, 1.0)] {
        drones[1].send(&delivery(beacon, at(ended))).expect("memory");
    }
    node.step(2.0).expect("memory");
    // What comes from the future may have come during that step; at the next it is judged.
    node.step(2.05).expect("memory");
    let taken = |link: &mut dyn DroneLink| {
        let mut taken = Vec::new();
        while let Some(order) = link.receive().expect("memory") {
            taken = order.taken;
        }
        taken.iter().map(|taken| (taken.beacon.0, taken.ended)).collect::<Vec<_>>()
    };
    assert_eq!(taken(&mut drones[1]), [], "they are not logged");
    let mut received = 0;
    let mut refused = Vec::new();
    while let Some(event) = node.poll_event() {
        match event {
            Event::Received { drone, .. } => {
                assert_eq!(drone, 1);
                received += 1;
            }
            Event::Refused { reason, .. } => refused.push(reason),
            _ => {}
        }
    }
    assert_eq!(received, 1);
    assert!(refused.len() == 1 && refused[0].contains("from 7.0 s in the future"), "{refused:?}");
    node.step(2.1).expect("memory");
    assert_eq!(taken(&mut drones[1]), [(0, at(1.0)), (0, at(9.0))]);
    // One that came while a long step ran is of its past at the next.
    drones[1].send(&delivery(0, at(6.0))).expect("memory");
    node.step(2.2).expect("memory");
    node.step(6.1).expect("memory");
    let events: Vec<Event> = std::iter::from_fn(|| node.poll_event()).collect();
    assert!(!events.iter().any(|event| matches!(event, Event::Refused { .. })), "{events:?}");
    node.step(6.2).expect("memory");
    assert!(taken(&mut drones[1]).contains(&(0, at(6.0))));
}

/// A link that reports a loss `lost` times before it hands out the reports, as a queue that ran
/// over does.
struct Overrun {
    link: MemoryFusion,
    lost: Rc<Cell<u32>>,
}

impl FusionLink for Overrun {
    fn send(&mut self, drone: usize, order: &Order) -> Result<(), LinkError> {
        self.link.send(drone, order)
    }

    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
        let lost = self.lost.get();
        if lost == 0 {
            return self.link.receive();
        }
        self.lost.set(lost - 1);
        let reason = format!("{lost} are lost");
        Err(LinkError::Message { over: "a test", what: "poses".to_owned(), reason })
    }
}

#[test]
fn a_hunt_that_stood_still_goes_on_with_what_has_come_since() {
    let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    let (mut drones, link) = memory_network(3);
    let hunt = hunt_of(&scenario);
    let lost = Rc::new(Cell::new(0));
    let link = Overrun { link, lost: Rc::clone(&lost) };
    let config = FusionNodeConfig::default();
    let mut node = FusionNode::new(hunt, 3, link, EPOCH, None, config).expect("in range");
    let mut report = |time: f64| {
        for (link, place) in drones.iter_mut().zip(&scenario.world.drones) {
            while link.receive().expect("memory").is_some() {}
            let pose = Pose::at(place.east_m, place.north_m, place.up_m);
            link.send(&Report::Pose { at: at(time), pose }).expect("memory");
        }
    };
    report(1.0);
    node.step(1.0).expect("memory");
    while node.poll_event().is_some() {}
    // The computer was busy for long, and the link kept only the last that was sent.
    report(301.0);
    lost.set(5);
    let error = node.step(301.0).expect_err("some were lost").to_string();
    assert!(error.contains("5 are lost"), "{error}");
    assert_eq!((lost.get(), node.silent(301.0)), (0, vec![]));
    while let Some(event) = node.poll_event() {
        let missed = matches!(event, Event::DutyChanged { .. } | Event::Recalled { .. });
        assert!(!missed, "{event:?}");
    }
    let order = drones[0].receive().expect("memory").expect("it was given though some were lost");
    assert_eq!(order.at, at(301.0));
}

#[test]
fn what_is_out_of_range_is_named() {
    let (drones, fusion) = memory_network(1);
    let devices = Devices::default();
    let config = DroneNodeConfig { repeat_every_s: 0.0, ..DroneNodeConfig::default() };
    let source = devices.clone();
    let vehicle = devices;
    let extractor = Pritzl2018::default();
    let link = drones[0].clone();
    let refused = DroneNode::new(source, vehicle, extractor, link, EPOCH, config);
    let error = refused.err().expect("no repetition").to_string();
    assert!(error.contains("repeat_every_s is 0"), "{error}");

    let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    let hunt = || hunt_of(&scenario);
    let config = FusionNodeConfig { assemble_s: f64::NAN, ..FusionNodeConfig::default() };
    let refused = FusionNode::new(hunt(), 1, fusion.clone(), EPOCH, None, config);
    let error = refused.expect_err("no time").to_string();
    assert!(error.contains("assemble_s is NaN"), "{error}");
    let config = FusionNodeConfig::default();
    let nobody = FusionNode::new(hunt(), 0, fusion.clone(), EPOCH, None, config);
    assert_eq!(nobody.err(), Some(NetworkError::NoDrone));
    let mut fusion = fusion;
    assert_eq!(fusion.send(7, &Order::default()), Err(LinkError::Drone { drone: 7, drones: 1 }));
    let impairment = Impairment { loss: 1.5, ..Impairment::default() };
    let impaired =
        Impaired::<_, _, _, Report>::new(drones[0].clone(), impairment, || 0.0, uniform_draws(1));
    assert!(impaired.map(|_| ()).expect_err("too much").to_string().contains("loss is 1.5"));
}
