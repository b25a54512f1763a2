use std::{cell::Cell, io};

use foxhunt_wire::{ByteStream, FixQuality, geodesy::Geodetic, memory_pair};
use nalgebra::Vector3;
use proptest::prelude::*;

use super::*;

/// A sentence with its checksum.
fn sentence(text: &str) -> String {
    format!("${text}*{:02X}\r\n", text.bytes().fold(0, |sum, byte| sum ^ byte))
}

fn decoded(decoder: &mut dyn GnssDecoder, bytes: &[u8]) -> Vec<GnssFix> {
    let mut fixes = Vec::new();
    decoder.decode(bytes, &mut |fix| fixes.push(fix));
    fixes
}

/// A NAV-PVT (u-blox F9 interface description): 2026-03-01 12:34:56.5, fix type and flags as given,
/// 50.1° N, 14.5° E, 400 m, hAcc 2.828 m, vAcc 3.5 m, 17 satellites, 1.5 m/s to the North, 0.7 to
/// the West, 0.25 down.
fn nav_pvt(fix_type: u8, flags: u8) -> Vec<u8> {
    let mut payload = vec![0_u8; 92];
    let mut put = |at: usize, bytes: &[u8]| payload[at..at + bytes.len()].copy_from_slice(bytes);
    put(4, &2026_u16.to_le_bytes());
    put(6, &[3, 1, 12, 34, 56, 0x07]);
    put(16, &500_000_000_i32.to_le_bytes());
    put(20, &[fix_type, flags, 0, 17]);
    put(24, &145_000_000_i32.to_le_bytes());
    put(28, &501_000_000_i32.to_le_bytes());
    put(32, &400_000_i32.to_le_bytes());
    put(36, &355_000_i32.to_le_bytes());
    put(40, &2828_u32.to_le_bytes());
    put(44, &3500_u32.to_le_bytes());
    put(48, &1500_i32.to_le_bytes());
    put(52, &(-700_i32).to_le_bytes());
    put(56, &250_i32.to_le_bytes());
    let mut body = vec![0x01, 0x07, 92, 0];
    body.extend(payload);
    let (a, b) = body.iter().fold((0_u8, 0_u8), |(a, b), &byte| {
        let a = a.wrapping_add(byte);
        (a, b.wrapping_add(a))
    });
    [vec![0xb5, 0x62], body, vec![a, b]].concat()
}

const TPV: &str = r#"{"class":"TPV","device":"/dev/pts/3","status":3,"mode":3,"time":"2026-03-01T12:34:56.500Z","leapseconds":18,"ept":0.005,"lat":50.1,"lon":14.5,"altHAE":400.0,"altMSL":355.0,"alt":355.0,"epx":0.012,"epy":0.015,"epv":0.03,"eph":0.019,"sep":0.04}"#;

/// 2026-03-01 12:34:56.5.
const MOMENT: f64 = 1_772_368_496.5;

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance
}

#[test]
fn nmea_takes_place_sigma_and_date_of_three_sentences() {
    let mut decoder = NmeaDecoder::new();
    // The magnetic variation without a direction is what some receivers send.
    let rmc = sentence("GNRMC,123455.50,A,5006.00000,N,01430.00000,E,0.0,,010326,3.9,,A");
    assert!(decoded(&mut decoder, rmc.as_bytes()).is_empty());
    let gga =
        sentence("GNGGA,123456.50,5006.00000,N,01430.00000,E,4,17,0.7,355.0,M,45.0,M,1.0,0000");
    let [first] = decoded(&mut decoder, gga.as_bytes())[..] else { panic!("one fix") };
    assert_eq!((first.quality, first.sigma_m, first.flat), (FixQuality::RtkFixed, None, false));
    assert_eq!(first.satellites, Some(17));
    assert!(close(first.hdop.expect("reported"), 0.7, 1e-6));
    assert!(close(first.utc_s.expect("a date came"), MOMENT, 1e-3));
    let place = first.place.expect("a fix");
    assert!(close(place.lat_deg, 50.1, 1e-9) && close(place.lon_deg, 14.5, 1e-9));
    assert!(close(place.alt_m, 400.0, 1e-4), "above the ellipsoid");
    let gst = sentence("GNGST,123456.50,1.2,0.02,0.01,30,0.015,0.012,0.03");
    let [second] = decoded(&mut decoder, gst.as_bytes())[..] else { panic!("repeated") };
    let sigma = second.sigma_m.expect("GST holds it");
    assert!((sigma - Vector3::new(0.012, 0.015, 0.03)).norm() < 1e-6, "East is the longitude's");
    // The next second's GGA comes before its GST, with the σ of the one before; later it is too
    // old.
    let at =
        |time: &str| sentence(&format!("GNGGA,{time},5006.0,S,01430.0,W,1,5,2.0,355.0,M,45.0,M,,"));
    let [next] = decoded(&mut decoder, at("123457.50").as_bytes())[..] else { panic!("one fix") };
    assert_eq!(next.sigma_m, second.sigma_m);
    assert!(next.place.is_some_and(|place| place.lat_deg < 0.0 && place.lon_deg < 0.0));
    let [late] = decoded(&mut decoder, at("123500.00").as_bytes())[..] else { panic!("one fix") };
    assert_eq!(late.sigma_m, None);
    assert_eq!((decoder.messages(), decoder.refused()), (5, 0));
}

#[test]
fn nmea_crosses_midnight_and_marks_what_is_no_fix() {
    let mut decoder = NmeaDecoder::new();
    let rmc = sentence("GPRMC,235959.90,A,5006.0,N,01430.0,E,0.0,,010326,,,A");
    let gga = sentence("GPGGA,000000.10,5006.0,N,01430.0,E,2,9,1.0,355.0,M,45.0,M,,");
    let fixes = decoded(&mut decoder, (rmc + &gga).as_bytes());
    assert!(close(fixes[0].utc_s.expect("dated"), 1_772_409_600.1, 1e-3), "the next day");
    assert_eq!(fixes[0].quality, FixQuality::Differential);
    let nothing = sentence("GPGGA,000001.00,,,,,0,03,,,M,,M,,");
    let flat = sentence("GPGGA,000002.00,5006.0,N,01430.0,E,1,3,6.0,,M,,M,,");
    let fixes = decoded(&mut decoder, (nothing + &flat).as_bytes());
    assert_eq!((fixes[0].quality, fixes[0].place), (FixQuality::None, None));
    assert_eq!(fixes[0].satellites, Some(3));
    assert!(fixes[1].flat && fixes[1].place.is_some_and(|place| close(place.alt_m, 400.0, 1e-4)));
    decoder.reset();
    let flat = sentence("GPGGA,000002.00,5006.0,N,01430.0,E,1,3,6.0,,M,,M,,");
    assert_eq!(decoded(&mut decoder, flat.as_bytes())[0].place, None, "it has had no height");
}

#[test]
fn nmea_wants_the_checksum_and_finds_its_way_back() {
    let mut decoder = NmeaDecoder::new();
    let good = sentence("GPGGA,123456.00,5006.0,N,01430.0,E,1,9,1.0,355.0,M,45.0,M,,");
    let wrong = good.replace("5006", "5106");
    let bare = "$GPGGA,123456.00,5006.0,N,01430.0,E,1,9,1.0,355.0,M,45.0,M,,\r\n";
    let foreign = sentence("PUBX,00,123456.00") + &sentence("GPXYZ,1,2");
    let cut = &good[..30];
    let bytes =
        [wrong.as_bytes(), bare.as_bytes(), &[0xff; 300], foreign.as_bytes(), cut.as_bytes()];
    assert!(decoded(&mut decoder, &bytes.concat()).is_empty());
    assert_eq!((decoder.messages(), decoder.refused()), (2, 2));
    assert_eq!(decoded(&mut decoder, good.as_bytes()).len(), 1, "a $ begins a sentence anywhere");
}

#[test]
fn ublox_has_carrier_solution_and_accuracies() {
    let mut decoder = UbloxDecoder::new();
    let cases = [
        (3, 0x01, FixQuality::Autonomous),
        (3, 0x03, FixQuality::Differential),
        (3, 0x43, FixQuality::RtkFloat),
        (3, 0x83, FixQuality::RtkFixed),
        (4, 0x01, FixQuality::Autonomous),
        (1, 0x01, FixQuality::Estimated),
        (3, 0x00, FixQuality::None),
        (0, 0x01, FixQuality::None),
        (5, 0x01, FixQuality::None),
    ];
    for (fix_type, flags, quality) in cases {
        let [fix] = decoded(&mut decoder, &nav_pvt(fix_type, flags))[..] else { panic!("one fix") };
        assert_eq!(fix.quality, quality, "type {fix_type}, flags {flags:#x}");
        assert_eq!(fix.place.is_some(), quality > FixQuality::None);
        assert_eq!(fix.satellites, Some(17));
    }
    let [fix] = decoded(&mut decoder, &nav_pvt(3, 1))[..] else { panic!("one fix") };
    let place = fix.place.expect("a fix");
    assert!(close(place.lat_deg, 50.1, 1e-9) && close(place.lon_deg, 14.5, 1e-9));
    assert!(close(place.alt_m, 400.0, 1e-9), "above the ellipsoid");
    let sigma = fix.sigma_m.expect("always sent");
    assert!((sigma - Vector3::new(2.0, 2.0, 3.5)).norm() < 1e-3, "hAcc is both axes: {sigma}");
    assert!(close(fix.utc_s.expect("dated"), MOMENT, 1e-3));
    let velocity = fix.velocity_mps.expect("always sent with a fix");
    assert!((velocity - Vector3::new(-0.7, 1.5, -0.25)).norm() < 1e-9, "{velocity}");
    let [none] = decoded(&mut decoder, &nav_pvt(0, 1))[..] else { panic!("no fix") };
    assert_eq!(none.velocity_mps, None);
}

#[test]
fn velocity_comes_by_rmc_and_tpv() {
    let mut decoder = NmeaDecoder::new();
    let gga = sentence("GPGGA,123456.50,5006.0,N,01430.0,E,1,9,1.0,355.0,M,45.0,M,,");
    let rmc = |speed_course: &str| {
        sentence(&format!("GPRMC,123456.50,A,5006.0,N,01430.0,E,{speed_course},010326,,,A"))
    };
    // 10 knots to the East by South.
    let [first] = decoded(&mut decoder, gga.as_bytes())[..] else { panic!("one fix") };
    assert_eq!(first.velocity_mps, None);
    let [second] = decoded(&mut decoder, rmc("10.0,120.0").as_bytes())[..] else {
        panic!("repeated, with a velocity")
    };
    let velocity = second.velocity_mps.expect("speed and course");
    let speed = 10.0 * 1852.0 / 3600.0;
    let expected = Vector3::new(speed * 0.75_f64.sqrt(), -speed / 2.0, 0.0);
    assert!((velocity - expected).norm() < 1e-9, "{velocity}");
    assert_eq!(GnssFix { velocity_mps: None, ..second }, GnssFix { utc_s: None, ..first });
    // A GST of the same moment keeps it, and the next second's fix has it until its own RMC comes.
    let gst = sentence("GPGST,123456.50,1.2,0.02,0.01,30,0.015,0.012,0.03");
    let [third] = decoded(&mut decoder, gst.as_bytes())[..] else { panic!("repeated, with σ") };
    assert!(third.velocity_mps == second.velocity_mps && third.sigma_m.is_some());
    let next = gga.replace("56.50", "57.50");
    let next = sentence(next.trim_start_matches('$').split('*').next().expect("text"));
    let [fourth] = decoded(&mut decoder, next.as_bytes())[..] else { panic!("one fix") };
    assert_eq!(fourth.velocity_mps, second.velocity_mps);
    // Without a course, or of no fix, it is none.
    decoder.reset();
    let void = rmc("10.0,120.0").replace(",A,5006", ",V,5006");
    let void = sentence(void.trim_start_matches('$').split('*').next().expect("text"));
    for text in [rmc("0.1,"), void] {
        assert!(decoded(&mut decoder, text.as_bytes()).is_empty());
        let [fix] = decoded(&mut decoder, gga.as_bytes())[..] else { panic!("one fix") };
        assert_eq!(fix.velocity_mps, None);
    }
    let mut decoder = GpsdDecoder::new();
    let moving = TPV.replace("\"eph\"", "\"speed\":2.0,\"track\":270.0,\"climb\":0.5,\"eph\"");
    let [fix] = decoded(&mut decoder, format!("{moving}\n").as_bytes())[..] else { panic!() };
    let velocity = fix.velocity_mps.expect("speed and track");
    assert!((velocity - Vector3::new(-2.0, 0.0, 0.5)).norm() < 1e-9, "{velocity}");
    assert_eq!(decoded(&mut decoder, format!("{TPV}\n").as_bytes())[0].velocity_mps, None);
}

#[test]
fn ublox_survives_garbage_cuts_and_false_lengths() {
    let mut decoder = UbloxDecoder::new();
    let good = nav_pvt(3, 1);
    let mut wrong = good.clone();
    wrong[30] ^= 4;
    // A header that promises 1200 bytes that never come holds up no more than 256.
    let false_header = [0xb5, 0x62, 0x01, 0x35, 0xb0, 0x04];
    let nmea = sentence("GPGGA,123456.00,5006.0,N,01430.0,E,1,9,1.0,355.0,M,45.0,M,,");
    let mut bytes = [&[7, 0xb5, 0xb5, 0x62][..], &wrong, &good[..50], nmea.as_bytes()].concat();
    bytes.extend(false_header);
    let before = decoded(&mut decoder, &bytes).len();
    let after: usize = (0..4).map(|_| decoded(&mut decoder, &good).len()).sum();
    assert_eq!(before, 0);
    assert!(after >= 2, "{after} of 4 after a false header");
    let set_up = decoder.set_up();
    assert_eq!(&set_up[..9], &[0xb5, 0x62, 6, 1, 3, 0, 1, 7, 1], "CFG-MSG of NAV-PVT");
    assert_eq!(&set_up[11..15], &[0xb5, 0x62, 6, 0x8a], "CFG-VALSET");
}

#[test]
fn gpsd_reports_are_read() {
    let mut decoder = GpsdDecoder::new();
    let sky = r#"{"class":"SKY","hdop":0.7,"satellites":[{"PRN":1,"used":true},{"PRN":2,"used":false},{"PRN":3,"used":true}]}"#;
    let lines =
        format!("{{\"class\":\"VERSION\",\"release\":\"3.22\"}}\r\nno JSON\n{sky}\r\n{TPV}\r\n");
    let [fix] = decoded(&mut decoder, lines.as_bytes())[..] else { panic!("one fix") };
    assert_eq!((fix.quality, fix.satellites), (FixQuality::RtkFixed, Some(2)));
    assert!(close(fix.utc_s.expect("dated"), MOMENT, 1e-3));
    assert_eq!(fix.place, Some(Geodetic { lat_deg: 50.1, lon_deg: 14.5, alt_m: 400.0 }));
    assert_eq!(fix.sigma_m, Some(Vector3::new(0.012, 0.015, 0.03)));
    assert_eq!((decoder.messages(), decoder.refused()), (3, 1));
    let qualities = [(1, FixQuality::Autonomous), (2, FixQuality::Differential)];
    for (status, quality) in
        qualities.into_iter().chain([(4, FixQuality::RtkFloat), (5, FixQuality::Estimated)])
    {
        let text = TPV.replace("\"status\":3", &format!("\"status\":{status}")) + "\n";
        assert_eq!(decoded(&mut decoder, text.as_bytes())[0].quality, quality);
    }
    // What gpsd 3.22 sends of an NMEA receiver: an eph that is HDOP times 19 m, and GST by itself.
    let bare = TPV.split(",\"epx\"").next().expect("its head").to_owned() + ",\"eph\":11.4}\n";
    assert_eq!(decoded(&mut decoder, bare.as_bytes())[0].sigma_m, None);
    let gst =
        r#"{"class":"GST","time":"2026-03-01T12:34:56.000Z","lat":0.014,"lon":0.011,"alt":0.03}"#;
    let fixes = decoded(&mut decoder, format!("{gst}\n{bare}").as_bytes());
    assert_eq!(fixes[0].sigma_m, Some(Vector3::new(0.011, 0.014, 0.03)));
    let later = bare.replace("12:34:56.500", "12:34:59.000");
    assert_eq!(decoded(&mut decoder, later.as_bytes())[0].sigma_m, None, "it is too old");
    let flat = TPV.replace("\"mode\":3", "\"mode\":2").replace(",\"epv\":0.03", "") + "\n";
    assert!(decoded(&mut decoder, flat.as_bytes())[0].flat);
    let [none] = decoded(&mut decoder, b"{\"class\":\"TPV\",\"mode\":1}\n")[..] else { panic!() };
    assert_eq!((none.quality, none.place), (FixQuality::None, None));
}

/// A receiver whose sentences and time the test sets.
struct Bench<'a> {
    time: &'a Cell<f64>,
    far: foxhunt_wire::MemoryStream,
}

impl Bench<'_> {
    fn send(&mut self, time: f64, quality: u8, tail: &str) {
        self.time.set(time);
        let text = format!("GPGGA,,5006.0,N,01430.0,E,{quality},9,{tail},355.0,M,45.0,M,,");
        self.far.send(sentence(&text).as_bytes()).expect("memory");
    }
}

#[test]
fn sigma_grows_with_age_and_poor_quality_until_the_fix_is_too_old() {
    let time = Cell::new(0.0);
    let (near, far) = memory_pair();
    let mut receiver =
        GnssReceiver::new(GnssConfig::default(), near, || time.get()).expect("in range");
    let mut bench = Bench { time: &time, far };
    assert!(matches!(receiver.position(), Err(GnssError::NoFix { satellites: None })));
    bench.send(10.0, 4, "0.7");
    let rtk = receiver.position().expect("a fix");
    // Untold: 2 · 0.01 m · 0.7, and twice that for Up.
    assert!((rtk.sigma_m - Vector3::new(0.014, 0.014, 0.028)).norm() < 1e-6, "{}", rtk.sigma_m);
    bench.send(11.0, 1, "1.0");
    let alone = receiver.position().expect("a fix");
    assert!((alone.sigma_m - Vector3::new(2.6, 2.6, 5.2)).norm() < 1e-6, "{}", alone.sigma_m);
    time.set(14.0);
    let old = receiver.position().expect("old, but not too old");
    assert!(close(old.sigma_m.x, 2.6_f64.hypot(6.0), 1e-9) && close(old.age_s, 3.0, 1e-9));
    time.set(16.5);
    let error = receiver.position().expect_err("too old").to_string();
    assert!(error.contains("5.5 s old") && error.contains("5 s are allowed"), "{error}");
    // A receiver that has lost its fix is no news of its place.
    bench.send(17.0, 0, "9.9");
    assert!(matches!(receiver.position(), Err(GnssError::Stale { .. })));
    bench.send(17.0, 2, "1.0");
    drop(bench);
    assert!(receiver.position().is_ok(), "what was delivered counts");
    assert!(receiver.poll().is_err_and(|error| error.kind() == io::ErrorKind::UnexpectedEof));
    assert!(receiver.position().is_ok(), "a pulled cable does not move the antenna");
    time.set(30.0);
    assert!(matches!(receiver.position(), Err(GnssError::Stream(_))));
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let config = GnssConfig { stale_s: 0.0, ..GnssConfig::default() };
    let error = config.check().expect_err("no fix could be young enough").to_string();
    assert_eq!(error, "stale_s is 0; it must be a positive number");
    let mut config = GnssConfig::default();
    config.floors.rtk_fixed_m = f64::NAN;
    assert!(config.check().expect_err("NaN").to_string().contains("floors.rtk_fixed_m"));
    let read: GnssConfig =
        serde_json::from_str(r#"{"kind":"ublox","antenna_up_m":0.2}"#).expect("fields");
    assert_eq!((read.kind, read.antenna().z.to_bits()), (GnssKind::Ublox, 0.2_f64.to_bits()));
    assert!(serde_json::from_str::<GnssConfig>(r#"{"speed":1}"#).is_err());
    // A σ that a receiver flatters itself with stays above the floor; a larger one is believed.
    let fix = GnssFix {
        place: Some(Geodetic { lat_deg: 50.0, lon_deg: 14.0, alt_m: 0.0 }),
        quality: FixQuality::Autonomous,
        sigma_m: Some(Vector3::new(0.1, 4.0, 0.1)),
        ..GnssFix::default()
    };
    let config = GnssConfig::default();
    assert_eq!(config.sigma(&fix), Some(Vector3::new(1.3, 4.0, 2.6)));
    let flat = GnssFix { flat: true, ..fix };
    assert_eq!(config.sigma(&flat), Some(Vector3::new(1.3, 4.0, 50.0)));
    assert_eq!(config.sigma(&GnssFix { place: None, ..fix }), None);
}

/// All decoders, new.
fn decoders() -> [Box<dyn GnssDecoder>; 3] {
    [Box::new(NmeaDecoder::new()), Box::new(UbloxDecoder::new()), Box::new(GpsdDecoder::new())]
}

/// Bytes that look like something: whole messages, pieces of them, and noise.
fn plausible() -> impl Strategy<Value = Vec<u8>> {
    let gga = sentence("GPGGA,123456.00,5006.0,N,01430.0,E,1,9,1.0,355.0,M,45.0,M,,").into_bytes();
    let gst = sentence("GNGST,123456.00,1.2,0.02,0.01,30,0.015,0.012,0.03").into_bytes();
    let whole = [gga, gst, nav_pvt(3, 1), nav_pvt(2, 0x81), format!("{TPV}\n").into_bytes()];
    let piece = (prop::sample::select(whole.to_vec()), any::<(u16, u16, bool)>()).prop_map(
        |(mut bytes, (cut, flip, damaged))| {
            if damaged {
                let length = bytes.len();
                bytes[usize::from(flip) % length] ^= 1 << (flip % 8);
                bytes.truncate(1 + usize::from(cut) % length);
            }
            bytes
        },
    );
    let noise = prop::collection::vec(any::<u8>(), 0..80);
    let parts = prop::collection::vec(prop_oneof![3 => piece, 1 => noise], 0..12);
    parts.prop_map(|parts| parts.concat())
}

proptest! {
    #[test]
    fn bytes_mean_the_same_however_they_are_cut(
        bytes in plausible(), size in 1..64_usize,
    ) {
        for (mut whole, mut cut) in decoders().into_iter().zip(decoders()) {
            let at_once = decoded(whole.as_mut(), &bytes);
            let mut pieces = Vec::new();
            for piece in bytes.chunks(size) {
                pieces.extend(decoded(cut.as_mut(), piece));
            }
            for fix in &at_once {
                prop_assert!(fix.place.is_some() == (fix.quality > FixQuality::None));
                prop_assert!(fix.sigma_m.is_none_or(|sigma| sigma.iter().all(|s| *s > 0.0)));
            }
            // A u-blox frame that is announced too long is given up sooner in small pieces.
            if whole.name() != "u-blox" {
                prop_assert_eq!(at_once, pieces);
            }
        }
    }

    #[test]
    fn no_bytes_panic_and_a_message_is_found_behind_them(
        bytes in prop::collection::vec(any::<u8>(), 0..600),
    ) {
        let messages = [
            sentence("GPGGA,123456.00,5006.0,N,01430.0,E,1,9,1.0,355.0,M,45.0,M,,").into_bytes(),
            nav_pvt(3, 1),
            format!("{TPV}\n").into_bytes(),
        ];
        for (mut decoder, message) in decoders().into_iter().zip(messages) {
            decoder.decode(&bytes, &mut |_| {});
            let found: usize = (0..8).map(|_| decoded(decoder.as_mut(), &message).len()).sum();
            prop_assert!(found >= 4, "{}: {found} of 8", decoder.name());
        }
    }
}
