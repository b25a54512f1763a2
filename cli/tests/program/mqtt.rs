//! `hunt --mqtt` against a broker of MQTT 3.1.1, written here from the standard.

use std::{
    collections::BTreeMap,
    fs,
    io::{Read, Write},
    net::{TcpListener, TcpStream},
    process::Command,
    sync::{Arc, Mutex, MutexGuard},
    thread,
};

use serde_json::Value;

use crate::support::{folder, foxhunt};

const ORIGIN: [&str; 2] = ["--origin", "50.0755,14.4378"];

/// A broker that keeps what it gets.
struct Broker {
    port: u16,
    seen: Arc<Mutex<Seen>>,
}

#[derive(Default)]
struct Seen {
    /// The last message of each topic.
    retained: BTreeMap<String, Vec<u8>>,
    /// Messages in their order: topic and text.
    all: Vec<(String, String)>,
    /// Topic and text of the will of each connection.
    wills: Vec<(String, String)>,
    logins: Vec<Option<(String, String)>>,
    /// Number of connections that ended with a farewell.
    farewells: usize,
}

impl Broker {
    /// Serves; the first connection is cut after some messages, if a number is given.
    fn start(cut_after: Option<usize>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let port = listener.local_addr().expect("bound").port();
        let seen = Arc::<Mutex<Seen>>::default();
        let kept = Arc::clone(&seen);
        thread::spawn(move || {
            let mut cut_after = cut_after;
            for stream in listener.incoming() {
                let cut = cut_after.take().unwrap_or(usize::MAX);
                let seen = Arc::clone(&kept);
                thread::spawn(move || serve(&mut stream.expect("a client"), &seen, cut));
            }
        });
        Self { port, seen }
    }

    fn address(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().expect("no thread panicked")
    }
}

/// Reads packets until the client leaves, or `cut` messages have come.
fn serve(stream: &mut TcpStream, seen: &Mutex<Seen>, cut: usize) {
    let mut messages = 0;
    while let Some((kind, mut body)) = packet(stream) {
        let mut seen = seen.lock().expect("no thread panicked");
        let answer = match kind >> 4 {
            // CONNECT: protocol, level, flags, keep-alive, then the texts that the flags name.
            1 => {
                assert_eq!(text(&mut body), "MQTT");
                assert_eq!(body[0], 4, "the level of MQTT 3.1.1");
                let flags = body[1];
                body.drain(..4);
                let client = text(&mut body);
                assert!(client.starts_with("foxhunt-hunt-"), "{client}");
                assert_eq!(flags & 0b10_0100, 0b10_0100, "a retained will");
                let will = (text(&mut body), text(&mut body));
                seen.wills.push(will);
                let login = (flags & 0b1100_0000 == 0b1100_0000)
                    .then(|| (text(&mut body), text(&mut body)));
                seen.logins.push(login);
                vec![0x20, 2, 0, 0]
            }
            // PUBLISH with quality of service 1: topic, identifier, message.
            3 => {
                assert_eq!(kind & 0b111, 0b011, "retained, and to be confirmed");
                let topic = text(&mut body);
                let id: Vec<u8> = body.drain(..2).collect();
                seen.all.push((topic.clone(), String::from_utf8(body.clone()).expect("UTF-8")));
                seen.retained.insert(topic, body);
                messages += 1;
                if messages >= cut {
                    return;
                }
                vec![0x40, 2, id[0], id[1]]
            }
            12 => vec![0xd0, 0],
            14 => {
                seen.farewells += 1;
                return;
            }
            other => panic!("packet {other}"),
        };
        drop(seen);
        // Whoever has left needs no answer.
        let _ = stream.write_all(&answer);
    }
}

/// The next packet: the first byte, and what follows its length.
fn packet(stream: &mut TcpStream) -> Option<(u8, Vec<u8>)> {
    let mut byte = [0];
    stream.read_exact(&mut byte).ok()?;
    let kind = byte[0];
    let mut length = 0;
    for shift in [0, 7, 14, 21] {
        stream.read_exact(&mut byte).ok()?;
        length |= usize::from(byte[0] & 0x7f) << shift;
        if byte[0] & 0x80 == 0 {
            break;
        }
    }
    let mut body = vec![0; length];
    stream.read_exact(&mut body).ok()?;
    Some((kind, body))
}

/// Takes a text from the beginning.
fn text(body: &mut Vec<u8>) -> String {
    let length = usize::from(u16::from_be_bytes([body[0], body[1]]));
    let text = body.drain(..2 + length).skip(2).collect();
    String::from_utf8(text).expect("UTF-8")
}

#[test]
fn a_broker_gets_every_beacon_and_receiver_for_home_assistant() {
    let broker = Broker::start(None);
    let folder = folder("mqtt");
    let out = folder.to_str().expect("UTF-8");
    let export = folder.join("hunt.geojson");
    let export_to = export.to_str().expect("UTF-8");
    let address = broker.address();
    let ran = Command::new(env!("CARGO_BIN_EXE_foxhunt"))
        .args(["hunt", "three-beacons", "--mqtt", &address, "--mqtt-user", "fox", "--pace", "500"])
        .args(["--out", out, "--export", export_to])
        .args(ORIGIN)
        .env("FOXHUNT_MQTT_PASSWORD", "hound")
        .output()
        .expect("the program was built for this test");
    let stderr = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{stderr}");
    assert!(stderr.contains(&format!("the broker {address}: connected")), "{stderr}");

    let seen = broker.seen();
    let availability = "foxhunt/three-beacons/availability".to_owned();
    assert_eq!(seen.wills, [(availability.clone(), "offline".to_owned())]);
    assert_eq!(seen.logins, [Some(("fox".to_owned(), "hound".to_owned()))]);
    assert_eq!(seen.all.first(), Some(&(availability.clone(), "online".to_owned())));
    assert_eq!(seen.retained[&availability], b"offline");
    assert_eq!(seen.farewells, 1);
    let json = |topic: &str| -> Value {
        let payload = seen.retained.get(topic).unwrap_or_else(|| panic!("{topic} did not come"));
        serde_json::from_slice(payload).expect("JSON")
    };
    let exported = fs::read_to_string(export).expect("an export");
    let exported: Value = serde_json::from_str(&exported).expect("GeoJSON");
    let features = exported["features"].as_array().expect("features");
    let fixes: Vec<_> = features.iter().filter(|it| it["properties"]["kind"] == "fix").collect();
    assert_eq!(fixes.len(), 3, "{exported}");
    let is_config = |topic: &&String| topic.starts_with("homeassistant/device_tracker/");
    let mut beacons = 0;
    let mut receivers = 0;
    for topic in seen.retained.keys().filter(is_config) {
        let config = json(topic);
        assert_eq!(
            *topic,
            format!(
                "homeassistant/device_tracker/{}/config",
                config["unique_id"].as_str().expect("an identifier")
            )
        );
        assert_eq!(config["device"]["identifiers"][0], "foxhunt__three-beacons");
        let place = json(config["json_attributes_topic"].as_str().expect("a topic"));
        assert_eq!(place["simulated"], true);
        assert_eq!(place["hunt"], "three-beacons");
        if place.get("receiver").is_some() {
            receivers += 1;
            assert_eq!(config["availability_topic"], *availability);
            continue;
        }
        beacons += 1;
        let fix = fixes.iter().find(|fix| fix["properties"]["name"] == place["beacon"]);
        let fix = fix.unwrap_or_else(|| panic!("{place} is not in {exported}"));
        assert_eq!(place["longitude"], fix["geometry"]["coordinates"][0]);
        assert_eq!(place["latitude"], fix["geometry"]["coordinates"][1]);
        assert_eq!(place["gps_accuracy"], fix["properties"]["semi_major_95_m"]);
        assert!(place["outcome"].is_string(), "{place}");
        assert!(place["last_reception"]["rss_dbm"].is_number(), "{place}");
    }
    assert_eq!(beacons, 3);
    assert!(receivers > 0, "{:?}", seen.retained.keys());
}

#[test]
fn a_broker_that_comes_back_gets_the_present_state() {
    let broker = Broker::start(Some(2));
    let out = folder("mqtt-cut");
    // Seconds of the hunt leave time to connect again.
    let args = ["hunt", "three-beacons", "--pace", "20", "--out", out.to_str().expect("UTF-8")];
    let address = broker.address();
    let ran = foxhunt(args.iter().chain(&["--mqtt", &address]).chain(&ORIGIN));
    assert_eq!(ran.code, 0, "{ran:?}");
    assert_eq!(ran.stderr.matches("it is tried again").count(), 1, "{}", ran.stderr);
    let seen = broker.seen();
    assert_eq!(seen.wills.len(), 2);
    assert_eq!(seen.farewells, 1);
    let online = |(topic, text): &&(String, String)| {
        topic == "foxhunt/three-beacons/availability" && text == "online"
    };
    assert_eq!(seen.all.iter().filter(online).count(), 2, "each connection gets everything");
    assert!(seen.retained.keys().any(|topic| topic.contains("/beacon/")));
}

#[test]
fn a_missing_broker_does_not_stop_a_hunt() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("bound").to_string();
    drop(listener);
    let out = folder("mqtt-missing");
    let args = ["hunt", "--pace", "100", "--out", out.to_str().expect("UTF-8")];
    let ran = foxhunt(args.iter().chain(&["--mqtt", &address]).chain(&ORIGIN));
    assert_eq!(ran.code, 0, "{ran:?}");
    assert_eq!(ran.stderr.matches("it is tried again").count(), 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("messages were not sent"), "{}", ran.stderr);
}

#[test]
fn wrong_brokers_and_hunts_without_a_place_are_refused() {
    let out = folder("mqtt-refused");
    let out = ["--out", out.to_str().expect("UTF-8")];
    let hunt = |args: &[&'static str]| foxhunt([&["hunt"], args, &out].concat());
    hunt(&["--mqtt", "127.0.0.1"]).failed(2, &["--mqtt: the hunt is in local metres", "--origin"]);
    hunt(&["--mqtt", "host:mqtt"]).failed(2, &["--mqtt", "host:mqtt", "65535"]);
    hunt(&["--mqtt", "mqtts://host"]).failed(2, &["--mqtt", "mqtts://host", "without TLS"]);
    hunt(&["--mqtt-user", "fox"]).failed(2, &["--mqtt"]);
    let user = ["--mqtt", "127.0.0.1", "--mqtt-user", "fox"];
    hunt(&user).failed(2, &["--mqtt-user", "FOXHUNT_MQTT_PASSWORD"]);
}
