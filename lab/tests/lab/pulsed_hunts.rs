//! Three drones search for a tag that pulses.

use foxhunt_hunt::{registry::Registry, scenario::Scenario};
use foxhunt_lab::campaign::{Repetition, campaign};

/// σ in degrees that turns go on for.
const SIGMA_DEG: f64 = 9.0;

/// The turns that a drone receives between two decisions.
#[derive(Clone, Copy)]
enum Turns {
    /// Rounds of eight positions until the bearing has this σ in degrees.
    Until(f64),
    /// One round of this many positions, whose pulses are taken one by one.
    ByPulse(u16),
}

/// `vhf-tag` with a tag of another interval, its E/N0 at the mean level where the hunt begins.
fn tag(interval_s: f64, e_n0_db: f64, turns: Turns) -> Scenario {
    let mut scenario = Scenario::find("vhf-tag").expect("built in");
    let pulses = scenario.world.beacons[0].pulses.as_mut().expect("it pulses");
    pulses.interval_s = interval_s;
    // −30 dBm at 1 m, exponent 2.6, 39 m: −71.4 dBm. A pulse is detected from 13 dB on.
    let noise_dbm = -71.4 - e_n0_db;
    let floor_dbm = noise_dbm + 13.0;
    scenario.world.channel.noise_dbm = Some(noise_dbm);
    scenario.world.channel.floor_dbm = Some(floor_dbm);
    let positions = match turns {
        Turns::Until(_) => 8,
        Turns::ByPulse(positions) => positions,
    };
    let timeout = 1.25 * interval_s;
    let first = 2.5 * interval_s;
    let source = format!(
        "kind = \"stepper\"\npositions = {positions}\nsamples_per_position = 1\n\
         position_timeout = {timeout}\nfirst_timeout = {first}\nfloor_dbm = {floor_dbm}"
    );
    scenario.source = toml::from_str(&source).expect("a source");
    scenario.hunt.turn_timeout_s = 300.0;
    match turns {
        Turns::Until(sigma_deg) => {
            let goal = format!("bearing_sigma_deg = {sigma_deg}\nlongest_s = 120.0");
            scenario.turns = Some(toml::from_str(&goal).expect("a goal"));
        }
        Turns::ByPulse(_) => "pulses".clone_into(&mut scenario.estimator),
    }
    scenario
}

/// The results of hunts with seeds from 1.
#[derive(Debug, Default)]
struct Hunts {
    /// The seconds to 3 m in order, infinite where a hunt never got there.
    seconds: Vec<f64>,
    /// The errors at the end in order, in metres.
    errors_m: Vec<f64>,
    /// The mean NEES, 2 where consistent.
    anees: f64,
}

impl Hunts {
    fn fly(scenario: &Scenario, runs: u16) -> Self {
        let registry = Registry::builtin();
        let estimator = registry.estimator(&scenario.estimator).expect("it has a name").clone();
        let mut hunts = Self::default();
        for seed in 1..=runs {
            let repetition = Repetition { runs: 1, seed: seed.into(), jobs: 1, progress: &|| () };
            let estimators = std::slice::from_ref(&estimator);
            let report = campaign(&registry, scenario, estimators, &repetition).expect("in order");
            let beacon = &report.estimators[0].beacons[0];
            let first = beacon.time_to_3m_s.as_ref().and_then(|passage| passage.p50);
            hunts.seconds.push(first.unwrap_or(f64::INFINITY));
            hunts.errors_m.extend(beacon.error_m.as_ref().map(|error| error.p50));
            hunts.anees += beacon.anees.expect("a covariance") / f64::from(runs);
        }
        hunts.seconds.sort_by(f64::total_cmp);
        hunts.errors_m.sort_by(f64::total_cmp);
        hunts
    }

    fn median_error_m(&self) -> f64 {
        let count = self.errors_m.len();
        0.5 * (self.errors_m[(count - 1) / 2] + self.errors_m[count / 2])
    }

    /// The median, and the order statistics that hold it with 88 %: of twenty the seventh and the
    /// fourteenth (David & Nagaraja 2003, section 7.1); of fewer the first and the last, with more.
    fn median(&self) -> [f64; 3] {
        let count = self.seconds.len();
        let from = if count < 20 { 0 } else { 6 };
        let middle = 0.5 * (self.seconds[(count - 1) / 2] + self.seconds[count / 2]);
        [middle, self.seconds[from], self.seconds[count - 1 - from]]
    }
}

/// Six hunts each, seeds from 1. The time follows the interval, turns being most of it: by no more
/// than the interval does. The sum of twelve NEES has 24 degrees of freedom; their mean is from
/// 0.63 to 4.46 (99.9 %).
#[test]
fn a_slow_tag_takes_longer_to_find() {
    let [quick, slow] = [0.65, 2.6]
        .map(|interval_s| Hunts::fly(&tag(interval_s, 35.0, Turns::Until(SIGMA_DEG)), 6));
    let ratio = slow.median()[0] / quick.median()[0];
    assert!((1.5..4.0).contains(&ratio), "{:?} and {:?}", quick.seconds, slow.seconds);
    let anees = 0.5 * (quick.anees + slow.anees);
    assert!((0.63..4.46).contains(&anees), "ANEES {anees}");
    for hunts in [quick, slow] {
        assert!(hunts.median_error_m() < 2.0, "{:?}", hunts.errors_m);
    }
}

/// Four hunts whose drones decide after five pulses each, taken one by one, seeds from 1: less time
/// than turns for a bearing take. The sum of four NEES has 8 degrees of freedom; their mean is
/// from 0.21 to 6.53 (99.8 %).
#[test]
fn pulses_taken_one_by_one_need_no_turns() {
    let by_pulse = Hunts::fly(&tag(2.6, 35.0, Turns::ByPulse(5)), 4);
    let by_turn = Hunts::fly(&tag(2.6, 35.0, Turns::Until(SIGMA_DEG)), 4);
    let [sooner, later] = [&by_pulse, &by_turn].map(|hunts| hunts.median()[0]);
    assert!(sooner < 0.9 * later, "{:?} and {:?}", by_pulse.seconds, by_turn.seconds);
    assert!((0.21..6.53).contains(&by_pulse.anees), "ANEES {}", by_pulse.anees);
    assert!(by_pulse.median_error_m() < 2.0, "{:?}", by_pulse.errors_m);
}

/// The table in docs/tags.md: 20 hunts a cell, seeds from 1.
#[test]
#[ignore = "a table"]
fn table_of_hunts() {
    print_table(Turns::Until(SIGMA_DEG));
}

/// The table of hunts by single pulses, five to a decision.
#[test]
#[ignore = "a table"]
fn table_of_hunts_by_pulse() {
    print_table(Turns::ByPulse(5));
}

#[expect(clippy::print_stdout, reason = "a table to look at")]
fn print_table(turns: Turns) {
    std::thread::scope(|scope| {
        for e_n0_db in [35.0, 25.0, 17.0] {
            scope.spawn(move || {
                for interval_s in [0.65, 1.3, 2.6] {
                    let hunts = Hunts::fly(&tag(interval_s, e_n0_db, turns), 20);
                    let [median, from, to] = hunts.median();
                    println!(
                        "{e_n0_db} dB, {interval_s} s: {median:.0} s ({from:.0} to {to:.0}), error \
                         {:.2} m, ANEES {:.2}",
                        hunts.median_error_m(),
                        hunts.anees
                    );
                }
            });
        }
    });
}
