use std::io;

use foxhunt_wire::{
    ByteStream,
    mavlink::{
        Codec, Frame, FrameCounts, Signing,
        dialect::{HEARTBEAT_DATA, MavAutopilot, MavMessage, MavModeFlag, MavState, MavType},
    },
};

use super::MavlinkConfig;

/// Messages to and from the other end of a stream, as a ground station.
#[derive(Debug)]
pub(super) struct Link<S> {
    stream: S,
    codec: Codec,
    connections: u32,
    /// Where anybody may send: since when the one that is pinned has sent nothing.
    pinned: Option<f64>,
    /// Without a message for so long another one may be pinned, in seconds.
    timeout_s: f64,
    /// Whether nothing is sent.
    listen_only: bool,
    /// When the last heartbeat of ours went out.
    beaten: f64,
    /// UNIX time when the clock was 0.
    pub(super) clock_origin_unix_s: f64,
}

/// Our component: MAV_COMP_ID_MISSIONPLANNER, a ground station.
const COMPONENT: u8 = 190;

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
        let timeout_s = config.link_timeout_s;
        Self {
            stream,
            codec,
            connections,
            pinned: None,
            timeout_s,
            listen_only: config.listen_only,
            beaten,
            clock_origin_unix_s: 0.0,
        }
    }

    /// Hands on what has come; `take` returns whether a frame is of the autopilot. Where anybody
    /// may send, only the sender of such a frame is received and answered, until it has been silent
    /// for as long as a link may be. Whether the stream was opened anew since the last time.
    pub(super) fn receive(
        &mut self,
        now: f64,
        mut take: impl FnMut(&Frame) -> bool,
    ) -> io::Result<bool> {
        let mut into = [0; 2048];
        if self.pinned.is_some_and(|since| now - since > self.timeout_s) {
            self.pinned = None;
            self.stream.unpin()?;
        }
        // As many as a second of the fastest link holds: a device that floods us is not followed.
        for _ in 0..256 {
            let count = self.stream.receive(&mut into)?;
            let Some(bytes) = into.get(..count).filter(|bytes| !bytes.is_empty()) else { break };
            let open = self.stream.is_open();
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
                self.pinned = Some(now);
                if open {
                    self.stream.pin()?;
                }
            }
        }
        let reopened = self.stream.connections() != self.connections;
        if reopened {
            (self.connections, self.pinned) = (self.stream.connections(), None);
            self.codec.restart();
        }
        Ok(reopened)
    }

    /// Sends a message. Where anybody may send, nobody is answered before the autopilot is known.
    pub(super) fn send(&mut self, now: f64, message: &MavMessage) -> io::Result<()> {
        if self.listen_only || self.stream.is_open() {
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
