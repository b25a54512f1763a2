use foxhunt_core::{HeightAboveGround, HeightSource};
use foxhunt_wire::mavlink::{
    Autopilot,
    dialect::{
        ALTITUDE_DATA, ATTITUDE_DATA, DISTANCE_SENSOR_DATA, MavMessage, MavSensorOrientation,
    },
};

use super::reports::Timed;
use crate::ReportedHeight;

/// Requested period of heights above the ground, in seconds.
pub(super) const GROUND_PERIOD_S: f64 = 1.0;

/// Age in seconds beyond which a report is not shown: three messages may be lost.
const STALE_S: f64 = 3.5;

/// Altitude in metres from which downwards ALTITUDE has no height above the terrain.
const UNKNOWN_M: f32 = -1000.0;

/// The signal quality of DISTANCE_SENSOR that makes a reading invalid.
const INVALID: u8 = 1;

/// The autopilot's reports of the ground below it: the newest of each message.
#[derive(Debug, Default)]
pub(super) struct GroundReports {
    /// DISTANCE_SENSOR of a sensor that looks down: its number, and the distance along its beam in
    /// metres; `None` beyond its range.
    sensor: Option<Timed<(u8, Option<f64>)>>,
    /// ArduPilot's RANGEFINDER, along its beam in metres. It does not hold the sensor's range.
    rangefinder: Option<Timed<f64>>,
    /// TERRAIN_REPORT, in metres.
    report: Option<Timed<f64>>,
    /// ALTITUDE, in metres.
    altitude: Option<Timed<f64>>,
}

impl GroundReports {
    /// Takes one of these messages; one that holds no height ends what was known by it.
    pub(super) fn take(&mut self, at: f64, autopilot: Autopilot, message: &MavMessage) {
        let timed = |value: Option<f64>| value.map(|value| Timed { at, value });
        match message {
            MavMessage::DISTANCE_SENSOR(value)
                if value.orientation == MavSensorOrientation::MAV_SENSOR_ROTATION_PITCH_270 =>
            {
                let value = (value.id, reading(value));
                // Of two sensors the one that has a reading counts.
                let other = self.sensor.is_some_and(|known| {
                    let Timed { value: (id, distance), .. } = known;
                    id != value.0 && distance.is_some() && at - known.at <= STALE_S
                });
                if value.1.is_some() || !other {
                    self.sensor = Some(Timed { at, value });
                }
            }
            MavMessage::RANGEFINDER(value) => {
                let distance = f64::from(value.distance);
                self.rangefinder = timed(Some(distance).filter(|d| d.is_finite() && *d > 0.0));
            }
            MavMessage::TERRAIN_REPORT(value) => {
                let height = f64::from(value.current_height);
                let known = value.spacing > 0 && height.is_finite();
                self.report = timed(Some(height).filter(|_| known));
            }
            MavMessage::ALTITUDE(value) => self.altitude = timed(above_terrain(autopilot, value)),
            _ => {}
        }
    }

    /// Returns the best known height above the ground: by the rangefinder, or else by its terrain.
    pub(super) fn height(
        &self,
        now: f64,
        attitude: Option<&Timed<ATTITUDE_DATA>>,
    ) -> Option<ReportedHeight> {
        let height = |of: Timed<f64>, source| ReportedHeight {
            height: HeightAboveGround { metres: of.value, source },
            age_s: now - of.at,
        };
        let rangefinder = self.below(now, attitude);
        rangefinder
            .map(|of| height(of, HeightSource::Rangefinder))
            .or_else(|| Some(height(self.terrain(now)?, HeightSource::Terrain)))
    }

    /// Returns all that is known, in words; `None` if nothing has come.
    pub(super) fn summary(
        &self,
        now: f64,
        attitude: &Option<Timed<ATTITUDE_DATA>>,
    ) -> Option<String> {
        let beyond = self.sensor.and_then(|sensor| fresh(now, sensor)).is_some();
        let rangefinder = match self.below(now, attitude.as_ref()) {
            Some(below) => Some(format!("rangefinder {:.1} m", below.value)),
            None => beyond.then(|| "rangefinder out of its range".to_owned()),
        };
        let terrain =
            self.terrain(now).map(|of| format!("terrain {:.1} m (autopilot's)", of.value));
        let parts: Vec<String> = rangefinder.into_iter().chain(terrain).collect();
        (!parts.is_empty()).then(|| parts.join(", "))
    }

    /// The ground below by a rangefinder. Its beam leans as the vehicle does; the ground is taken
    /// for level.
    fn below(&self, now: f64, attitude: Option<&Timed<ATTITUDE_DATA>>) -> Option<Timed<f64>> {
        let beam = match self.sensor.and_then(|sensor| fresh(now, sensor)) {
            Some(Timed { at, value: (_, distance) }) => Timed { at, value: distance? },
            None => fresh(now, self.rangefinder?)?,
        };
        let attitude = attitude.filter(|attitude| now - attitude.at <= STALE_S);
        let lean = attitude.map_or(1.0, |attitude| {
            f64::from(attitude.value.roll).cos() * f64::from(attitude.value.pitch).cos()
        });
        let value = beam.value * lean;
        (value.is_finite() && value >= 0.0).then_some(Timed { at: beam.at, value })
    }

    /// Returns the vehicle's height above the terrain of its autopilot.
    fn terrain(&self, now: f64) -> Option<Timed<f64>> {
        let known = |of: Option<Timed<f64>>| of.and_then(|of| fresh(now, of));
        known(self.report).or_else(|| known(self.altitude))
    }
}

fn fresh<T>(now: f64, of: Timed<T>) -> Option<Timed<T>> {
    (now - of.at <= STALE_S).then_some(of)
}

/// The distance in metres, if it is one: within the sensor's range and not marked as invalid.
fn reading(sensor: &DISTANCE_SENSOR_DATA) -> Option<f64> {
    let range = sensor.min_distance..=sensor.max_distance;
    let valid = range.contains(&sensor.current_distance) && sensor.signal_quality != INVALID;
    valid.then(|| f64::from(sensor.current_distance) * 0.01)
}

/// The height above the ground in metres, if it is known. PX4 gives the terrain's own height in the
/// field for that above the terrain, and what is needed in the clearance.
fn above_terrain(autopilot: Autopilot, of: &ALTITUDE_DATA) -> Option<f64> {
    let known = |value: f32, known: bool| (known && value.is_finite()).then(|| f64::from(value));
    let clearance = known(of.bottom_clearance, of.bottom_clearance >= 0.0);
    match autopilot {
        Autopilot::Px4 => clearance,
        Autopilot::ArduPilot => {
            clearance.or_else(|| known(of.altitude_terrain, of.altitude_terrain > UNKNOWN_M))
        }
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_wire::mavlink::dialect::{RANGEFINDER_DATA, TERRAIN_REPORT_DATA};

    use super::*;

    const DOWN: MavSensorOrientation = MavSensorOrientation::MAV_SENSOR_ROTATION_PITCH_270;

    fn sensor(id: u8, current_distance: u16) -> DISTANCE_SENSOR_DATA {
        let min_distance = 20;
        let max_distance = 4000;
        let orientation = DOWN;
        DISTANCE_SENSOR_DATA {
            id,
            min_distance,
            max_distance,
            current_distance,
            orientation,
            ..DISTANCE_SENSOR_DATA::default()
        }
    }

    fn after(messages: &[(f64, MavMessage)]) -> GroundReports {
        let mut ground = GroundReports::default();
        for (at, message) in messages {
            ground.take(*at, Autopilot::ArduPilot, message);
        }
        ground
    }

    fn height(messages: &[(f64, MavMessage)], now: f64) -> Option<(f64, HeightSource)> {
        after(messages).height(now, None).map(|of| (of.height.metres, of.height.source))
    }

    #[test]
    fn a_reading_beyond_the_range_is_none() {
        let one = |sensor| [(0.0, MavMessage::DISTANCE_SENSOR(sensor))];
        let rangefinder = |metres| Some((metres, HeightSource::Rangefinder));
        assert_eq!(height(&one(sensor(0, 1234)), 0.0), rangefinder(12.34));
        assert_eq!(height(&one(sensor(0, 20)), 0.0), rangefinder(0.2));
        assert_eq!(height(&one(sensor(0, 4000)), 0.0), rangefinder(40.0));
        for beyond in [0, 19, 4001, u16::MAX] {
            assert_eq!(height(&one(sensor(0, beyond)), 0.0), None, "{beyond} cm");
        }
        let invalid = DISTANCE_SENSOR_DATA { signal_quality: 1, ..sensor(0, 300) };
        assert_eq!(height(&one(invalid), 0.0), None);
        let forwards = MavSensorOrientation::MAV_SENSOR_ROTATION_NONE;
        let forwards = DISTANCE_SENSOR_DATA { orientation: forwards, ..sensor(0, 300) };
        assert_eq!(height(&one(forwards), 0.0), None);
        let text = after(&one(sensor(0, 19))).summary(0.0, &None);
        assert_eq!(text.as_deref(), Some("rangefinder out of its range"));
    }

    #[test]
    fn an_old_height_is_none() {
        let one = [(10.0, MavMessage::DISTANCE_SENSOR(sensor(0, 300)))];
        assert!(height(&one, 10.0 + STALE_S).is_some());
        assert_eq!(height(&one, 10.1 + STALE_S), None);
        assert_eq!(after(&one).summary(20.0, &None), None);
        assert!(after(&one).height(12.0, None).is_some_and(|of| (of.age_s - 2.0).abs() < 1e-12));
        // What is out of range is so at once.
        let [first] = one;
        let messages = [first, (10.5, MavMessage::DISTANCE_SENSOR(sensor(0, 4001)))];
        assert_eq!(height(&messages, 10.5), None);
        // But for one of two sensors.
        let mut messages = messages;
        messages[1].1 = MavMessage::DISTANCE_SENSOR(sensor(1, 4001));
        assert_eq!(height(&messages, 10.5), Some((3.0, HeightSource::Rangefinder)));
    }

    #[test]
    fn the_beam_leans_as_the_vehicle_does() {
        let ground = after(&[(0.0, MavMessage::DISTANCE_SENSOR(sensor(0, 1000)))]);
        let value = ATTITUDE_DATA { roll: 0.3, pitch: -0.2, ..ATTITUDE_DATA::default() };
        let height = ground.height(0.0, Some(&Timed { at: 0.0, value })).expect("a reading");
        let expected = 10.0 * 0.3_f64.cos() * 0.2_f64.cos();
        assert_abs_diff_eq!(height.height.metres, expected, epsilon = 1e-6);
    }

    #[test]
    fn the_range_of_a_sensor_counts_more_than_a_distance_alone() {
        let rangefinder = RANGEFINDER_DATA { distance: 55.0, voltage: 0.0 };
        let alone = [(0.0, MavMessage::RANGEFINDER(rangefinder.clone()))];
        assert_eq!(height(&alone, 0.0), Some((55.0, HeightSource::Rangefinder)));
        let [first] = alone;
        let both = [first, (0.0, MavMessage::DISTANCE_SENSOR(sensor(0, 5500)))];
        assert_eq!(height(&both, 0.0), None);
        let none = RANGEFINDER_DATA { distance: f32::NAN, ..rangefinder };
        assert_eq!(height(&[(0.0, MavMessage::RANGEFINDER(none))], 0.0), None);
    }

    #[test]
    fn terrain_that_is_not_known_has_no_height() {
        let report = |spacing, current_height| {
            let report =
                TERRAIN_REPORT_DATA { spacing, current_height, ..TERRAIN_REPORT_DATA::default() };
            [(0.0, MavMessage::TERRAIN_REPORT(report))]
        };
        assert_eq!(height(&report(100, 7.5), 0.0), Some((7.5, HeightSource::Terrain)));
        assert_eq!(height(&report(0, 7.5), 0.0), None);
        assert_eq!(height(&report(100, f32::INFINITY), 0.0), None);
        let nan = f32::NAN;
        for (autopilot, altitude_terrain, bottom_clearance, expected) in [
            (Autopilot::ArduPilot, 7.0, -1.0, Some(7.0)),
            (Autopilot::ArduPilot, -1000.0, -1.0, None),
            (Autopilot::ArduPilot, nan, nan, None),
            (Autopilot::ArduPilot, 7.0, 6.0, Some(6.0)),
            (Autopilot::Px4, 7.0, 6.0, Some(6.0)),
            (Autopilot::Px4, 7.0, nan, None),
            (Autopilot::Px4, 7.0, -1.0, None),
        ] {
            let altitude =
                ALTITUDE_DATA { altitude_terrain, bottom_clearance, ..ALTITUDE_DATA::default() };
            let found = above_terrain(autopilot, &altitude);
            assert_eq!(found, expected, "{autopilot}: {altitude_terrain} {bottom_clearance}");
        }
    }
}
