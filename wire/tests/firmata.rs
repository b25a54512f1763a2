//! Firmata against the vectors of npm firmata-io, and whatever bytes may come.
#![cfg(feature = "firmata")]

use approx::abs_diff_eq;
use foxhunt_wire::firmata::{
    Decimal, Decoder, Message, PinCapability, PinMode, Reply, Request, StepperInterface,
    StepperRequest, Wiring,
};
use proptest::prelude::*;
use serde_json::Value;

fn bytes<M: Message>(message: &M) -> Vec<u8> {
    let mut bytes = Vec::new();
    message.encode(&mut bytes).expect("it has room");
    bytes
}

fn read<M: Message>(bytes: &[u8]) -> Vec<M> {
    let mut decoder = Decoder::default();
    bytes.iter().filter_map(|byte| decoder.push(*byte)).collect()
}

const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../vectors/firmata.json");

fn vectors() -> Value {
    let text = std::fs::read_to_string(PATH)
        .unwrap_or_else(|error| panic!("no vectors at {PATH}: {error}"));
    serde_json::from_str(&text).expect("the vectors are JSON")
}

fn unhex(case: &Value) -> Vec<u8> {
    let hex = case["hex"].as_str().expect("a vector has bytes");
    let pair = |i| u8::from_str_radix(&hex[i..i + 2], 16).expect("hexadecimal");
    (0..hex.len()).step_by(2).map(pair).collect()
}

fn number(value: &Value) -> i32 {
    value.as_i64().and_then(|value| value.try_into().ok()).expect("a whole number")
}

fn pin(value: &Value) -> u8 {
    value.as_u64().and_then(|pin| pin.try_into().ok()).expect("a pin")
}

/// The request of a vector of the peer's arguments.
fn request_of(name: &str, args: &Value) -> Request {
    let decimal =
        || Decimal::truncated(args[1].as_f64().expect("a number")).expect("it is in range");
    let request = match name.split('_').next().expect("a name") {
        "config" => {
            let of = |name: &str| pin(&args[0][name]);
            let wiring = match of("type") {
                1 => Wiring::Driver { step_pin: of("stepPin"), direction_pin: of("directionPin") },
                4 => Wiring::FourWire(["motorPin1", "motorPin2", "motorPin3", "motorPin4"].map(of)),
                other => panic!("a vector with {other} wires"),
            };
            let enable_pin = args[0].get("enablePin").map(pin);
            // The one pin that a vector inverts is its enable pin.
            let inverted = u8::from(args[0].get("invertPins").is_some()) << 4;
            StepperRequest::Configure(StepperInterface {
                wiring,
                divisor_log2: of("stepSize"),
                enable_pin,
                inverted,
            })
        }
        "step" => StepperRequest::Step(number(&args[1])),
        "enable" => StepperRequest::Enable(args[1].as_bool().expect("on or off")),
        "stop" => StepperRequest::Stop,
        "speed" => StepperRequest::Speed(decimal()),
        other => panic!("an unknown vector {other}"),
    };
    let device = args[0].get("deviceNum").unwrap_or(&args[0]);
    Request::Stepper { device: pin(device), request }
}

#[test]
fn requests_are_those_of_firmata_io() {
    let vectors = vectors();
    let requests = vectors["requests"].as_array().expect("a list");
    assert_eq!(requests.len(), 28);
    for case in requests {
        let name = case["name"].as_str().expect("a name");
        let (request, expected) = (request_of(name, &case["args"]), unhex(case));
        let there: Vec<Request> = read(&expected);
        assert_eq!(there.len(), 1, "{name}");
        assert_eq!(bytes(&there[0]), expected, "{name}: bytes there and back");
        // A significand of 2²³ has no room in 23 bits: firmata-io wraps it to a speed of 0.
        if ["speed_83886.08", "speed_8388608"].contains(&name) {
            let Request::Stepper { request: StepperRequest::Speed(wrapped), .. } = there[0] else {
                panic!("{name} is no speed");
            };
            assert_eq!(wrapped.to_f64().to_bits(), 0.0_f64.to_bits(), "{name}");
            let Request::Stepper { request: StepperRequest::Speed(ours), .. } = request else {
                panic!("{name} is no speed");
            };
            let value = case["args"][1].as_f64().expect("a number");
            assert!(abs_diff_eq!(ours.to_f64() / value, 1.0, epsilon = 1e-6), "{name}: {ours:?}");
            continue;
        }
        assert_eq!(bytes(&request), expected, "{name}");
        assert_eq!(there[0], request, "{name}");
    }
}

#[test]
fn a_pin_state_has_a_pin_a_mode_and_a_level() {
    let reply = Reply::PinState { pin: 9, mode: PinMode::Stepper.code(), state: 1 };
    assert_eq!(bytes(&reply), [0xF0, 0x6E, 9, 8, 1, 0xF7]);
    assert_eq!(read::<Reply>(&bytes(&reply)), [reply]);
}

#[test]
fn replies_are_those_that_firmata_io_understands() {
    let vectors = vectors();
    let replies = vectors["replies"].as_array().expect("a list");
    assert_eq!(replies.len(), 4);
    for case in replies {
        let (device, position) = (pin(&case["device"]), number(&case["value"]));
        let reply = match case["kind"].as_str().expect("a kind") {
            "position" => Reply::Position { device, position },
            "done" => Reply::Done { device, position },
            other => panic!("an unknown vector {other}"),
        };
        assert_eq!(bytes(&reply), unhex(case));
        assert_eq!(read::<Reply>(&unhex(case)), [reply]);
    }
}

#[test]
fn a_missing_inversion_is_none() {
    let sent = [0xF0, 0x62, 0, 0, 0x42, 8, 10, 9, 11, 0xF7];
    let [Request::Stepper { request: StepperRequest::Configure(interface), .. }] =
        read::<Request>(&sent)[..]
    else {
        panic!("it is a configuration");
    };
    assert_eq!((interface.inverted, interface.wiring), (0, Wiring::FourWire([8, 10, 9, 11])));
}

#[test]
fn what_has_no_room_is_refused_with_its_value() {
    let refused = |request: Request| {
        let mut bytes = vec![7];
        let error = request.encode(&mut bytes).expect_err("it has no room").to_string();
        assert_eq!(bytes, [7], "nothing was appended");
        error
    };
    let error = refused(Request::Stepper { device: 10, request: StepperRequest::Zero });
    assert!(error.contains("device is 10"), "{error}");
    let error = refused(Request::PinMode { pin: 200, mode: PinMode::PullUp });
    assert!(error.contains("pin is 200"), "{error}");
    let request = StepperRequest::To(i32::MIN);
    assert!(refused(Request::Stepper { device: 0, request }).contains("-2147483648"));
}

#[test]
fn a_cut_frame_costs_nothing_but_itself() {
    let whole = bytes(&Reply::Done { device: 0, position: -77 });
    for cut in 0..whole.len() {
        let mut stream = whole[..cut].to_vec();
        stream.extend(&whole);
        assert_eq!(read::<Reply>(&stream), [Reply::Done { device: 0, position: -77 }]);
    }
    let mut decoder = Decoder::<Reply>::default();
    let mut flood = vec![0xF0];
    flood.extend(std::iter::repeat_n(0x11, 1_000_000));
    flood.extend([0xF7, 0xF9, 2, 6]);
    let replies: Vec<Reply> = flood.iter().filter_map(|byte| decoder.push(*byte)).collect();
    assert_eq!(replies, [Reply::Version { major: 2, minor: 6 }]);
    assert_eq!(decoder.rejected(), 1);
}

fn wiring() -> impl Strategy<Value = Wiring> {
    let pin = 0u8..0x80;
    prop_oneof![
        (pin.clone(), pin.clone())
            .prop_map(|(step_pin, direction_pin)| Wiring::Driver { step_pin, direction_pin }),
        prop::array::uniform2(pin.clone()).prop_map(Wiring::TwoWire),
        prop::array::uniform3(pin.clone()).prop_map(Wiring::ThreeWire),
        prop::array::uniform4(pin).prop_map(Wiring::FourWire),
    ]
}

fn decimal() -> impl Strategy<Value = Decimal> {
    (-1e6..1e6f64).prop_map(|value| Decimal::truncated(value).expect("in range"))
}

fn stepper_request() -> impl Strategy<Value = StepperRequest> {
    let whole = -i32::MAX..=i32::MAX;
    prop_oneof![
        (wiring(), 0u8..8, prop::option::of(0u8..0x80), 0u8..0x20).prop_map(
            |(wiring, divisor_log2, enable_pin, inverted)| {
                StepperRequest::Configure(StepperInterface {
                    wiring,
                    divisor_log2,
                    enable_pin,
                    inverted,
                })
            }
        ),
        Just(StepperRequest::Zero),
        whole.clone().prop_map(StepperRequest::Step),
        whole.prop_map(StepperRequest::To),
        any::<bool>().prop_map(StepperRequest::Enable),
        Just(StepperRequest::Stop),
        Just(StepperRequest::Report),
        decimal().prop_map(StepperRequest::Acceleration),
        decimal().prop_map(StepperRequest::Speed),
    ]
}

fn request() -> impl Strategy<Value = Request> {
    let modes =
        [PinMode::Input, PinMode::Output, PinMode::Analog, PinMode::Stepper, PinMode::PullUp];
    prop_oneof![
        Just(Request::Version),
        Just(Request::Firmware),
        Just(Request::Capabilities),
        Just(Request::AnalogMapping),
        Just(Request::Reset),
        (0u8..0x80, prop::sample::select(modes.to_vec()))
            .prop_map(|(pin, mode)| Request::PinMode { pin, mode }),
        (0u8..0x10, any::<bool>()).prop_map(|(port, on)| Request::ReportDigital { port, on }),
        (0u8..10, stepper_request())
            .prop_map(|(device, request)| Request::Stepper { device, request }),
    ]
}

fn reply() -> impl Strategy<Value = Reply> {
    let seven = 0u8..0x80;
    let whole = -i32::MAX..=i32::MAX;
    let capability = (0u8..0x7F, seven.clone())
        .prop_map(|(mode, resolution)| PinCapability { mode, resolution });
    let pins = prop::collection::vec(prop::collection::vec(capability, 0..6), 0..30);
    prop_oneof![
        (seven.clone(), seven.clone()).prop_map(|(major, minor)| Reply::Version { major, minor }),
        (seven.clone(), seven.clone(), "\\PC{0,40}")
            .prop_map(|(major, minor, name)| Reply::Firmware { major, minor, name }),
        "\\PC{0,60}".prop_map(Reply::Text),
        pins.prop_map(Reply::Capabilities),
        prop::collection::vec(prop::option::of(0u8..0x7F), 0..70).prop_map(Reply::AnalogMapping),
        (0u8..0x10, any::<u8>()).prop_map(|(port, levels)| Reply::Digital { port, levels }),
        (seven.clone(), whole.clone())
            .prop_map(|(device, position)| Reply::Position { device, position }),
        (seven, whole).prop_map(|(device, position)| Reply::Done { device, position }),
    ]
}

/// Bytes as a broken cable gives them: any, and those that mean something more often.
fn noise() -> impl Strategy<Value = Vec<u8>> {
    let reporting =
        prop::sample::select(vec![0xF0, 0xF7, 0xF9, 0x62, 0x79, 0x6C, 0x90, 0x06, 0x0A]);
    prop::collection::vec(prop_oneof![any::<u8>(), reporting], 0..400)
}

proptest! {
    #[test]
    fn requests_there_and_back(sent in prop::collection::vec(request(), 1..8)) {
        let stream: Vec<u8> = sent.iter().flat_map(bytes).collect();
        prop_assert_eq!(read::<Request>(&stream), sent);
    }

    #[test]
    fn replies_there_and_back(sent in prop::collection::vec(reply(), 1..8)) {
        let stream: Vec<u8> = sent.iter().flat_map(bytes).collect();
        prop_assert_eq!(read::<Reply>(&stream), sent);
    }

    /// Whatever came before, a message is found; and what is read means the same written again.
    #[test]
    fn noise_is_survived(noise in noise(), last in reply(), query in request()) {
        let mut stream = noise.clone();
        stream.extend(bytes(&last));
        let replies = read::<Reply>(&stream);
        prop_assert_eq!(replies.last(), Some(&last));
        for reply in &replies {
            prop_assert_eq!(&read::<Reply>(&bytes(reply)), std::slice::from_ref(reply));
        }
        let mut stream = noise;
        stream.extend(bytes(&query));
        let replies = read::<Request>(&stream);
        prop_assert_eq!(replies.last(), Some(&query));
        for request in &replies {
            prop_assert_eq!(&read::<Request>(&bytes(request)), std::slice::from_ref(request));
        }
    }
}
