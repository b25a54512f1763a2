//! A GNSS driver against another project's program, at the endpoint that `.ci/peers/gnss` names.

use std::{env, thread, time::Duration};

use foxhunt::{
    geodesy::{Geodetic, LocalFrame},
    hardware::{GnssConfig, GnssReceiver, Positioning, Reconnecting, SystemClock},
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
