//! The AR.Drone's driver against an emulated one, over datagrams on this machine or in memory.

use approx::assert_abs_diff_eq;
use std::{cell::RefCell, collections::VecDeque, f64::consts::TAU, io, rc::Rc};

use foxhunt::{
    hardware::{
        Aircraft, AircraftState, ArDrone, ArDroneConfig, ArDroneError, MotionCapture,
        MotionCaptureConfig,
    },
    sim::{
        DroneConfig, EmulatedArDrone, EmulatedMotionCapture, EmulatedMotionCaptureConfig, Emulator,
        Interval, SimClock, World, WorldConfig,
    },
    wire::{ByteStream, Endpoint},
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
    cameras: Option<EmulatedMotionCapture<Datagrams>>,
    emulated: EmulatedArDrone<Datagrams, Datagrams>,
    driver: ArDrone<Datagrams, Datagrams, SimClock>,
}

impl Field {
    fn new(lost: Vec<Interval>) -> Self {
        let config = ArDroneConfig {
            east_m: 2.0,
            north_m: 1.0,
            heading_deg_ccw_from_east: 70.0,
            ..ArDroneConfig::default()
        };
        Self::of(config, lost)
    }

    /// The drone at 2 m East, 1 m North, its nose at 70°, with a driver.
    fn of(config: ArDroneConfig, lost: Vec<Interval>) -> Self {
        let drone = DroneConfig {
            east_m: 2.0,
            north_m: 1.0,
            up_m: 3.0,
            heading_deg_ccw_from_east: 70.0,
            lost,
            ..DroneConfig::default()
        };
        let world = WorldConfig { drones: vec![drone], ..WorldConfig::default() };
        let world = World::new(&world, 1).expect("a world");
        let ((orders, ordered), (reported, reports)) = (pair(), pair());
        let emulated = EmulatedArDrone::new(&world, 0, ordered, reports).expect("a drone");
        let driver = ArDrone::new(config, orders, reported, world.clock()).expect("a driver");
        Self { world, cameras: None, emulated, driver }
    }

    /// The drone in a room with cameras, with a driver that has it 3 m and 40° from where it is.
    fn captured(hidden: Vec<Interval>) -> Self {
        let config = ArDroneConfig {
            east_m: 5.0,
            north_m: 1.0,
            heading_deg_ccw_from_east: 110.0,
            ..ArDroneConfig::default()
        };
        let Self { world, emulated, driver, .. } = Self::of(config, Vec::new());
        let (poses, cameras) = pair();
        let endpoint = Endpoint::UdpIn { address: "127.0.0.1:5005".into() };
        let capture = MotionCaptureConfig::new(endpoint, "drone-1");
        let capture = MotionCapture::new(capture, Box::new(poses)).expect("in range");
        let seen = EmulatedMotionCaptureConfig { hidden, ..Default::default() };
        let cameras = EmulatedMotionCapture::new(&world, 0, seen, 4, cameras).expect("a drone");
        let driver = driver.with_motion_capture(capture);
        Self { world, cameras: Some(cameras), emulated, driver }
    }

    fn tick(&mut self) -> AircraftState {
        self.world.advance(0.02).expect("time passes");
        self.emulated.serve().expect("datagrams");
        if let Some(cameras) = &mut self.cameras {
            cameras.serve().expect("datagrams");
        }
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
    assert_abs_diff_eq!(
        field.driver.position_sigma().expect("it reports it").x,
        0.5,
        epsilon = 1e-9
    );

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
    assert_abs_diff_eq!(turned, TAU, epsilon = 0.3);
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
fn motion_capture_corrects_place_and_heading() {
    let mut field = Field::captured(vec![Interval { from_s: 60.0, to_s: Some(65.0) }]);
    let findings = {
        let Field { world, cameras, emulated, driver } = &mut field;
        let cameras = cameras.as_mut().expect("given");
        driver.examine(&mut || {
            world.advance(0.02).expect("time passes");
            emulated.serve().expect("datagrams");
            cameras.serve().expect("datagrams");
        })
    };
    let captured = findings.iter().find(|finding| finding.subject == "motion capture");
    assert!(captured.is_some_and(|finding| finding.is_good()), "{findings:?}");
    field.fly(3.0);
    let goal = Vector3::new(8.0, 5.0, 3.0);
    field.driver.go_to(&Waypoint { position: goal }).expect("accepted");
    field.until("there", 40.0, |_, world| (place(world) - goal).norm() < 0.4);
    field.driver.spin(Some(45_f64.to_radians())).expect("accepted");
    while field.world.time() < 59.0 {
        field.tick();
        let truth = field.world.pose(0).expect("a drone");
        let reported = field.driver.pose().expect("a pose");
        let error = (reported.position - truth.position).xy().norm();
        assert!(error < 0.03, "{error} m off");
        let turned = angle::distance(reported.heading, truth.heading).to_degrees();
        assert!(turned < 2.0, "{turned}° off");
    }
    assert!(field.driver.device_failure().is_none());
    assert!(field.driver.position_sigma().expect("reported").x < 0.02);

    // Hidden for 5 s: it counts on by itself, and says so once.
    let target = Waypoint { position: Vector3::new(3.0, 1.0, 3.0) };
    field.driver.go_to(&target).expect("accepted");
    while field.world.time() < 64.9 {
        field.tick();
    }
    let lost = field.driver.device_failure().expect("a loss").to_string();
    assert!(lost.starts_with("motion capture: no pose of \"drone-1\" at udpin:127"), "{lost}");
    assert!(field.driver.device_failure().is_none(), "it is reported");
    let sigma = field.driver.position_sigma().expect("reported").x;
    assert!((0.1..1.0).contains(&sigma), "a few metres by its own odometry: {sigma}");
    let reported = field.driver.pose().expect("a pose").position;
    assert!((reported - place(&field.world)).xy().norm() < 0.5, "{reported}");
    field.until("seen again", 2.0, |_, world| world.time() > 65.2);
    assert!(field.driver.position_sigma().expect("reported").x < 0.02);
}

/// Without the cameras this drone flies past its goal by as much as its start is off.
#[test]
fn without_motion_capture_a_wrong_start_stays_wrong() {
    let mut field = Field::captured(vec![Interval { from_s: 0.0, to_s: None }]);
    field.fly(3.0);
    let goal = Vector3::new(8.0, 5.0, 3.0);
    field.driver.go_to(&Waypoint { position: goal }).expect("accepted");
    field.until("its time", 30.0, |_, world| world.time() > 30.0);
    assert!((place(&field.world) - goal).norm() > 2.0);
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
