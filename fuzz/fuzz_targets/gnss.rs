//! Any bytes into the GNSS decoders, divided anyhow; the first byte gives the size.
#![no_main]

use foxhunt_hardware::{FixQuality, GnssDecoder, GnssFix, GpsdDecoder, NmeaDecoder, UbloxDecoder};
use libfuzzer_sys::fuzz_target;

fn decoded(mut decoder: impl GnssDecoder, bytes: &[u8], chunk: usize) -> Vec<GnssFix> {
    let mut decoded = Vec::new();
    for some in bytes.chunks(chunk) {
        decoder.decode(some, &mut |fix| decoded.push(fix));
    }
    for fix in &decoded {
        assert_eq!(fix.place.is_some(), fix.quality > FixQuality::None);
        assert!(fix.place.is_none_or(|place| place.lat_deg.abs() <= 90.0));
        assert!(fix.sigma_m.is_none_or(|sigma| sigma.iter().all(|s| *s > 0.0 && s.is_finite())));
        assert!(fix.hdop.is_none_or(|hdop| hdop > 0.0 && hdop.is_finite()));
        assert!(fix.utc_s.is_none_or(f64::is_finite));
        assert!(fix.velocity_mps.is_none_or(|v| v.iter().all(|mps| mps.is_finite())));
    }
    decoded
}

fuzz_target!(|bytes: &[u8]| {
    let Some((first, bytes)) = bytes.split_first() else { return };
    let whole = bytes.len().max(1);
    let chunk = usize::from(*first).max(1);
    for mut bytes in [bytes.to_vec(), with_checksum(bytes)] {
        assert_eq!(
            decoded(NmeaDecoder::new(), &bytes, whole.max(bytes.len())),
            decoded(NmeaDecoder::new(), &bytes, chunk),
            "division matters"
        );
        bytes.push(b'\n');
        assert_eq!(
            decoded(GpsdDecoder::new(), &bytes, bytes.len()),
            decoded(GpsdDecoder::new(), &bytes, chunk),
            "division matters"
        );
        // A frame that is announced too long is given up sooner in small pieces.
        decoded(UbloxDecoder::new(), &bytes, chunk);
    }
    decoded(UbloxDecoder::new(), &framed(bytes), chunk);
});

/// As a sentence of NMEA: checksums are hard to hit.
fn with_checksum(bytes: &[u8]) -> Vec<u8> {
    let sum = bytes.iter().fold(0, |sum, byte| sum ^ byte);
    [b"$", bytes, format!("*{sum:02X}\r\n").as_bytes()].concat()
}

/// As a NAV-PVT.
fn framed(bytes: &[u8]) -> Vec<u8> {
    let mut body = vec![0x01, 0x07, 92, 0];
    body.extend(bytes.iter().chain(std::iter::repeat(&0)).take(92));
    let sum = body.iter().fold([0_u8, 0], |[a, b], byte| {
        let a = a.wrapping_add(*byte);
        [a, b.wrapping_add(a)]
    });
    [&[0xb5, 0x62], &body[..], &sum].concat()
}
