use std::collections::VecDeque;

use foxhunt_wire::mavlink::{
    Autopilot, Frame,
    dialect::{HEARTBEAT_DATA, MavAutopilot, MavMessage, MavType},
};
#[cfg(feature = "receivers")]
use foxhunt_wire::receivers::SikStatus;

use super::{
    MavlinkConfig, RadioStatus, Telemetry,
    reports::{Timed, parameter},
};

/// Heartbeats overtake each other by less than that, in seconds.
const REORDERED_S: f64 = 2.0;

/// Most parameters that are kept: no autopilot has more.
const PARAMETERS: usize = 4096;

/// Number of answers that are kept.
const KEPT: usize = 16;

impl Telemetry {
    /// Takes a message of the autopilot, or one about the link to it; messages of others are not
    /// ours. Returns true if it is the autopilot's.
    pub(super) fn take(&mut self, now: f64, config: &MavlinkConfig, frame: &Frame) -> bool {
        if let MavMessage::RADIO_STATUS(radio) = &frame.message {
            let rssi = radio.rssi;
            let remote_rssi = radio.remrssi;
            let noise = radio.noise;
            let remote_noise = radio.remnoise;
            self.radio = Some(RadioStatus { time: now, rssi, remote_rssi, noise, remote_noise });
            #[cfg(feature = "receivers")]
            if let Some(feed) = &self.feed {
                let remrssi = remote_rssi;
                let remnoise = remote_noise;
                feed.push(SikStatus { rssi, remrssi, noise, remnoise });
            }
            return false;
        }
        let Ok(system) = u8::try_from(frame.header.system_id) else { return false };
        let component = frame.header.component_id;
        if let (None, MavMessage::HEARTBEAT(heartbeat)) = (self.who, &frame.message) {
            self.meet(config, system, component, heartbeat);
        }
        if let MavMessage::HEARTBEAT(beat) = &frame.message
            && beat.mavtype == MavType::MAV_TYPE_GCS
        {
            self.stations.insert(system);
        }
        if self.who.is_none_or(|(s, c, _)| (s, c) != (system, component)) {
            return false;
        }
        self.last = Some(now);
        match self.armed() {
            true => self.doubt.take(now, &frame.message),
            false => self.doubt.clear(),
        }
        match &frame.message {
            MavMessage::HEARTBEAT(value) if self.is_newer(now, frame.header.sequence) => {
                self.heartbeat = timed(now, value);
            }
            MavMessage::GLOBAL_POSITION_INT(value) => self.position = timed(now, value),
            MavMessage::ATTITUDE(value) => self.attitude = timed(now, value),
            MavMessage::GPS_RAW_INT(value) => self.gps = timed(now, value),
            MavMessage::EKF_STATUS_REPORT(value) => {
                self.estimator = timed(now, &value.flags.bits());
            }
            MavMessage::ESTIMATOR_STATUS(value) => {
                self.estimator = timed(now, &value.flags.bits());
            }
            MavMessage::SYS_STATUS(value) => self.status = timed(now, value),
            MavMessage::HOME_POSITION(value) => self.home = timed(now, value),
            MavMessage::POSITION_TARGET_GLOBAL_INT(value) => self.target = timed(now, value),
            MavMessage::LOCAL_POSITION_NED(value) => self.local = timed(now, value),
            MavMessage::POSITION_TARGET_LOCAL_NED(value) => self.local_target = timed(now, value),
            MavMessage::EXTENDED_SYS_STATE(value) => {
                self.landed = timed(now, &value.landed_state);
            }
            MavMessage::DISTANCE_SENSOR(_)
            | MavMessage::RANGEFINDER(_)
            | MavMessage::TERRAIN_REPORT(_)
            | MavMessage::ALTITUDE(_) => self.ground.take(now, self.autopilot(), &frame.message),
            MavMessage::AUTOPILOT_VERSION(value) => self.version = Some(value.clone()),
            MavMessage::PARAM_VALUE(value) => {
                let name = value.param_id.to_str().unwrap_or_default().to_owned();
                let known =
                    self.parameters.len() < PARAMETERS || self.parameters.contains_key(&name);
                if known {
                    let number = parameter(self.autopilot(), value);
                    self.parameters.insert(name, number);
                }
            }
            MavMessage::STATUSTEXT(value) => self.texts.take(now, value),
            MavMessage::COMMAND_ACK(value)
                if [0, config.ground_system_id].contains(&value.target_system) =>
            {
                keep(&mut self.acks, (value.command as u32, value.result));
            }
            _ => {}
        }
        true
    }

    /// Returns true if a heartbeat was sent after the last one: what comes late or twice must not
    /// show an older mode. After a while without any, every one counts: the autopilot may have been
    /// reset.
    fn is_newer(&mut self, now: f64, sequence: u8) -> bool {
        let ahead = sequence.wrapping_sub(self.beat_sequence);
        let newer = (1..128).contains(&ahead) || self.without_heartbeat(now) > REORDERED_S;
        if newer {
            self.beat_sequence = sequence;
        }
        newer
    }

    fn meet(&mut self, config: &MavlinkConfig, system: u8, component: u8, beat: &HEARTBEAT_DATA) {
        // Ground stations, gimbals and cameras have heartbeats, too.
        if beat.mavtype == MavType::MAV_TYPE_GCS
            || beat.autopilot == MavAutopilot::MAV_AUTOPILOT_INVALID
            || config.system_id.is_some_and(|wanted| wanted != system)
        {
            return;
        }
        let announced = match beat.autopilot {
            MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA => Some(Autopilot::ArduPilot),
            MavAutopilot::MAV_AUTOPILOT_PX4 => Some(Autopilot::Px4),
            _ => None,
        };
        self.who = config.autopilot.or(announced).map(|autopilot| (system, component, autopilot));
    }
}

#[expect(clippy::unnecessary_wraps, reason = "fields of this type are assigned from it")]
fn timed<T: Clone>(at: f64, value: &T) -> Option<Timed<T>> {
    Some(Timed { at, value: value.clone() })
}

/// Adds to a queue of limited length, which forgets the oldest.
fn keep<T>(queue: &mut VecDeque<T>, item: T) {
    if queue.len() >= KEPT {
        queue.pop_front();
    }
    queue.push_back(item);
}
