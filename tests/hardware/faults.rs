//! Whole flights in which things go wrong, in the world's time: one at a time in a table, and many
//! at random.

use foxhunt::{
    fly::{
        BoxedAircraft, DroneFaults, EmulatedField, EmulatedFieldConfig, Ending, FlightRules,
        Mission,
    },
    hardware::Shared,
    hunt::{BoxedSource, Event, FlightStage},
    registry::Registry,
    scenario::Scenario,
    sim::{AutopilotFaults, CableFaults, Interval, PilotOrder, World},
    wire::mavlink::Autopilot,
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

/// What the last report of a drone was.
#[derive(Clone, Debug, Default)]
struct Reported {
    mode: String,
    commanded: bool,
}

/// What a flight came to.
#[derive(Debug)]
struct Flown {
    drones: Vec<Reported>,
    /// The modes of each drone, in their order.
    modes: Vec<Vec<String>>,
    /// How high each is at the end, in truth, in metres.
    up_m: Vec<f64>,
    found: usize,
    failure: Option<String>,
    seconds: f64,
    /// The nearest two drones that took our orders, over ground, in metres.
    nearest_m: f64,
    /// The farthest that one that took our orders was from the middle, East or North, in metres.
    farthest_m: f64,
}

/// Half the side of the fence, in metres.
const FENCE_M: f64 = 60.0;

/// A flight that takes longer waits for somebody, in seconds.
const LONG_S: f64 = 900.0;

/// How long failsafes have after a flight to bring down what is left, in seconds.
const AFTER_S: f64 = 120.0;

/// Flies pritzl-6.1 within a fence, broken off at a time where one is given.
fn fly(config: &EmulatedFieldConfig, rules: FlightRules, seed: u64, abort: Option<f64>) -> Flown {
    let mut scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    let f = FENCE_M;
    scenario.hunt.airspace.fence_m = vec![[-f, -f], [f, -f], [f, f], [-f, f]];
    // What is of interest is over then.
    scenario.hunt.stop.time_s = Some(100.0);
    let world = World::new(&scenario.world, seed).expect("a world");
    let (mut field, mut ports) =
        EmulatedField::in_memory(&scenario, &world, config).expect("a field");
    let mut flight = field.flight().clone();
    flight.flight = FlightRules { takeoff_up_m: flight.flight.takeoff_up_m, ..rules };
    let registry = Registry::builtin();
    let estimator = flight.estimator(&registry).expect("it is known");
    let hunt = flight.parts(&registry, estimator, seed).build().expect("a hunt");
    let drones = flight.open(&mut ports, &world.clock(), 0.0, None).expect("devices");
    let mut mission: Mission<Shared<BoxedAircraft>, BoxedSource> =
        Mission::new(flight.flight, hunt, drones, world.time()).expect("a flight");
    let count = world.drone_count();
    let mut flown = Flown {
        drones: vec![Reported::default(); count],
        modes: vec![Vec::new(); count],
        up_m: Vec::new(),
        found: 0,
        failure: None,
        seconds: 0.0,
        nearest_m: f64::INFINITY,
        farthest_m: 0.0,
    };
    let place = |drone| world.pose(drone).expect("a drone").position;
    let mut until = f64::INFINITY;
    while world.time() < until {
        world.advance(scenario.simulation.tick_s).expect("time passes");
        field.serve(|device, error| panic!("{device}: {error}"));
        if abort.is_some_and(|at| world.time() >= at) && !mission.is_over() {
            mission.abort(world.time(), "the pilot breaks off");
        }
        if !mission.is_over() {
            mission.step(world.time());
        } else if until.is_infinite() {
            (flown.seconds, until) = (world.time(), world.time() + AFTER_S);
        }
        assert!(world.time() < 3600.0, "seed {seed} does not end: {mission:?}, {flown:#?}");
        while let Some(event) = mission.poll_event() {
            if let Event::Aircraft { drone, mode, commanded, .. } = event {
                if flown.modes[drone].last() != Some(&mode) {
                    flown.modes[drone].push(mode.clone());
                }
                flown.drones[drone] = Reported { mode, commanded };
            }
        }
        let hunting = mission.stage() == FlightStage::Hunting;
        let ours: Vec<_> = (0..count)
            .filter(|drone| hunting && flown.drones[*drone].commanded)
            .map(place)
            .collect();
        for (index, one) in ours.iter().enumerate() {
            flown.farthest_m = flown.farthest_m.max(one.x.abs()).max(one.y.abs());
            for other in &ours[..index] {
                flown.nearest_m = flown.nearest_m.min((one - other).xy().norm());
            }
        }
    }
    flown.up_m = (0..count).map(|drone| place(drone).z).collect();
    flown.found = mission.hunt().fixes().len();
    flown.failure = mission.failure().map(str::to_owned);
    flown
}

fn during(from_s: f64, to_s: f64) -> Vec<Interval> {
    vec![Interval { from_s, to_s: Some(to_s) }]
}

fn pilot(orders: &[(f64, &str)]) -> DroneFaults {
    let order = |&(at_s, mode): &(f64, &str)| PilotOrder { at_s, mode: mode.into() };
    let pilot = orders.iter().map(order).collect();
    DroneFaults {
        vehicle: AutopilotFaults { pilot, ..AutopilotFaults::default() },
        ..DroneFaults::default()
    }
}

fn silent(from_s: f64, to_s: f64) -> DroneFaults {
    DroneFaults {
        vehicle: AutopilotFaults { silent: during(from_s, to_s), ..AutopilotFaults::default() },
        ..DroneFaults::default()
    }
}

/// Modes that pilots of ArduCopter choose, or of PX4.
fn modes(autopilot: Autopilot) -> &'static [&'static str] {
    match autopilot {
        Autopilot::ArduPilot => {
            &["STABILIZE", "ALT_HOLD", "LOITER", "POSHOLD", "BRAKE", "AUTO", "RTL", "LAND"]
        }
        Autopilot::Px4 => &["ALTITUDE", "POSITION", "HOLD", "MISSION", "RETURN", "LAND"],
    }
}

/// The faults of a drone, drawn at random.
fn drawn(random: &mut Xoshiro256PlusPlus, autopilot: Autopilot) -> DroneFaults {
    let mut interval = |longest: f64| {
        let from_s: f64 = random.random_range(5.0..250.0);
        during(from_s, from_s + random.random_range(0.5..longest))
    };
    let mut faults = DroneFaults::default();
    let (radio, rotator, garbage, silence) =
        (interval(30.0), interval(30.0), interval(30.0), interval(40.0));
    let mut happens = |share: f64| random.random::<f64>() < share;
    if happens(0.3) {
        faults.radio = CableFaults { pulled: radio, garbage };
    }
    if happens(0.3) {
        faults.rotator.pulled = rotator;
    }
    if happens(0.4) {
        faults.vehicle.silent = silence;
    }
    if happens(0.5) {
        let all = modes(autopilot);
        let at_s = random.random_range(5.0..250.0);
        let mode = all[random.random_range(0..all.len())].to_owned();
        faults.vehicle.pilot.push(PilotOrder { at_s, mode });
        if random.random::<f64>() < 0.4 {
            let back = if autopilot == Autopilot::Px4 { "HOLD" } else { "GUIDED" };
            let at_s = at_s + random.random_range(1.0..60.0);
            faults.vehicle.pilot.push(PilotOrder { at_s, mode: back.into() });
        }
    }
    faults
}

/// Plays flights of these seeds, holds each to what every flight must keep, and sums them up.
fn play(seeds: std::ops::Range<u64>) -> String {
    let (mut nearest_m, mut farthest_m, mut found, mut ended) = (f64::INFINITY, 0.0_f64, 0, 0);
    let flights = seeds.end - seeds.start;
    for seed in seeds {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let autopilot = if random.random() { Autopilot::ArduPilot } else { Autopilot::Px4 };
        let faults = (0..3).map(|_| drawn(&mut random, autopilot)).collect();
        let config = EmulatedFieldConfig { autopilot, faults, ..EmulatedFieldConfig::default() };
        let endings = [Ending::Return, Ending::Land];
        let rules = FlightRules {
            at_end: endings[random.random_range(0..2)],
            on_abort: endings[random.random_range(0..2)],
            ..FlightRules::default()
        };
        let aborts = random.random::<f64>() < 0.3;
        let abort = aborts.then(|| random.random_range(1.0..200.0));
        // A pilot who has the last one need not give it back: he ends the flight.
        let flown = fly(&config, rules, seed, abort.or(Some(LONG_S)));
        let shown = format!("seed {seed}: {flown:#?}\n{config:#?}\nbroken off: {abort:?}");
        let mut pilots = 0;
        for (drone, up_m) in flown.drones.iter().zip(&flown.up_m) {
            // What the pilot flies stays where he has it.
            let ours = ["GUIDED", "OFFBOARD", "TAKEOFF"].contains(&drone.mode.as_str());
            pilots += u32::from(*up_m >= 0.3);
            assert!(*up_m < 0.3 || !ours, "{shown}");
        }
        assert!(flown.seconds < LONG_S || pilots > 0, "{shown}");
        assert!(flown.farthest_m <= FENCE_M, "{shown}");
        assert!(flown.nearest_m >= 2.0, "{shown}");
        nearest_m = nearest_m.min(flown.nearest_m);
        farthest_m = farthest_m.max(flown.farthest_m);
        found += u64::from(flown.found == 2);
        ended += u64::from(flown.failure.is_none());
    }
    format!(
        "{flights} flights: nearest pair {nearest_m:.2} m (2 m kept), farthest {farthest_m:.1} m \
         (fence {FENCE_M} m), {found} with both searches done, {ended} ended as planned"
    )
}

#[test]
fn random_flights_with_random_faults_end_well() {
    println!("{}", play(1..7));
}

#[test]
#[ignore = "1000 flights take a quarter of an hour"]
fn a_thousand_random_flights() {
    println!("{}", play(1..1001));
}

/// How a flight is expected to end for the drone that something happens to.
#[derive(Clone, Copy, Debug)]
enum Expected {
    /// As if nothing had happened.
    Planned,
    /// It takes orders again, and comes down by them.
    Rejoins,
    /// It stays in the mode that its pilot has chosen.
    Pilots,
    /// It comes down by a mode that we did not order; the others go on.
    ComesDown,
    /// The flight ends, and all come down.
    AllDown,
}

impl Expected {
    fn words(self) -> &'static str {
        match self {
            Self::Planned => "all found, all down",
            Self::Rejoins => "it takes part again, all found, all down",
            Self::Pilots => "it stays the pilot's, the others are down",
            Self::ComesDown => "it comes down by itself, the others go on",
            Self::AllDown => "the flight ends, all down",
        }
    }

    /// Whether a flight ended so for its second drone.
    fn holds(self, flown: &Flown) -> bool {
        let down = |drone: usize| flown.up_m[drone] < 0.3;
        let others = down(0) && down(2);
        let planned = flown.failure.is_none() && flown.found == 2;
        match self {
            Self::Planned | Self::Rejoins => planned && others && down(1),
            Self::Pilots => others && !down(1) && !flown.drones[1].commanded,
            Self::ComesDown => others && down(1) && flown.found == 2,
            Self::AllDown => others && down(1) && flown.failure.is_some(),
        }
    }
}

/// Everything of the table with one autopilot: what happens to the second drone, to all where
/// `all`, when the flight is broken off, and how it ends.
struct Row {
    what: String,
    faults: DroneFaults,
    all: bool,
    abort: Option<f64>,
    expected: Expected,
}

fn rows(autopilot: Autopilot) -> Vec<Row> {
    let px4 = autopilot == Autopilot::Px4;
    let mut rows = Vec::new();
    let mut row = |what: &str, faults: DroneFaults, expected| {
        rows.push(Row { what: what.to_owned(), faults, all: false, abort: None, expected });
    };
    row("nothing", DroneFaults::default(), Expected::Planned);
    for mode in modes(autopilot) {
        let down = ["RTL", "LAND", "RETURN"].contains(mode);
        let expected = if down { Expected::ComesDown } else { Expected::Pilots };
        row(&format!("the pilot takes it in {mode}, hunting"), pilot(&[(40.0, mode)]), expected);
    }
    let (by_hand, back) = if px4 { ("POSITION", "HOLD") } else { ("LOITER", "GUIDED") };
    // PX4 gives set-points back in HOLD, which `fly` does not take by itself.
    let again = if px4 { Expected::Pilots } else { Expected::Rejoins };
    row(
        &format!("the pilot takes it in {by_hand}, and gives it back in {back}"),
        pilot(&[(40.0, by_hand), (50.0, back)]),
        again,
    );
    row("the pilot takes it while it climbs", pilot(&[(7.0, by_hand)]), Expected::Pilots);
    row(
        "the link is lost for 3 s, hunting",
        silent(40.0, 43.0),
        match px4 {
            true => Expected::Pilots,
            false => Expected::Planned,
        },
    );
    let lost = if px4 { Expected::Pilots } else { Expected::ComesDown };
    row("the link is lost for 30 s, hunting: failsafe", silent(40.0, 70.0), lost);
    row("the link is lost for good, hunting: failsafe", silent(40.0, 9999.0), lost);
    let cable = |radio, rotator| DroneFaults {
        radio: CableFaults { pulled: radio, garbage: Vec::new() },
        rotator: CableFaults { pulled: rotator, garbage: Vec::new() },
        ..DroneFaults::default()
    };
    row(
        "the radio's cable is pulled for 30 s",
        cable(during(40.0, 70.0), vec![]),
        Expected::Planned,
    );
    row(
        "the motor's cable is pulled for 30 s",
        cable(vec![], during(40.0, 70.0)),
        Expected::Planned,
    );
    for (phase, at) in [("climbing", 7.0), ("hunting", 60.0)] {
        rows.push(Row {
            what: format!("the pilot breaks off, {phase}"),
            faults: DroneFaults::default(),
            all: false,
            abort: Some(at),
            expected: Expected::AllDown,
        });
    }
    if !px4 {
        rows.push(Row {
            what: "all links are lost for good, hunting: failsafe".into(),
            faults: silent(40.0, 9999.0),
            all: true,
            abort: None,
            expected: Expected::AllDown,
        });
    }
    rows
}

/// Prints what happened in each case beside what is expected:
/// `cargo test --test hardware -- --ignored table --nocapture`.
#[test]
#[ignore = "a table of flights, which takes minutes"]
fn table() {
    let mut wrong = Vec::new();
    println!("| autopilot | what happens | expected | happened | as expected |");
    println!("| --- | --- | --- | --- | --- |");
    for autopilot in [Autopilot::ArduPilot, Autopilot::Px4] {
        for Row { what, faults, all, abort, expected } in rows(autopilot) {
            let first = if all { faults.clone() } else { DroneFaults::default() };
            let faults = vec![first.clone(), faults, first];
            let config =
                EmulatedFieldConfig { autopilot, faults, ..EmulatedFieldConfig::default() };
            let rules = FlightRules { leaving_timeout_s: 90.0, ..FlightRules::default() };
            let flown = fly(&config, rules, 1, abort);
            let holds = expected.holds(&flown);
            let ends = flown.failure.as_deref().unwrap_or("as planned");
            println!(
                "| {autopilot} | {what} | {} | {}; {:.1} m up; {} found; {:.0} s; {ends} | {} |",
                expected.words(),
                flown.modes[1].join(", "),
                flown.up_m[1],
                flown.found,
                flown.seconds,
                if holds { "yes" } else { "NO" }
            );
            if !holds {
                wrong.push(format!("{autopilot}, {what}: {flown:#?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
