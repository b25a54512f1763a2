//! The MAVLink driver's link: keys, garbage, and what is found when it is looked at.

use foxhunt::{
    hardware::{Aircraft, MavlinkConfig, MavlinkError, MavlinkSigning, MavlinkVehicle, Watch},
    sim::{
        AutopilotConfig, AutopilotFaults, DroneConfig, EmulatedAutopilot, Emulator, Interval,
        World, WorldConfig,
    },
    wire::{
        ByteStream, MemoryStream, UdpStream,
        mavlink::{
            Autopilot, Codec, SigningKey,
            dialect::{HEARTBEAT_DATA, MavAutopilot, MavMessage, MavModeFlag, MavState, MavType},
        },
        memory_pair,
    },
};
use foxhunt_core::{Clock, Vehicle};

use super::mavlink::{Field, TICK};

#[test]
fn only_the_same_key_is_obeyed() {
    let key = |byte| SigningKey::new([byte; 32]);
    let signing = |byte| Some(MavlinkSigning { key: key(byte), link_id: 2 });
    for (theirs, ours, agrees) in [
        (Some(key(1)), signing(1), true),
        (Some(key(1)), signing(2), false),
        (Some(key(1)), None, false),
        (None, signing(1), false),
    ] {
        let emulated = AutopilotConfig { signing: theirs, ..AutopilotConfig::default() };
        let driver = MavlinkConfig { signing: ours, ..MavlinkConfig::default() };
        let mut field = Field::new(emulated, driver);
        let state = field.run(8.0);
        if agrees {
            field.fly(5.0);
            continue;
        }
        // Without our signature nothing is requested; without theirs nothing is received.
        assert!(!state.hindrance.is_empty(), "{state:?}");
        let refused = field.driver.link_counts().refused;
        assert_eq!(refused > 0, ours.is_some(), "{refused} messages refused");
        assert!(field.driver.pose().is_err());
    }
}

/// A cable that adds garbage and cuts everything into pieces.
struct Noisy {
    stream: MemoryStream,
    seed: u32,
}

impl ByteStream for Noisy {
    fn receive(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        self.seed = self.seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let [.., noise] = self.seed.to_be_bytes();
        if noise < 5 {
            into[..3].copy_from_slice(&[0xfd, noise, noise]);
            return Ok(3);
        }
        let most = usize::from(noise % 13) + 1;
        self.stream.receive(&mut into[..most])
    }

    fn send(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        bytes.chunks(7).try_for_each(|piece| self.stream.send(piece))
    }
}

/// Others who know the port have neither the link nor the time of it: one-byte datagrams, an
/// autopilot of another number, one that signs with no key, thousands in every second.
#[test]
fn strangers_do_not_get_the_link() {
    for signing in [None, Some(SigningKey::new([3; 32]))] {
        let config = WorldConfig { drones: vec![DroneConfig::default()], ..WorldConfig::default() };
        let world = World::new(&config, 1).expect("a world");
        let near = UdpStream::listen("127.0.0.1:0").expect("a port");
        let address = near.local_address().expect("a port").to_string();
        let to = || UdpStream::to(&address).expect("a port");
        let mut stranger = to();
        let mut other = Codec::new(9, 1);
        let beat = MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            custom_mode: 4,
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode: MavModeFlag::from_bits_retain(0),
            system_status: MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
        });
        let mut flood = |now: f64| {
            for _ in 0..130 {
                stranger.send(&[0xfd]).expect("a port");
            }
            stranger.send(&other.encode(&beat, now)).expect("a port");
        };
        flood(0.0);
        let autopilot = AutopilotConfig { signing, ..AutopilotConfig::default() };
        let mut emulated = EmulatedAutopilot::new(autopilot, &world, 0, to()).expect("one");
        let config = MavlinkConfig {
            system_id: Some(1),
            signing: signing.map(|key| MavlinkSigning { key, link_id: 1 }),
            ..MavlinkConfig::default()
        };
        let mut driver = MavlinkVehicle::new(config, near, world.clock()).expect("a driver");
        let mut ordered = false;
        let mut up = None;
        // 130,000 datagrams in 20 s of the world's time.
        while world.time() < 60.0 {
            world.advance(TICK).expect("time passes");
            flood(world.time());
            emulated.serve().expect("a port");
            let state = driver.state().expect("a port");
            if !ordered && state.hindrance.is_empty() {
                driver.take_off(5.0).expect("accepted");
                ordered = true;
            }
            if state.commanded {
                up.get_or_insert(world.time());
            }
            assert!(up.is_none() || state.commanded, "{state:?} at {} s", world.time());
            assert!(up.is_some() || world.time() < 30.0, "never up: {state:?}");
        }
        let mut into = [0; 64];
        assert_eq!(stranger.receive(&mut into).expect("a port"), 0, "nothing was sent to it");
    }
}

/// An autopilot that was started again speaks from another port.
#[test]
fn a_link_is_taken_up_from_another_port() {
    let config = WorldConfig { drones: vec![DroneConfig::default()], ..WorldConfig::default() };
    let world = World::new(&config, 1).expect("a world");
    let near = UdpStream::listen("127.0.0.1:0").expect("a port");
    let address = near.local_address().expect("a port").to_string();
    let config = MavlinkConfig::default();
    let mut driver = MavlinkVehicle::new(config, near, world.clock()).expect("a driver");
    for _ in 0..2 {
        let to = UdpStream::to(&address).expect("a port");
        let autopilot = AutopilotConfig::default();
        let mut emulated = EmulatedAutopilot::new(autopilot, &world, 0, to).expect("one");
        for _ in 0..400 {
            world.advance(TICK).expect("time passes");
            emulated.serve().expect("a port");
            driver.state().expect("a port");
        }
        assert!(driver.pose().is_ok(), "{:?}", driver.state());
    }
}

/// The link of a drone in flight is silent for 12 s: a stranger who has its number is neither heard
/// nor answered, the drone is sent to all the while, and is heard again.
#[test]
fn a_silent_link_in_flight_is_kept_for_its_drone() {
    let config = WorldConfig { drones: vec![DroneConfig::default()], ..WorldConfig::default() };
    let world = World::new(&config, 1).expect("a world");
    let near = UdpStream::listen("127.0.0.1:0").expect("a port");
    let address = near.local_address().expect("a port").to_string();
    let to = || UdpStream::to(&address).expect("a port");
    let faults = AutopilotFaults {
        silent: vec![Interval { from_s: 30.0, to_s: Some(42.0) }],
        ..AutopilotFaults::default()
    };
    let autopilot = AutopilotConfig { faults, ground_failsafe_s: None, ..Default::default() };
    let mut emulated = EmulatedAutopilot::new(autopilot, &world, 0, to()).expect("one");
    let mut stranger = to();
    let mut other = Codec::new(1, 1);
    let mut driver =
        MavlinkVehicle::new(MavlinkConfig::default(), near, world.clock()).expect("a driver");
    let mut ordered = false;
    let mut into = [0; 512];
    while world.time() < 50.0 {
        world.advance(TICK).expect("time passes");
        emulated.serve().expect("a port");
        let state = driver.state().expect("a port");
        if !ordered && state.hindrance.is_empty() {
            driver.take_off(5.0).expect("accepted");
            ordered = true;
        }
        if world.time() > 29.0 {
            let beat = MavMessage::HEARTBEAT(HEARTBEAT_DATA {
                custom_mode: 9,
                mavtype: MavType::MAV_TYPE_QUADROTOR,
                autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
                base_mode: MavModeFlag::from_bits_retain(0),
                system_status: MavState::MAV_STATE_ACTIVE,
                mavlink_version: 3,
            });
            stranger.send(&other.encode(&beat, world.time())).expect("a port");
            assert_ne!(state.mode, "LAND", "the stranger was heard");
            assert_eq!(stranger.receive(&mut into).expect("a port"), 0, "it was answered");
        }
    }
    assert!(driver.pose().is_ok(), "{:?}", driver.state());
}

#[test]
fn garbage_on_the_cable_is_survived() {
    let config = WorldConfig { drones: vec![DroneConfig::default()], ..WorldConfig::default() };
    let world = World::new(&config, 1).expect("a world");
    let (near, far) = memory_pair();
    let autopilot = AutopilotConfig::default();
    let mut emulated = EmulatedAutopilot::new(autopilot, &world, 0, far).expect("an autopilot");
    let noisy = Noisy { stream: near, seed: 7 };
    let config = MavlinkConfig { pose_timeout_s: 3.0, ..MavlinkConfig::default() };
    let mut driver = MavlinkVehicle::new(config, noisy, world.clock()).expect("a driver");
    let mut up = false;
    for _ in 0..4000 {
        world.advance(TICK).expect("time passes");
        emulated.serve().expect("a cable");
        let state = driver.state().expect("a cable");
        if !up && state.hindrance.is_empty() {
            driver.take_off(5.0).expect("accepted");
            up = true;
        }
        if state.commanded {
            break;
        }
    }
    assert!(driver.state().expect("a cable").commanded, "it flies all the same");
    let counts = driver.link_counts();
    assert!(counts.garbage_bytes > 100 && counts.messages > 200, "{counts:?}");
    assert!(driver.origin().is_some(), "its launch place became the origin");
    // The other end is pulled out: an error at every call, and no panic.
    drop(emulated);
    let failed = (0..100_000).any(|_| driver.state().is_err());
    assert!(
        failed && matches!(driver.pose(), Err(MavlinkError::Link(_) | MavlinkError::Stale { .. }))
    );
}

#[test]
fn what_examine_finds() {
    let mut field = Field::of(Autopilot::ArduPilot);
    field.run(4.0);
    let Field { world, emulated, driver } = &mut field;
    let mut pause = || {
        world.advance(TICK).expect("time passes");
        emulated.serve().expect("a cable");
    };
    let findings = driver.examine(&mut pause);
    let text: Vec<String> = findings.iter().map(ToString::to_string).collect();
    // Its battery and its fence have no failsafe.
    let bad: Vec<&str> =
        findings.iter().filter(|of| !of.is_good()).map(|of| of.subject.as_str()).collect();
    assert_eq!(bad, ["failsafe: battery", "failsafe: fence"], "{text:#?}");
    let by_autopilot = findings.iter().filter(|of| of.watch == Watch::Autopilot).count();
    assert_eq!(by_autopilot, 5, "{text:#?}");
    for wanted in [
        "failsafe: ground station: FS_GCS_ENABLE is 1; it acts 5 s after foxhunt's last heartbeat",
        "way home: 15.0 m up",
        "autopilot: ArduPilot, system 1",
        "firmware: 4.5.7",
        "mode: STABILIZE",
        "position: 3D, 14 satellites, good to 0.50 m",
        "battery: 100 % left",
    ] {
        assert!(text.iter().any(|line| line == wanted), "no {wanted:?} in {text:#?}");
    }
    // Nobody at the other end: it ends, and reports what to look at.
    let (near, _far) = memory_pair();
    let config = MavlinkConfig::default();
    let mut alone = MavlinkVehicle::new(config, near, world.clock()).expect("a driver");
    let before = world.clock().now();
    let findings = alone.examine(&mut || world.advance(0.1).expect("time passes"));
    assert!(world.clock().now() - before < 7.0);
    assert!(findings.iter().any(|finding| finding.text == "nothing was received"), "{findings:?}");
}
