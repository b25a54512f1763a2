//! Whole hunts on emulated autopilots whose heights count from a reference of their own, with gaps
//! of their links, in the world's time.

use foxhunt::{
    config::SourceConfig,
    fly::{BoxedAircraft, DroneFaults, EmulatedField, EmulatedFieldConfig, FlightRules, Mission},
    hardware::Shared,
    hunt::{BoxedSource, Event, FlightStage},
    registry::Registry,
    scenario::Scenario,
    sensors::BodyConfig,
    sim::{AutopilotFaults, Interval, World},
    wire::mavlink::Autopilot,
};

/// What became of a hunt.
#[derive(Debug)]
struct Hunted {
    failure: Option<String>,
    found: usize,
    /// Modes of the first drone while hunting.
    modes: Vec<String>,
    /// The worst difference of a drone's height from 4 m in the second half of its hunt, in metres.
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
    let mut begun = None;
    let mut leaving = 0.0;
    while !mission.is_over() && world.time() < 1800.0 {
        world.advance(scenario.simulation.tick_s).expect("time passes");
        field.serve(|device, error| panic!("{device}: {error}"));
        mission.step(world.time());
        while let Some(event) = mission.poll_event() {
            if let Event::Aircraft { drone: 0, mode, .. } = event
                && hunted.modes.last() != Some(&mode)
            {
                hunted.modes.push(mode);
            }
        }
        let places: Vec<_> =
            (0..count).map(|drone| world.pose(drone).expect("a drone").position).collect();
        let leaves = mission.stage() == FlightStage::Leaving;
        if mission.stage() == FlightStage::Hunting {
            let begun = *begun.get_or_insert(world.time());
            if world.time() - begun > 10.0 {
                let off = places.iter().map(|at| (at.z - 4.0).abs());
                hunted.worst_up_m = off.fold(hunted.worst_up_m, f64::max);
            }
        } else if leaves && leaving < 1.0 {
            leaving = world.time();
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

/// A gap in both directions while hunting, of a PX4 that is set up as the checklist has it, with the
/// zero of its estimator above or below home and drifting.
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
fn three_hunt_at_their_heights_over_a_gap_and_come_home_apart() {
    check("three", Autopilot::Px4, 3.0, 2.5, -0.02);
    check("body", Autopilot::Px4, 2.0, -2.5, 0.02);
}

#[test]
#[ignore = "two dozen whole hunts"]
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
