//! AT commands against those of npm's ar-drone.
#![cfg(feature = "ardrone")]

use foxhunt_wire::ardrone::{ArDroneCommand, encode_commands, parse_commands};
use proptest::prelude::*;

const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../vectors/ardrone.json");

fn progressive(roll: f32, pitch: f32, climb: f32, yaw: f32) -> ArDroneCommand {
    ArDroneCommand::Progressive { progressive: true, roll, pitch, climb, yaw }
}

fn named(name: &str) -> Option<ArDroneCommand> {
    let reference = |fly, emergency| ArDroneCommand::Reference { fly, emergency };
    Some(match name {
        "takeoff" => reference(true, false),
        "land" => reference(false, false),
        "emergency" => reference(false, true),
        "hover" => ArDroneCommand::hover(),
        "front_up" => progressive(0.0, -0.25, 0.5, 0.0),
        "ftrim" => ArDroneCommand::FlatTrim,
        "ctrl5" => ArDroneCommand::Control { mode: 5, argument: 0 },
        "config_navdata_demo" => {
            ArDroneCommand::Config { key: "general:navdata_demo".into(), value: "FALSE".into() }
        }
        "comwdg" => ArDroneCommand::Watchdog,
        _ => progressive(0.0, 0.0, 0.0, name.strip_prefix("yaw_cw_")?.parse().ok()?),
    })
}

#[test]
fn the_vectors() {
    let text = std::fs::read_to_string(PATH)
        .unwrap_or_else(|error| panic!("no vectors at {PATH}: {error}"));
    let file: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let sequence = u32::try_from(file["sequence"].as_u64().expect("a number")).expect("small");
    let vectors = file["vectors"].as_array().expect("a list");
    assert!(!vectors.is_empty());
    for vector in vectors {
        let (name, text) = (vector["name"].as_str(), vector["text"].as_str());
        let (name, text) = name.zip(text).expect("a name and a text");
        let command = named(name).unwrap_or_else(|| panic!("no command {name}"));
        assert_eq!(command.encode(sequence), text, "{name}");
        let read = parse_commands(text.as_bytes()).expect("an order");
        assert_eq!(read, [(sequence, command)], "{name}");
    }
}

#[test]
fn what_is_no_order_is_named() {
    for text in [
        "AT*PCMD=7,1,0,0,0\r",
        "AT*PCMD=7,1,0,0,0,0,0\r",
        "AT*PCMD=7,1,2139095040,0,0,0\r",
        "AT*REF=7,1\r",
        "AT*REF=x,512\r",
        "AT*CONFIG=7,\"a\"\r",
        "AT*FTRIM\r",
        "PCMD\r",
    ] {
        let error = parse_commands(text.as_bytes()).expect_err(text).to_string();
        let line = format!("{:?}", text.trim_end());
        assert!(error.contains(&line), "{error}");
    }
    assert!(parse_commands(&[0xFF]).is_err());
    assert!(parse_commands(&[b'A'; 1025]).is_err());
    let old = parse_commands(b"AT*REF=1,290718208\r").expect("bits of older programs");
    assert_eq!(old[0].1, ArDroneCommand::Reference { fly: true, emergency: false });
}

fn command() -> impl Strategy<Value = ArDroneCommand> {
    let share = || -1.0f32..=1.0;
    prop_oneof![
        (any::<bool>(), any::<bool>())
            .prop_map(|(fly, emergency)| ArDroneCommand::Reference { fly, emergency }),
        (share(), share(), share(), share()).prop_map(|(a, b, c, d)| progressive(a, b, c, d)),
        Just(ArDroneCommand::FlatTrim),
        Just(ArDroneCommand::Watchdog),
        (any::<i32>(), any::<i32>())
            .prop_map(|(mode, argument)| ArDroneCommand::Control { mode, argument }),
        ("[a-z:_]{1,20}", "[A-Za-z0-9,.]{0,20}")
            .prop_map(|(key, value)| ArDroneCommand::Config { key, value }),
    ]
}

proptest! {
    #[test]
    fn orders_are_read_as_they_are_written(
        commands in prop::collection::vec(command(), 0..8), first in any::<u32>(),
    ) {
        let mut sequence = first;
        let bytes = encode_commands(&commands, &mut sequence);
        let read = parse_commands(&bytes).expect("our own");
        prop_assert_eq!(read.len(), commands.len());
        for (i, ((number, read), written)) in (0..).zip(read.iter().zip(&commands)) {
            prop_assert_eq!(*number, first.wrapping_add(i));
            prop_assert_eq!(read, written);
        }
    }

    #[test]
    fn no_bytes_are_too_much(bytes in prop::collection::vec(any::<u8>(), 0..1200)) {
        let _ = parse_commands(&bytes);
    }
}
