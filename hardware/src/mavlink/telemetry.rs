use std::collections::{BTreeMap, BTreeSet, VecDeque};

use foxhunt_wire::mavlink::{
    Autopilot, FlightMode, Frame,
    dialect::{
        ATTITUDE_DATA, AUTOPILOT_VERSION_DATA, GLOBAL_POSITION_INT_DATA, GPS_RAW_INT_DATA,
        HEARTBEAT_DATA, HOME_POSITION_DATA, LOCAL_POSITION_NED_DATA, MavAutopilot, MavLandedState,
        MavMessage, MavModeFlag, MavResult, MavState, MavType, POSITION_TARGET_GLOBAL_INT_DATA,
        POSITION_TARGET_LOCAL_NED_DATA, SYS_STATUS_DATA,
    },
};
#[cfg(feature = "receivers")]
use foxhunt_wire::receivers::SikStatus;

use super::{
    MavlinkConfig, doubt::Doubt, ground::GroundReports, parameter::parameter, texts::Texts,
    timed::Timed,
};
use crate::ReportedHeight;

/// A SiK telemetry radio's report of its link (RADIO_STATUS).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadioStatus {
    /// Time at which it came, in seconds of the driver's clock.
    pub time: f64,
    /// Signal strength of the other radio here, in the radio's own units; 255 is invalid.
    pub rssi: u8,
    /// Signal strength of this radio there.
    pub remote_rssi: u8,
    /// The noise here.
    pub noise: u8,
    /// The noise there.
    pub remote_noise: u8,
}

/// The newest of each message of the autopilot.
#[derive(Debug, Default)]
pub(super) struct Telemetry {
    /// Its system, its component and its firmware.
    pub(super) who: Option<(u8, u8, Autopilot)>,
    /// Time of its last message.
    pub(super) last: Option<f64>,
    pub(super) heartbeat: Option<Timed<HEARTBEAT_DATA>>,
    /// The number of its frame.
    pub(super) beat_sequence: u8,
    pub(super) position: Option<Timed<GLOBAL_POSITION_INT_DATA>>,
    pub(super) attitude: Option<Timed<ATTITUDE_DATA>>,
    pub(super) gps: Option<Timed<GPS_RAW_INT_DATA>>,
    /// Flags of the estimator, the same bits from both firmwares.
    pub(super) estimator: Option<Timed<u16>>,
    pub(super) status: Option<Timed<SYS_STATUS_DATA>>,
    pub(super) home: Option<Timed<HOME_POSITION_DATA>>,
    pub(super) target: Option<Timed<POSITION_TARGET_GLOBAL_INT_DATA>>,
    /// Its place and its target in the frame of its own estimator.
    pub(super) local: Option<Timed<LOCAL_POSITION_NED_DATA>>,
    pub(super) local_target: Option<Timed<POSITION_TARGET_LOCAL_NED_DATA>>,
    pub(super) landed: Option<Timed<MavLandedState>>,
    /// Signs that its place is false.
    pub(super) doubt: Doubt,
    pub(super) ground: GroundReports,
    pub(super) version: Option<AUTOPILOT_VERSION_DATA>,
    /// Ground stations whose heartbeats came over this link.
    pub(super) stations: BTreeSet<u8>,
    /// The parameters that it has sent, by their names.
    pub(super) parameters: BTreeMap<String, f64>,
    pub(super) radio: Option<RadioStatus>,
    /// Receiver of the SiK radio's reports.
    #[cfg(feature = "receivers")]
    pub(super) feed: Option<crate::SikFeed>,
    /// The last texts, the newest last.
    pub(super) texts: Texts,
    /// Answers to orders that nobody has looked at yet: the order's number and what was answered.
    pub(super) acks: VecDeque<(u32, MavResult)>,
}

/// Greatest age of its landed state, in seconds.
const LANDED_S: f64 = 3.0;

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

    pub(super) fn autopilot(&self) -> Autopilot {
        self.who.map_or(Autopilot::default(), |(_, _, autopilot)| autopilot)
    }

    /// Returns true for a PX4 1 that reports a minor version of at least `minor`.
    pub(super) fn is_px4_since(&self, minor: u8) -> bool {
        let version = self.version.as_ref().map(|version| version.flight_sw_version.to_be_bytes());
        self.autopilot() == Autopilot::Px4
            && version.is_some_and(|[major, of, ..]| major > 1 || (major == 1 && of >= minor))
    }

    /// The mode of the last heartbeat.
    pub(super) fn mode(&self) -> Option<FlightMode> {
        let custom = self.heartbeat.as_ref()?.value.custom_mode;
        Some(FlightMode { autopilot: self.autopilot(), custom })
    }

    pub(super) fn armed(&self) -> bool {
        let armed = MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        self.heartbeat.as_ref().is_some_and(|beat| beat.value.base_mode.contains(armed))
    }

    /// Returns true if its last heartbeat reports that a failsafe acts.
    pub(super) fn failsafe(&self) -> bool {
        let critical = MavState::MAV_STATE_CRITICAL;
        self.heartbeat.as_ref().is_some_and(|beat| beat.value.system_status == critical)
    }

    /// Seconds since its last heartbeat.
    pub(super) fn without_heartbeat(&self, now: f64) -> f64 {
        self.heartbeat.as_ref().map_or(f64::INFINITY, |beat| now - beat.at)
    }

    /// Seconds since anything of it came: any message shows that the link lives. Heartbeats, which
    /// alone have its mode, may be away for twice as long.
    pub(super) fn silence(&self, now: f64) -> f64 {
        let any = self.last.map_or(f64::INFINITY, |last| now - last);
        any.max(0.5 * self.without_heartbeat(now))
    }

    /// Returns true if it is in the air, by its last reports.
    pub(super) fn airborne(&self, now: f64) -> bool {
        let landed = self.landed.filter(|landed| now - landed.at <= LANDED_S);
        match landed.map(|landed| landed.value) {
            Some(MavLandedState::MAV_LANDED_STATE_ON_GROUND) => false,
            Some(MavLandedState::MAV_LANDED_STATE_UNDEFINED) | None => {
                self.armed() && self.up().is_some_and(|up| up > 0.5)
            }
            Some(_) => true,
        }
    }

    /// Metres above its launch place.
    pub(super) fn up(&self) -> Option<f64> {
        Some(f64::from(self.position.as_ref()?.value.relative_alt) * 1e-3)
    }

    /// Returns its height above the ground by its own devices.
    pub(super) fn above_ground(&self, now: f64) -> Option<ReportedHeight> {
        self.ground.height(now, self.attitude.as_ref())
    }

    /// Returns the charge of the battery, from 0 to 1.
    pub(super) fn battery(&self) -> Option<f64> {
        let percent = self.status.as_ref()?.value.battery_remaining;
        (0..=100).contains(&percent).then(|| f64::from(percent) / 100.0)
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
