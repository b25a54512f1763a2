//! Whole hunts on emulated autopilots whose heights count from a reference of their own, with gaps
//! of their links, in the world's time.

use approx::abs_diff_eq;
use foxhunt::{
    config::SourceConfig,
    fly::{
        BoxedAircraft, DroneFaults, EmulatedField, EmulatedFieldConfig, Examined, FlightRules,
        Mission,
    },
    hardware::{Finding, OwnFence, Shared},
    hunt::{BoxedSource, Event, FlightStage},
    registry::Registry,
    scenario::Scenario,
    sensors::BodyConfig,
    sim::{AutopilotFaults, Interval, World},
    wire::mavlink::Autopilot,
};

/// Outcome of a hunt.
#[derive(Debug)]
struct Hunted {
    failure: Option<String>,
    found: usize,
    /// Modes of the first drone while hunting.
    modes: Vec<String>,
    /// The worst difference of a drone's height from its goal's, five seconds after that was set,
    /// in metres.
    worst_up_m: f64,
    /// The nearest two drones in the air, in space, hunting and coming home, in metres.
    nearest_m: [f64; 2],
    seconds: f64,
}

/// One drone with a stepper, one that turns its body, or three.
fn scenario(drones: &str) -> Scenario {
    let name = if drones == "three" { "pritzl-6.1" } else { "one-drone" };
    let mut scenario = Scenario::find(name).expect("it is built in");
    if drones == "body" {
        let answer_timeout_s = 0.2;
        let body = BodyConfig { answer_timeout_s, ..BodyConfig::pritzl2018() };
        scenario.source = SourceConfig::RotatingBody(body);
    }
    scenario.hunt.stop.time_s = Some(100.0);
    scenario
}

fn hunt(drones: &str, autopilot: Autopilot, vehicle: &AutopilotFaults) -> Hunted {
    let scenario = scenario(drones);
    let world = World::new(&scenario.world, 3).expect("a world");
    let count = world.drone_count();
    let faults = vec![DroneFaults { vehicle: vehicle.clone(), ..Default::default() }; count];
    let config = EmulatedFieldConfig { autopilot, faults, ..EmulatedFieldConfig::default() };
    let (mut field, mut ports) =
        EmulatedField::in_memory(&scenario, &world, &config).expect("a field");
    let mut flight = field.flight().clone();
    flight.flight = FlightRules { takeoff_up_m: 4.0, ..FlightRules::default() };
    let registry = Registry::builtin();
    let estimator = flight.estimator(&registry).expect("it is known");
    let hunt = flight.parts(&registry, estimator, 3).build().expect("a hunt");
    let goal = flight.goal(&registry).expect("a goal");
    let drones =
        flight.open(&mut ports, &world.clock(), 0.0, goal.as_ref(), None).expect("devices");
    let mut mission: Mission<Shared<BoxedAircraft>, BoxedSource> =
        Mission::new(flight.flight, hunt, drones, world.time()).expect("a flight");
    let mut hunted = Hunted {
        failure: None,
        found: 0,
        modes: Vec::new(),
        worst_up_m: 0.0,
        nearest_m: [f64::INFINITY; 2],
        seconds: 0.0,
    };
    // When goals were set last, and their heights.
    let mut sent = (0.0, Vec::new());
    while !mission.is_over() && world.time() < 1800.0 {
        world.advance(scenario.simulation.tick_s).expect("time passes");
        field.serve(|device, error| panic!("{device}: {error}"));
        mission.step(world.time());
        while let Some(event) = mission.poll_event() {
            match event {
                Event::Aircraft { drone: 0, mode, .. } if hunted.modes.last() != Some(&mode) => {
                    hunted.modes.push(mode);
                }
                Event::GoalsSet { time, goals } => {
                    sent = (time, goals.iter().map(|goal| goal.z).collect());
                }
                // Home is where each was when the hunt began.
                Event::Recalled { .. } => sent.1.clear(),
                _ => {}
            }
        }
        let places: Vec<_> =
            (0..count).map(|drone| world.pose(drone).expect("a drone").position).collect();
        let leaves = mission.stage() == FlightStage::Leaving;
        if mission.stage() == FlightStage::Hunting && world.time() - sent.0 > 5.0 {
            let off = places.iter().zip(&sent.1).map(|(at, up)| (at.z - up).abs());
            hunted.worst_up_m = off.fold(hunted.worst_up_m, f64::max);
        }
        if leaves || mission.stage() == FlightStage::Hunting {
            let nearest = &mut hunted.nearest_m[usize::from(leaves)];
            for (index, one) in places.iter().enumerate() {
                for other in places[..index].iter().filter(|other| one.z > 0.5 && other.z > 0.5) {
                    *nearest = nearest.min((one - other).norm());
                }
            }
        }
    }
    hunted.failure = mission.failure().map(str::to_owned);
    hunted.found = mission.hunt().fixes().len();
    hunted.seconds = world.time();
    assert!(mission.is_over(), "it does not end: {hunted:?}");
    hunted
}

/// A gap in both directions while hunting, of a PX4 that is set up as the checklist has it, with
/// the zero of its estimator above or below home and drifting.
fn faults(autopilot: Autopilot, gap_s: f64, reference_m: f64, drift_mps: f64) -> AutopilotFaults {
    let set_up = [("COM_OF_LOSS_T", 3.5), ("COM_OBL_RC_ACT", 3.0)];
    let px4 = autopilot == Autopilot::Px4;
    AutopilotFaults {
        silent: vec![Interval { from_s: 45.3, to_s: Some(45.3 + gap_s) }],
        reference_m,
        reference_drift_mps: drift_mps,
        parameters: set_up
            .into_iter()
            .filter(|_| px4)
            .map(|(name, value)| (name.to_owned(), value))
            .collect(),
        ..AutopilotFaults::default()
    }
}

#[expect(clippy::print_stdout, reason = "the table is read by whoever runs it")]
fn check(drones: &str, autopilot: Autopilot, gap_s: f64, reference_m: f64, drift_mps: f64) {
    let hunted = hunt(drones, autopilot, &faults(autopilot, gap_s, reference_m, drift_mps));
    println!(
        "| {drones} | {autopilot} | {gap_s} s | {reference_m:+.1} m, {drift_mps:+.2} m/s | {} | \
         {:.2} m | {:.1} m, {:.1} m | {:.0} s |",
        hunted.failure.as_deref().unwrap_or("to its end"),
        hunted.worst_up_m,
        hunted.nearest_m[0],
        hunted.nearest_m[1],
        hunted.seconds,
    );
    if gap_s <= 3.0 {
        assert_eq!(hunted.failure, None, "{drones}, {autopilot}: {hunted:?}");
        assert!(hunted.worst_up_m < 0.3, "{drones}, {autopilot}: {hunted:?}");
    }
    assert!(hunted.nearest_m.iter().all(|nearest| *nearest > 2.0), "{drones}: {hunted:?}");
}

#[test]
fn own_fences_narrow_the_airspace_and_ways_home_are_compared() {
    let scenario = scenario("three");
    let world = World::new(&scenario.world, 1).expect("a world");
    let (field, _) = EmulatedField::in_memory(&scenario, &world, &EmulatedFieldConfig::default())
        .expect("a field");
    let mut flight = field.flight().clone();
    let of = |drone: &str, home_up_m, radius_m, east_m| {
        let own_fence = OwnFence {
            centre_m: Some([east_m, 0.0]),
            radius_m: Some(radius_m),
            max_up_m: Some(20.0),
            min_up_m: Some(1.0),
            has_polygons: false,
        };
        let fence = Finding { own_fence: Some(own_fence), ..Finding::good("fence", "on") };
        let home = Finding { home_up_m: Some(home_up_m), ..Finding::good("way home", "up") };
        Examined { drone: drone.to_owned(), device: "vehicle", findings: vec![fence, home] }
    };
    flight.hunt.airspace.fence_m.clear();
    flight.hunt.airspace.altitude_m = None;
    let near = [of("alpha", 15.0, 30.0, 0.0), of("beta", 18.0, 12.0, 0.0)];
    flight.stay_inside(&near).expect("there is room");
    let airspace = &flight.hunt.airspace;
    assert_eq!(airspace.altitude_m, Some([1.0, 20.0]));
    let far = |corner: &[f64; 2]| corner[0].hypot(corner[1]);
    assert!(airspace.fence_m.len() > 30);
    assert!(airspace.fence_m.iter().all(|corner| abs_diff_eq!(far(corner), 12.0, epsilon = 0.1)));
    let ways = |examined: &[Examined]| {
        let checks = flight.checklist(&flight.drones, Some(examined));
        let ways = checks.into_iter().find(|check| check.finding.subject == "ways home");
        ways.map(|check| check.finding.text)
    };
    assert_eq!(ways(&near).as_deref(), Some("alpha and beta come home 15 and 18 m up"));
    assert_eq!(ways(&[of("alpha", 15.0, 30.0, 0.0), of("beta", 21.0, 30.0, 0.0)]), None);
    // A fence elsewhere leaves nothing.
    let error = flight.clone().stay_inside(&[of("beta", 18.0, 5.0, 90.0)]).expect_err("nothing");
    assert!(error.to_string().contains("beta"), "{error}");
}

#[test]
fn three_hunt_at_their_heights_over_a_gap_and_come_home_apart() {
    check("three", Autopilot::Px4, 3.0, 2.5, -0.02);
    check("body", Autopilot::Px4, 2.0, -2.5, 0.02);
}

#[test]
#[ignore = "36 whole hunts"]
fn hunts_over_gaps() {
    println!("| drones | autopilot | gap | reference | result | off in height | nearest | time |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for drones in ["one", "body", "three"] {
        for gap_s in [1.0, 2.0, 3.0, 10.0] {
            check(drones, Autopilot::Px4, gap_s, 2.5, 0.02);
            check(drones, Autopilot::Px4, gap_s, -2.5, -0.02);
            check(drones, Autopilot::ArduPilot, gap_s, 0.0, 0.0);
        }
    }
}
