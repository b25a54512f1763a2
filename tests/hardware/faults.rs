//! Whole flights in which things go wrong, in the world's time: one at a time in a table, and many
//! at random.

use foxhunt::{
    fly::{
        DroneFaults, EmulatedFieldConfig, EmulatedFlight, EmulatedFlown, FlightRules, pilot_modes,
    },
    registry::Registry,
    sim::{AutopilotFaults, CableFaults, Interval, PilotOrder},
    wire::mavlink::Autopilot,
};

/// Flies it, broken off at a time where one is given.
fn fly(
    config: &EmulatedFieldConfig,
    rules: FlightRules,
    seed: u64,
    abort_s: Option<f64>,
) -> EmulatedFlown {
    let flight = EmulatedFlight { field: config.clone(), rules, seed, abort_s };
    flight.fly(&Registry::builtin()).unwrap_or_else(|error| panic!("{error}: {flight:#?}"))
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

/// Plays flights of these seeds, holds each to what every flight must keep, and sums them up.
fn play(seeds: std::ops::Range<u64>) -> String {
    let mut nearest_m = f64::INFINITY;
    let mut farthest_m = 0.0_f64;
    let mut found = 0;
    let mut ended = 0;
    let flights = seeds.end - seeds.start;
    let registry = Registry::builtin();
    for seed in seeds {
        let flight = EmulatedFlight::draw(seed);
        let flown = flight.fly(&registry).unwrap_or_else(|error| panic!("{error}: {flight:#?}"));
        let violations = flown.violations();
        assert!(violations.is_empty(), "{violations:?}\n{flown:#?}\n{flight:#?}");
        nearest_m = nearest_m.min(flown.nearest_m);
        farthest_m = farthest_m.max(flown.farthest_m);
        found += u64::from(flown.found == 2);
        ended += u64::from(flown.failure.is_none());
    }
    format!(
        "{flights} flights: nearest pair {nearest_m:.2} m (2 m kept), farthest {farthest_m:.1} m \
         (fence {} m), {found} with both searches done, {ended} ended as planned",
        EmulatedFlight::FENCE_M
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

/// Expected end of a flight for the drone that something happens to.
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

    /// Returns true if a flight ended so for its second drone.
    fn holds(self, flown: &EmulatedFlown) -> bool {
        let down = |drone: usize| flown.up_m[drone] < 0.3;
        let others = down(0) && down(2);
        let planned = flown.failure.is_none() && flown.found == 2;
        match self {
            Self::Planned | Self::Rejoins => planned && others && down(1),
            Self::Pilots => others && !down(1) && !flown.drones[1].is_commanded,
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
    for mode in pilot_modes(autopilot) {
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
                flown.duration_s,
                if holds { "yes" } else { "NO" }
            );
            if !holds {
                wrong.push(format!("{autopilot}, {what}: {flown:#?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
