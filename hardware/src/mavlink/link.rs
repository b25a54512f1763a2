use std::io;

use foxhunt_wire::{
    ByteStream,
    mavlink::{
        Codec, Frame, FrameCounts, Signing,
        dialect::{HEARTBEAT_DATA, MavAutopilot, MavMessage, MavModeFlag, MavState, MavType},
    },
};

use super::MavlinkConfig;

/// Messages to and from whoever is at the other end of a stream, as a ground station.
#[derive(Debug)]
pub(super) struct Link<S> {
    stream: S,
    codec: Codec,
    connections: u32,
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
        Self { stream, codec, connections, beaten, clock_origin_unix_s: 0.0 }
    }

    /// Hands on what has come. Whether the stream was opened anew since the last time.
    pub(super) fn receive(&mut self, now: f64, mut take: impl FnMut(Frame)) -> io::Result<bool> {
        let mut into = [0; 2048];
        // As many as a second of the fastest link holds: a device that floods us is not followed.
        for _ in 0..256 {
            let count = self.stream.receive(&mut into)?;
            let Some(bytes) = into.get(..count).filter(|bytes| !bytes.is_empty()) else { break };
            self.codec.push(bytes);
            while let Some(frame) = self.codec.next_frame(self.clock_origin_unix_s + now) {
                take(frame);
            }
        }
        let reopened = self.stream.connections() != self.connections;
        if reopened {
            self.connections = self.stream.connections();
            self.codec.restart();
        }
        Ok(reopened)
    }

    /// Sends a message. Until something has come to our port there is no address to send it to.
    pub(super) fn send(&mut self, now: f64, message: &MavMessage) -> io::Result<()> {
        let bytes = self.codec.encode(message, self.clock_origin_unix_s + now);
        match self.stream.send(&bytes) {
            Err(error) if error.kind() == io::ErrorKind::NotConnected => Ok(()),
            other => other,
        }
    }

    /// Says that we are there, once a second.
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
