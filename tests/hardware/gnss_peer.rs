//! A GNSS driver against another project's program, at the endpoint that `.ci/peers/gnss` names.

use std::{env, thread, time::Duration};

use foxhunt::{
    geodesy::{Geodetic, LocalFrame},
    hardware::{
        Corrections, CorrectionsConfig, GnssConfig, GnssReceiver, Positioning, Reconnecting,
        SystemClock,
    },
    wire::{ByteStream, memory_pair, rtcm},
};

/// Reads the peer's place: `FOXHUNT_GNSS_KIND` at `FOXHUNT_GNSS_ENDPOINT` is to be within
/// `FOXHUNT_GNSS_WITHIN_M` of `FOXHUNT_GNSS_PLACE` (degrees North, degrees East, and metres unless
/// the peer has no height), with `FOXHUNT_GNSS_QUALITY`. The receiver's time, where it has one, is
/// to be that of this computer within 10 s; `FOXHUNT_GNSS_DATED` requires one.
#[test]
#[ignore = ".ci/peers/gnss runs it"]
fn a_peer_is_read() {
    let reported = |name: &str| {
        let name = format!("FOXHUNT_GNSS_{name}");
        env::var(&name).unwrap_or_else(|_| panic!("{name} is not set"))
    };
    let kind = serde_json::from_value(reported("KIND").into()).expect("nmea, ublox or gpsd");
    let endpoint = reported("ENDPOINT").parse().expect("an endpoint");
    let place: Vec<f64> =
        reported("PLACE").split(',').map(|part| part.parse().expect("a number")).collect();
    let alt_m = place.get(2).copied();
    let place = Geodetic::new(place[0], place[1], alt_m.unwrap_or(0.0)).expect("on Earth");
    let within_m: f64 = reported("WITHIN_M").parse().expect("metres");
    let clock = SystemClock::start();
    let config = GnssConfig { kind, ..GnssConfig::default() };
    let stream = Reconnecting::open(endpoint, clock).expect("the peer is there");
    let mut receiver = GnssReceiver::new(config, stream, clock).expect("in range");
    let mut last = None;
    for _ in 0..3000 {
        last = Some(receiver.position());
        // The date may come after the place.
        let dated = receiver.last().is_some_and(|fix| fix.utc_s.is_some());
        if let Some(Ok(position)) = &last
            && position.quality.name() == reported("QUALITY")
            && (dated || env::var_os("FOXHUNT_GNSS_DATED").is_none())
        {
            break;
        }
        thread::sleep(Duration::from_millis(10));
    }
    let position = last.expect("it was queried").expect("a fix within 30 s");
    assert_eq!(position.quality.name(), reported("QUALITY"));
    let error = LocalFrame::new(place).expect("on Earth").to_local(&position.place);
    println!("{:?}, {error:?} m from the peer's place, σ {:?}", position, position.sigma_m);
    let error_m = if alt_m.is_some() { error.norm() } else { error.xy().norm() };
    assert!(error_m < within_m, "{error} m from the peer's place");
    assert_eq!(position.height.is_flat(), alt_m.is_none(), "{:?}", position.height);
    let utc_s = receiver.last().and_then(|fix| fix.utc_s);
    let now_s = SystemClock::start().started_unix_s();
    assert!(utc_s.is_none_or(|utc_s| (utc_s - now_s).abs() < 10.0), "{utc_s:?} at {now_s}");
    assert!(utc_s.is_some() || env::var_os("FOXHUNT_GNSS_DATED").is_none(), "it has no time");
}

/// Takes corrections of the caster `FOXHUNT_CASTER_ENDPOINT`, version `FOXHUNT_CASTER_NTRIP`, with
/// the password in `FOXHUNT_CASTER_PASSWORD`: the example of the standard, a damaged frame before
/// each. The password in `FOXHUNT_CASTER_WRONG` is to be refused.
#[test]
#[ignore = ".ci/peers/gnss runs it"]
fn a_peers_corrections_are_forwarded() {
    let reported = |name: &str| {
        let name = format!("FOXHUNT_CASTER_{name}");
        env::var(&name).unwrap_or_else(|_| panic!("{name} is not set"))
    };
    let clock = SystemClock::start();
    for (password, is_right) in [("PASSWORD", true), ("WRONG", false)] {
        let config = CorrectionsConfig {
            endpoint: Some(reported("ENDPOINT").parse().expect("an endpoint")),
            mountpoint: Some("pygnssutils".into()),
            ntrip: Some(reported("NTRIP").parse().expect("1 or 2")),
            user: Some("hunter".into()),
            password_env: Some(format!("FOXHUNT_CASTER_{password}")),
            stale_s: Some(2.0),
            ..CorrectionsConfig::default()
        };
        let endpoint = config.endpoint.clone().expect("given");
        let stream = Reconnecting::open(endpoint, clock).expect("the peer is there");
        let gnss = GnssConfig::default();
        let corrections = Corrections::new(config, gnss.kind, Box::new(stream)).expect("proper");
        let (port, mut device) = memory_pair();
        let receiver = GnssReceiver::new(gnss, port, clock).expect("in range");
        let mut receiver = receiver.with_corrections(corrections);
        let mut forwarded = Vec::new();
        for _ in 0..300 {
            receiver.poll().expect("memory");
            let mut bytes = [0; 512];
            while let Ok(count @ 1..) = device.receive(&mut bytes) {
                forwarded.extend_from_slice(&bytes[..count]);
            }
            thread::sleep(Duration::from_millis(10));
        }
        let own = receiver.corrections().expect("given");
        println!("{own:?}, {} damaged", own.damaged());
        if is_right {
            let mut frames = rtcm::Frames::default();
            frames.take(&forwarded, &mut |frame| {
                assert_eq!(rtcm::message_number(frame), Some(1005));
            });
            assert!(frames.whole() >= 3 && frames.damaged() == 0, "{frames:?}");
            assert_eq!(frames.whole(), own.frames());
            assert!(own.damaged() >= 3);
        } else {
            assert!(forwarded.is_empty());
            let failure = receiver.failure().expect("none has come").to_string();
            assert!(failure.contains("refuses the user or the password"), "{failure}");
        }
    }
}
