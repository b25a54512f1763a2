//! The names that logs hold: as they are written, and as older logs have them.

use foxhunt_core::{Outcome, Stage};
use foxhunt_formation::{Duty, MovedReason, OrderReason, Phase, Travel};
use serde::{Serialize, de::DeserializeOwned};

fn is_written<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(value: T, text: &str) {
    assert_eq!(serde_json::to_string(&value).expect("plain data"), text);
    assert_eq!(serde_json::from_str::<T>(text).expect("as written"), value);
}

#[test]
fn names_in_logs_stay() {
    for (duty, text) in [
        (Duty::Formation, r#""formation""#),
        (Duty::Still, r#""still""#),
        (Duty::Silent, r#""silent""#),
        (Duty::Lost, r#""lost""#),
        (Duty::Away, r#""away""#),
        (Duty::Returning, r#""returning""#),
        (Duty::Landed, r#""landed""#),
    ] {
        is_written(duty, text);
    }
    for (reason, text) in [
        (MovedReason::Airspace, r#""airspace""#),
        (MovedReason::Altitude, r#""altitude""#),
        (MovedReason::Drone, r#""drone""#),
        (MovedReason::Separation, r#""separation""#),
        (MovedReason::Void, r#""void""#),
        (MovedReason::NoPlace, r#""no_place""#),
    ] {
        is_written(reason, text);
    }
    for (reason, text) in [
        (OrderReason::Straight, r#""straight""#),
        (OrderReason::Around, r#""around""#),
        (OrderReason::Corner, r#""corner""#),
        (OrderReason::Stop, r#""stop""#),
        (OrderReason::Return, r#""return""#),
        (OrderReason::Exchanged { with: 2 }, r#"{"exchanged":{"with":2}}"#),
        (OrderReason::Aside, r#""aside""#),
    ] {
        is_written(reason, text);
    }
    is_written(Travel::UnderWay, r#""under_way""#);
    is_written(Phase::Idle, r#"{"name":"idle"}"#);
    is_written(Phase::Start, r#"{"name":"start"}"#);
    let moving = r#"{"name":"moving","detail":"searching"}"#;
    is_written(Phase::Moving(Stage::Searching), moving);
    let measuring = r#"{"name":"measuring","detail":"finishing"}"#;
    is_written(Phase::Measuring(Stage::Finishing), measuring);
    let finished = r#"{"name":"finished","detail":"no_signal"}"#;
    is_written(Phase::Finished(Outcome::NoSignal), finished);
    let before = r#"{"name":"finished","detail":"nothing_heard"}"#;
    let phase = serde_json::from_str::<Phase>(before).expect("of an older log");
    assert_eq!(phase, Phase::Finished(Outcome::NoSignal));
}
