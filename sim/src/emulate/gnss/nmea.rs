use foxhunt_wire::FixQuality;

use super::epoch::{Epoch, whole};

/// Knots in a metre per second.
const KNOTS: f64 = 3600.0 / 1852.0;

/// The sentences of an epoch in the order in which receivers by u-blox send them: RMC, GGA, GSA,
/// GST (NMEA 0183 4.10; minutes with seven decimals, as RTK receivers do).
pub(super) fn sentences(epoch: &Epoch) -> String {
    [rmc(epoch), gga(epoch), gsa(epoch), gst(epoch)].map(|text| framed(&text)).concat()
}

fn framed(text: &str) -> String {
    let sum = text.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${text}*{sum:02X}\r\n")
}

/// Latitude and longitude with their directions.
fn place(epoch: &Epoch) -> String {
    if !epoch.has_fix() {
        return ",,,".into();
    }
    let lat = epoch.place.lat_deg;
    let lon = epoch.place.lon_deg;
    let lon = if lon > 180.0 { lon - 360.0 } else { lon };
    let (lat_degrees, lat_minutes) = minutes(lat);
    let (lon_degrees, lon_minutes) = minutes(lon);
    let north = if lat < 0.0 { 'S' } else { 'N' };
    let east = if lon < 0.0 { 'W' } else { 'E' };
    format!("{lat_degrees:02}{lat_minutes},{north},{lon_degrees:03}{lon_minutes},{east}")
}

/// Whole degrees, and minutes with seven decimals; they are rounded together, so that there are no
/// 60 minutes.
fn minutes(deg: f64) -> (i64, String) {
    const MINUTE: i64 = 10_000_000;
    let all = whole(deg.abs() * 6e8);
    let rest = all % (60 * MINUTE);
    (all / (60 * MINUTE), format!("{:02}.{:07}", rest / MINUTE, rest % MINUTE))
}

fn rmc(epoch: &Epoch) -> String {
    let status = if epoch.has_fix() { 'A' } else { 'V' };
    let mode = match epoch.quality {
        FixQuality::None => 'N',
        FixQuality::Estimated => 'E',
        FixQuality::Autonomous => 'A',
        FixQuality::Differential => 'D',
        FixQuality::RtkFloat => 'F',
        FixQuality::RtkFixed => 'R',
    };
    let (speed, course) = epoch.speed_course();
    let moving =
        if epoch.has_fix() { format!("{:.3},{course:.2}", speed * KNOTS) } else { ",".into() };
    let hms = epoch.hms();
    let dmy = epoch.dmy();
    format!("GNRMC,{hms},{status},{},{moving},{dmy},,,{mode}", place(epoch))
}

fn gga(epoch: &Epoch) -> String {
    let quality = match epoch.quality {
        FixQuality::None => 0,
        FixQuality::Autonomous => 1,
        FixQuality::Differential => 2,
        FixQuality::RtkFixed => 4,
        FixQuality::RtkFloat => 5,
        FixQuality::Estimated => 6,
    };
    let heights = if epoch.has_fix() {
        format!("{:.4},M,{:.3},M", epoch.place.alt_m - epoch.geoid_m, epoch.geoid_m)
    } else {
        ",M,,M".into()
    };
    let hms = epoch.hms();
    let satellites = epoch.satellites;
    let hdop = epoch.hdop;
    format!("GNGGA,{hms},{},{quality},{satellites:02},{hdop:.2},{heights},,", place(epoch))
}

fn gsa(epoch: &Epoch) -> String {
    let dimensions = if epoch.has_fix() { 3 } else { 1 };
    let used = (1..=12).map(|satellite| {
        if satellite <= epoch.satellites { format!("{satellite:02}") } else { String::new() }
    });
    let used: Vec<String> = used.collect();
    let (vdop, pdop) = epoch.vdop_pdop();
    format!("GNGSA,A,{dimensions},{},{pdop:.2},{:.2},{vdop:.2},1", used.join(","), epoch.hdop)
}

fn gst(epoch: &Epoch) -> String {
    let hms = epoch.hms();
    if !epoch.has_fix() {
        return format!("GNGST,{hms},,,,,,,");
    }
    let sigma = epoch.sigma_m;
    let east = sigma.x;
    let north = sigma.y;
    let up = sigma.z;
    let major = east.max(north);
    let minor = east.min(north);
    // From North; the axes of the ellipse are those of the frame.
    let orientation = if east > north { 90 } else { 0 };
    let rms = sigma.norm();
    format!("GNGST,{hms},{rms:.3},{major:.4},{minor:.4},{orientation},{north:.4},{east:.4},{up:.4}")
}
