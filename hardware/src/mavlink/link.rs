use std::{io, net::SocketAddr};

use foxhunt_wire::{
    ByteStream,
    mavlink::{
        Codec, Frame, FrameCounts, Signing,
        dialect::{HEARTBEAT_DATA, MavAutopilot, MavMessage, MavModeFlag, MavState, MavType},
    },
};

use super::{MavlinkConfig, timed::Timed};

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
    pub(super) clock_origin_unix_s: f64,
}

/// Our component: MAV_COMP_ID_MISSIONPLANNER, a ground station.
const COMPONENT: u8 = 190;

/// Silence in seconds after which an unsigned peer is gone: by then the autopilot's own failsafes
/// have acted.
const GONE_S: f64 = 30.0;

/// Between our heartbeats, in seconds.
const BEAT_S: f64 = 1.0;

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
