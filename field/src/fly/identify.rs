use foxhunt_core::Clock;
use foxhunt_hardware::{
    Finding, FirmataConfig, FirmataStepper, GnssConfig, GnssKind, GnssReceiver, MavlinkConfig,
    MavlinkVehicle, XbeeConfig, XbeeRadio,
};
use foxhunt_wire::{ByteStream, Endpoint};

use super::Examine;

/// Time for which unrequested bytes of a device are awaited, in seconds: heartbeats and fixes come
/// once a second.
const LISTEN_S: f64 = 2.2;

/// The rates that serial devices are tried at: what XBees, Arduinos, autopilots and GNSS receivers
/// are set to.
const BAUD: [u32; 4] = [57_600, 115_200, 9_600, 38_400];

/// Identifies the device at an endpoint: its name, and what was found of it. At a serial port the
/// usual rates are tried, the endpoint's own first.
pub fn identify<C: Clock + Clone + 'static>(
    endpoint: &Endpoint,
    clock: &C,
    pause: &mut dyn FnMut(),
) -> (&'static str, Vec<Finding>) {
    let mut tried = vec![endpoint.clone()];
    if let Endpoint::Serial { port, baud } = endpoint {
        let others = BAUD.into_iter().filter(|other| other != baud);
        tried.extend(others.map(|baud| Endpoint::Serial { port: port.clone(), baud }));
    }
    let mut failure = None;
    for endpoint in &tried {
        match identify_at(endpoint, clock, pause) {
            Ok(Some((device, mut findings))) => {
                findings.insert(0, Finding::good("reached at", endpoint));
                return (device, findings);
            }
            Ok(None) => {}
            Err(error) => failure = Some(error.to_string()),
        }
    }
    let finding = match failure {
        Some(error) => Finding::bad(
            "port",
            error,
            "see that no other program has it open, and that you may open it",
        ),
        None => Finding::bad(
            "answer",
            "nothing that is known",
            "switch the device on; see that its cable carries data, and its rate is one of 9600, \
             38400, 57600 or 115200",
        ),
    };
    ("unknown", vec![finding])
}

/// Identifies the device at one endpoint and rate.
fn identify_at<C: Clock + Clone + 'static>(
    endpoint: &Endpoint,
    clock: &C,
    pause: &mut dyn FnMut(),
) -> std::io::Result<Option<(&'static str, Vec<Finding>)>> {
    let protocol = await_bytes(endpoint.open()?.as_mut(), clock, pause)?;
    let (device, mut driver): (_, Box<dyn Examine>) = match protocol {
        Some(Protocol::Mavlink) => {
            let vehicle =
                MavlinkVehicle::new(MavlinkConfig::default(), endpoint.open()?, clock.clone());
            ("autopilot (MAVLink)", Box::new(vehicle.expect("the defaults are in range")))
        }
        Some(Protocol::Gnss(kind)) => {
            let config = GnssConfig { kind, ..GnssConfig::default() };
            let receiver = GnssReceiver::new(config, endpoint.open()?, clock.clone());
            ("GNSS receiver", Box::new(receiver.expect("the defaults are in range")))
        }
        None => return probe(endpoint, clock, pause),
    };
    Ok(Some((device, driver.examine(pause))))
}

/// Sends requests to a silent device, as to a radio and then as to a motor: those send nothing by
/// themselves.
fn probe<C: Clock + Clone + 'static>(
    endpoint: &Endpoint,
    clock: &C,
    pause: &mut dyn FnMut(),
) -> std::io::Result<Option<(&'static str, Vec<Finding>)>> {
    let radio = XbeeRadio::new(XbeeConfig::default(), endpoint.open()?, clock.clone());
    let mut radio = radio.expect("the defaults are in range");
    let findings = radio.examine(pause);
    if radio.identity().is_some() {
        return Ok(Some(("XBee", findings)));
    }
    let stepper = FirmataStepper::new(FirmataConfig::default(), endpoint.open()?, clock.clone());
    let findings = stepper.expect("the defaults are in range").examine(pause);
    Ok(findings.first().is_some_and(Finding::is_good).then_some(("stepper (Firmata)", findings)))
}

/// Protocol that a device speaks without a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Protocol {
    Mavlink,
    Gnss(GnssKind),
}

/// Reads until the protocol is recognised, or [`LISTEN_S`] have passed.
fn await_bytes(
    stream: &mut dyn ByteStream,
    clock: &impl Clock,
    pause: &mut dyn FnMut(),
) -> std::io::Result<Option<Protocol>> {
    let begun = clock.now();
    let mut bytes = Vec::new();
    let mut into = [0; 512];
    while clock.now() - begun < LISTEN_S && bytes.len() < 16_384 {
        let count = stream.receive(&mut into)?;
        bytes.extend_from_slice(&into[..count]);
        if let Some(protocol) = recognise(&bytes) {
            return Ok(Some(protocol));
        }
        pause();
    }
    Ok(None)
}

/// Recognises a protocol by beginnings of frames that are long enough not to come by chance.
fn recognise(bytes: &[u8]) -> Option<Protocol> {
    let has = |pattern: &[u8]| bytes.windows(pattern.len()).any(|window| window == pattern);
    // A heartbeat: MAVLink 2, 9 bytes less what is cut off at the end, message 0.
    let mavlink2 = bytes.windows(10).any(|w| w[0] == 0xFD && w[1] <= 9 && w[7..10] == [0, 0, 0]);
    let mavlink1 = bytes.windows(6).any(|w| w[0] == 0xFE && w[1] == 9 && w[5] == 0);
    if mavlink2 || mavlink1 {
        return Some(Protocol::Mavlink);
    }
    if has(&[0xB5, 0x62, 0x01]) {
        return Some(Protocol::Gnss(GnssKind::Ublox));
    }
    let talkers: [&[u8]; 4] = [b"$GP", b"$GN", b"$GL", b"$GA"];
    talkers.iter().any(|talker| has(talker)).then_some(Protocol::Gnss(GnssKind::Nmea))
}

#[cfg(test)]
mod tests {
    use std::{cell::Cell, net::TcpListener, rc::Rc};

    use super::*;

    #[derive(Clone)]
    struct StepClock(Rc<Cell<f64>>);

    impl Clock for StepClock {
        fn now(&self) -> f64 {
            self.0.get()
        }
    }

    #[test]
    fn what_never_answers_is_unknown() {
        let silent = TcpListener::bind("127.0.0.1:0").expect("a port");
        let endpoint = format!("tcp:{}", silent.local_addr().expect("an address"));
        let endpoint = endpoint.parse().expect("an endpoint");
        let clock = StepClock(Rc::default());
        let mut pause = || clock.0.set(clock.now() + 0.01);
        let (device, findings) = identify(&endpoint, &clock, &mut pause);
        assert_eq!(device, "unknown");
        assert!(matches!(&findings[..], [finding] if !finding.is_good()), "{findings:?}");
    }

    #[test]
    fn protocols_are_recognised() {
        let heartbeat = [0xFD, 9, 0, 0, 7, 1, 1, 0, 0, 0, 4, 0, 0, 0, 2, 3, 81, 3, 3];
        assert_eq!(recognise(&heartbeat), Some(Protocol::Mavlink));
        assert_eq!(recognise(b"\n$GNGGA,1,2"), Some(Protocol::Gnss(GnssKind::Nmea)));
        assert_eq!(recognise(&[0, 0xB5, 0x62, 0x01, 0x07]), Some(Protocol::Gnss(GnssKind::Ublox)));
        assert_eq!(recognise(&[0x7E, 0, 4, 8, 1, b'A', b'P', 0x65]), None);
    }
}
