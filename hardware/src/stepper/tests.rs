use std::{cell::Cell, f64::consts::TAU, rc::Rc};

use foxhunt_core::Rotator;
use foxhunt_wire::{
    ByteStream,
    firmata::{Decoder, Message, Reply, Request, StepperRequest},
    memory_pair,
};
use proptest::prelude::*;

use super::{Approach, FirmataConfig, FirmataStepper, Homing};

#[test]
fn a_file_holds_what_differs_and_nothing_unknown() {
    let text = r#"{ "homing": { "kind": "switch", "pin": 2, "at_deg": -90.0 },
        "approach": "compensated", "cable_turns": 0.75 }"#;
    let config: FirmataConfig = serde_json::from_str(text).expect("it is in order");
    let homing = Homing::Switch { pin: 2, at_deg: -90.0 };
    let approach = Approach::Compensated;
    let expected =
        FirmataConfig { homing, approach, cable_turns: 0.75, ..FirmataConfig::default() };
    assert_eq!(config, expected);
    config.check().expect("it can be so");
    let written = serde_json::to_string(&config).expect("it is written");
    assert_eq!(serde_json::from_str::<FirmataConfig>(&written).expect("and read"), config);
    let unknown = serde_json::from_str::<FirmataConfig>(r#"{ "cable_deg": 3 }"#);
    assert!(unknown.expect_err("there is no such field").to_string().contains("cable_deg"));
}

#[test]
fn what_cannot_be_is_named_with_its_value() {
    let good = FirmataConfig::default;
    good().check().expect("the default can be so");
    let switch = |pin| Homing::Switch { pin, at_deg: 0.0 };
    let wrong = [
        (FirmataConfig { device: 10, ..good() }, "device is 10;"),
        (FirmataConfig { pins: [8, 9, 8, 11], ..good() }, "pins is [8, 9, 8, 11];"),
        (FirmataConfig { half_steps_per_turn: [4076, 0], ..good() }, "half_steps_per_turn is"),
        (FirmataConfig { speed_half_steps_per_s: 0.0, ..good() }, "speed_half_steps_per_s is 0;"),
        (
            FirmataConfig { acceleration_half_steps_per_s2: -1.0, ..good() },
            "acceleration_half_steps_per_s2 is -1;",
        ),
        (FirmataConfig { backlash_deg: f64::NAN, ..good() }, "backlash_deg is NaN"),
        (FirmataConfig { cable_turns: 0.25, ..good() }, "cable_turns is 0.25"),
        (FirmataConfig { homing: switch(9), ..good() }, "homing.pin is 9"),
        (
            FirmataConfig { homing: Homing::Declared { at_deg: 400.0 }, ..good() },
            "homing.at_deg is 400;",
        ),
        (FirmataConfig { settle_s: -0.1, ..good() }, "settle_s is -0.1"),
        (FirmataConfig { answer_timeout_s: 0.0, ..good() }, "answer_timeout_s is 0;"),
    ];
    for (config, expected) in wrong {
        let error = config.check().expect_err("it cannot be so").to_string();
        assert!(error.contains(expected), "{error}");
    }
}

/// Orders of a driver to a device whose motor and coils do what they should.
fn orders(approach: Approach, angles: &[f64]) -> Vec<i32> {
    let (here, mut there) = memory_pair();
    let time = Rc::new(Cell::new(0.0));
    let clock = {
        let time = Rc::clone(&time);
        move || time.get()
    };
    let config = FirmataConfig { approach, ..FirmataConfig::default() };
    let mut driver = FirmataStepper::new(config, here, clock).expect("it is in order");
    let mut decoder = Decoder::<Request>::default();
    let mut orders = Vec::new();
    // Where it was sent from, where to, and when.
    let mut from = 0_i32;
    let mut to = 0_i32;
    let mut sent = 0.0;
    let mut pending = false;
    for angle in angles {
        driver.turn_to(*angle).expect("the order is accepted");
        let stands = (0..2000).find_map(|_| {
            time.set(time.get() + 0.02);
            let mut replies = Vec::new();
            let mut into = [0; 256];
            let count = there.receive(&mut into).expect("it is there");
            for request in into[..count].iter().filter_map(|byte| decoder.push(*byte)) {
                let steps = 600.0 * (time.get() - sent);
                let gone = f64::from(to - from).signum() * steps.min(f64::from(to - from).abs());
                #[expect(clippy::cast_possible_truncation, reason = "some steps")]
                let position = from + gone as i32;
                replies.push(match request {
                    Request::Firmware => Reply::Firmware { major: 1, minor: 0, name: "x".into() },
                    Request::Stepper { request: StepperRequest::To(target), .. } => {
                        orders.push(target);
                        (from, to, sent, pending) = (position, target, time.get(), true);
                        continue;
                    }
                    Request::Stepper { device, request: StepperRequest::Report } => {
                        Reply::Position { device, position }
                    }
                    Request::ReportDigital { port, on: true } => {
                        let patterns = [0x1, 0x3, 0x2, 0x6, 0x4, 0xC, 0x8, 0x9];
                        let at = usize::try_from(position.rem_euclid(8)).expect("it is positive");
                        Reply::Digital { port, levels: patterns[at] }
                    }
                    _ => continue,
                });
            }
            if pending && time.get() >= sent + f64::from((to - from).abs()) / 600.0 {
                (from, pending) = (to, false);
                replies.push(Reply::Done { device: 0, position: to });
            }
            for reply in replies {
                there.send(&encoded(&reply)).expect("it is there");
            }
            driver.poll().expect("nothing fails")
        });
        assert!(stands.is_some(), "it does not come to {angle}");
    }
    orders
}

#[test]
fn an_angle_is_come_to_from_below() {
    let quarter = TAU / 4.0;
    // First steps show that the coils follow. 6° are 68 half steps, a quarter of a turn 1019.
    let made = orders(Approach::OneSided, &[quarter, 2.0 * quarter, quarter, quarter, 0.0]);
    assert_eq!(made, [1, 5, 1019, 2038, 951, 1019, -68, 0]);
    // From the start the play may be anywhere: 32 half steps do not take it up.
    assert_eq!(orders(Approach::OneSided, &[0.05]), [1, 5, -36, 32]);
    // Once the play is taken up, each side is known.
    let made = orders(Approach::Compensated, &[quarter, 2.0 * quarter, quarter, 0.0, quarter]);
    assert_eq!(made, [1, 5, 1019, 2038, 951, -68, 1019]);
}

fn reply() -> impl Strategy<Value = Vec<u8>> {
    let position = -i32::MAX..=i32::MAX;
    prop_oneof![
        prop::collection::vec(any::<u8>(), 0..20),
        position.clone().prop_map(|position| encoded(&Reply::Done { device: 0, position })),
        position.prop_map(|position| encoded(&Reply::Position { device: 0, position })),
        any::<u8>().prop_map(|levels| encoded(&Reply::Digital { port: 0, levels })),
        Just(encoded(&Reply::Version { major: 2, minor: 6 })),
        Just(encoded(&Reply::Firmware { major: 1, minor: 0, name: "x".into() })),
    ]
}

fn encoded(reply: &Reply) -> Vec<u8> {
    let mut bytes = Vec::new();
    reply.encode(&mut bytes).expect("it has room");
    bytes
}

proptest! {
    /// Any replies of a device, at any time.
    #[test]
    fn no_device_makes_it_panic(
        replies in prop::collection::vec((reply(), 0.0..3.0f64, -7.0..7.0f64), 1..60),
        switch in any::<bool>(),
    ) {
        let (here, mut there) = memory_pair();
        let time = Rc::new(Cell::new(0.0));
        let clock = { let time = Rc::clone(&time); move || time.get() };
        let homing = if switch {
            Homing::Switch { pin: 2, at_deg: 0.0 }
        } else {
            Homing::Declared { at_deg: 0.0 }
        };
        let config = FirmataConfig { homing, ..FirmataConfig::default() };
        let mut driver = FirmataStepper::new(config, here, clock).expect("it is in order");
        for (i, (bytes, dt, angle)) in replies.iter().enumerate() {
            there.send(bytes).expect("it is there");
            time.set(time.get() + dt);
            if let Ok(Some(angle)) = driver.poll() {
                prop_assert!(angle.is_finite());
            }
            let _ = match i % 5 {
                0 => driver.turn_to(*angle),
                1 => driver.zero(),
                2 => driver.find_home(),
                3 => driver.unwind(),
                _ => Ok(()),
            };
        }
    }
}
