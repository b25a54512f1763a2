use std::io;

use foxhunt_wire::{
    ByteStream,
    receivers::{RtlTcpCommand, RtlTcpHeader},
};

use super::{EmulatedDongle, EmulatedRtlTcpConfig, PlayedPulse};
use crate::{Emulator, SimError, World};

/// A server of rtl_tcp, whose [receiver](EmulatedDongle) stands under the antenna of a simulated
/// drone.
#[derive(Debug)]
pub struct EmulatedRtlTcp<S> {
    stream: S,
    dongle: EmulatedDongle,
    /// Connections whose client was met.
    met: u32,
    begun: Vec<u8>,
}

/// The gain that a tuner sets by itself, in dB.
const AUTOMATIC_GAIN_DB: f64 = 30.0;

impl<S: ByteStream> EmulatedRtlTcp<S> {
    /// A server whose clients come over `stream`.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Field`] names what is out of
    /// range in
    /// `config`.
    pub fn new(
        world: &World,
        drone: usize,
        config: EmulatedRtlTcpConfig,
        stream: S,
    ) -> Result<Self, SimError> {
        let dongle = EmulatedDongle::new(world, drone, config)?;
        Ok(Self { stream, dongle, met: 0, begun: Vec::new() })
    }

    /// The pulses that have begun in samples since the last call.
    pub fn played(&mut self) -> Vec<PlayedPulse> {
        self.dongle.played()
    }

    fn obey(&mut self, bytes: &[u8]) {
        self.begun.extend(bytes);
        while let Some((command, rest)) = self.begun.split_first_chunk() {
            match RtlTcpCommand::decode(*command) {
                RtlTcpCommand::Frequency(hz) => self.dongle.tune(hz),
                RtlTcpCommand::SampleRate(hz) => self.dongle.set_rate(hz),
                RtlTcpCommand::Gain(tenths) => self.dongle.set_gain(f64::from(tenths) / 10.0),
                RtlTcpCommand::ManualGain(false) => self.dongle.set_gain(AUTOMATIC_GAIN_DB),
                RtlTcpCommand::Correction(ppm) => self.dongle.set_correction(ppm),
                _ => {}
            }
            self.begun = rest.to_vec();
        }
    }
}

impl<S: ByteStream> Emulator for EmulatedRtlTcp<S> {
    fn serve(&mut self) -> io::Result<()> {
        let mut bytes = [0; 512];
        let count = self.stream.receive(&mut bytes)?;
        let connections = self.stream.connections();
        if connections != self.met {
            self.met = connections;
            self.begun.clear();
            // An R820T with its 29 gains.
            self.stream.send(&RtlTcpHeader { tuner: 5, gains: 29 }.encode())?;
            self.dongle.restart();
        }
        self.obey(bytes.get(..count).unwrap_or_default());
        if connections == 0 {
            return Ok(());
        }
        let samples = self.dongle.take();
        match self.stream.send(&samples) {
            // Nobody is there any more; another may come.
            Err(error) if error.kind() == io::ErrorKind::NotConnected => Ok(()),
            other => other,
        }
    }
}
