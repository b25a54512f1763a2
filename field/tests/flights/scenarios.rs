//! Scenarios with their expected ends, for both firmwares.

use foxhunt_wire::mavlink::Autopilot::{self, ArduPilot, Px4};

use super::{
    drawn::{Drawn, What},
    flight::{Flown, fly},
};

/// Expected end of a flight for its first drone.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Expected {
    /// It is brought down by our order.
    Home,
    /// It is on the ground, whoever has brought it there.
    Down,
    /// It stays on the ground, and the flight says what that waits for.
    Stays,
    /// It is up in a mode of somebody else, who is named.
    Left(&'static str),
}

impl Expected {
    fn holds(self, flown: &Flown) -> bool {
        let (mode, up_m) = &flown.ends[0];
        flown.wrong.is_empty()
            && match self {
                Self::Home | Self::Down => *up_m < 0.3,
                Self::Stays => *up_m < 0.3 && flown.words.contains("it stays down until"),
                Self::Left(named) => mode == named && flown.words.contains("drone-1 is left to"),
            }
    }
}

struct Row {
    what: &'static str,
    autopilot: Autopilot,
    happenings: Vec<(f64, What)>,
    /// The last second by which the flight is over.
    over_s: f64,
    expected: Expected,
}

/// Numbers of the modes that a pilot takes it in.
const BY_HAND: What = What::Takes(0);
const HOLD: What = What::Takes(1);

fn rows() -> Vec<Row> {
    let row = |what, autopilot, happenings: &[(f64, What)], over_s, expected| Row {
        what,
        autopilot,
        happenings: happenings.to_vec(),
        over_s,
        expected,
    };
    let mut rows = Vec::new();
    for autopilot in [ArduPilot, Px4] {
        let hand = if autopilot == Px4 { "POSITION" } else { "LOITER" };
        let left = Expected::Left(hand);
        let mut both = |what, happenings: &[(f64, What)], over_s, expected| {
            rows.push(row(what, autopilot, happenings, over_s, expected));
        };
        both("nothing happens", &[], 130.0, Expected::Home);
        both("it is broken off", &[(40.0, What::BreaksOff)], 90.0, Expected::Home);
        both(
            "one way only, broken off, and the pilot takes it",
            &[(35.0, What::Unheard(400)), (36.0, What::BreaksOff), (37.0, BY_HAND)],
            90.0,
            left,
        );
        both(
            "nothing is heard, broken off, and the pilot takes it",
            &[(35.0, What::Silent(80)), (37.0, What::BreaksOff), (36.5, BY_HAND)],
            60.0,
            left,
        );
        both("taken while it leaves", &[(40.0, What::BreaksOff), (42.0, BY_HAND)], 50.0, left);
        both(
            "another station sends velocities, broken off",
            &[(30.0, What::Velocities(120)), (41.0, What::BreaksOff)],
            120.0,
            if autopilot == Px4 { left } else { Expected::Down },
        );
        both(
            "its failsafe lands it in the climb, in a silence",
            &[(7.0, What::Silent(90)), (7.2, What::Failsafe(1))],
            200.0,
            Expected::Stays,
        );
        both(
            "its motors are run by another station before it takes off",
            &[(3.0, What::Motors(60))],
            200.0,
            Expected::Stays,
        );
        both(
            "it stays down, and is cleared",
            &[(2.0, What::Motors(60)), (20.0, What::Word), (60.0, What::BreaksOff)],
            120.0,
            Expected::Home,
        );
        both(
            "nothing is heard for 2.7 s in the climb",
            &[(6.0, What::Silent(27))],
            130.0,
            Expected::Home,
        );
        both(
            "its messages are lost from the climb on, for 21 s",
            &[(7.6, What::Unheard(213))],
            130.0,
            Expected::Home,
        );
        both(
            "its autopilot starts again on the ground",
            &[(4.0, What::Restarts)],
            200.0,
            Expected::Down,
        );
    }
    for (what, happenings) in [
        (
            "HOLD at the moment in which a silence begins and OFFBOARD is ordered",
            vec![(12.2, HOLD), (12.2, What::Silent(157))],
        ),
        (
            "its pilot returns it, and a failsafe stops that",
            vec![(50.0, What::Takes(4)), (60.0, What::Failsafe(2))],
        ),
        (
            "a failsafe holds it in the climb, and in a silence its pilot flies it and holds it",
            vec![
                (5.3, What::Failsafe(2)),
                (46.1, What::Silent(240)),
                (46.1, What::Takes(2)),
                (60.1, What::GivesBack),
            ],
        ),
        ("HOLD before a heartbeat has shown OFFBOARD", vec![(11.6, HOLD)]),
        ("HOLD before a heartbeat has shown the climb", vec![(6.4, HOLD)]),
        ("HOLD in the climb", vec![(7.5, HOLD)]),
        ("POSITION, then HOLD in the climb", vec![(7.2, BY_HAND), (7.6, HOLD)]),
        ("HOLD while it hunts", vec![(30.0, HOLD)]),
        (
            "HOLD in a silence, broken off",
            vec![(30.0, What::Silent(60)), (32.0, HOLD), (33.0, What::BreaksOff)],
        ),
    ] {
        rows.push(row(what, Px4, &happenings, 200.0, Expected::Left("HOLD")));
    }
    rows.push(row(
        "a failsafe holds it, broken off",
        Px4,
        &[(30.0, What::Failsafe(2)), (35.0, What::BreaksOff)],
        120.0,
        Expected::Home,
    ));
    rows.push(row(
        "taken and given back while it leaves, beside one that returns",
        ArduPilot,
        &[(40.0, What::BreaksOff), (41.5, BY_HAND), (43.0, What::GivesBack)],
        120.0,
        Expected::Home,
    ));
    rows
}

/// Prints each scenario with what was expected and what happened.
#[test]
fn scenarios_end_as_expected() {
    let mut wrong = Vec::new();
    println!("| autopilot | what happens | expected | happened |");
    println!("| --- | --- | --- | --- |");
    for Row { what, autopilot, happenings, over_s, expected } in rows() {
        let drones = if what.contains("beside") { 2 } else { 1 };
        let flown = fly(&Drawn::of(autopilot, drones, &happenings));
        let (mode, up_m) = &flown.ends[0];
        let words = &flown.words;
        let over = flown.over_s;
        println!(
            "| {autopilot} | {what} | {expected:?} by {over_s} s | {mode}, {up_m:.1} m up; \
             {words}; {over:.0} s |"
        );
        if !expected.holds(&flown) || flown.over_s > over_s {
            wrong.push(format!("{autopilot}, {what}: {expected:?} by {over_s} s: {flown:#?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The hunt has flown them home and landed them: they are not sent up again to come home.
#[test]
fn drones_that_the_hunt_has_landed_are_left_to_land() {
    for autopilot in [ArduPilot, Px4] {
        for drones in [1, 3] {
            let drawn = Drawn { flies_home: true, ..Drawn::of(autopilot, drones, &[]) };
            let flown = fly(&drawn);
            assert!(flown.wrong.is_empty() && flown.words == "as planned", "{flown:#?}");
            assert!(flown.ends.iter().all(|(_, up_m)| *up_m < 0.3), "{flown:#?}");
            assert_eq!(flown.returning, 0, "{autopilot}: {flown:#?}");
        }
    }
}

/// Each holds its place until the one before is down, also while the order to return waits for a
/// heartbeat and its effect for the next one.
#[test]
fn drones_return_one_after_the_other() {
    for autopilot in [ArduPilot, Px4] {
        for tenths in 0..10 {
            let at_s = 40.0 + 0.1 * f64::from(tenths);
            let flown = fly(&Drawn::of(autopilot, 3, &[(at_s, What::BreaksOff)]));
            assert!(flown.wrong.is_empty() && flown.ends.iter().all(|(_, up_m)| *up_m < 0.3));
            assert_eq!(flown.returning, 1, "{autopilot}, {at_s:.1} s: {flown:#?}");
        }
    }
}
