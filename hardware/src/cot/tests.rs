use std::{
    io::{Read, Write},
    net::{TcpListener, TcpStream, UdpSocket},
    path::Path,
    time::{Duration, Instant},
};

use super::{CotAddress, CotConfig, CotMessage, CotSender, CotTransport, sender::parcel, tls};
use crate::outbox::Outbox;

/// A time that no test reaches.
const LATER: f64 = 1e10;

fn message(uid: &str, text: &str) -> CotMessage {
    let xml = format!("<event uid=\"{uid}\">{text}</event>").into_bytes();
    CotMessage { uid: uid.to_owned(), xml, stale_unix_s: LATER }
}

fn sender(address: &str) -> CotSender {
    let to = vec![address.parse().expect("an address")];
    CotSender::open(&CotConfig { to, ..CotConfig::default() }, None).expect("no files")
}

/// Reads a connection until a text has come.
fn read_until(stream: &mut TcpStream, text: &str) -> String {
    stream.set_read_timeout(Some(Duration::from_millis(50))).expect("a socket");
    let mut read = Vec::new();
    let end = Instant::now() + Duration::from_secs(10);
    let mut part = [0; 4096];
    while Instant::now() < end {
        if let Ok(bytes) = stream.read(&mut part) {
            read.extend_from_slice(&part[..bytes]);
        }
        if String::from_utf8_lossy(&read).contains(text) {
            return String::from_utf8(read).expect("UTF-8");
        }
    }
    panic!("{text:?} did not come: {}", String::from_utf8_lossy(&read));
}

#[test]
fn addresses_are_read_and_written() {
    for (text, transport, host, port) in [
        ("tcp://tak.example:8087", CotTransport::Tcp, "tak.example", 8087),
        ("TLS://tak.example", CotTransport::Tls, "tak.example", 8089),
        ("udp://239.2.3.1/", CotTransport::Udp, "239.2.3.1", 6969),
        ("udp://[ff02::1]:7000", CotTransport::Udp, "ff02::1", 7000),
    ] {
        let address: CotAddress = text.parse().expect("an address");
        assert_eq!(address, CotAddress { transport, host: host.to_owned(), port });
        assert_eq!(address.to_string().parse::<CotAddress>().expect("as written"), address);
    }
    for (text, why) in [
        ("tak.example:8087", "tcp://"),
        ("http://tak.example", "tcp://"),
        ("tcp://", "host"),
        ("tcp://a b:1", "host"),
        ("tcp://host:0", "65535"),
        ("tcp://host:70000", "65535"),
        ("tcp://[::1", "]"),
    ] {
        let error = text.parse::<CotAddress>().expect_err(text).to_string();
        assert!(error.contains(text) && error.contains(why), "{error}");
    }
}

#[test]
fn only_tls_and_this_computer_are_closed() {
    let is_open = |text: &str| text.parse::<CotAddress>().expect("an address").is_open();
    for open in ["tcp://10.0.0.1", "udp://239.2.3.1", "tcp://tak.example"] {
        assert!(is_open(open), "{open}");
    }
    for closed in ["tls://tak.example", "tcp://localhost", "udp://127.0.0.1", "tcp://[::1]"] {
        assert!(!is_open(closed), "{closed}");
    }
}

#[test]
fn settings_that_change_nothing_are_refused() {
    let of = |address: &str| CotConfig {
        to: vec![address.parse().expect("an address")],
        ..CotConfig::default()
    };
    let refused = |config: &CotConfig| config.check().expect_err("refused").to_string();
    assert!(refused(&CotConfig::default()).starts_with("to:"));
    // No way leads to TLS that is not checked.
    assert!(refused(&of("tls://tak.example")).starts_with("ca:"));
    let ca = Some("ca.pem".into());
    assert!(refused(&CotConfig { ca: ca.clone(), ..of("tcp://tak.example") }).starts_with("ca:"));
    let key = CotConfig { ca: ca.clone(), key: ca.clone(), ..of("tls://tak.example") };
    assert!(refused(&key).starts_with("key:"));
    let from = Some("127.0.0.1".parse().expect("an address"));
    assert!(refused(&CotConfig { from, ..of("tcp://tak.example") }).starts_with("from:"));
    let near = CotConfig { ca, ..of("tls://tak.example") }.in_folder(Path::new("team"));
    assert_eq!(near.ca.as_deref(), Some(Path::new("team/ca.pem")));
    let missing = CotSender::open(&near, None).expect_err("no such file").to_string();
    assert!(missing.contains("team/ca.pem"), "{missing}");
}

#[test]
fn a_lost_server_gets_the_present_state_and_nothing_twice() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("loopback");
    let port = listener.local_addr().expect("bound").port();
    let sender = sender(&format!("tcp://127.0.0.1:{port}"));
    let (mut first, _) = listener.accept().expect("a connection");
    sender.put(&[message("drone", "there"), message("fix", "old")]);
    let came = read_until(&mut first, "old");
    assert!(came.contains("there"), "{came}");
    // The same again is no news; other numbers are.
    sender.put(&[message("drone", "there"), message("fix", "new")]);
    let came = read_until(&mut first, "new");
    assert!(!came.contains("there"), "{came}");
    drop(first);
    let (mut second, _) = listener.accept().expect("a connection again");
    let came = read_until(&mut second, "new");
    assert!(came.contains("there") && !came.contains("old"), "{came}");
    let remarks = sender.take_remarks().join("\n");
    assert!(remarks.contains("it is tried again"), "{remarks}");
    sender.put(&[message("fix", "last")]);
    sender.finish(Duration::from_secs(5)).expect("it is there");
    let _ = read_until(&mut second, "last");
}

#[test]
fn a_server_that_reads_nothing_or_sends_all_the_time_holds_nobody_up() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("loopback");
    let port = listener.local_addr().expect("bound").port();
    let sender = sender(&format!("tcp://127.0.0.1:{port}"));
    let (mut server, _) = listener.accept().expect("a connection");
    let long = "x".repeat(100_000);
    let begun = Instant::now();
    for round in 0..100 {
        let all = (0..100).map(|n| message(&n.to_string(), &format!("{round}{long}")));
        sender.put(&all.collect::<Vec<_>>());
    }
    assert!(begun.elapsed() < Duration::from_secs(3), "{:?}", begun.elapsed());
    // The team's own events, which nobody has use for.
    server.set_write_timeout(Some(Duration::from_secs(5))).expect("a socket");
    server.set_read_timeout(Some(Duration::from_millis(1))).expect("a socket");
    for _ in 0..200 {
        server.write_all(&[b' '; 100_000]).expect("somebody reads");
        // Everything may have come.
        let _ = server.read(&mut vec![0; 1_000_000]);
    }
}

#[test]
fn a_server_that_is_not_there_is_an_error_in_the_end() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("loopback");
    let port = listener.local_addr().expect("bound").port();
    drop(listener);
    let sender = sender(&format!("tcp://127.0.0.1:{port}"));
    sender.put(&[message("fix", "unheard")]);
    let failed = sender.finish(Duration::from_secs(2)).expect_err("nobody is there");
    assert!(failed[0].contains("1 messages were not sent"), "{failed:?}");
}

#[test]
fn datagrams_hold_one_event_each() {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("loopback");
    socket.set_read_timeout(Some(Duration::from_secs(5))).expect("a socket");
    let port = socket.local_addr().expect("bound").port();
    let sender = sender(&format!("udp://127.0.0.1:{port}"));
    let huge = "x".repeat(70_000);
    sender.put(&[message("a", "1"), message("b", &huge), message("c", "3")]);
    let mut came = Vec::new();
    let mut datagram = [0; 4096];
    for _ in 0..2 {
        let bytes = socket.recv(&mut datagram).expect("a datagram");
        came.push(String::from_utf8_lossy(&datagram[..bytes]).into_owned());
    }
    let whole = |uid: &str, text: &str| String::from_utf8(message(uid, text).xml).expect("UTF-8");
    assert_eq!(came, [whole("a", "1"), whole("c", "3")]);
    let remarks = sender.take_remarks().join("\n");
    assert!(remarks.contains("b has 70023 bytes"), "{remarks}");
}

#[test]
fn a_full_outbox_takes_known_names_and_what_is_written_counts() {
    let outbox = Outbox::default();
    let names = (0..2_001).map(|name| message(&name.to_string(), "old"));
    outbox.put(names.collect::<Vec<_>>().iter().map(parcel), 0.0);
    let old = outbox.take(Duration::ZERO, 0.0);
    assert_eq!(old.len(), 2_000);
    assert_eq!(outbox.take(Duration::ZERO, 0.0).len(), 2_000, "nothing was written");
    // The unknown name comes first.
    outbox.put([message("2000", "new"), message("7", "new")].iter().map(parcel), 0.0);
    old.iter().for_each(|(uid, xml)| outbox.sent(uid, xml));
    let left = outbox.take(Duration::ZERO, 0.0);
    assert_eq!(left.iter().map(|(uid, _)| uid.as_str()).collect::<Vec<_>>(), ["7"]);
    outbox.close();
    outbox.lost("gone".to_owned());
    outbox.end();
    let failure = outbox.ended(Duration::ZERO).expect("messages are left");
    assert_eq!(failure, "2000 messages were not sent: gone");
}

#[test]
fn a_wrong_name_of_the_server_is_blamed_on_its_setting() {
    let refused = |setting| tls::name(setting, "a b").expect_err("a space").to_string();
    assert!(refused(Some("tak server")).starts_with("server_name:"));
    assert!(refused(None).contains("\"a b\""));
}
