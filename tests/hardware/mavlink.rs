//! The MAVLink driver flies emulated autopilots over memory, in the world's own time.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use foxhunt::{
    hardware::{
        Aircraft, AircraftState, FlightLimits, MavlinkConfig, MavlinkError, MavlinkOrigin,
        MavlinkVehicle,
    },
    sim::{
        AutopilotConfig, AutopilotFaults, DroneConfig, EmulatedAutopilot, Emulator, Interval,
        KinematicConfig, PilotOrder, ReliefConfig, SimClock, VehicleConfig, World, WorldConfig,
    },
    wire::{MemoryStream, mavlink::Autopilot, memory_pair},
};
use foxhunt_core::{Spinner, Vehicle, Waypoint, angle};
use nalgebra::Vector3;

pub(super) type Driver = MavlinkVehicle<MemoryStream, SimClock>;

pub(super) struct Field {
    pub(super) world: World,
    pub(super) emulated: EmulatedAutopilot<MemoryStream>,
    pub(super) driver: Driver,
}

/// Seconds of the world from one serving to the next.
pub(super) const TICK: f64 = 0.02;

const BOTH: [Autopilot; 2] = [Autopilot::ArduPilot, Autopilot::Px4];

fn place(world: &World) -> Vector3<f64> {
    world.pose(0).expect("a drone").position
}

impl Field {
    pub(super) fn new(emulated: AutopilotConfig, driver: MavlinkConfig) -> Self {
        Self::within(KinematicConfig::default(), emulated, driver)
    }

    /// A drone that is capable of no more.
    fn within(limits: KinematicConfig, emulated: AutopilotConfig, driver: MavlinkConfig) -> Self {
        Self::over(None, limits, emulated, driver)
    }

    /// A drone over some terrain.
    pub(super) fn over(
        terrain: Option<ReliefConfig>,
        limits: KinematicConfig,
        emulated: AutopilotConfig,
        driver: MavlinkConfig,
    ) -> Self {
        let drone = DroneConfig {
            east_m: 3.0,
            north_m: -2.0,
            up_m: 10.0,
            heading_deg_ccw_from_east: 120.0,
            ..DroneConfig::default()
        };
        let vehicle = VehicleConfig::Kinematic(limits);
        let config =
            WorldConfig { drones: vec![drone], vehicle, terrain, ..WorldConfig::default() };
        let world = World::new(&config, 1).expect("a world");
        let (near, far) = memory_pair();
        let origin = emulated.origin;
        let emulated = EmulatedAutopilot::new(emulated, &world, 0, far).expect("an autopilot");
        let origin = Some(MavlinkOrigin { lat_deg: origin.lat_deg, lon_deg: origin.lon_deg });
        let config = MavlinkConfig { origin, ..driver };
        let driver = MavlinkVehicle::new(config, near, world.clock()).expect("a driver");
        Self { world, emulated, driver }
    }

    pub(super) fn of(autopilot: Autopilot) -> Self {
        let emulated = AutopilotConfig { autopilot, ..AutopilotConfig::default() };
        Self::new(emulated, MavlinkConfig::default())
    }

    pub(super) fn tick(&mut self) -> AircraftState {
        self.world.advance(TICK).expect("time passes");
        self.emulated.serve().expect("a cable");
        self.driver.state().expect("a cable")
    }

    /// Until something holds; the time may not pass `limit` seconds more.
    pub(super) fn until(
        &mut self,
        what: &str,
        limit: f64,
        holds: impl Fn(&AircraftState, &World) -> bool,
    ) {
        let end = self.world.time() + limit;
        loop {
            let state = self.tick();
            if holds(&state, &self.world) {
                return;
            }
            assert!(self.world.time() < end, "{what}: {state:?} at {}", place(&self.world));
        }
    }

    pub(super) fn run(&mut self, seconds: f64) -> AircraftState {
        let end = self.world.time() + seconds;
        loop {
            let state = self.tick();
            if self.world.time() >= end {
                return state;
            }
        }
    }

    pub(super) fn fly(&mut self, up: f64) {
        self.until("ready", 10.0, |state, _| state.hindrance.is_empty());
        self.driver.take_off(up).expect("accepted");
        self.until("up", 60.0, |state, _| state.commanded);
    }

    pub(super) fn go(&mut self, east: f64, north: f64, up: f64) {
        let goal = Waypoint { position: Vector3::new(east, north, up) };
        self.driver.go_to(&goal).expect("accepted");
        self.until("there", 60.0, |_, world| (place(world) - goal.position).norm() < 0.1);
    }
}

#[test]
fn a_flight_from_the_ground_to_the_ground() {
    for autopilot in BOTH {
        let mut field = Field::of(autopilot);
        assert!(place(&field.world).z.abs() < 1e-12, "it begins on the ground");
        field.fly(8.0);
        assert!((place(&field.world) - Vector3::new(3.0, -2.0, 8.0)).norm() < 0.6);
        field.go(20.0, 15.0, 12.0);
        field.run(0.5);
        let (reported, true_pose) =
            (field.driver.pose().expect("a pose"), field.world.pose(0).expect("a drone"));
        assert!(
            (reported.position - true_pose.position).norm() < 0.05,
            "{autopilot}: {reported:?}"
        );
        assert!(
            angle::distance(reported.heading, 120_f64.to_radians()) < 0.02,
            "its nose was held"
        );
        let sigma = field.driver.position_sigma().expect("it reports it");
        assert!((sigma - Vector3::new(0.5, 0.5, 0.8)).norm() < 1e-9);

        // A whole turn while it flies, at 45 °/s.
        field.driver.spin(Some(45_f64.to_radians())).expect("accepted");
        field.driver.go_to(&Waypoint { position: Vector3::new(0.0, 15.0, 12.0) }).expect("a goal");
        field.run(1.0);
        let mut turned = 0.0;
        let mut last = field.world.pose(0).expect("a drone").heading;
        let mut worst: f64 = 0.0;
        for _ in 0..400 {
            field.tick();
            let reported = field.driver.pose().expect("a pose").heading;
            let heading = field.world.pose(0).expect("a drone").heading;
            turned += angle::wrap(heading - last);
            last = heading;
            worst = worst.max(angle::distance(reported, heading));
        }
        assert!(abs_diff_eq!(turned, TAU, epsilon = 0.05), "{autopilot}: {turned} rad in 8 s");
        assert!(worst < 2_f64.to_radians(), "{autopilot}: the heading is off by {worst} rad");
        field.driver.spin(None).expect("accepted");
        field.run(3.0);
        let before = field.world.pose(0).expect("a drone").heading;
        field.run(2.0);
        let after = field.world.pose(0).expect("a drone").heading;
        assert!(angle::distance(before, after) < 0.01, "{autopilot}: its heading is held");

        // To headings across both wraps.
        for heading in [FRAC_PI_2, -PI + 0.1, -0.5, 3.0] {
            field.driver.turn_to(heading).expect("accepted");
            let begun = field.world.time();
            while !field.driver.is_turned().expect("a pose") {
                assert!(field.world.time() < begun + 20.0, "{autopilot}: never at {heading}");
                field.tick();
            }
            field.run(2.0);
            let nose = field.world.pose(0).expect("a drone").heading;
            assert!(angle::distance(nose, heading) < 0.05, "{autopilot}: {nose} for {heading}");
        }

        field.driver.land().expect("accepted");
        field.until("down", 60.0, |state, _| !state.armed && !state.airborne);
        assert!((place(&field.world) - Vector3::new(0.0, 15.0, 0.0)).norm() < 0.2);
        assert!(field.driver.go_to(&Waypoint::default()).is_err(), "it is on the ground");
        // And once more, back home by its own rules.
        field.fly(5.0);
        field.go(10.0, 15.0, 5.0);
        field.driver.return_to_launch().expect("accepted");
        let state = field.run(3.0);
        assert!(!state.commanded && state.hindrance.contains("returns"), "{state:?}");
        field.until("home", 90.0, |state, _| !state.armed);
        assert!((place(&field.world) - Vector3::new(0.0, 15.0, 0.0)).norm() < 0.4);
    }
}

#[test]
fn orders_end_when_the_pilot_takes_it() {
    for (autopilot, by_hand, back) in
        [(Autopilot::ArduPilot, "LOITER", "GUIDED"), (Autopilot::Px4, "POSITION", "HOLD")]
    {
        let order = |at_s, mode: &str| PilotOrder { at_s, mode: mode.into() };
        let faults = AutopilotFaults {
            pilot: vec![order(30.0, by_hand), order(40.0, back)],
            ..AutopilotFaults::default()
        };
        let config = AutopilotConfig { autopilot, faults, ..AutopilotConfig::default() };
        let mut field = Field::new(config, MavlinkConfig::default());
        field.fly(6.0);
        let goal = Waypoint { position: Vector3::new(150.0, 0.0, 6.0) };
        field.driver.go_to(&goal).expect("accepted");
        field.until("the pilot", 40.0, |state, _| !state.commanded);
        assert!(field.world.time() < 31.5, "noticed with the next heartbeat");
        let taken_at = place(&field.world);
        let error = field.driver.go_to(&goal).expect_err("the pilot has it").to_string();
        assert!(error.contains(by_hand), "{error}");
        for refused in [
            field.driver.spin(Some(0.1)),
            field.driver.land(),
            field.driver.return_to_launch(),
            field.driver.take_over(),
        ] {
            let refused = refused.expect_err("the pilot has it");
            assert!(matches!(refused, MavlinkError::NotCommanded { .. }), "{refused}");
        }
        // He gives it back: nothing happens before a take-over.
        let state = field.run(45.0 - field.world.time());
        assert!(!state.commanded, "{state:?}");
        assert!(field.driver.spin(None).is_err());
        assert!((place(&field.world) - taken_at).norm() < 3.0, "nobody sends it on");
        field.driver.take_over().expect("it was given back");
        field.until("ours again", 5.0, |state, _| state.commanded);
        let here = field.run(2.0);
        assert!(here.commanded && (place(&field.world) - taken_at).norm() < 3.0, "it stays");
        field.go(taken_at.x + 5.0, 0.0, 6.0);
    }
}

/// Highest speed over ground in a flight of this length, after the first two seconds.
fn fastest(field: &mut Field, east: f64, seconds: f64) -> f64 {
    let goal = Waypoint { position: Vector3::new(east, 0.0, 6.0) };
    field.driver.go_to(&goal).expect("accepted");
    field.run(2.0);
    let end = field.world.time() + seconds;
    let mut fastest: f64 = 0.0;
    while field.world.time() < end {
        let before = place(&field.world);
        field.tick();
        fastest = fastest.max((place(&field.world) - before).xy().norm() / TICK);
    }
    fastest
}

/// ArduCopter takes WPNAV_SPEED (10 m/s) with the first set-point, and again after a pilot had it.
#[test]
fn it_flies_as_fast_as_ordered() {
    let order = |at_s, mode: &str| PilotOrder { at_s, mode: mode.into() };
    let faults = AutopilotFaults {
        pilot: vec![order(60.0, "LOITER"), order(62.0, "GUIDED")],
        ..AutopilotFaults::default()
    };
    let limits = KinematicConfig { speed_mps: 8.0, ..KinematicConfig::default() };
    let config = AutopilotConfig { faults, ..AutopilotConfig::default() };
    let driver = MavlinkConfig { cruise_speed_mps: Some(2.0), ..MavlinkConfig::default() };
    let mut field = Field::within(limits, config.clone(), driver);
    field.fly(6.0);
    let speed = fastest(&mut field, 40.0, 8.0);
    assert_abs_diff_eq!(speed, 2.0, epsilon = 0.2);
    field.run(64.0 - field.world.time());
    field.driver.take_over().expect("it was given back");
    field.until("ours again", 5.0, |state, _| state.commanded);
    let speed = fastest(&mut field, -40.0, 8.0);
    assert_abs_diff_eq!(speed, 2.0, epsilon = 0.2);
    // Without an order it is its own speed.
    let mut field = Field::within(limits, config, MavlinkConfig::default());
    field.fly(6.0);
    let speed = fastest(&mut field, 60.0, 3.0);
    assert_abs_diff_eq!(speed, 8.0, epsilon = 0.2);
}

/// Set-points in OFFBOARD are flown to at MPC_XY_VEL_MAX: that is reported, not hidden.
#[test]
fn a_speed_that_is_not_obeyed_is_reported() {
    let limits = KinematicConfig { speed_mps: 8.0, ..KinematicConfig::default() };
    let config = AutopilotConfig { autopilot: Autopilot::Px4, ..AutopilotConfig::default() };
    let driver = MavlinkConfig { cruise_speed_mps: Some(2.0), ..MavlinkConfig::default() };
    let mut field = Field::within(limits, config, driver);
    field.fly(6.0);
    assert!(fastest(&mut field, 90.0, 5.0) > 7.0);
    let state = field.run(0.1);
    let words = "it flies at 8.0 m/s; cruise_speed_mps is 2";
    assert!(state.commanded && state.hindrance == words, "{state:?}");
}

#[test]
fn orders_end_with_the_link() {
    for autopilot in BOTH {
        let silent = vec![Interval { from_s: 30.0, to_s: Some(38.0) }];
        let faults = AutopilotFaults { silent, ..AutopilotFaults::default() };
        let config = AutopilotConfig {
            autopilot,
            faults,
            ground_failsafe_s: None,
            ..AutopilotConfig::default()
        };
        let mut field = Field::new(config, MavlinkConfig::default());
        field.fly(6.0);
        field.run(32.0 - field.world.time());
        assert!(matches!(field.driver.pose(), Err(MavlinkError::Stale { .. })), "an old pose");
        let state = field.run(36.0 - field.world.time());
        assert!(!state.commanded && state.silent_s > 5.0, "{state:?}");
        assert!(matches!(field.driver.pose(), Err(MavlinkError::Silent { .. })));
        assert!(matches!(field.driver.spin(None), Err(MavlinkError::Silent { .. })));
        let state = field.run(42.0 - field.world.time());
        assert!(!state.commanded && !state.hindrance.is_empty(), "{state:?}");
        assert!(field.driver.pose().is_ok(), "{autopilot}: it reports its place again");
        assert!(matches!(field.driver.spin(None), Err(MavlinkError::NotCommanded { .. })));
        if autopilot == Autopilot::Px4 {
            // Without set-points it left OFFBOARD: that is the pilot's now.
            assert_eq!(state.mode, "POSITION");
            assert!(field.driver.take_over().is_err());
            continue;
        }
        field.driver.take_over().expect("the link is back");
        field.until("ours again", 5.0, |state, _| state.commanded);
        field.go(5.0, 5.0, 6.0);
    }
}

#[test]
fn a_ground_station_that_falls_silent_has_it_come_back() {
    let mut field = Field::of(Autopilot::ArduPilot);
    field.fly(6.0);
    field.go(20.0, 0.0, 6.0);
    // Nobody serves the driver any more.
    for _ in 0..4000 {
        field.world.advance(TICK).expect("time passes");
        field.emulated.serve().expect("a cable");
    }
    assert!((place(&field.world) - Vector3::new(3.0, -2.0, 0.0)).norm() < 0.4);
    let state = field.tick();
    assert!(!state.armed && !state.commanded, "{state:?}");
}

#[test]
fn early_orders_are_refused_with_a_reason() {
    let late = AutopilotConfig { position_good_after_s: 1e9, ..AutopilotConfig::default() };
    let config = MavlinkConfig { position_timeout_s: 20.0, ..MavlinkConfig::default() };
    let mut field = Field::new(late, config);
    let state = field.tick();
    assert!(state.silent_s < 1.0 && !state.armed && state.mode == "STABILIZE", "{state:?}");
    let state = field.run(5.0);
    assert!(state.hindrance.contains("0x0081"), "{state:?}");
    assert!(matches!(field.driver.pose(), Err(MavlinkError::Position { .. })));
    field.driver.take_off(5.0).expect("it waits for a position");
    let state = field.run(10.0);
    assert!(!state.armed && !state.airborne, "{state:?}");
    let state = field.run(15.0);
    assert!(!state.armed && state.hindrance.contains("given up"), "{state:?}");
    let goal = field.driver.go_to(&Waypoint::default()).expect_err("on the ground");
    assert!(goal.to_string().contains("given up"), "{goal}");
}

#[test]
fn limits_are_refused_on_our_side() {
    let limits = FlightLimits {
        max_up_m: 20.0,
        min_up_m: 3.0,
        fence_radius_m: 40.0,
        fence: vec![[-30.0, -30.0], [50.0, -30.0], [50.0, 30.0], [-30.0, 30.0]],
    };
    let config = MavlinkConfig { limits, spin_limit_deg_s: 60.0, ..MavlinkConfig::default() };
    let mut field = Field::new(AutopilotConfig::default(), config);
    field.run(5.0);
    assert!(matches!(field.driver.take_off(25.0), Err(MavlinkError::UpLimit { .. })));
    field.fly(5.0);
    let before = place(&field.world);
    for (goal, words) in [
        (Vector3::new(0.0, 0.0, 21.0), "21 m is not within the limits of 3 to 20"),
        (Vector3::new(0.0, 0.0, 1.0), "1 m is not within"),
        (Vector3::new(44.0, -2.0, 5.0), "41.0 m from the launch place"),
        (Vector3::new(0.0, 31.0, 5.0), "outside the fence of 4 corners"),
        (Vector3::new(f64::NAN, 0.0, 5.0), "not finite"),
    ] {
        let error = field.driver.go_to(&Waypoint { position: goal }).expect_err("a limit");
        assert!(error.to_string().contains(words), "{error}");
    }
    let error = field.driver.spin(Some(1.2)).expect_err("too fast").to_string();
    assert!(error.contains("68.7") && error.contains("60"), "{error}");
    field.run(5.0);
    assert!((place(&field.world) - before).norm() < 0.5, "none of it was sent");
}
