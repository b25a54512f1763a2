//! The AR.Drone's driver against an emulated one, over datagrams on this machine or in memory.

use std::{cell::RefCell, collections::VecDeque, f64::consts::TAU, io, rc::Rc};

use foxhunt::{
    hardware::{Aircraft, AircraftState, ArDrone, ArDroneConfig, ArDroneError},
    sim::{DroneConfig, EmulatedArDrone, Emulator, Interval, SimClock, World, WorldConfig},
    wire::ByteStream,
};
use foxhunt_core::{Spinner, Vehicle, Waypoint, angle};
use nalgebra::{Vector2, Vector3};

type Queue = Rc<RefCell<VecDeque<Vec<u8>>>>;

/// One end of a pair that keeps datagrams apart.
struct Datagrams {
    inbox: Queue,
    outbox: Queue,
}

fn pair() -> (Datagrams, Datagrams) {
    let a = Queue::default();
    let b = Queue::default();
    let other = Datagrams { inbox: Rc::clone(&b), outbox: Rc::clone(&a) };
    (Datagrams { inbox: a, outbox: b }, other)
}

impl ByteStream for Datagrams {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let Some(datagram) = self.inbox.borrow_mut().pop_front() else { return Ok(0) };
        let count = datagram.len().min(into.len());
        into[..count].copy_from_slice(&datagram[..count]);
        Ok(count)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.outbox.borrow_mut().push_back(bytes.to_vec());
        Ok(())
    }
}

struct Field {
    world: World,
    emulated: EmulatedArDrone<Datagrams, Datagrams>,
    driver: ArDrone<Datagrams, Datagrams, SimClock>,
}

impl Field {
    fn new(lost: Vec<Interval>) -> Self {
        let drone = DroneConfig {
            east_m: 2.0,
            north_m: 1.0,
            up_m: 3.0,
            heading_deg_ccw_from_east: 70.0,
            lost,
            ..DroneConfig::default()
        };
        let config = WorldConfig { drones: vec![drone], ..WorldConfig::default() };
        let world = World::new(&config, 1).expect("a world");
        let ((orders, ordered), (reported, reports)) = (pair(), pair());
        let emulated = EmulatedArDrone::new(&world, 0, ordered, reports).expect("a drone");
        let config = ArDroneConfig {
            east_m: 2.0,
            north_m: 1.0,
            heading_deg_ccw_from_east: 70.0,
            ..ArDroneConfig::default()
        };
        let driver = ArDrone::new(config, orders, reported, world.clock()).expect("a driver");
        Self { world, emulated, driver }
    }

    fn tick(&mut self) -> AircraftState {
        self.world.advance(0.02).expect("time passes");
        self.emulated.serve().expect("datagrams");
        self.driver.state().expect("datagrams")
    }

    fn until(&mut self, what: &str, limit: f64, holds: impl Fn(&AircraftState, &World) -> bool) {
        let end = self.world.time() + limit;
        loop {
            let state = self.tick();
            if holds(&state, &self.world) {
                return;
            }
            let pose = self.world.pose(0);
            assert!(self.world.time() < end, "{what}: {state:?} at {pose:?}");
        }
    }

    fn fly(&mut self, up: f64) {
        self.until("received", 3.0, |state, _| state.battery.is_some());
        self.driver.take_off(up).expect("accepted");
        self.until("up", 20.0, |state, _| state.commanded);
    }
}

fn place(world: &World) -> Vector3<f64> {
    world.pose(0).expect("a drone").position
}

#[test]
fn it_flies_turns_and_comes_home() {
    let mut field = Field::new(Vec::new());
    field.fly(3.0);
    for goal in [Vector3::new(8.0, 5.0, 4.0), Vector3::new(-3.0, 6.0, 2.0)] {
        field.driver.go_to(&Waypoint { position: goal }).expect("accepted");
        field.until("there", 40.0, |_, world| (place(world) - goal).norm() < 0.4);
        let reported = field.driver.pose().expect("a pose");
        assert!(
            (reported.position - place(&field.world)).norm() < 0.3,
            "its odometry: {reported:?}"
        );
    }
    let sigma = field.driver.position_sigma().expect("it reports it");
    assert!(sigma.x > 1.0 && sigma.x < 4.0, "some twenty metres flown: {sigma}");
    field.driver.correct(Vector2::new(-3.0, 6.0), 0.5);
    assert!((field.driver.position_sigma().expect("it reports it").x - 0.5).abs() < 1e-9);

    field.driver.spin(Some(45_f64.to_radians())).expect("accepted");
    field.until("a second", 1.0, |_, _| true);
    let mut turned = 0.0;
    let mut worst = 0.0_f64;
    let mut last = field.world.pose(0).expect("a drone").heading;
    for _ in 0..400 {
        field.tick();
        let heading = field.world.pose(0).expect("a drone").heading;
        let reported = field.driver.pose().expect("a pose").heading;
        worst = worst.max(angle::distance(reported, heading));
        turned += angle::wrap(heading - last);
        last = heading;
    }
    assert!((turned - TAU).abs() < 0.3, "{turned} rad in 8 s");
    assert!(worst < 5_f64.to_radians(), "off by {worst} rad");
    field.driver.spin(None).expect("accepted");

    assert!(matches!(
        field.driver.go_to(&Waypoint { position: Vector3::new(0.0, 0.0, 9.0) }),
        Err(ArDroneError::Limit { what: "an Up", .. })
    ));
    assert!(field.driver.spin(Some(2.0)).is_err(), "115 °/s");
    field.driver.return_to_launch().expect("accepted");
    assert!(field.driver.spin(None).is_err(), "it returns");
    field.until("home", 60.0, |state, _| !state.airborne);
    assert!((place(&field.world) - Vector3::new(2.0, 1.0, 0.0)).norm() < 1.0);
}

#[test]
fn a_lost_link_ends_the_orders() {
    let mut field = Field::new(vec![Interval { from_s: 15.0, to_s: Some(20.0) }]);
    field.fly(2.0);
    let goal = Waypoint { position: Vector3::new(30.0, 1.0, 2.0) };
    field.driver.go_to(&goal).expect("accepted");
    field.until("lost", 20.0, |state, _| !state.commanded);
    assert!(field.world.time() > 16.9);
    assert!(matches!(field.driver.pose(), Err(ArDroneError::Silent { .. })));
    assert!(field.driver.take_over().is_err());
    let hovering = place(&field.world);
    field.until("back", 10.0, |state, _| state.silent_s < 0.5);
    assert!((place(&field.world) - hovering).norm() < 1.5, "it hovers");
    assert!(matches!(field.driver.go_to(&goal), Err(ArDroneError::NotCommanded { .. })));
    field.driver.take_over().expect("the link is back");
    field.driver.go_to(&Waypoint { position: place(&field.world) }).expect("ours again");
    field.driver.land().expect("accepted");
    field.until("down", 20.0, |state, _| !state.airborne);
}

#[test]
fn motors_stop_at_once_and_fly_again() {
    let mut field = Field::new(Vec::new());
    field.fly(2.0);
    field.driver.stop_motors().expect("sent");
    field.until("down", 5.0, |state, world| !state.airborne && place(world).z < 0.01);
    let findings = field.driver.examine(&mut || {});
    let bad: Vec<_> = findings.iter().filter(|finding| !finding.is_good()).collect();
    assert!(bad.len() == 1 && bad[0].subject == "emergency", "{findings:?}");
    field.fly(1.5);
}

#[test]
fn impossible_numbers_are_named() {
    let ((orders, _a), (reported, _b)) = (pair(), pair());
    let config = ArDroneConfig { rate_hz: 1.0, ..ArDroneConfig::default() };
    let error = ArDrone::new(config, orders, reported, || 0.0).err().expect("too slow").to_string();
    assert!(error.contains("rate_hz is 1"), "{error}");
}
