//! A whole hunt through the wire protocols: radios and motors on pseudo-terminals, autopilots on
//! UDP.

use std::{fs, path::PathBuf, thread, time::Duration};

use foxhunt::{
    config::SourceConfig,
    core::Estimate,
    fly::{
        BoxedAircraft, DroneFaults, EmulatedField, EmulatedFieldConfig, Ending, FlightConfig,
        Mission, SystemPorts,
    },
    hardware::Shared,
    hunt::{BoxedSource, Event, Fix, FlightStage},
    registry::Registry,
    scenario::Scenario,
    sensors::BodyConfig,
    sim::{AutopilotFaults, CableFaults, Interval, World},
    simulation::Setup,
};

/// pritzl-6.1, its third drone turning its body.
fn scenario() -> Scenario {
    let mut scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    let stepper = scenario.source.clone();
    let body = SourceConfig::RotatingBody(BodyConfig {
        // A question and its answer take several looks at the devices.
        answer_timeout_s: 0.2,
        ..BodyConfig::pritzl2018()
    });
    scenario.sources = vec![stepper.clone(), stepper, body];
    scenario
}

/// A folder of this test's own for the links to the pseudo-terminals.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("foxhunt-{name}-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("there is room");
    folder
}

struct Flown {
    events: Vec<Event>,
    fixes: Vec<Fix>,
    failure: Option<String>,
    seconds: f64,
}

/// Flies the scenario on emulated devices. Time is the world's; the short sleep lets the kernel
/// hand on what was written to the pseudo-terminals.
fn fly(scenario: &Scenario, seed: u64, faults: Vec<DroneFaults>, name: &str) -> Flown {
    let world = World::new(&scenario.world, seed).expect("a world");
    let config = EmulatedFieldConfig { faults, ..EmulatedFieldConfig::default() };
    let folder = folder(name);
    let mut field = EmulatedField::new(scenario, &world, &config, &folder).expect("ports");
    // As a user would have it: from a file.
    let text = toml::to_string(field.flight()).expect("it can be written");
    let mut flight = FlightConfig::parse(&text, "emulated.toml").expect("it can be read");
    flight.flight.at_end = Ending::Land;
    let registry = Registry::builtin();
    let estimator = flight.estimator(&registry).expect("it is known");
    let hunt = flight.parts(&registry, estimator, seed).build().expect("a hunt");
    let drones = flight
        .open(&mut SystemPorts::new(world.clock()), &world.clock(), 0.0, None, None)
        .expect("devices");
    let mut mission: Mission<Shared<BoxedAircraft>, BoxedSource> =
        Mission::new(flight.flight, hunt, drones, world.time()).expect("a flight");
    let mut events = Vec::new();
    while !mission.is_over() && world.time() < 7200.0 {
        world.advance(scenario.simulation.tick_s).expect("time passes");
        // A port may be away for a while; the flight sees that for itself.
        field.serve(|_, _| ());
        mission.step(world.time());
        while let Some(event) = mission.poll_event() {
            events.push(event);
        }
        thread::sleep(Duration::from_micros(30));
    }
    fs::remove_dir_all(&folder).expect("it is ours");
    Flown {
        events,
        fixes: mission.hunt().fixes().to_vec(),
        failure: mission.failure().map(str::to_owned),
        seconds: world.time(),
    }
}

fn stages(flown: &Flown) -> Vec<FlightStage> {
    let stage = |event: &Event| match event {
        Event::FlightStage { stage, .. } => Some(*stage),
        _ => None,
    };
    flown.events.iter().filter_map(stage).collect()
}

/// The squared Mahalanobis distance of an estimate to a place, and the distance in metres.
fn off(estimate: &Estimate<2>, truth: nalgebra::Vector2<f64>) -> (f64, f64) {
    let error = estimate.mean - truth;
    (estimate.nees(&truth).expect("a proper covariance"), error.norm())
}

fn truths(scenario: &Scenario) -> Vec<nalgebra::Vector2<f64>> {
    let place = |b: &foxhunt::sim::BeaconConfig| nalgebra::Vector2::new(b.east_m, b.north_m);
    scenario.world.beacons.iter().map(place).collect()
}

#[test]
fn a_hunt_through_wires_finds_what_the_simulation_finds() {
    let scenario = scenario();
    let registry = Registry::builtin();
    let estimator = registry.estimator(&scenario.estimator).expect("it is known");
    let setup = Setup { scenario: &scenario, estimator, registry: &registry };
    let direct = setup.simulate(1, |_| Ok::<_, std::io::Error>(()));
    let direct = direct.expect("it flies");
    let flown = fly(&scenario, 1, Vec::new(), "flown");
    use FlightStage::{Climbing, Hunting, Leaving, Over, Preparing};
    assert_eq!(stages(&flown), [Preparing, Climbing, Hunting, Leaving, Over]);
    assert_eq!(flown.failure, None);
    assert_eq!(flown.fixes.len(), 2);
    for (fix, truth) in flown.fixes.iter().zip(truths(&scenario)) {
        let found = direct.found.iter().find(|found| found.fix.beacon == fix.beacon);
        let found = found.expect("the simulation found it");
        let (nees, error) = off(&fix.estimate, truth);
        let between = (fix.estimate.mean - found.fix.estimate.mean).norm();
        println!(
            "{}: {error:.2} m off (NEES {nees:.2}), direct {:.2} m; {between:.2} m apart; {} and \
             {} steps; {:.0} s and {:.0} s",
            fix.name,
            found.error_m(),
            fix.steps,
            found.fix.steps,
            flown.seconds,
            direct.duration_s
        );
        // χ² of two degrees of freedom: 1 in 10 000 is above 18.4.
        assert!(nees < 18.4, "{}: NEES {nees:.1}", fix.name);
        // Both have the same patterns, drawn from one seed, but not the same places: what is apart
        // is below both ellipses.
        assert!(off(&fix.estimate, found.fix.estimate.mean).0 < 9.2, "{between:.2} m apart");
    }
}

#[test]
fn a_hunt_survives_its_faults() {
    let mut scenario = scenario();
    // Nothing is received for a while: the beacon is silent.
    for drone in &mut scenario.world.drones {
        drone.silent = vec![Interval { from_s: 150.0, to_s: Some(190.0) }];
    }
    let during = |from_s, to_s| vec![Interval { from_s, to_s: Some(to_s) }];
    let faults = vec![
        DroneFaults {
            radio: CableFaults { pulled: during(60.0, 75.0), garbage: during(100.0, 130.0) },
            ..DroneFaults::default()
        },
        DroneFaults {
            rotator: CableFaults { pulled: during(90.0, 100.0), garbage: Vec::new() },
            ..DroneFaults::default()
        },
        DroneFaults {
            vehicle: AutopilotFaults { silent: during(80.0, 95.0), ..AutopilotFaults::default() },
            ..DroneFaults::default()
        },
    ];
    let flown = fly(&scenario, 2, faults, "faults");
    assert_eq!((flown.fixes.len(), &flown.failure), (2, &None));
    use FlightStage::{Climbing, Hunting, Leaving, Over, Preparing};
    assert_eq!(stages(&flown), [Preparing, Climbing, Hunting, Leaving, Over]);
    let failed = |drone: usize, within: std::ops::Range<f64>, words: &str| {
        flown.events.iter().any(|event| match event {
            Event::DeviceFailed { time, drone: Some(of), reason } => {
                *of == drone && within.contains(time) && reason.contains(words)
            }
            _ => false,
        })
    };
    assert!(failed(0, 60.0..75.0, "the radio failed"), "the pulled cable of the radio");
    assert!(failed(1, 90.0..100.0, "the rotator failed"), "the pulled cable of the motor");
    assert!(failed(2, 80.0..95.0, "nothing of an autopilot"), "the autopilot that fell silent");
    for (fix, truth) in flown.fixes.iter().zip(truths(&scenario)) {
        let (nees, error) = off(&fix.estimate, truth);
        println!("{}: {error:.2} m off, NEES {nees:.2}, {} steps", fix.name, fix.steps);
        assert!(nees < 18.4, "{}: NEES {nees:.1}, {error:.2} m", fix.name);
    }
}

#[test]
fn an_emulated_field_knows_its_site() {
    let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    let world = World::new(&scenario.world, 1).expect("a world");
    let folder = folder("site");
    let mut config = EmulatedFieldConfig::default();
    config.site.lat_deg = 91.0;
    let error = EmulatedField::new(&scenario, &world, &config, &folder).expect_err("no such place");
    assert!(error.to_string().contains("91"), "{error}");
    fs::remove_dir_all(&folder).expect("it is ours");
}
