use std::io;

use foxhunt_wire::{ByteStream, FixQuality, geodesy::LocalFrame};
use nalgebra::Vector3;

use super::{
    EmulatedGnssConfig, EmulatedGnssKind,
    epoch::{Epoch, whole},
    gpsd::{self, Client},
    nmea,
    ublox::{self, Host},
    wander::Wander,
};
use crate::{Emulator, SimError, World, devices::OnBoard};

/// A drone's GNSS receiver, its antenna in the drone's middle, as the bytes that it sends.
///
/// At every epoch it reports where the drone is then, with an error of the σ that it reports: a
/// Gauss-Markov process for each axis, from a random stream of its own. Epochs that pass between
/// two calls of [`serve`](Emulator::serve) are left out but for the last.
#[derive(Debug)]
pub struct EmulatedGnss<S> {
    stream: S,
    on_board: OnBoard,
    config: EmulatedGnssConfig,
    frame: LocalFrame,
    wander: Wander,
    /// The number of the epoch that was sent last, and the drone's place then.
    sent: Option<(f64, Vector3<f64>)>,
    host: Host,
    client: Client,
    /// The connection that was greeted.
    greeted: Option<u32>,
}

impl<S: ByteStream> EmulatedGnss<S> {
    /// The receiver of one of the world's drones; `seed` draws its errors.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Field`] names what is out of
    /// range.
    pub fn new(
        world: &World,
        drone: usize,
        config: EmulatedGnssConfig,
        seed: u64,
        stream: S,
    ) -> Result<Self, SimError> {
        let frame = config.checked()?;
        let on_board = world.on_board(drone)?;
        let wander = Wander::new(config.sigma_m, config.correlation_s, seed, drone);
        let host = Host::default();
        let client = Client::default();
        Ok(Self {
            stream,
            on_board,
            config,
            frame,
            wander,
            sent: None,
            host,
            client,
            greeted: None,
        })
    }

    /// Takes what the program sends, and answers.
    fn listen(&mut self) -> io::Result<()> {
        let connections = self.stream.connections();
        if connections > 0 && self.greeted != Some(connections) {
            self.greeted = Some(connections);
            self.client = Client::default();
            if self.config.kind == EmulatedGnssKind::Gpsd {
                self.emit(gpsd::VERSION.as_bytes())?;
            }
        }
        let mut piece = [0; 512];
        loop {
            let count = self.stream.receive(&mut piece)?;
            let received = piece.get(..count).unwrap_or(&piece);
            let answer = match self.config.kind {
                _ if received.is_empty() => return Ok(()),
                EmulatedGnssKind::Nmea => Vec::new(),
                EmulatedGnssKind::Ublox => self.host.take(received),
                EmulatedGnssKind::Gpsd => self.client.take(received).into_bytes(),
            };
            self.emit(&answer)?;
        }
    }

    /// Sends bytes; without a client they are dropped.
    fn emit(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self.stream.send(bytes) {
            Err(error) if error.kind() == io::ErrorKind::NotConnected => Ok(()),
            other => other,
        }
    }

    /// The epoch that is due, if it was not sent yet.
    fn due(&mut self) -> Option<Epoch> {
        let (truth, now) = self.on_board.with(|drone, now| (drone.pose().position, now));
        // A hair before an epoch is that epoch: time is a sum of steps.
        let number = (now * self.config.rate_hz + 1e-6).floor();
        let rate_hz = self.config.rate_hz;
        let passed = self.sent.map(|(last, place)| ((number - last) / rate_hz, place));
        if passed.is_some_and(|(passed, _)| passed <= 0.0) {
            return None;
        }
        self.sent = Some((number, truth));
        let error = self.wander.step(passed.map_or(0.0, |(passed, _)| passed));
        let velocity =
            passed.map_or(Vector3::zeros(), |(passed, before)| (truth - before) / passed);
        let out = self.config.outages.iter().any(|outage| outage.contains(now));
        let config = &self.config;
        Some(Epoch {
            utc_ms: whole((config.utc_start_s + number / rate_hz) * 1e3),
            place: self.frame.to_geodetic(&(truth + error)),
            quality: if out { FixQuality::None } else { config.quality },
            sigma_m: config.sigma_m,
            velocity,
            satellites: if out { 2 } else { config.satellites },
            hdop: if out { 99.0 } else { config.hdop },
            geoid_m: config.geoid_m,
        })
    }
}

impl<S: ByteStream> Emulator for EmulatedGnss<S> {
    fn serve(&mut self) -> io::Result<()> {
        self.listen()?;
        let Some(epoch) = self.due() else { return Ok(()) };
        let output = match self.config.kind {
            EmulatedGnssKind::Nmea => nmea::sentences(&epoch).into_bytes(),
            EmulatedGnssKind::Ublox => {
                let mut output = nmea::sentences(&epoch).into_bytes();
                if self.host.sends_pvt {
                    output.extend(ublox::nav_pvt(&epoch));
                }
                output
            }
            EmulatedGnssKind::Gpsd if self.client.watches => gpsd::reports(&epoch).into_bytes(),
            EmulatedGnssKind::Gpsd => return Ok(()),
        };
        self.emit(&output)
    }
}
