use foxhunt_wire::mavlink::{
    Autopilot, MessageData,
    dialect::{
        ALTITUDE_DATA, ATTITUDE_DATA, DISTANCE_SENSOR_DATA, EKF_STATUS_REPORT_DATA,
        ESTIMATOR_STATUS_DATA, EXTENDED_SYS_STATE_DATA, GLOBAL_POSITION_INT_DATA, GPS_RAW_INT_DATA,
        HEARTBEAT_DATA, HOME_POSITION_DATA, LOCAL_POSITION_NED_DATA,
        POSITION_TARGET_GLOBAL_INT_DATA, POSITION_TARGET_LOCAL_NED_DATA, RANGEFINDER_DATA,
        SYS_STATUS_DATA, SYSTEM_TIME_DATA, TERRAIN_REPORT_DATA, VFR_HUD_DATA,
    },
};

use super::AutopilotConfig;

/// The messages that it sends, each at its own rate.
#[derive(Debug)]
pub(super) struct Streams {
    all: Vec<Stream>,
}

#[derive(Debug)]
struct Stream {
    id: u32,
    /// Time from one message to the next, in seconds; infinite if it was not requested.
    period: f64,
    due: f64,
}

/// The messages that may be requested, each with the rate at which PX4 sends it without a request,
/// per second.
const KNOWN: [(u32, f64); 17] = [
    (ATTITUDE_DATA::ID, 10.0),
    (GLOBAL_POSITION_INT_DATA::ID, 5.0),
    (LOCAL_POSITION_NED_DATA::ID, 2.0),
    (GPS_RAW_INT_DATA::ID, 1.0),
    (SYS_STATUS_DATA::ID, 1.0),
    (EXTENDED_SYS_STATE_DATA::ID, 1.0),
    (HOME_POSITION_DATA::ID, 0.5),
    (VFR_HUD_DATA::ID, 2.0),
    (SYSTEM_TIME_DATA::ID, 1.0),
    (POSITION_TARGET_GLOBAL_INT_DATA::ID, 1.0),
    (POSITION_TARGET_LOCAL_NED_DATA::ID, 1.0),
    (ESTIMATOR_STATUS_DATA::ID, 1.0),
    (EKF_STATUS_REPORT_DATA::ID, 0.0),
    (DISTANCE_SENSOR_DATA::ID, 1.0),
    (ALTITUDE_DATA::ID, 1.0),
    (RANGEFINDER_DATA::ID, 0.0),
    (TERRAIN_REPORT_DATA::ID, 0.0),
];

impl Streams {
    pub(super) fn new(config: &AutopilotConfig, now: f64) -> Self {
        let ranges = config.rangefinder_m.is_some();
        let terrain = config.terrain_data;
        let px4 = config.autopilot == Autopilot::Px4;
        // What the firmware has no message of, or the vehicle no device for.
        let has = |id: u32| match id {
            ESTIMATOR_STATUS_DATA::ID | POSITION_TARGET_LOCAL_NED_DATA::ID => px4,
            EKF_STATUS_REPORT_DATA::ID => !px4,
            DISTANCE_SENSOR_DATA::ID => ranges,
            RANGEFINDER_DATA::ID => ranges && !px4,
            TERRAIN_REPORT_DATA::ID => terrain && !px4,
            ALTITUDE_DATA::ID => (ranges || terrain) && px4,
            _ => true,
        };
        let known = KNOWN.iter().filter(|(id, _)| has(*id)).map(|(id, rate)| {
            let unrequested = px4;
            Stream {
                id: *id,
                period: if unrequested { 1.0 / rate } else { f64::INFINITY },
                due: now,
            }
        });
        let beat = Stream { id: HEARTBEAT_DATA::ID, period: 1.0, due: now };
        Self { all: std::iter::once(beat).chain(known).collect() }
    }

    /// Requests a message every `period` seconds from now on; returns false if it may not be
    /// requested.
    pub(super) fn query(&mut self, id: u32, period: f64, now: f64) -> bool {
        let Some(stream) = self.all.iter_mut().find(|stream| stream.id == id) else {
            return false;
        };
        // Serial ports and processors have an end.
        (stream.period, stream.due) = (period.max(0.01), now);
        true
    }

    /// Returns the messages that are due now.
    pub(super) fn due(&mut self, now: f64) -> Vec<u32> {
        let mut due = Vec::new();
        for stream in &mut self.all {
            // A nanosecond is forgiven: time is a sum of steps.
            if stream.period.is_finite() && now >= stream.due - 1e-9 {
                due.push(stream.id);
                // In step with itself, and never a burst after a pause.
                stream.due = (stream.due + stream.period).max(now - stream.period);
                if stream.due <= now {
                    stream.due = now + stream.period;
                }
            }
        }
        due
    }
}
