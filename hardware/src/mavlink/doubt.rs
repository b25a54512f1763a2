use foxhunt_core::angle;
use foxhunt_wire::mavlink::{
    degrees_of_e7,
    dialect::{
        EKF_STATUS_REPORT_DATA, ESTIMATOR_STATUS_DATA, GLOBAL_POSITION_INT_DATA, GPS_RAW_INT_DATA,
        GpsFixType, MavMessage, MavSeverity, MavSysStatusSensor, STATUSTEXT_DATA, SYS_STATUS_DATA,
    },
};

use super::reports::is_good_news;

/// Signs that the place or the heading of an aircraft in flight differs from its reports.
///
/// A place that is false once is not shown to be true again by anything that the autopilot reports:
/// ArduCopter calls a glitch cleared when it has taken the new place. So doubt outlasts its last
/// sign.
#[derive(Debug, Default)]
pub(super) struct Doubt {
    /// The sign that counts longest.
    why: String,
    /// Until when it counts, in seconds.
    until: f64,
    place: Option<GLOBAL_POSITION_INT_DATA>,
    /// Time since which the estimator has rejected what its sensors measure.
    rejects: Option<f64>,
}

/// Time for which a step or a warning counts, in seconds.
const SIGN_S: f64 = 30.0;

/// Time for which a condition counts after its last report, in seconds.
const CONDITION_S: f64 = 5.0;

/// Distance by which an aircraft may be elsewhere than its velocity takes it, in metres and in
/// metres per second of the time between two reports: estimators correct themselves by less.
const STEP_M: f64 = 3.0;
const STEP_MPS: f64 = 2.0;

/// Longest time between two reports that are compared, in seconds.
const APART_S: f64 = 3.0;

/// Ratio of an innovation to its limit from which an estimator rejects it, and how long that lasts
/// until it counts, in seconds.
const REJECTED: f32 = 1.0;
const LASTS_S: f64 = 1.0;

/// Metres of a degree of latitude.
const DEGREE_M: f64 = 111_320.0;

/// Words of warnings about place and heading, in lower case.
const WORDS: [&str; 10] = [
    "gps",
    "gnss",
    "glitch",
    "compass",
    "ekf",
    "position",
    "yaw",
    "heading",
    "estimator",
    "dead reckoning",
];

impl Doubt {
    /// Takes a message of an autopilot whose motors run.
    pub(super) fn take(&mut self, now: f64, message: &MavMessage) {
        match message {
            MavMessage::GLOBAL_POSITION_INT(place) => self.place(now, place),
            MavMessage::GPS_RAW_INT(gps) => self.fix(now, gps),
            MavMessage::SYS_STATUS(status) => self.sensors(now, status),
            MavMessage::EKF_STATUS_REPORT(EKF_STATUS_REPORT_DATA {
                velocity_variance,
                pos_horiz_variance,
                pos_vert_variance,
                compass_variance,
                ..
            }) => self.innovations(
                now,
                [*velocity_variance, *pos_horiz_variance, *pos_vert_variance, *compass_variance],
            ),
            MavMessage::ESTIMATOR_STATUS(ESTIMATOR_STATUS_DATA {
                vel_ratio,
                pos_horiz_ratio,
                pos_vert_ratio,
                mag_ratio,
                ..
            }) => {
                self.innovations(now, [*vel_ratio, *pos_horiz_ratio, *pos_vert_ratio, *mag_ratio])
            }
            MavMessage::STATUSTEXT(text) => self.warning(now, text),
            _ => {}
        }
    }

    /// Takes a condition of its estimator, which counts while it is reported.
    pub(super) fn condition(&mut self, now: f64, why: String) {
        self.sign(now, CONDITION_S, why);
    }

    /// Forgets it all: its motors stand still.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Returns why its place is in doubt, while it is.
    pub(super) fn why(&self, now: f64) -> Option<&str> {
        (now < self.until).then_some(self.why.as_str())
    }

    /// Takes a sign; the longest-lasting sign is told.
    fn sign(&mut self, now: f64, lasts_s: f64, why: String) {
        let until = now + lasts_s;
        if until >= self.until {
            (self.until, self.why) = (until, why);
        }
    }

    fn place(&mut self, now: f64, place: &GLOBAL_POSITION_INT_DATA) {
        let before = self.place.replace(place.clone());
        let Some(before) = before else { return };
        let apart_s = (f64::from(place.time_boot_ms) - f64::from(before.time_boot_ms)) * 1e-3;
        // One that came twice is no step.
        if apart_s <= 0.0 || apart_s > APART_S {
            return;
        }
        let east_m = degrees_of_e7(before.lat).to_radians().cos() * DEGREE_M;
        // The shorter way: an aircraft may cross 180 degrees of longitude.
        let metres = |e7: i32, before: i32, scale: f64| {
            let degrees = degrees_of_e7(e7) - degrees_of_e7(before);
            angle::wrap(degrees.to_radians()).to_degrees() * scale
        };
        let way = [
            metres(place.lat, before.lat, DEGREE_M),
            metres(place.lon, before.lon, east_m),
            (f64::from(before.relative_alt) - f64::from(place.relative_alt)) * 1e-3,
        ];
        let [from, to] =
            [&before, place].map(|of| [of.vx, of.vy, of.vz].map(|cm_s| f64::from(cm_s) * 0.01));
        let flown = |axis: usize| 0.5 * (from[axis] + to[axis]) * apart_s;
        let step_m = (0..3).map(|axis| (way[axis] - flown(axis)).powi(2)).sum::<f64>().sqrt();
        if step_m > STEP_M + STEP_MPS * apart_s {
            let why = format!("its place jumped by {step_m:.0} m, which no aircraft flies");
            self.sign(now, SIGN_S, why);
        }
    }

    fn fix(&mut self, now: f64, gps: &GPS_RAW_INT_DATA) {
        let none = [
            GpsFixType::GPS_FIX_TYPE_NO_GPS,
            GpsFixType::GPS_FIX_TYPE_NO_FIX,
            GpsFixType::GPS_FIX_TYPE_2D_FIX,
        ];
        if none.contains(&gps.fix_type) {
            self.sign(now, CONDITION_S, "its GPS has no fix in space".into());
        }
    }

    fn sensors(&mut self, now: f64, status: &SYS_STATUS_DATA) {
        let watched = [
            (MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_MAG, "compass"),
            (MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_GPS, "GPS"),
        ];
        let bad = watched.into_iter().find(|(sensor, _)| {
            status.onboard_control_sensors_enabled.contains(*sensor)
                && !status.onboard_control_sensors_health.contains(*sensor)
        });
        if let Some((_, name)) = bad {
            self.sign(now, CONDITION_S, format!("its {name} is not healthy"));
        }
    }

    fn innovations(&mut self, now: f64, ratios: [f32; 4]) {
        let names = ["velocity", "place", "height", "compass"];
        let Some((name, _)) = names.into_iter().zip(ratios).find(|(_, ratio)| *ratio >= REJECTED)
        else {
            self.rejects = None;
            return;
        };
        if now - *self.rejects.get_or_insert(now) >= LASTS_S {
            self.sign(
                now,
                CONDITION_S,
                format!("its estimator rejects the {name} that is measured"),
            );
        }
    }

    fn warning(&mut self, now: f64, text: &STATUSTEXT_DATA) {
        let words = text.text.to_str().unwrap_or_default().trim();
        let lower = words.to_ascii_lowercase();
        let bad = text.severity as u32 <= MavSeverity::MAV_SEVERITY_WARNING as u32;
        // A mode that was refused for want of a position tells nothing of the position.
        let of_place = WORDS.iter().any(|word| lower.contains(word)) && !lower.contains("mode");
        if bad && of_place && !is_good_news(words) {
            self.sign(now, SIGN_S, format!("it warns: {words}"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(ms: u32, north_m: f64, north_mps: f64) -> MavMessage {
        MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
            time_boot_ms: ms,
            lat: 480_000_000 + foxhunt_wire::mavlink::e7_of_degrees(north_m / DEGREE_M),
            lon: 110_000_000,
            vx: i16::try_from(foxhunt_wire::mavlink::whole(north_mps * 100.0)).unwrap_or(0),
            ..GLOBAL_POSITION_INT_DATA::default()
        })
    }

    #[test]
    fn steps_that_no_aircraft_flies_are_doubted_for_a_while() {
        let mut doubt = Doubt::default();
        // 10 m/s, with reports of half a second.
        for step in 0..20_u32 {
            let t = f64::from(step) * 0.5;
            doubt.take(t, &place(step * 500, 10.0 * t, 10.0));
        }
        // A correction of 2 m, and a gap of 4 s.
        doubt.take(10.0, &place(10_000, 102.0, 10.0));
        doubt.take(14.0, &place(14_000, 160.0, 10.0));
        assert_eq!(doubt.why(14.0), None);
        doubt.take(14.5, &place(14_500, 220.0, 10.0));
        let words = "its place jumped by 55 m, which no aircraft flies";
        assert_eq!(doubt.why(14.5), Some(words));
        assert_eq!((doubt.why(44.4), doubt.why(44.6)), (Some(words), None));
    }

    #[test]
    fn any_numbers_are_compared() {
        let report = |ms, lon, relative_alt| {
            let lat = 650_000_000;
            MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
                time_boot_ms: ms,
                lat,
                lon,
                relative_alt,
                ..GLOBAL_POSITION_INT_DATA::default()
            })
        };
        let mut doubt = Doubt::default();
        doubt.take(0.0, &report(0, 1_799_999_900, 10_000));
        doubt.take(0.5, &report(500, -1_799_999_900, 10_000));
        assert_eq!(doubt.why(0.5), None, "a metre across 180 degrees");
        doubt.take(1.0, &report(1_000, -1_799_999_900, i32::MIN));
        doubt.take(1.5, &report(1_500, -1_799_999_900, i32::MAX));
        assert!(doubt.why(1.5).is_some_and(|why| why.contains("4294967")), "{:?}", doubt.why(1.5));
    }

    #[test]
    fn warnings_of_place_and_heading_are_doubts_and_others_are_not() {
        let doubted = |severity, text: &str| {
            let mut doubt = Doubt::default();
            let text = STATUSTEXT_DATA { severity, text: text.into(), ..Default::default() };
            doubt.take(1.0, &MavMessage::STATUSTEXT(text));
            doubt.why(2.0).is_some()
        };
        use MavSeverity::{
            MAV_SEVERITY_CRITICAL as CRITICAL, MAV_SEVERITY_INFO as INFO,
            MAV_SEVERITY_WARNING as WARNING,
        };
        for text in ["GPS Glitch or Compass error", "EKF variance", "EKF3 lane switch 1"] {
            assert!(doubted(CRITICAL, text), "{text}");
        }
        assert!(!doubted(CRITICAL, "GPS Glitch cleared") && !doubted(WARNING, "Battery 1 is low"));
        assert!(!doubted(INFO, "EKF3 IMU0 is using GPS"));
        assert!(!doubted(WARNING, "Mode change failed: requires position"));
    }

    #[test]
    fn a_dead_compass_and_rejected_measurements_are_doubts_while_they_last() {
        let mag = MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_MAG;
        let status = |health| {
            MavMessage::SYS_STATUS(SYS_STATUS_DATA {
                onboard_control_sensors_enabled: mag,
                onboard_control_sensors_health: health,
                ..SYS_STATUS_DATA::default()
            })
        };
        let mut doubt = Doubt::default();
        doubt.take(0.0, &status(mag));
        assert_eq!(doubt.why(0.0), None);
        doubt.take(1.0, &status(MavSysStatusSensor::empty()));
        assert_eq!(doubt.why(5.9), Some("its compass is not healthy"));
        assert_eq!(doubt.why(6.1), None);
        let report = |compass_variance| {
            let report = EKF_STATUS_REPORT_DATA { compass_variance, ..Default::default() };
            MavMessage::EKF_STATUS_REPORT(report)
        };
        let mut doubt = Doubt::default();
        doubt.take(1.0, &report(1.4));
        assert_eq!(doubt.why(1.0), None, "one report");
        doubt.take(1.5, &report(0.4));
        doubt.take(2.0, &report(1.4));
        doubt.take(3.0, &report(1.6));
        assert_eq!(doubt.why(3.0), Some("its estimator rejects the compass that is measured"));
    }
}
