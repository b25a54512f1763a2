//! `fly --advise`: a pilot flies as he is advised, over a link of his own, and a recorder on our
//! wire receives nothing.

use std::{cell::RefCell, io, rc::Rc};

use foxhunt::{
    core::{Vehicle, Waypoint},
    fly::{
        BoxedAircraft, EmulatedField, EmulatedFieldConfig, EmulatedPorts, FlightConfig, Mission,
        Ports, VehicleDevice,
    },
    hardware::{Aircraft, MavlinkConfig, MavlinkOrigin, MavlinkVehicle, Shared},
    hunt::{BoxedSource, FlightStage},
    registry::Registry,
    scenario::Scenario,
    sim::{SimClock, World},
    wire::{ByteStream, Endpoint, MemoryStream, memory_pair},
};

/// One autopilot, its pilot's station and us: what the autopilot sends goes to both, what the
/// station sends goes to the autopilot, and what we send is kept.
struct Router {
    autopilot: Box<dyn ByteStream>,
    station: MemoryStream,
    ours: MemoryStream,
    recorded: Rc<RefCell<Vec<u8>>>,
}

impl Router {
    fn route(&mut self) {
        let mut bytes = [0; 4096];
        let mut receive = |from: &mut dyn ByteStream| {
            let count = from.receive(&mut bytes).expect("memory");
            bytes[..count].to_vec()
        };
        let telemetry = receive(&mut self.autopilot);
        let orders = receive(&mut self.station);
        self.recorded.borrow_mut().extend(receive(&mut self.ours));
        self.station.send(&telemetry).expect("memory");
        self.ours.send(&telemetry).expect("memory");
        self.autopilot.send(&orders).expect("memory");
    }
}

type Pilot = MavlinkVehicle<MemoryStream, SimClock>;

/// The ports of a field whose autopilots are behind routers.
struct Routed {
    ports: EmulatedPorts,
    clock: SimClock,
    origin: MavlinkOrigin,
    routers: Vec<Router>,
    pilots: Vec<Pilot>,
    recorded: Rc<RefCell<Vec<u8>>>,
}

impl Ports for Routed {
    fn open(&mut self, endpoint: &Endpoint) -> io::Result<Box<dyn ByteStream>> {
        let stream = self.ports.open(endpoint)?;
        if !matches!(endpoint, Endpoint::UdpIn { .. }) {
            return Ok(stream);
        }
        let (pilots, station) = memory_pair();
        let (near, ours) = memory_pair();
        let config = MavlinkConfig { origin: Some(self.origin), ..MavlinkConfig::default() };
        let pilot = MavlinkVehicle::new(config, pilots, self.clock.clone()).expect("a station");
        self.pilots.push(pilot);
        let recorded = Rc::clone(&self.recorded);
        self.routers.push(Router { autopilot: stream, station, ours, recorded });
        Ok(Box::new(near))
    }
}

#[test]
fn advice_is_followed_and_nothing_is_sent() {
    let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    let world = World::new(&scenario.world, 1).expect("a world");
    let config = EmulatedFieldConfig::default();
    let (mut field, ports) = EmulatedField::in_memory(&scenario, &world, &config).expect("a field");
    let flight: FlightConfig = field.flight().clone().advised().expect("pilots fly");
    let registry = Registry::builtin();
    let estimator = flight.estimator(&registry).expect("it is known");
    let hunt = flight.parts(&registry, estimator, 1).build().expect("a hunt");
    let recorded = Rc::default();
    let mut routed = Routed {
        ports,
        clock: world.clock(),
        origin: MavlinkOrigin { lat_deg: flight.site.lat_deg, lon_deg: flight.site.lon_deg },
        routers: Vec::new(),
        pilots: Vec::new(),
        recorded: Rc::clone(&recorded),
    };
    let drones = flight.open(&mut routed, &world.clock(), 0.0, None, None).expect("devices");
    let mut mission: Mission<Shared<BoxedAircraft>, BoxedSource> =
        Mission::new(flight.flight, hunt, drones, world.time()).expect("a flight");
    let up = flight.flight.takeoff_up_m;
    let mut home = false;
    while !mission.is_over() && world.time() < 4000.0 {
        world.advance(scenario.simulation.tick_s).expect("time passes");
        field.serve(|device, error| panic!("{device}: {error}"));
        routed.routers.iter_mut().for_each(Router::route);
        mission.step(world.time());
        // The pilots do as they are advised.
        let stations = mission.hunt().stations();
        for (drone, pilot) in routed.pilots.iter_mut().enumerate() {
            let state = pilot.state().expect("memory");
            match mission.stage() {
                FlightStage::Climbing if !state.airborne => drop(pilot.take_off(up)),
                FlightStage::Leaving if !home => drop(pilot.land()),
                FlightStage::Hunting if state.commanded => {
                    let goal = stations[drone].goal.position;
                    let near = pilot.pose().is_ok_and(|pose| (pose.position - goal).norm() < 0.5);
                    if !near && world.time().fract() < 0.03 {
                        let _ = pilot.go_to(&Waypoint { position: goal });
                    }
                }
                _ => {}
            }
        }
        home |= mission.stage() == FlightStage::Leaving;
        while mission.poll_event().is_some() {}
    }
    assert!(mission.is_over() && mission.failure().is_none(), "{mission:?}");
    assert_eq!(recorded.borrow().len(), 0, "bytes on the wire to the autopilots");
    assert_eq!(mission.hunt().fixes().len(), 2);
    for fix in mission.hunt().fixes() {
        let truth = world.truth_at(fix.beacon, 0.0).expect("a beacon").xy();
        let nees = fix.estimate.nees(&truth).expect("a proper covariance");
        // χ² of two degrees of freedom: 1 in 10 000 is above 18.4.
        assert!(nees < 18.4, "{}: NEES {nees:.1}", fix.name);
    }
}

/// A flight that needs orders is refused, with its reason.
#[test]
fn what_needs_orders_cannot_be_advised() {
    let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    let world = World::new(&scenario.world, 1).expect("a world");
    let config = EmulatedFieldConfig::default();
    let (field, _) = EmulatedField::in_memory(&scenario, &world, &config).expect("a field");
    let mut flight = field.flight().clone();
    flight.drones[1].vehicle = VehicleDevice::ArDrone {
        motion_capture: None,
        endpoint: "udpout:192.168.1.1:5556".parse().expect("an endpoint"),
        navdata: "udpout:192.168.1.1:5554".parse().expect("an endpoint"),
        settings: Default::default(),
    };
    let error = flight.advised().expect_err("it reports nothing by itself").to_string();
    assert!(error.contains("drone-2") && error.contains("ar-drone"), "{error}");
}
