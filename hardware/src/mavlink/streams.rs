use foxhunt_wire::mavlink::{
    Autopilot, Message, MessageData,
    dialect::{
        ALTITUDE_DATA, ATTITUDE_DATA, DISTANCE_SENSOR_DATA, EKF_STATUS_REPORT_DATA,
        ESTIMATOR_STATUS_DATA, EXTENDED_SYS_STATE_DATA, GLOBAL_POSITION_INT_DATA, GPS_RAW_INT_DATA,
        HOME_POSITION_DATA, LOCAL_POSITION_NED_DATA, MavCmd, MavMessage,
        POSITION_TARGET_GLOBAL_INT_DATA, POSITION_TARGET_LOCAL_NED_DATA, RANGEFINDER_DATA,
        SYS_STATUS_DATA, TERRAIN_REPORT_DATA,
    },
};

use super::{MavlinkConfig, ground::GROUND_PERIOD_S, orders::Order};

/// Messages that the autopilot is requested to send regularly.
#[derive(Debug)]
pub(super) struct Streams {
    wanted: Vec<Wanted>,
}

#[derive(Debug)]
struct Wanted {
    message: u32,
    period_s: f64,
    received: f64,
    requested: f64,
    /// Number of requests in vain.
    vain: u32,
}

/// Home moves seldom.
const HOME_PERIOD_S: f64 = 2.0;

/// Number of requests after which a message that does not come is requested less often.
const PATIENCE: u32 = 5;

impl Streams {
    pub(super) fn new(config: &MavlinkConfig, autopilot: Autopilot) -> Self {
        let pose = 1.0 / config.pose_rate_hz;
        let status = 1.0 / config.status_rate_hz;
        // PX4 has its target in OFFBOARD in the local frame alone.
        let own: &[u32] = match autopilot {
            Autopilot::ArduPilot => {
                &[EKF_STATUS_REPORT_DATA::ID, POSITION_TARGET_GLOBAL_INT_DATA::ID]
            }
            Autopilot::Px4 => &[
                ESTIMATOR_STATUS_DATA::ID,
                LOCAL_POSITION_NED_DATA::ID,
                POSITION_TARGET_LOCAL_NED_DATA::ID,
            ],
        };
        // What a vehicle does not have is refused, and requested again now and then.
        let ground: &[u32] = match autopilot {
            Autopilot::ArduPilot => {
                &[DISTANCE_SENSOR_DATA::ID, RANGEFINDER_DATA::ID, TERRAIN_REPORT_DATA::ID]
            }
            Autopilot::Px4 => &[DISTANCE_SENSOR_DATA::ID, ALTITUDE_DATA::ID],
        };
        let wanted = [
            (GLOBAL_POSITION_INT_DATA::ID, pose),
            (ATTITUDE_DATA::ID, pose),
            (GPS_RAW_INT_DATA::ID, status),
            (SYS_STATUS_DATA::ID, status),
            (EXTENDED_SYS_STATE_DATA::ID, status),
            (HOME_POSITION_DATA::ID, HOME_PERIOD_S),
        ];
        let never = f64::NEG_INFINITY;
        let wanted = wanted
            .into_iter()
            .chain(own.iter().map(|message| (*message, status)))
            .chain(ground.iter().map(|message| (*message, GROUND_PERIOD_S)))
            .map(|(message, period_s)| Wanted {
                message,
                period_s,
                received: never,
                requested: never,
                vain: 0,
            })
            .collect();
        Self { wanted }
    }

    pub(super) fn received(&mut self, now: f64, message: &MavMessage) {
        let id = message.message_id();
        if let Some(wanted) = self.wanted.iter_mut().find(|wanted| wanted.message == id) {
            (wanted.received, wanted.vain) = (now, 0);
        }
    }

    /// The autopilot may have been reset: everything is requested again at once.
    pub(super) fn restart(&mut self) {
        for wanted in &mut self.wanted {
            (wanted.received, wanted.requested, wanted.vain) =
                (f64::NEG_INFINITY, f64::NEG_INFINITY, 0);
        }
    }

    /// The orders that are due for what does not come.
    pub(super) fn due(&mut self, now: f64) -> Vec<Order> {
        let mut orders = Vec::new();
        for wanted in &mut self.wanted {
            let missing = now - wanted.received > 3.0 * wanted.period_s + 1.0;
            let patience = if wanted.vain < PATIENCE { 1.0 } else { 10.0 };
            if missing && now - wanted.requested > patience + wanted.period_s {
                wanted.requested = now;
                wanted.vain = wanted.vain.saturating_add(1);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_precision_loss,
                    reason = "message numbers are below 2^24; a period needs no more digits"
                )]
                let [id, period_us] = [wanted.message as f32, (wanted.period_s * 1e6) as f32];
                let parameters = [id, period_us, 0.0, 0.0, 0.0, 0.0, 0.0];
                orders.push(Order::new(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, parameters));
            }
        }
        orders
    }
}
