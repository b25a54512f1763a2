use foxhunt_wire::mavlink::{Autopilot, dialect::GpsFixType};
use nalgebra::Vector3;

use super::{PositionRequirements, Telemetry};

/// Flags of an estimator, by the bits that both firmwares share, that have to be set, and what the
/// estimator lacks without each.
const NEEDED: [(u16, &str); 6] = [
    (0x01, "attitude"),
    (0x02, "horizontal velocity"),
    (0x04, "vertical velocity"),
    (0x08, "relative position"),
    (0x10, "global position"),
    (0x20, "height"),
];

/// ArduPilot: attitude, velocities and both horizontal positions.
const ARDUPILOT_NEEDED: u16 = 0x1F;

/// Flags of ArduPilot that must not be set.
const ARDUPILOT_BAD: [(u16, &str); 3] = [
    (0x0080, "guesses that it stands still"),
    (0x0400, "was never healthy"),
    (0x8000, "finds that its GPS jumps"),
];

/// PX4: the height as well.
const PX4_NEEDED: u16 = 0x3F;

/// Flags of PX4. Since 2024 it sets 0x080 (CONST_POS_MODE) whenever the vehicle stands still, which
/// tells nothing about its place (PX4 1.16, `Ekf::get_ekf_soln_status`).
const PX4_BAD: [(u16, &str); 1] = [(0x0400, "finds that its GPS jumps")];

/// Oldest report that is judged, in seconds.
const OLD_S: f64 = 5.0;

/// Checks that the autopilot's estimator knows its place; the error names the missing flags.
pub(super) fn estimator(telemetry: &Telemetry, now: f64) -> Result<(), String> {
    let autopilot = telemetry.autopilot();
    let (needed, bad): (_, &[(u16, &str)]) = match autopilot {
        Autopilot::ArduPilot => (ARDUPILOT_NEEDED, &ARDUPILOT_BAD),
        Autopilot::Px4 => (PX4_NEEDED, &PX4_BAD),
    };
    let Some(flags) = telemetry.estimator.filter(|flags| now - flags.at < OLD_S) else {
        return match autopilot {
            // Not every PX4 link has its estimator's status; the position alone has to do.
            Autopilot::Px4 => Ok(()),
            Autopilot::ArduPilot => Err("nothing was received of the estimator yet".into()),
        };
    };
    let flags = flags.value;
    let missing = NEEDED.iter().filter(|(bit, _)| needed & bit != 0 && flags & bit == 0);
    let missing: Vec<&str> = missing.map(|(_, name)| *name).collect();
    let why = match bad.iter().find(|(bit, _)| flags & bit != 0) {
        _ if !missing.is_empty() => format!("has no {}", missing.join(", no ")),
        Some((_, what)) => (*what).into(),
        None => return Ok(()),
    };
    Err(format!("the estimator {why} (flags {flags:#06x})"))
}

/// Checks that the position is good enough for a take-off; the error names what is not.
pub(super) fn for_take_off(
    telemetry: &Telemetry,
    wanted: &PositionRequirements,
    now: f64,
) -> Result<(), String> {
    estimator(telemetry, now)?;
    let fresh = telemetry.gps.as_ref().filter(|gps| now - gps.at < OLD_S);
    let gps = &fresh.ok_or("nothing was received of the GPS yet")?.value;
    if (gps.fix_type as u32) < u32::from(wanted.fix_type) {
        return Err(format!(
            "the fix is {} ({}); position.fix_type is {}",
            fix_name(gps.fix_type),
            gps.fix_type as u32,
            wanted.fix_type
        ));
    }
    if gps.satellites_visible != u8::MAX && gps.satellites_visible < wanted.satellites {
        return Err(format!(
            "{} satellites; position.satellites is {}",
            gps.satellites_visible, wanted.satellites
        ));
    }
    let accuracy = accuracy_m(gps.h_acc);
    if let Some(accuracy) = accuracy.filter(|accuracy| *accuracy > wanted.horizontal_accuracy_m) {
        return Err(format!(
            "the GPS is good to {accuracy:.1} m; position.horizontal_accuracy_m is {}",
            wanted.horizontal_accuracy_m
        ));
    }
    if telemetry.position.as_ref().is_none_or(|position| now - position.at > OLD_S) {
        return Err("nothing was received of its place yet".into());
    }
    Ok(())
}

/// Returns the name of a fix.
pub(super) fn fix_name(fix: GpsFixType) -> &'static str {
    match fix {
        GpsFixType::GPS_FIX_TYPE_NO_GPS => "no GPS",
        GpsFixType::GPS_FIX_TYPE_NO_FIX => "no fix",
        GpsFixType::GPS_FIX_TYPE_2D_FIX => "2D",
        GpsFixType::GPS_FIX_TYPE_3D_FIX => "3D",
        GpsFixType::GPS_FIX_TYPE_DGPS => "differential",
        GpsFixType::GPS_FIX_TYPE_RTK_FLOAT => "RTK float",
        GpsFixType::GPS_FIX_TYPE_RTK_FIXED => "RTK fixed",
        GpsFixType::GPS_FIX_TYPE_STATIC => "static",
        GpsFixType::GPS_FIX_TYPE_PPP => "PPP",
    }
}

/// An accuracy in metres, where one is reported.
fn accuracy_m(mm: u32) -> Option<f64> {
    (mm > 0 && mm < u32::MAX).then(|| f64::from(mm) * 1e-3)
}

/// σ of a range to a satellite, in metres, by which a dilution of precision is multiplied: what
/// single frequency receivers have in the open (Kaplan & Hegarty 2017, §10).
const RANGE_SIGMA_M: f64 = 2.5;

/// Growth of σ of a place while nothing is received of it, in metres per second.
const DRIFT_MPS: f64 = 2.0;

/// σ of East, North and Up in metres, as the GPS has them; `None` if it sends nothing.
///
/// An accuracy that the receiver reports is taken for each axis. Without one, dilution of precision
/// times σ of a range, which RTK makes smaller. Without a fix in space everything is ten times
/// worse. What is older than `old_s` counts for less the older it is.
pub(super) fn position_sigma(telemetry: &Telemetry, now: f64, old_s: f64) -> Option<Vector3<f64>> {
    let message = telemetry.gps.as_ref()?;
    let gps = &message.value;
    let age = now - message.at;
    let drift = if age > old_s { DRIFT_MPS * age } else { 0.0 };
    let (range, poor) = match gps.fix_type {
        GpsFixType::GPS_FIX_TYPE_RTK_FIXED => (0.02, 1.0),
        GpsFixType::GPS_FIX_TYPE_RTK_FLOAT => (0.4, 1.0),
        GpsFixType::GPS_FIX_TYPE_DGPS | GpsFixType::GPS_FIX_TYPE_PPP => (1.0, 1.0),
        GpsFixType::GPS_FIX_TYPE_3D_FIX | GpsFixType::GPS_FIX_TYPE_STATIC => (RANGE_SIGMA_M, 1.0),
        _ => (RANGE_SIGMA_M, 10.0),
    };
    // Unknown dilutions are 65535; a clear sky has about 1.
    let dilution = |hundredths: u16, usual: f64| {
        if hundredths == u16::MAX || hundredths == 0 { usual } else { f64::from(hundredths) * 0.01 }
    };
    let over_ground = accuracy_m(gps.h_acc).unwrap_or_else(|| range * dilution(gps.eph, 1.5));
    let up = accuracy_m(gps.v_acc).unwrap_or_else(|| range * dilution(gps.epv, 2.5));
    Some((Vector3::new(over_ground, over_ground, up) * poor).map(|sigma| sigma.hypot(drift)))
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_wire::mavlink::dialect::GPS_RAW_INT_DATA;

    use super::*;
    use crate::mavlink::reports::Timed;

    fn telemetry(fix_type: GpsFixType, h_acc: u32, eph: u16) -> Telemetry {
        let value = GPS_RAW_INT_DATA {
            fix_type,
            h_acc,
            eph,
            epv: u16::MAX,
            satellites_visible: 9,
            ..GPS_RAW_INT_DATA::default()
        };
        Telemetry { gps: Some(Timed { at: 1.0, value }), ..Telemetry::default() }
    }

    #[test]
    fn a_poor_fix_has_a_large_sigma() {
        let sigma = |fix, h_acc, eph| {
            let sigma = position_sigma(&telemetry(fix, h_acc, eph), 1.4, 1.0).expect("a GPS");
            [sigma.x, sigma.y, sigma.z]
        };
        let close = |a: [f64; 3], b: [f64; 3]| a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(position_sigma(&Telemetry::default(), 1.0, 1.0).is_none());
        let in_space = GpsFixType::GPS_FIX_TYPE_3D_FIX;
        let old = position_sigma(&telemetry(in_space, 800, 90), 11.0, 1.0).expect("a GPS");
        assert_abs_diff_eq!(old.x, 20.0_f64.hypot(0.8), epsilon = 1e-9);
        assert!(close(sigma(in_space, 800, 90), [0.8, 0.8, 6.25]));
        assert!(close(sigma(in_space, 0, 90), [2.25, 2.25, 6.25]), "dilution times 2.5 m");
        assert!(close(sigma(in_space, u32::MAX, u16::MAX), [3.75, 3.75, 6.25]), "nothing reported");
        let fixed = GpsFixType::GPS_FIX_TYPE_RTK_FIXED;
        assert!(close(sigma(fixed, 0, 100), [0.02, 0.02, 0.05]));
        let flat = GpsFixType::GPS_FIX_TYPE_2D_FIX;
        assert!(close(sigma(flat, 800, 90), [8.0, 8.0, 62.5]), "ten times worse");
    }

    #[test]
    fn flags_are_those_of_the_firmware() {
        let mut telemetry = telemetry(GpsFixType::GPS_FIX_TYPE_3D_FIX, 800, 90);
        let of = |telemetry: &mut Telemetry, autopilot, flags| {
            telemetry.who = Some((1, 1, autopilot));
            telemetry.estimator = Some(Timed { at: 10.0, value: flags });
            estimator(telemetry, 11.0)
        };
        for (flags, ardupilot, px4) in [
            (0x33F, true, true),
            // PX4 1.18, standing still and with its GPS in use.
            (0x3FF, false, true),
            (0x0BF, false, true),
            (0x01F, true, false),
            (0x00F, false, false),
            (0x09F, false, false),
            (0x43F, false, false),
            // PX4 1.18 without GPS.
            (0x0A7, false, false),
            (0x000, false, false),
        ] {
            assert_eq!(
                of(&mut telemetry, Autopilot::ArduPilot, flags).is_ok(),
                ardupilot,
                "{flags:#x}"
            );
            assert_eq!(of(&mut telemetry, Autopilot::Px4, flags).is_ok(), px4, "{flags:#x}");
        }
        let why = of(&mut telemetry, Autopilot::Px4, 0x0A7).expect_err("no GPS");
        let text = "the estimator has no relative position, no global position (flags 0x00a7)";
        assert_eq!(why, text);
        telemetry.who = Some((1, 1, Autopilot::ArduPilot));
        telemetry.estimator = Some(Timed { at: 10.0, value: 0x33F });
        assert!(estimator(&telemetry, 16.0).is_err(), "an old word");
        let wanted = PositionRequirements::default();
        let why = for_take_off(&telemetry, &wanted, 11.0).expect_err("the GPS is old");
        assert!(why.contains("GPS"), "{why}");
        let few = PositionRequirements { satellites: 12, ..wanted };
        let why = for_take_off(&telemetry, &few, 5.5).expect_err("too few");
        assert_eq!(why, "9 satellites; position.satellites is 12");
    }
}
