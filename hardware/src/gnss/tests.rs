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
    assert_eq!(
        (first.quality, first.sigma_m, first.height),
        (FixQuality::RtkFixed, None, HeightOrigin::Fix)
    );
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
    assert!(
        fixes[1].height.is_flat()
            && fixes[1].place.is_some_and(|place| close(place.alt_m, 400.0, 1e-4))
    );
    decoder.reset();
    let flat = sentence("GPGGA,000002.00,5006.0,N,01430.0,E,1,3,6.0,,M,,M,,");
    let fix = decoded(&mut decoder, flat.as_bytes())[0];
    assert_eq!(fix.height, HeightOrigin::SeaLevel, "it has had no height");
    assert!(fix.place.is_some_and(|place| close(place.alt_m, 44.7, 1.5)), "{fix:?}");
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
    // One that stops stands at once; a course that is missing at speed makes it unknown.
    for (still, expected) in [("0.05,", Some(Vector3::zeros())), ("5.0,", None)] {
        for place_first in [true, false] {
            decoder.reset();
            assert!(decoded(&mut decoder, rmc("10.0,120.0").as_bytes()).is_empty());
            let still = rmc(still).replace("56.50", "57.50");
            let still = sentence(still.trim_start_matches('$').split('*').next().expect("text"));
            let both = if place_first { next.clone() + &still } else { still + &next };
            let fixes = decoded(&mut decoder, both.as_bytes());
            assert_eq!(fixes.last().expect("a fix").velocity_mps, expected);
        }
    }
    // Without a status, or in mode N of VTG, there is no velocity; without a speed it stays.
    let cases = [
        ("GPRMC,123456.50,V,5006.0,N,01430.0,E,,,010326,,,N", false),
        ("GPVTG,120.0,T,,M,10.0,N,18.5,K,N", false),
        ("GPRMC,123456.50,A,5006.0,N,01430.0,E,,,010326,,,A", true),
        ("GPVTG,,T,,M,,N,,K,A", true),
    ];
    for (text, stays) in cases {
        decoder.reset();
        let before = decoded(&mut decoder, (gga.clone() + &rmc("10.0,120.0")).as_bytes());
        assert!(before.last().is_some_and(|fix| fix.velocity_mps.is_some()));
        let fixes = fixes_of(&mut decoder, &[text]);
        assert_eq!(fixes.len(), usize::from(!stays), "{text}");
        assert!(fixes.iter().all(|fix| fix.velocity_mps.is_none()), "{text}");
        let [fix] = decoded(&mut decoder, next.as_bytes())[..] else { panic!("one fix") };
        assert_eq!(fix.velocity_mps.is_some(), stays, "{text}");
    }
    let mut decoder = NmeaDecoder::new();
    let signed = "GPRMC,123456.50,A,5006.0,N,01430.0,E,0.0,,+10326,,,A";
    assert!(fixes_of(&mut decoder, &[signed, signed]).is_empty());
    assert_eq!(decoder.refused(), 2, "a date has no sign");
    let mut decoder = GpsdDecoder::new();
    let moving = TPV.replace("\"eph\"", "\"speed\":2.0,\"track\":270.0,\"climb\":0.5,\"eph\"");
    let [fix] = decoded(&mut decoder, format!("{moving}\n").as_bytes())[..] else { panic!() };
    let velocity = fix.velocity_mps.expect("speed and track");
    assert!((velocity - Vector3::new(-2.0, 0.0, 0.5)).norm() < 1e-9, "{velocity}");
    assert_eq!(decoded(&mut decoder, format!("{TPV}\n").as_bytes())[0].velocity_mps, None);
}

/// Fixes of sentences without their checksums.
fn fixes_of(decoder: &mut dyn GnssDecoder, sentences: &[&str]) -> Vec<GnssFix> {
    let text: String = sentences.iter().map(|text| sentence(text)).collect();
    decoded(decoder, text.as_bytes())
}

#[test]
fn a_marine_receiver_is_placed_by_rmc_or_gll_alone() {
    let rmc = |second: u32| {
        sentence(&format!("GPRMC,1234{second}.50,A,5006.0,N,01430.0,E,10.0,90.0,010326,,,A"))
    };
    let mut decoder = NmeaDecoder::new();
    assert!(decoded(&mut decoder, rmc(55).as_bytes()).is_empty(), "a GGA may follow");
    assert!(decoder.missing().is_some_and(|missing| missing.contains("one RMC came")));
    let [fix] = decoded(&mut decoder, rmc(56).as_bytes())[..] else { panic!("one fix") };
    let place = fix.place.expect("valid");
    assert!(close(place.lat_deg, 50.1, 1e-9) && close(place.lon_deg, 14.5, 1e-9));
    assert_eq!((fix.quality, fix.height), (FixQuality::Autonomous, HeightOrigin::SeaLevel));
    assert!(close(fix.utc_s.expect("dated"), MOMENT, 1e-3));
    let velocity = fix.velocity_mps.expect("speed and course");
    assert!((velocity - Vector3::new(10.0 * 1852.0 / 3600.0, 0.0, 0.0)).norm() < 1e-9);
    let missing = decoder.missing().expect("a height");
    assert!(missing.contains("RMC, without a height: turn GGA on"), "{missing}");
    let mut decoder = NmeaDecoder::new();
    let void = "GPRMC,123455.50,V,5006.0,N,01430.0,E,,,010326,,,N";
    let fixes = fixes_of(&mut decoder, &[void, &void.replace("55.50", "56.50")]);
    assert_eq!((fixes.len(), fixes[0].place), (1, None), "V is no place");

    // GLL with a VTG after it: its velocity is that of the same moment.
    let mut decoder = NmeaDecoder::new();
    let gll = |second: u32| format!("IIGLL,5006.0,S,01430.0,W,1234{second}.50,A,D");
    let vtg = "IIVTG,180.0,T,,M,2.0,N,3.7,K,D";
    let fixes = fixes_of(&mut decoder, &[&gll(55), vtg, &gll(56), vtg]);
    assert_eq!(fixes.len(), 2, "the second one is repeated with its velocity");
    assert_eq!((fixes[1].quality, fixes[0].velocity_mps), (FixQuality::Differential, None));
    let velocity = fixes[1].velocity_mps.expect("of VTG");
    assert!((velocity - Vector3::new(0.0, -2.0 * 1852.0 / 3600.0, 0.0)).norm() < 1e-9);
    assert!(fixes[1].place.is_some_and(|place| place.lat_deg < 0.0 && place.lon_deg < 0.0));
    let missing = decoder.missing().expect("height and date");
    assert!(missing.contains("GLL") && missing.contains("no date"), "{missing}");

    // Before NMEA 2.0 a GLL had neither time nor status.
    let mut decoder = NmeaDecoder::new();
    let old = "LCGLL,5006.00,N,01430.00,E";
    let fixes = fixes_of(&mut decoder, &[old, old]);
    assert_eq!((fixes.len(), fixes[0].quality), (1, FixQuality::Estimated));
    assert!(decoder.missing().is_some_and(|missing| missing.contains("is valid")));
}

#[test]
fn the_best_sentence_gives_the_place_and_poorer_ones_replace_it() {
    let at = |second: u32| {
        let time = format!("1234{second:02}.00");
        let gga = format!("GPGGA,{time},5006.0,N,01430.0,E,1,9,1.0,355.0,M,45.0,M,,");
        let rmc = format!("GPRMC,{time},A,5006.0,N,01431.0,E,0.0,,010326,,,A");
        let gns = format!("GNGNS,{time},5006.0,N,01432.0,E,AN,12,0.8,355.0,45.0,,,V");
        (gga, rmc, gns)
    };
    let lon = |fix: &GnssFix| fix.place.map(|place| ((place.lon_deg - 14.5) * 60.0).round());
    let mut decoder = NmeaDecoder::new();
    // Whatever their order, GGA leads at once.
    for second in 0..3 {
        let (gga, rmc, gns) = at(second);
        let fixes = fixes_of(&mut decoder, &[&rmc, &gns, &gga]);
        assert!(fixes.iter().all(|fix| lon(fix) == Some(0.0)) && fixes.len() == 1, "{fixes:?}");
    }
    // A GGA without a place is believed, too.
    let fixes = fixes_of(&mut decoder, &["GPGGA,123403.00,,,,,0,02,,,M,,M,,", &at(3).1]);
    assert_eq!((fixes.len(), fixes[0].place), (1, None));
    // When GGA stays away, GNS takes over after 10 s, and has a height of its own.
    let fixes: Vec<_> =
        (4..20).flat_map(|second| fixes_of(&mut decoder, &[&at(second).2])).collect();
    assert_eq!(fixes.len(), 5, "from the second one after 10 s on");
    assert_eq!((lon(&fixes[0]), fixes[0].height), (Some(2.0), HeightOrigin::Fix));
    assert_eq!((fixes[0].satellites, fixes[0].quality), (Some(12), FixQuality::Autonomous));
    assert_eq!(decoder.refused(), 0);
}

#[test]
fn a_gga_without_quality_or_height_is_made_the_best_of() {
    // A GGA without a quality lends its height to the RMC that says that the place is valid.
    let mut decoder = NmeaDecoder::new();
    let at = |second: u32| {
        let gga = format!("GPGGA,1234{second}.00,5006.0,N,01430.0,E,,9,1.0,355.0,M,45.0,M,,");
        let rmc = format!("GPRMC,1234{second}.00,A,5006.0,N,01430.0,E,0.0,,010326,,,A");
        [rmc, gga]
    };
    let mut fixes = Vec::new();
    for second in 10..14 {
        let [rmc, gga] = at(second);
        fixes.extend(fixes_of(&mut decoder, &[&gga, &rmc]));
    }
    let last = fixes.last().expect("fixes");
    assert_eq!((last.quality, last.height), (FixQuality::Autonomous, HeightOrigin::Fix));
    assert!(last.place.is_some_and(|place| close(place.alt_m, 400.0, 1e-9)));
    // Alone, it is an estimate.
    let mut decoder = NmeaDecoder::new();
    let [_, gga] = at(10);
    let fixes = fixes_of(&mut decoder, &[&gga, &at(11)[1]]);
    assert_eq!((fixes.len(), fixes[0].quality), (1, FixQuality::Estimated));
    assert!(fixes[0].place.is_some_and(|place| close(place.alt_m, 400.0, 1e-9)));
    // Without a height it is flat; with one above the sea alone, the geoid is the model's.
    let mut decoder = NmeaDecoder::new();
    let flat = "GPGGA,123410.00,5006.0,N,01430.0,E,1,9,1.0,,,,,,";
    let sea = "GPGGA,123411.00,5006.0,N,01430.0,E,1,9,1.0,355.0,M,,,,";
    let fixes = fixes_of(&mut decoder, &[flat, sea, &flat.replace("10.00", "12.00")]);
    let heights: Vec<_> = fixes.iter().map(|fix| fix.height).collect();
    let expected = [HeightOrigin::SeaLevel, HeightOrigin::Geoid, HeightOrigin::Earlier];
    assert_eq!(heights, expected);
    // EGM96 has 44.6 m in Prague's North.
    let alt_m = |at: usize| fixes[at].place.expect("a fix").alt_m;
    assert!(close(alt_m(1), 399.6, 1.5) && close(alt_m(2), alt_m(1), 0.0), "{}", alt_m(1));
}

#[test]
fn zda_has_the_date_and_compasses_the_heading() {
    let mut decoder = NmeaDecoder::new();
    let gga = "GPGGA,123456.50,5006.0,N,01430.0,E,1,9,1.0,355.0,M,45.0,M,,";
    let zda = "GPZDA,123456.00,01,03,2026,00,00";
    let [fix] = fixes_of(&mut decoder, &[zda, gga])[..] else { panic!("one fix") };
    assert!(close(fix.utc_s.expect("dated"), MOMENT, 1e-3));
    assert_eq!((decoder.missing(), decoder.take_heading()), (None, None));
    let mut heading = |text: &str| {
        assert!(fixes_of(&mut decoder, &[text]).is_empty(), "{text}");
        decoder.take_heading().map(|heading| (90.0 - heading.to_degrees()).rem_euclid(360.0))
    };
    assert!(close(heading("HEHDT,274.07,T").expect("true"), 274.07, 1e-9));
    assert!(close(heading("HCHDG,101.1,1.0,E,7.1,W").expect("its variation"), 95.0, 1e-9));
    // By the model, as date and place are known: 5° East in Prague.
    assert!(close(heading("HCHDM,100.0,M").expect("the model"), 105.1, 0.5));
    assert_eq!(heading("HCHDM,,M"), None);
    // A THS that is simulated or not valid is no heading.
    assert_eq!((heading("HETHS,274.07,V"), heading("HETHS,274.07,S")), (None, None));
    for mode in ["A", "E", "M", ""] {
        assert!(close(heading(&format!("HETHS,274.07,{mode}")).expect("valid"), 274.07, 1e-9));
    }
    assert!(close(heading("HETHS,274.07").expect("without a mode"), 274.07, 1e-9));
    let mut decoder = NmeaDecoder::new();
    assert!(fixes_of(&mut decoder, &["HCHDM,100.0,M", gga]).len() == 1);
    assert_eq!(decoder.take_heading(), None);
    assert!(decoder.missing().is_some_and(|missing| missing.contains("variation")));
    // Once it is known nothing is missing, whether the heading was taken or not.
    assert!(fixes_of(&mut decoder, &[zda, gga, "HCHDM,100.0,M"]).len() == 1);
    assert_eq!(decoder.missing(), None);
    assert!(decoder.take_heading().is_some());
    assert_eq!(decoder.missing(), None);
    let mut decoder = GpsdDecoder::new();
    assert!(decoded(&mut decoder, b"{\"class\":\"ATT\",\"heading\":90.0}\n").is_empty());
    assert!(decoder.take_heading().is_some_and(|heading| heading.abs() < 1e-12));
}

#[test]
fn what_a_receiver_lacks_is_said() {
    let mut decoder = NmeaDecoder::new();
    let gsv = sentence("GPGSV,1,1,01,21,54,088,40");
    let bare = "$GPGGA,123456.00,5006.0,N,01430.0,E,1,9,1.0,355.0,M,45.0,M,,\r\n";
    assert!(decoded(&mut decoder, (gsv + bare).as_bytes()).is_empty());
    let missing = decoder.missing().expect("everything");
    assert!(missing.contains("no checksum") && missing.contains("turn GGA"), "{missing}");
    let (near, mut far) = memory_pair();
    far.send(sentence("GPGSV,1,1,01,21,54,088,40").as_bytes()).expect("memory");
    let mut receiver = GnssReceiver::new(GnssConfig::default(), near, || 1.0).expect("in range");
    let error = receiver.position().expect_err("no place").to_string();
    assert!(error.contains("has no fix yet; no sentence has a place: turn GGA"), "{error}");
    let mut decoder = GpsdDecoder::new();
    let flat = "{\"class\":\"TPV\",\"mode\":2,\"lat\":50.1,\"lon\":14.5}\n";
    let [fix] = decoded(&mut decoder, flat.as_bytes())[..] else { panic!("one fix") };
    assert_eq!(fix.height, HeightOrigin::SeaLevel);
    assert!(decoder.missing().is_some_and(|missing| missing.contains("no height")));
    let sea = flat.replace("\"mode\":2", "\"mode\":3,\"altMSL\":355.0");
    let [fix] = decoded(&mut decoder, sea.as_bytes())[..] else { panic!("one fix") };
    assert_eq!((fix.height, decoder.missing()), (HeightOrigin::Geoid, None));
    assert!(fix.place.is_some_and(|place| close(place.alt_m, 399.6, 1.5)), "{fix:?}");
}

/// A message of u-blox of a time of the week in milliseconds, with numbers at their offsets.
fn nav(id: u8, length: usize, itow: u32, fields: &[(usize, &[u8])]) -> Vec<u8> {
    let mut payload = vec![0_u8; length];
    payload[..4].copy_from_slice(&itow.to_le_bytes());
    for (at, bytes) in fields {
        payload[*at..at + bytes.len()].copy_from_slice(bytes);
    }
    ubx::frame((1, id), &payload)
}

fn posllh(itow: u32, accuracy_mm: u32) -> Vec<u8> {
    let fields: [(usize, &[u8]); 5] = [
        (4, &145_000_000_i32.to_le_bytes()),
        (8, &501_000_000_i32.to_le_bytes()),
        (12, &400_000_i32.to_le_bytes()),
        (20, &accuracy_mm.to_le_bytes()),
        (24, &3500_u32.to_le_bytes()),
    ];
    nav(0x02, 28, itow, &fields)
}

#[test]
fn ublox_of_before_nav_pvt_is_read() {
    // POSLLH alone: a place where it is sure enough, from its second epoch on.
    let mut decoder = UbloxDecoder::new();
    assert!(decoded(&mut decoder, &posllh(1000, 2828)).is_empty());
    let [fix] = decoded(&mut decoder, &posllh(2000, 2828))[..] else { panic!("one fix") };
    let expected = Geodetic { lat_deg: 50.1, lon_deg: 14.5, alt_m: 400.0 };
    let near = |fix: &GnssFix, metres: f64| {
        let frame = foxhunt_wire::geodesy::LocalFrame::new(expected).expect("a place");
        fix.place.is_some_and(|place| frame.to_local(&place).norm() < metres)
    };
    assert!(near(&fix, 1e-6), "{fix:?}");
    let sigma = fix.sigma_m.expect("sent");
    assert!((sigma - Vector3::new(2.0, 2.0, 3.5)).norm() < 1e-3, "{sigma}");
    assert_eq!((fix.quality, fix.utc_s), (FixQuality::Autonomous, None));
    let missing = decoder.missing().expect("quality and time");
    assert!(missing.contains("NAV-STATUS") && missing.contains("NAV-TIMEUTC"), "{missing}");
    assert_eq!(decoded(&mut decoder, &posllh(3000, 4_000_000_000))[0].place, None);

    // With the messages of generation 5 and 6 beside it.
    let sol = |itow: u32, fix_type: u8, flags: u8| {
        // By the closed formulas of WGS84: 50.1° N, 14.5° E, 400 m.
        let ecef = [396_901_199_i32, 102_645_629, 487_023_819];
        let fields: [(usize, &[u8]); 7] = [
            (10, &[fix_type, flags]),
            (12, &ecef[0].to_le_bytes()),
            (16, &ecef[1].to_le_bytes()),
            (20, &ecef[2].to_le_bytes()),
            (24, &520_u32.to_le_bytes()),
            (44, &150_u16.to_le_bytes()),
            (47, &[9]),
        ];
        nav(0x06, 52, itow, &fields)
    };
    let velned = |itow: u32| {
        let fields: [(usize, &[u8]); 3] = [
            (4, &150_i32.to_le_bytes()),
            (8, &(-70_i32).to_le_bytes()),
            (12, &25_i32.to_le_bytes()),
        ];
        nav(0x12, 36, itow, &fields)
    };
    let timeutc = |itow: u32| {
        let fields: [(usize, &[u8]); 3] = [
            (8, &500_000_000_i32.to_le_bytes()),
            (12, &2026_u16.to_le_bytes()),
            (14, &[3, 1, 12, 34, 56, 7]),
        ];
        nav(0x21, 20, itow, &fields)
    };
    let mut decoder = UbloxDecoder::new();
    let epoch =
        |itow: u32| [posllh(itow, 2828), sol(itow, 3, 0x0f), velned(itow), timeutc(itow)].concat();
    let _ = decoded(&mut decoder, &epoch(1000));
    let fixes = decoded(&mut decoder, &epoch(2000));
    let last = fixes.last().expect("fixes");
    assert!(near(last, 1e-6), "POSLLH leads before SOL: {last:?}");
    assert_eq!((last.quality, last.satellites), (FixQuality::Differential, Some(9)));
    let velocity = last.velocity_mps.expect("VELNED");
    assert!((velocity - Vector3::new(-0.7, 1.5, -0.25)).norm() < 1e-9, "{velocity}");
    assert!(close(last.utc_s.expect("TIMEUTC"), MOMENT, 1e-3));
    assert_eq!((decoder.missing(), decoder.refused()), (None, 0));
    let lost = decoded(&mut decoder, &[posllh(3000, 2828), sol(3000, 0, 0)].concat());
    assert_eq!(lost.last().expect("told").place, None, "SOL knows that there is no fix");

    // SOL alone has its place in Earth-centred coordinates of centimetres.
    let mut decoder = UbloxDecoder::new();
    let _ = decoded(&mut decoder, &sol(1000, 3, 1));
    let [fix] = decoded(&mut decoder, &sol(2000, 3, 1))[..] else { panic!("one fix") };
    assert!(near(&fix, 0.02) && fix.quality == FixQuality::Autonomous, "{fix:?}");
    let sigma = fix.sigma_m.expect("of pAcc");
    assert!((sigma - Vector3::repeat(5.2 / 3_f64.sqrt())).norm() < 1e-9, "{sigma}");

    // HPPOSLLH adds tenths of a millimetre, and marks what is invalid.
    let hp = |itow: u32, flags: u8| {
        let fields: [(usize, &[u8]); 8] = [
            (3, &[flags]),
            (8, &145_000_000_i32.to_le_bytes()),
            (12, &501_000_000_i32.to_le_bytes()),
            (16, &400_000_i32.to_le_bytes()),
            (24, &[50_u8, (-50_i8).cast_unsigned(), 5]),
            (28, &200_u32.to_le_bytes()),
            (32, &300_u32.to_le_bytes()),
            (26, &[5]),
        ];
        // The time stands behind version and flags.
        let mut payload = vec![0_u8; 36];
        payload[4..8].copy_from_slice(&itow.to_le_bytes());
        for (at, bytes) in fields {
            payload[at..at + bytes.len()].copy_from_slice(bytes);
        }
        ubx::frame((1, 0x14), &payload)
    };
    let mut decoder = UbloxDecoder::new();
    let _ = decoded(&mut decoder, &hp(1000, 0));
    let [fix] = decoded(&mut decoder, &hp(2000, 0))[..] else { panic!("one fix") };
    let place = fix.place.expect("valid");
    assert!(close(place.lon_deg, 14.500_000_05, 1e-12), "{}", place.lon_deg);
    assert!(close(place.lat_deg, 50.099_999_95, 1e-12), "{}", place.lat_deg);
    assert!(close(place.alt_m, 400.0005, 1e-9), "{}", place.alt_m);
    let sigma = fix.sigma_m.expect("sent");
    assert!((sigma - Vector3::new(0.02 / SQRT_2, 0.02 / SQRT_2, 0.03)).norm() < 1e-9, "{sigma}");
    assert_eq!(decoded(&mut decoder, &hp(3000, 1))[0].place, None);
}

#[test]
fn ublox_without_nav_pvt_is_set_up_by_its_own_messages() {
    let mut decoder = UbloxDecoder::new();
    let modern = decoder.set_up();
    let nak = |class, id| ubx::frame((5, 0), &[class, id]);
    assert!(decoded(&mut decoder, &[nak(6, 1), nak(6, 0x8a)].concat()).is_empty());
    assert!(decoder.missing().is_some_and(|missing| missing.contains("knows no NAV-PVT")));
    let old = decoder.set_up();
    assert_eq!(&old[..modern.len()], &modern[..]);
    assert_eq!(
        old[modern.len()..],
        [2, 6, 3, 0x12, 0x21].map(|id| ubx::frame((6, 1), &[1, id, 1])).concat()
    );
    // A NAV-PVT of generation 7 ends after its DOP: 84 bytes.
    let mut pvt = nav_pvt(3, 1);
    pvt.truncate(pvt.len() - 2);
    let short = ubx::frame((1, 7), &pvt[6..6 + 84]);
    decoder.reset();
    let [fix] = decoded(&mut decoder, &short)[..] else { panic!("one fix") };
    assert!(fix.place.is_some_and(|place| close(place.alt_m, 400.0, 1e-9)));
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
    assert!(decoded(&mut decoder, flat.as_bytes())[0].height.is_flat());
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
    assert!(matches!(receiver.position(), Err(GnssError::NoFix { satellites: None, .. })));
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
fn corrections_that_cannot_be_are_refused_by_name() {
    let refused = |text: &str, kind| {
        let config: CorrectionsConfig = serde_json::from_str(text).expect("fields");
        config.check(kind).expect_err(text).to_string()
    };
    let caster = |more: &str| {
        let near = r#"{"endpoint":"tcp:caster:2101","mountpoint":"FOX""#;
        refused(&format!("{near}{more}}}"), GnssKind::Ublox)
    };
    for (error, named) in [
        (refused("{}", GnssKind::Nmea), "either endpoint or file; neither is given"),
        (caster(r#","file":"base.rtcm""#), "both are given"),
        (refused(r#"{"file":"base.rtcm","gga_s":5}"#, GnssKind::Nmea), "gga_s has no effect"),
        (refused(r#"{"file":"base.rtcm","ntrip":1}"#, GnssKind::Nmea), "ntrip has no effect"),
        (refused(r#"{"file":"a","mountpoint":"FOX"}"#, GnssKind::Nmea), "mountpoint has no effect"),
        (refused(r#"{"file":"base.rtcm"}"#, GnssKind::Gpsd), "gpsd ntrip://"),
        (caster(r#","stale_s":0"#), "stale_s is 0; it must be a positive number"),
        (caster(r#","gga_s":-1"#), "gga_s is -1;"),
        (caster(r#","ntrip":3"#), "ntrip is 3; it must be 1 or 2"),
        (caster(r#","user":"me""#), "password_env is missing"),
        (caster(r#","password_env":"P""#), "password_env has no effect without a user"),
        (caster(r#","user":"a:b","password_env":"P""#), "user is \"a:b\""),
        (
            caster(r#","user":"me","password_env":"P","password_file":"p""#),
            "password_file has no effect beside password_env",
        ),
        (
            refused(r#"{"endpoint":"tcp:a:1","mountpoint":"F HTTP/1.1\r\nX: y"}"#, GnssKind::Nmea),
            "mountpoint is",
        ),
        (
            refused(r#"{"endpoint":"udpin:a:1","mountpoint":"FOX"}"#, GnssKind::Nmea),
            "endpoint is \"udpin:a:1\"; it must be tcp:HOST:PORT",
        ),
    ] {
        assert!(error.contains(named), "{named}: {error}");
    }
    assert!(serde_json::from_str::<CorrectionsConfig>(r#"{"password":"x"}"#).is_err());
    let absent: CorrectionsConfig = serde_json::from_str(
        r#"{"endpoint":"tcp:a:1","mountpoint":"F","user":"u","password_env":"FOXHUNT_NO_SUCH"}"#,
    )
    .expect("fields");
    let (near, _) = memory_pair();
    let error = Corrections::new(absent, GnssKind::Nmea, Box::new(near)).expect_err("not set");
    assert!(error.to_string().contains("no variable \"FOXHUNT_NO_SUCH\""), "{error}");
}

/// A caster's silence, its refusal and its lost connection, by the requests that come to it.
#[test]
fn a_caster_is_asked_again_after_a_while() {
    let config: CorrectionsConfig =
        serde_json::from_str(r#"{"endpoint":"tcp:a:1","mountpoint":"FOX","ntrip":1}"#)
            .expect("fields");
    let (near, mut far) = memory_pair();
    let mut corrections =
        Corrections::new(config, GnssKind::Nmea, Box::new(near)).expect("proper settings");
    let mut requests = |corrections: &mut Corrections, seconds: std::ops::Range<u32>| {
        let mut count = 0;
        for second in seconds {
            corrections.poll(second.into(), None, &mut |_| Ok(())).expect("nothing is forwarded");
            let mut request = [0; 512];
            while let Ok(length @ 1..) = far.receive(&mut request) {
                assert!(request[..length].starts_with(b"GET /FOX HTTP/1.0\r\n"));
                count += 1;
            }
            if second == 50 {
                far.send(b"ERROR - Bad Password\r\n").expect("memory");
            }
        }
        count
    };
    assert_eq!(requests(&mut corrections, 0..20), 1);
    assert_eq!(requests(&mut corrections, 20..22), 1, "after 20 s of silence");
    let lost = corrections.loss(21.0).expect("none has come").to_string();
    assert!(lost.contains("nothing for 20 s; a virtual station needs gga_s"), "{lost}");
    assert_eq!(requests(&mut corrections, 22..52), 1);
    assert_eq!(requests(&mut corrections, 52..81), 0, "a refusal at 51 s is respected");
    let lost = corrections.loss(80.0).expect("none has come").to_string();
    assert!(lost.contains("wants a user and a password"), "{lost}");
    assert_eq!(requests(&mut corrections, 81..84), 1);
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
    let up_of = |height| config.sigma(&GnssFix { height, ..fix }).expect("a fix").z;
    assert!(close(up_of(HeightOrigin::Geoid), 2.6_f64.hypot(1.5), 1e-12));
    assert!(close(up_of(HeightOrigin::Earlier), 50.0, 0.0));
    assert!(close(up_of(HeightOrigin::SeaLevel), 500.0, 0.0));
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
