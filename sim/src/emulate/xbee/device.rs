//! The XBee itself: its settings, and the frames that it takes and sends.

use std::io;

use foxhunt_core::{
    BeaconId, Clock,
    parameter::{FieldError, positive, require},
};
use foxhunt_wire::{
    ByteStream,
    xbee::{
        Address16, Address64, ApiMode, AtCommand, AtStatus, Decoder, DeliveryStatus, Frame,
        ModemStatus, Protocol, TransmitStatus,
    },
};
use serde::{Deserialize, Serialize};

use super::{Air, Outgoing, Payload, Registers, Text, drone_address};
use crate::{Emulator, SimClock, SimError, SimRadio, World};

/// A frame that stops in the middle for this time, in seconds, was cut.
const QUIET_S: f64 = 0.1;

/// The kind of XBee that is emulated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmulatedXbeeConfig {
    /// Protocol of the emulated firmware on the air.
    pub firmware: Protocol,
    /// `AP`: 0 transparent, 1 plain frames, 2 escaped frames.
    pub ap: u8,
    /// Time from a question to a beacon that does not answer to the report of that, in seconds.
    pub no_answer_s: f64,
    /// True if its antenna is the drone's, which may have a direction; otherwise it has none.
    pub directional: bool,
}

/// Zigbee, plain frames, 0.2 s, the drone's antenna.
impl Default for EmulatedXbeeConfig {
    fn default() -> Self {
        Self { firmware: Protocol::Zigbee, ap: 1, no_answer_s: 0.2, directional: true }
    }
}

impl EmulatedXbeeConfig {
    fn check(&self) -> Result<(), FieldError> {
        require(self.ap <= 2, "ap", f64::from(self.ap), "0, 1 or 2")?;
        positive("no_answer_s", self.no_answer_s)?;
        Ok(())
    }
}

/// The XBee of a simulated drone behind a stream of bytes.
///
/// The beacons of the world are radios in its network, at the addresses of
/// [`xbee_address`](crate::xbee_address), whose programs send back what they are sent. A question
/// reaches its beacon and is answered as the world has it, in whole dB; one that is not is reported
/// as undelivered. It answers AT commands about itself and, where these can be received, about
/// beacons.
#[derive(Debug)]
pub struct EmulatedXbee<S> {
    stream: S,
    clock: SimClock,
    config: EmulatedXbeeConfig,
    own: Registers,
    air: Air,
    decoder: Decoder,
    received_at: f64,
    text: Text,
}

impl<S: ByteStream> EmulatedXbee<S> {
    /// Returns the radio of a drone, which has just been switched on and reports that if it speaks
    /// in frames.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Field`] names what is out of
    /// range in `config`.
    pub fn new(
        world: &World,
        drone: usize,
        config: EmulatedXbeeConfig,
        stream: S,
    ) -> Result<Self, SimError> {
        config.check()?;
        let radio = SimRadio { directional: config.directional, ..world.radio(drone)? };
        let names: Vec<String> =
            (0..).map_while(|number| world.beacon_name(BeaconId(number))).collect();
        let short = Address16(0x4000 | u16::try_from(drone & 0xFFF).unwrap_or(0));
        let name = format!("DRONE-{drone}");
        let own = Registers::new(config.firmware, config.ap, drone_address(drone), short, &name);
        let air = Air::new(radio, config.firmware, &names, config.no_answer_s);
        let decoder = Decoder::new(mode(config.ap));
        let clock = world.clock();
        Ok(Self {
            stream,
            clock,
            config,
            own,
            air,
            decoder,
            received_at: 0.0,
            text: Text::default(),
        })
    }

    /// The port.
    #[must_use]
    pub fn stream_mut(&mut self) -> &mut S {
        &mut self.stream
    }

    /// Takes its power away and gives it back: what was under way is forgotten, and it reports
    /// that it has started.
    ///
    /// # Errors
    ///
    /// Any error of the stream.
    pub fn reset(&mut self) -> io::Result<()> {
        self.air.reset();
        self.text = Text::default();
        self.decoder = Decoder::new(mode(self.own.ap()));
        if self.own.ap() == 0 {
            return Ok(());
        }
        self.report(&Frame::ModemStatus { status: ModemStatus::HARDWARE_RESET })
    }

    fn report(&mut self, frame: &Frame) -> io::Result<()> {
        let bytes = frame
            .encode(self.decoder.mode())
            .map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))?;
        self.stream.send(&bytes)
    }

    /// Takes a frame: answers at once, or sends it over the air.
    fn take_in(&mut self, frame: Frame) -> io::Result<()> {
        let mesh = self.config.firmware != Protocol::Ieee802154;
        let immediate = match frame {
            Frame::AtCommand { id, command, parameter }
            | Frame::QueuedAtCommand { id, command, parameter } => {
                return self.command(id, command, &parameter);
            }
            Frame::RemoteAtCommand { id, to64, to16, command, parameter, .. } => {
                let beacon = self.air.beacon_at(to64, to16);
                let payload = Payload::Command { id, command, parameter, to64, to16 };
                self.air.enqueue(Outgoing { beacon, payload });
                None
            }
            Frame::Transmit { id, to64, to16, data, .. } if mesh => {
                self.packet(id, to64, to16, data, false)
            }
            Frame::ExplicitTransmit { id, to64, to16, data, .. } if mesh => {
                self.packet(id, to64, to16, data, false)
            }
            Frame::Transmit64 { id, to, data, .. } if !mesh => {
                self.packet(id, to, Address16::UNKNOWN, data, false)
            }
            Frame::Transmit16 { id, to, data, .. } if !mesh => {
                self.packet(id, Address64::UNKNOWN, to, data, true)
            }
            // Frames of other firmwares, and of no radio at all, are ignored.
            _ => None,
        };
        // A packet of number 0 requests no status.
        let silent = |frame: &Frame| {
            matches!(
                frame,
                Frame::DeliveryStatus { id: 0, .. } | Frame::TransmitStatus { id: 0, .. }
            )
        };
        immediate.filter(|frame| !silent(frame)).map_or(Ok(()), |frame| self.report(&frame))
    }

    /// Queues a packet to one beacon; the frame that answers it at once.
    fn packet(
        &mut self,
        id: u8,
        to64: Address64,
        to16: Address16,
        data: Vec<u8>,
        short: bool,
    ) -> Option<Frame> {
        let mesh = self.config.firmware != Protocol::Ieee802154;
        let status = |delivery: u8, plain: u8| {
            Some(if mesh {
                let delivery = DeliveryStatus(delivery);
                Frame::DeliveryStatus { id, to16, retries: 0, delivery, discovery: 0 }
            } else {
                Frame::TransmitStatus { id, status: TransmitStatus(plain) }
            })
        };
        if to64 == Address64::BROADCAST {
            return status(0, 0);
        }
        if data.len() > 84 {
            return status(0x74, 0x74);
        }
        let beacon = self.air.beacon_at(to64, to16);
        let room =
            self.air.enqueue(Outgoing { beacon, payload: Payload::Packet { id, data, short } });
        if room { None } else { status(0x32, 0x32) }
    }

    fn command(&mut self, id: u8, command: AtCommand, parameter: &[u8]) -> io::Result<()> {
        if command == AtCommand::ND {
            for beacon in self.air.beacons() {
                let payload = Payload::Discovery { id };
                self.air.enqueue(Outgoing { beacon: Some(beacon), payload });
            }
            if self.config.firmware == Protocol::Ieee802154 {
                self.air.enqueue(Outgoing { beacon: None, payload: Payload::Discovered { id } });
            }
            return Ok(());
        }
        let restart = command.0 == *b"FR";
        let (status, value) =
            if restart { (AtStatus::OK, Vec::new()) } else { self.own.query(command, parameter) };
        if id != 0 {
            self.report(&Frame::AtResponse { id, command, status, value })?;
        }
        if restart {
            return self.reset();
        }
        // A new mode holds from the next frame on.
        if command == AtCommand::AP && mode(self.own.ap()) != self.decoder.mode() {
            self.decoder = Decoder::new(mode(self.own.ap()));
        }
        Ok(())
    }
}

impl<S: ByteStream> Emulator for EmulatedXbee<S> {
    fn serve(&mut self) -> io::Result<()> {
        let now = self.clock.now();
        let mut bytes = [0; 512];
        for _ in 0..32 {
            let count = self.stream.receive(&mut bytes)?;
            let came = bytes.get(..count).unwrap_or_default();
            if self.own.ap() == 0 {
                let sent = self.text.take_in(came, &mut self.own, now);
                if !sent.is_empty() {
                    self.stream.send(&sent)?;
                }
                if self.own.ap() != 0 {
                    self.decoder = Decoder::new(mode(self.own.ap()));
                }
            } else {
                let sent = if came.is_empty() && now - self.received_at > QUIET_S {
                    self.decoder.give_up()
                } else {
                    self.decoder.push(came)
                };
                for frame in sent.into_iter().flatten() {
                    self.take_in(frame)?;
                }
            }
            if count > 0 {
                self.received_at = now;
            }
            if count == 0 {
                break;
            }
        }
        for frame in self.air.advance(&mut self.own, now) {
            let silent = matches!(
                frame,
                Frame::DeliveryStatus { id: 0, .. } | Frame::TransmitStatus { id: 0, .. }
            );
            if !silent {
                self.report(&frame)?;
            }
        }
        Ok(())
    }
}

fn mode(ap: u8) -> ApiMode {
    if ap == 2 { ApiMode::Escaped } else { ApiMode::Plain }
}
