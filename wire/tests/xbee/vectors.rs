use foxhunt_wire::xbee::{
    Address16, Address64, ApiMode, AtCommand, AtStatus, Decoder, DeliveryStatus, Frame, FrameError,
    ModemStatus, TransmitStatus,
};
use serde_json::Value;

const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../vectors/xbee.json");

fn vectors() -> Vec<Value> {
    let text = std::fs::read_to_string(PATH)
        .unwrap_or_else(|error| panic!("no vectors at {PATH}: {error}"));
    let mut file: Value = serde_json::from_str(&text).expect("the vectors are JSON");
    serde_json::from_value(file["vectors"].take()).expect("a list")
}

fn hex(text: &str) -> Vec<u8> {
    let digits = |at| u8::from_str_radix(&text[at..at + 2], 16).expect("hexadecimal");
    (0..text.len()).step_by(2).map(digits).collect()
}

/// The fields of a vector by their names.
struct Fields<'a>(&'a Value);

impl Fields<'_> {
    fn number(&self, name: &str) -> u64 {
        self.0[name].as_u64().unwrap_or_else(|| panic!("no number {name} in {}", self.0))
    }
    fn byte(&self, name: &str) -> u8 {
        self.number(name).try_into().expect("a byte")
    }
    fn word(&self, name: &str) -> u16 {
        self.number(name).try_into().expect("a word")
    }
    fn text(&self, name: &str) -> &str {
        self.0[name].as_str().unwrap_or_else(|| panic!("no text {name} in {}", self.0))
    }
    fn bytes(&self, name: &str) -> Vec<u8> {
        hex(self.text(name))
    }
    fn a64(&self) -> Address64 {
        Address64(u64::from_str_radix(self.text("addr64"), 16).expect("hexadecimal"))
    }
    fn a16(&self) -> Address16 {
        Address16(u16::from_str_radix(self.text("addr16"), 16).expect("hexadecimal"))
    }
    fn command(&self) -> AtCommand {
        AtCommand(self.text("command").as_bytes().try_into().expect("two letters"))
    }
}

fn frame(vector: &Value) -> Frame {
    let f = Fields(&vector["fields"]);
    let id = || f.byte("frame_id");
    match vector["frame_type"].as_u64().expect("a type") {
        0x01 => Frame::Transmit16 {
            id: id(),
            to: f.a16(),
            options: f.byte("options"),
            data: f.bytes("data"),
        },
        0x08 => {
            Frame::AtCommand { id: id(), command: f.command(), parameter: f.bytes("parameter") }
        }
        0x09 => Frame::QueuedAtCommand {
            id: id(),
            command: f.command(),
            parameter: f.bytes("parameter"),
        },
        0x10 => Frame::Transmit {
            id: id(),
            to64: f.a64(),
            to16: f.a16(),
            broadcast_radius: f.byte("broadcast_radius"),
            options: f.byte("options"),
            data: f.bytes("data"),
        },
        0x11 => Frame::ExplicitTransmit {
            id: id(),
            to64: f.a64(),
            to16: f.a16(),
            source_endpoint: f.byte("src_ep"),
            destination_endpoint: f.byte("dst_ep"),
            cluster: f.word("cluster"),
            profile: f.word("profile"),
            broadcast_radius: f.byte("broadcast_radius"),
            options: f.byte("options"),
            data: f.bytes("data"),
        },
        0x17 => Frame::RemoteAtCommand {
            id: id(),
            to64: f.a64(),
            to16: f.a16(),
            options: f.byte("options"),
            command: f.command(),
            parameter: f.bytes("parameter"),
        },
        0x80 => Frame::Receive64 {
            from: f.a64(),
            rssi_neg_dbm: f.byte("rssi_neg_dbm"),
            options: f.byte("options"),
            data: f.bytes("data"),
        },
        0x81 => Frame::Receive16 {
            from: f.a16(),
            rssi_neg_dbm: f.byte("rssi_neg_dbm"),
            options: f.byte("options"),
            data: f.bytes("data"),
        },
        0x88 => Frame::AtResponse {
            id: id(),
            command: f.command(),
            status: AtStatus(f.byte("status")),
            value: f.bytes("value"),
        },
        0x89 => Frame::TransmitStatus { id: id(), status: TransmitStatus(f.byte("status")) },
        0x8A => Frame::ModemStatus { status: ModemStatus(f.byte("status")) },
        0x8B => Frame::DeliveryStatus {
            id: id(),
            to16: f.a16(),
            retries: f.byte("retries"),
            delivery: DeliveryStatus(f.byte("delivery")),
            discovery: f.byte("discovery"),
        },
        0x90 => Frame::Receive {
            from64: f.a64(),
            from16: f.a16(),
            options: f.byte("options"),
            data: f.bytes("data"),
        },
        0x91 => Frame::ExplicitReceive {
            from64: f.a64(),
            from16: f.a16(),
            source_endpoint: f.byte("src_ep"),
            destination_endpoint: f.byte("dst_ep"),
            cluster: f.word("cluster"),
            profile: f.word("profile"),
            options: f.byte("options"),
            data: f.bytes("data"),
        },
        0x97 => Frame::RemoteAtResponse {
            id: id(),
            from64: f.a64(),
            from16: f.a16(),
            command: f.command(),
            status: AtStatus(f.byte("status")),
            value: f.bytes("value"),
        },
        other => panic!("a vector of type {other:#x}"),
    }
}

fn valid<'a>(vectors: &'a [Value], name: &str) -> &'a Value {
    vectors.iter().find(|v| v["name"] == name).unwrap_or_else(|| panic!("no vector {name}"))
}

#[test]
fn valid_frames_are_written_and_read_as_another_implementation_does() {
    let vectors = vectors();
    let valid: Vec<_> = vectors.iter().filter(|v| v["kind"] == "valid").collect();
    assert_eq!(valid.len(), 35, "the vectors have changed");
    for vector in valid {
        let frame = frame(vector);
        for (mode, name) in [(ApiMode::Plain, "raw"), (ApiMode::Escaped, "escaped")] {
            let bytes = hex(vector[name].as_str().expect("bytes"));
            assert_eq!(frame.encode(mode).expect("short"), bytes, "{}", vector["name"]);
            assert_eq!(Frame::decode(&bytes, mode).as_ref(), Ok(&frame), "{}", vector["name"]);
        }
    }
}

#[test]
fn invalid_frames_are_refused_for_their_reasons() {
    let vectors = vectors();
    let invalid: Vec<_> = vectors.iter().filter(|v| v["kind"] == "invalid").collect();
    assert_eq!(invalid.len(), 6, "the vectors have changed");
    for vector in invalid {
        let (mode, bytes) = match vector["raw"].as_str() {
            Some(raw) => (ApiMode::Plain, hex(raw)),
            None => (ApiMode::Escaped, hex(vector["escaped"].as_str().expect("bytes"))),
        };
        let error = Frame::decode(&bytes, mode).expect_err("it is invalid");
        let why = match error {
            FrameError::Checksum { .. } => "checksum",
            FrameError::Delimiter { .. } => "delimiter",
            FrameError::Length { .. } | FrameError::Cut { .. } => "length",
            other => panic!("{other}"),
        };
        assert_eq!(vector["why"], why, "{}: {error}", vector["name"]);
    }
}

#[test]
fn streams_give_their_frames() {
    let vectors = vectors();
    let streams: Vec<_> = vectors.iter().filter(|v| v["kind"] == "stream").collect();
    assert_eq!(streams.len(), 3, "the vectors have changed");
    for stream in streams {
        let mode = if stream["api_mode"] == 2 { ApiMode::Escaped } else { ApiMode::Plain };
        let decoded = Decoder::new(mode).push(&hex(stream["bytes"].as_str().expect("bytes")));
        let errors = decoded.iter().filter(|outcome| outcome.is_err()).count();
        assert_eq!(stream["expect_errors"], errors, "{}", stream["name"]);
        let known = decoded.into_iter().flatten().filter(|f| !matches!(f, Frame::Unknown { .. }));
        let known: Vec<_> = known.collect();
        let expected = stream["expect"].as_array().expect("a list").iter();
        // Two of the streams hold frames that are no vectors of their own: these are checked by
        // what their names.
        let expected: Vec<_> = expected.map(|name| name.as_str().expect("a name")).collect();
        assert_eq!(known.len(), expected.len(), "{}", stream["name"]);
        for (frame_found, name) in known.iter().zip(expected) {
            match name {
                "rx_escapes" => assert!(matches!(frame_found, Frame::Receive { .. })),
                "tx_status_00" => {
                    assert!(matches!(frame_found, Frame::DeliveryStatus { delivery, .. }
                        if *delivery == DeliveryStatus::SUCCESS))
                }
                "modem_status_6" => {
                    assert_eq!(*frame_found, Frame::ModemStatus { status: ModemStatus(6) });
                }
                name => assert_eq!(*frame_found, frame(valid(&vectors, name))),
            }
        }
    }
}
