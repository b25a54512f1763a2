//! Messages to and from an autopilot, and those that it is requested to send regularly.

use std::{io, net::SocketAddr};

use foxhunt_wire::{
    ByteStream,
    mavlink::{
        Autopilot, Codec, Frame, FrameCounts, Message, MessageData, Signing,
        dialect::{
            ALTITUDE_DATA, ATTITUDE_DATA, DISTANCE_SENSOR_DATA, EKF_STATUS_REPORT_DATA,
            ESTIMATOR_STATUS_DATA, EXTENDED_SYS_STATE_DATA, GLOBAL_POSITION_INT_DATA,
            GPS_RAW_INT_DATA, HEARTBEAT_DATA, HOME_POSITION_DATA, LOCAL_POSITION_NED_DATA,
            MavAutopilot, MavCmd, MavMessage, MavModeFlag, MavState, MavType,
            POSITION_TARGET_GLOBAL_INT_DATA, POSITION_TARGET_LOCAL_NED_DATA, RANGEFINDER_DATA,
            SYS_STATUS_DATA, TERRAIN_REPORT_DATA,
        },
    },
};

use super::{MavlinkConfig, ground::GROUND_PERIOD_S, orders::Order, reports::Timed};

/// Our component: MAV_COMP_ID_MISSIONPLANNER, a ground station.
const COMPONENT: u8 = 190;

/// Silence in seconds after which an unsigned peer is gone: by then the autopilot's own failsafes
/// have acted.
const GONE_S: f64 = 30.0;

/// Between our heartbeats, in seconds.
const BEAT_S: f64 = 1.0;

/// Home moves seldom.
const HOME_PERIOD_S: f64 = 2.0;

/// Number of requests after which a message that does not come is requested less often.
const PATIENCE: u32 = 5;

/// Messages to and from the other end of a stream, as a ground station.
#[derive(Debug)]
pub(super) struct Link<S> {
    stream: S,
    codec: Codec,
    connections: u32,
    /// Last time at which the pinned peer sent something of the autopilot, if anybody may send to
    /// the port.
    heard: Option<f64>,
    /// Time in seconds without a message after which it may come from elsewhere.
    timeout_s: f64,
    /// True if a sender is known by its signature.
    signed: bool,
    /// The last change of the other end.
    change: Option<Timed<String>>,
    /// True if nothing is sent.
    listen_only: bool,
    /// Time of our last heartbeat.
    beaten: f64,
    /// UNIX time when the clock was 0.
    pub clock_origin_unix_s: f64,
}

impl<S: ByteStream> Link<S> {
    pub(super) fn new(config: &MavlinkConfig, stream: S) -> Self {
        let codec = Codec::new(config.ground_system_id, COMPONENT);
        let codec = match config.signing {
            Some(signing) => codec.with_signing(Signing::new(signing.key, signing.link_id)),
            None => codec,
        };
        let connections = stream.connections();
        let beaten = f64::NEG_INFINITY;
        Self {
            stream,
            codec,
            connections,
            heard: None,
            timeout_s: config.link_timeout_s,
            signed: config.signing.is_some(),
            change: None,
            listen_only: config.listen_only,
            beaten,
            clock_origin_unix_s: 0.0,
        }
    }

    /// Hands on what has come; `take` returns whether a frame is of the autopilot. Where anybody
    /// may send, only the sender of such a frame is received and answered, until it has been silent
    /// for as long as a link may be. Then it is answered still, and others are heard at once where
    /// they sign or nothing `flies`, and otherwise when it may be taken for gone. Returns true if
    /// the stream was opened again since the last time.
    pub(super) fn receive(
        &mut self,
        now: f64,
        flies: bool,
        mut take: impl FnMut(&Frame) -> bool,
    ) -> io::Result<bool> {
        let mut into = [0; 2048];
        let silent_s = self.heard.map_or(f64::INFINITY, |heard| now - heard);
        if self.heard.is_some() && silent_s > self.timeout_s && !self.stream.is_open() {
            self.stream.unpin()?;
        }
        // As many as a second of the fastest link holds: a device that floods us is not followed.
        for _ in 0..256 {
            let count = self.stream.receive(&mut into)?;
            let Some(bytes) = into.get(..count).filter(|bytes| !bytes.is_empty()) else { break };
            let open = self.stream.is_open();
            let known = self.stream.peer();
            let sender = self.stream.sender();
            let elsewhere = open && known.is_some() && sender != known;
            if elsewhere && flies && !self.signed && silent_s < GONE_S {
                continue;
            }
            if open {
                // What a stranger has begun is not continued by another one.
                self.codec.restart();
            }
            self.codec.push(bytes);
            let mut ours = false;
            while let Some(frame) = self.codec.next_frame(self.clock_origin_unix_s + now) {
                ours |= take(&frame);
            }
            if ours {
                self.heard = Some(now);
                if open {
                    self.stream.pin()?;
                }
                if let (true, Some(known), Some(sender)) = (elsewhere, known, sender) {
                    self.moved(now, known, sender);
                }
            }
        }
        let reopened = self.stream.connections() != self.connections;
        if reopened {
            (self.connections, self.heard) = (self.stream.connections(), None);
            self.codec.restart();
        }
        Ok(reopened)
    }

    fn moved(&mut self, now: f64, from: SocketAddr, to: SocketAddr) {
        let sign = if self.signed { "" } else { ", unsigned: anybody may have sent it" };
        let value = format!("its link comes from {to} now, and came from {from}{sign}");
        self.change = Some(Timed { at: now, value });
    }

    /// The last change of the other end.
    pub(super) fn change(&self) -> Option<&Timed<String>> {
        self.change.as_ref()
    }

    /// Returns true if anybody could become the other end.
    pub(super) fn is_for_anybody(&self) -> bool {
        !self.signed && (self.stream.is_open() || self.stream.peer().is_some())
    }

    /// Sends a message. Where anybody may send, nobody is answered before the autopilot is known;
    /// one that has fallen silent is sent to still, as it may hear us.
    pub(super) fn send(&mut self, now: f64, message: &MavMessage) -> io::Result<()> {
        let nobody = self.stream.is_open() && self.stream.peer().is_none();
        if self.listen_only || nobody {
            return Ok(());
        }
        let bytes = self.codec.encode(message, self.clock_origin_unix_s + now);
        match self.stream.send(&bytes) {
            Err(error) if error.kind() == io::ErrorKind::NotConnected => Ok(()),
            other => other,
        }
    }

    /// Sends a heartbeat once a second.
    pub(super) fn beat(&mut self, now: f64) -> io::Result<()> {
        if now - self.beaten < BEAT_S {
            return Ok(());
        }
        self.beaten = now;
        let heartbeat = HEARTBEAT_DATA {
            custom_mode: 0,
            mavtype: MavType::MAV_TYPE_GCS,
            autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
            base_mode: MavModeFlag::from_bits_retain(0),
            system_status: MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
        };
        self.send(now, &MavMessage::HEARTBEAT(heartbeat))
    }

    pub(super) fn counts(&self) -> FrameCounts {
        self.codec.counts()
    }
}

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
