//! A drone of an emulated field that is where a vehicle outside of it is.

use approx::assert_abs_diff_eq;
use foxhunt::{
    core::{BeaconId, Vehicle, Waypoint, nalgebra::Vector3},
    fly::{CarriedDrone, EmulatedField, EmulatedFieldConfig, EmulatedFieldError, ForeignVehicle},
    geodesy::Geodetic,
    hardware::{Aircraft, MavlinkConfig, MavlinkOrigin, MavlinkVehicle},
    scenario::Scenario,
    sensors::Patch,
    sim::{AutopilotConfig, EmulatedAutopilot, Emulator, World},
    wire::{ByteStream, Endpoint, MemoryStream, memory_pair},
};

const ORIGIN: MavlinkOrigin = MavlinkOrigin { lat_deg: 47.4, lon_deg: 8.5 };

/// Router: the autopilot's bytes go to its pilot and, while it `passes`, to the field; the pilot's
/// go to the autopilot.
struct Router {
    autopilot: MemoryStream,
    pilot: MemoryStream,
    field: MemoryStream,
    passes: bool,
}

impl Router {
    fn route(&mut self) {
        let mut bytes = [0; 4096];
        let count = self.autopilot.receive(&mut bytes).expect("memory");
        self.pilot.send(&bytes[..count]).expect("memory");
        if self.passes {
            self.field.send(&bytes[..count]).expect("memory");
        }
        let count = self.pilot.receive(&mut bytes).expect("memory");
        self.autopilot.send(&bytes[..count]).expect("memory");
        assert_eq!(self.field.receive(&mut bytes).expect("memory"), 0, "it sends nothing");
    }
}

#[test]
fn radio_and_motor_go_where_a_foreign_vehicle_goes() {
    let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    // One world flies, the other one follows; they share nothing but the telemetry.
    let flown = world(&scenario, 1);
    let field = world(&scenario, 2);
    let begin = field.pose(0).expect("a drone");
    let (near, autopilot) = memory_pair();
    let (pilot, near_pilot) = memory_pair();
    let (followed, near_field) = memory_pair();
    let origin = Geodetic::new(ORIGIN.lat_deg, ORIGIN.lon_deg, 500.0).expect("a place");
    let config = AutopilotConfig { origin, ..AutopilotConfig::default() };
    let mut emulator = EmulatedAutopilot::new(config, &flown, 0, autopilot).expect("an autopilot");
    let config = MavlinkConfig { origin: Some(ORIGIN), ..MavlinkConfig::default() };
    let mut pilot = MavlinkVehicle::new(config.clone(), pilot, flown.clock()).expect("a pilot");
    let mut carried =
        CarriedDrone::new(&field, 0, config, Box::new(followed)).expect("a drone to carry");
    let mut router = Router { autopilot: near, pilot: near_pilot, field: near_field, passes: true };

    let mut errors = Vec::new();
    let mut pass = |seconds: f64, router: &mut Router, pilot: &mut MavlinkVehicle<_, _>| {
        let end = flown.time() + seconds;
        while flown.time() < end {
            flown.advance(0.02).expect("time passes");
            field.advance(0.02).expect("time passes");
            emulator.serve().expect("memory");
            router.route();
            let _ = pilot.state().expect("memory");
            if let Err(error) = carried.serve() {
                errors.push(error.to_string());
            }
        }
        std::mem::take(&mut errors)
    };
    let apart = || {
        let true_pose = flown.pose(0).expect("one");
        let there = field.pose(0).expect("one");
        (true_pose.position - there.position).norm()
    };

    let errors = pass(20.0, &mut router, &mut pilot);
    assert!(errors.is_empty(), "{errors:?}");
    pilot.take_off(10.0).expect("a take-off");
    assert_eq!(pass(30.0, &mut router, &mut pilot), [""; 0]);
    let goal = Vector3::new(begin.position.x + 25.0, begin.position.y - 15.0, 10.0);
    pilot.go_to(&Waypoint { position: goal }).expect("a goal");
    assert_eq!(pass(40.0, &mut router, &mut pilot), [""; 0]);
    // As good as the telemetry: a centimetre of rounding, and what the vehicle hovers.
    assert!(apart() < 0.2, "{:.2} m apart", apart());
    assert!((field.pose(0).expect("one").position - goal).norm() < 0.5);

    // The radio is there, too: what it receives falls off with the distance from there.
    let beam = Patch::new(0.8, 0.8, 15.0).expect("an antenna");
    let mean = |world: &World| {
        let levels = (0..400).filter_map(|position| {
            let turned = f64::from(position) * 0.1;
            world.receive(0, BeaconId(0), &beam, turned).expect("a drone")
        });
        levels.sum::<f64>() / 400.0
    };
    let near = mean(&flown);
    let there = mean(&field);
    assert_abs_diff_eq!(near, there, epsilon = 0.6);

    // An order of the field's own does not move it.
    let mut orders = field.vehicle(0).expect("a drone");
    orders.go_to(&Waypoint { position: Vector3::new(0.0, 0.0, 50.0) }).expect("a goal");
    assert_eq!(pass(5.0, &mut router, &mut pilot), [""; 0]);
    assert!(apart() < 0.2, "{:.2} m apart", apart());

    // Without news it stays, which is reported once, and follows again afterwards.
    router.passes = false;
    let before = field.pose(0).expect("a drone").position;
    let goal = Vector3::new(begin.position.x, begin.position.y, 10.0);
    pilot.go_to(&Waypoint { position: goal }).expect("a goal");
    let errors = pass(20.0, &mut router, &mut pilot);
    assert!(errors.len() == 1 && errors[0].contains("stays where it was"), "{errors:?}");
    assert!((field.pose(0).expect("a drone").position - before).norm() < 1.5);
    assert!(apart() > 10.0, "{:.2} m apart", apart());
    router.passes = true;
    assert_eq!(pass(5.0, &mut router, &mut pilot), [""; 0]);
    assert!(apart() < 0.2, "{:.2} m apart", apart());
}

/// A field is written for foreign vehicles where its file names them, and only in the wall's time.
#[test]
fn a_field_follows_the_vehicles_of_its_file() {
    let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    let world = world(&scenario, 1);
    let udp = |port: u16| Endpoint::UdpIn { address: format!("127.0.0.1:{port}") };
    let foreign = ForeignVehicle { flown: udp(0), pose: udp(0), system_id: Some(7) };
    let config = EmulatedFieldConfig { vehicles: vec![foreign.clone()], ..Default::default() };
    assert!(matches!(
        EmulatedField::in_memory(&scenario, &world, &config),
        Err(EmulatedFieldError::Foreign { drone: 0 })
    ));

    let folder = std::env::temp_dir().join(format!("foxhunt-carried-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let field = EmulatedField::new(&scenario, &world, &config, &folder).expect("a field");
    let text = toml::to_string(field.flight()).expect("a flight");
    drop(field);
    assert!(text.contains("system_id = 7"), "{text}");
    assert_eq!(text.matches("launch_m").count(), scenario.world.drones.len() - 1, "{text}");

    let too_many = vec![foreign; scenario.world.drones.len() + 1];
    let config = EmulatedFieldConfig { vehicles: too_many, ..Default::default() };
    let refused = EmulatedField::new(&scenario, &world, &config, &folder);
    assert!(matches!(refused, Err(EmulatedFieldError::Vehicles { .. })));
    let _ = std::fs::remove_dir_all(folder);
}

fn world(scenario: &Scenario, seed: u64) -> World {
    // Patterns that are the same in both but for their samples' noise.
    let mut config = scenario.world.clone();
    config.channel.pattern_sigma_db = 0.0;
    config.channel.bearing_sigma_deg = 0.0;
    World::new(&config, seed).expect("a world")
}
