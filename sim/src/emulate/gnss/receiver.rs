//! The GNSS receiver itself: its settings, its errors, and what it sends when.

use std::io;

use foxhunt_core::parameter::{FieldError, ParameterError, in_range, positive};
use foxhunt_wire::{
    ByteStream, FixQuality,
    geodesy::{Geodetic, LocalFrame, radians_to_compass_deg},
};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::{
    Epoch, GPSD_VERSION, GpsdClient, UbloxHost, caster::Corrected, gpsd_reports, nav_pvt,
    nmea_sentences, whole,
};
use crate::{Emulator, Interval, SimError, World, devices::OnBoard};

/// A number that separates a receiver's stream from the streams of the world and of other drones'
/// receivers.
const RECEIVER: u64 = 0x6e55_0e77_0000_0000;

/// The protocol of an emulated receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EmulatedGnssKind {
    /// GGA, RMC, GST and GSA.
    #[default]
    Nmea,
    /// NMEA, as it comes from the factory, and UBX-NAV-PVT once that is requested.
    Ublox,
    /// gpsd, to a client that watches.
    Gpsd,
}

/// An emulated receiver.
///
/// By default an autonomous NMEA receiver at 5 Hz, at 50.1° N 14.5° E 250 m, σ 1.5 m on the
/// ground and 3 m in height, that forgets its errors within a minute; 14 satellites, HDOP 0.8;
/// never without a fix; time 0 of the world is 2026-01-01.
#[derive(Clone, Debug, PartialEq)]
pub struct EmulatedGnssConfig {
    /// Protocol of the receiver.
    pub kind: EmulatedGnssKind,
    /// The place of the world's zero.
    pub origin: Geodetic,
    /// The rate of its reports, per second.
    pub rate_hz: f64,
    /// The reported quality of its fix.
    pub quality: FixQuality,
    /// σ of East, North and Up in metres, which it also reports. UBX has one number for East and
    /// North.
    pub sigma_m: Vector3<f64>,
    /// The time in which the correlation of its errors falls to 1/e, in seconds.
    pub correlation_s: f64,
    /// The number of satellites that it uses.
    pub satellites: u8,
    /// The horizontal dilution of precision that it reports.
    pub hdop: f64,
    /// Height of the geoid above the ellipsoid, in metres.
    pub geoid_m: f64,
    /// True if a compass is beside it, whose heading goes between the sentences of NMEA (HDT).
    pub compass: bool,
    /// Times when it has no fix, and reports so.
    pub outages: Vec<Interval>,
    /// Greatest age in seconds of RTCM 3 with which it reaches an RTK quality; without younger
    /// frames it is autonomous, with the σ of that quality. If absent, it needs no corrections.
    pub corrections_s: Option<f64>,
    /// UNIX time of the world's time 0, in seconds.
    pub utc_start_s: f64,
}

impl Default for EmulatedGnssConfig {
    fn default() -> Self {
        Self {
            kind: EmulatedGnssKind::default(),
            origin: Geodetic { lat_deg: 50.1, lon_deg: 14.5, alt_m: 250.0 },
            rate_hz: 5.0,
            quality: FixQuality::Autonomous,
            sigma_m: Vector3::new(1.5, 1.5, 3.0),
            correlation_s: 60.0,
            satellites: 14,
            hdop: 0.8,
            geoid_m: 45.0,
            compass: false,
            outages: Vec::new(),
            corrections_s: None,
            utc_start_s: 1_767_225_600.0,
        }
    }
}

impl EmulatedGnssConfig {
    /// Sets the quality, and the σ that it has in the open, East, North and Up: 3, 3, 6 m
    /// estimated; 1.5, 1.5, 3 m autonomous; 0.9, 0.9, 1.8 m differential; 0.2, 0.2, 0.4 m float;
    /// 1.2, 1.2, 2 cm fixed.
    #[must_use]
    pub fn with_quality(self, quality: FixQuality) -> Self {
        let sigma_m = match quality {
            FixQuality::None => self.sigma_m,
            FixQuality::Estimated => Vector3::new(3.0, 3.0, 6.0),
            FixQuality::Autonomous => Vector3::new(1.5, 1.5, 3.0),
            FixQuality::Differential => Vector3::new(0.9, 0.9, 1.8),
            FixQuality::RtkFloat => Vector3::new(0.2, 0.2, 0.4),
            FixQuality::RtkFixed => Vector3::new(0.012, 0.012, 0.02),
        };
        Self { quality, sigma_m, ..self }
    }

    /// The world's frame on Earth.
    fn checked(&self) -> Result<LocalFrame, SimError> {
        self.check().map_err(|error| error.within("gnss"))?;
        Ok(LocalFrame::new(self.origin).expect("its numbers were checked"))
    }

    fn check(&self) -> Result<(), FieldError> {
        in_range("rate_hz", self.rate_hz, 0.1..=25.0, "from 0.1 to 25")?;
        positive("sigma_m of East", self.sigma_m.x)?;
        positive("sigma_m of North", self.sigma_m.y)?;
        positive("sigma_m of Up", self.sigma_m.z)?;
        positive("correlation_s", self.correlation_s)?;
        in_range("hdop", self.hdop, 0.1..=99.0, "from 0.1 to 99")?;
        in_range("geoid_m", self.geoid_m, -120.0..=120.0, "within ±120")?;
        positive("corrections_s", self.corrections_s.unwrap_or(1.0))?;
        // Up to the year 2100; RMC has two digits for it.
        let dates = 946_684_800.0..=4_102_444_800.0;
        in_range("utc_start_s", self.utc_start_s, dates, "a date of this century")?;
        for (i, outage) in self.outages.iter().enumerate() {
            let within = |error: ParameterError| error.within(format_args!("outages[{i}]"));
            outage.check().map_err(within)?;
        }
        let Geodetic { lat_deg, lon_deg, alt_m } = self.origin;
        in_range("origin.lat_deg", lat_deg, -90.0..=90.0, "within ±90")?;
        in_range("origin.lon_deg", lon_deg, -180.0..=360.0, "within -180 to 360")?;
        in_range("origin.alt_m", alt_m, -500.0..=20_000.0, "from -500 to 20000")?;
        Ok(())
    }
}

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
    /// Errors without corrections.
    astray: Wander,
    corrected: Corrected,
    /// The number of the epoch that was sent last, and the drone's place then.
    sent: Option<(f64, Vector3<f64>)>,
    host: UbloxHost,
    client: GpsdClient,
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
        let alone = config.clone().with_quality(FixQuality::Autonomous);
        let astray = Wander::new(alone.sigma_m, alone.correlation_s, seed, drone);
        let host = UbloxHost::default();
        let client = GpsdClient::default();
        Ok(Self {
            stream,
            on_board,
            config,
            frame,
            wander,
            astray,
            corrected: Corrected::default(),
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
            self.client = GpsdClient::default();
            if self.config.kind == EmulatedGnssKind::Gpsd {
                self.emit(GPSD_VERSION.as_bytes())?;
            }
        }
        let mut piece = [0; 512];
        loop {
            let count = self.stream.receive(&mut piece)?;
            let received = piece.get(..count).unwrap_or(&piece);
            self.corrected.take(received, self.on_board.with(|_, now| now));
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
        let (pose, now) = self.on_board.with(|drone, now| (drone.pose(), now));
        let truth = pose.position;
        let heading = pose.heading;
        // A hair before an epoch is that epoch: time is a sum of steps.
        let number = (now * self.config.rate_hz + 1e-6).floor();
        let rate_hz = self.config.rate_hz;
        let passed = self.sent.map(|(last, place)| ((number - last) / rate_hz, place));
        if passed.is_some_and(|(passed, _)| passed <= 0.0) {
            return None;
        }
        self.sent = Some((number, truth));
        let since = passed.map_or(0.0, |(passed, _)| passed);
        let alone =
            self.config.corrections_s.filter(|_| self.config.quality >= FixQuality::RtkFloat);
        let is_alone = alone.is_some_and(|age_s| !self.corrected.is_within(age_s, now));
        let wander = self.wander.step(since);
        let astray = self.astray.step(since);
        let (error, sigma_m, quality) = match is_alone {
            true => (astray, self.astray.sigma, FixQuality::Autonomous),
            false => (wander, self.config.sigma_m, self.config.quality),
        };
        let velocity =
            passed.map_or(Vector3::zeros(), |(passed, before)| (truth - before) / passed);
        let out = self.config.outages.iter().any(|outage| outage.contains(now));
        let config = &self.config;
        Some(Epoch {
            utc_ms: whole((config.utc_start_s + number / rate_hz) * 1e3),
            place: self.frame.to_geodetic(&(truth + error)),
            quality: if out { FixQuality::None } else { quality },
            sigma_m,
            velocity,
            satellites: if out { 2 } else { config.satellites },
            hdop: if out { 99.0 } else { config.hdop },
            geoid_m: config.geoid_m,
            heading_deg: config.compass.then(|| radians_to_compass_deg(heading)),
        })
    }
}

impl<S: ByteStream> Emulator for EmulatedGnss<S> {
    fn serve(&mut self) -> io::Result<()> {
        self.listen()?;
        let Some(epoch) = self.due() else { return Ok(()) };
        let output = match self.config.kind {
            EmulatedGnssKind::Nmea => nmea_sentences(&epoch).into_bytes(),
            EmulatedGnssKind::Ublox => {
                let mut output = nmea_sentences(&epoch).into_bytes();
                if self.host.sends_pvt {
                    output.extend(nav_pvt(&epoch));
                }
                output
            }
            EmulatedGnssKind::Gpsd if self.client.watches => gpsd_reports(&epoch).into_bytes(),
            EmulatedGnssKind::Gpsd => return Ok(()),
        };
        self.emit(&output)
    }
}

/// The error of a receiver's place: East, North and Up by themselves, each a first-order
/// Gauss-Markov process with a stationary σ. e(t + dt) = ρ e(t) + σ √(1 − ρ²) n, with ρ =
/// exp(−dt / τ).
#[derive(Clone, Debug)]
struct Wander {
    sigma: Vector3<f64>,
    /// The time constant τ in seconds.
    tau: f64,
    stream: Xoshiro256PlusPlus,
    error: Vector3<f64>,
}

impl Wander {
    fn new(sigma: Vector3<f64>, tau: f64, seed: u64, drone: usize) -> Self {
        let drone = u64::try_from(drone).unwrap_or(u64::MAX);
        let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed ^ RECEIVER ^ drone);
        let error = normal(&mut stream).component_mul(&sigma);
        Self { sigma, tau, stream, error }
    }

    /// The error after `dt` seconds more.
    fn step(&mut self, dt: f64) -> Vector3<f64> {
        let rho = libm::exp(-dt / self.tau);
        let fresh = normal(&mut self.stream).component_mul(&self.sigma);
        self.error = self.error * rho + fresh * libm::sqrt(1.0 - rho * rho);
        self.error
    }
}

fn normal(stream: &mut Xoshiro256PlusPlus) -> Vector3<f64> {
    Vector3::from_fn(|_, _| stream.sample(StandardNormal))
}
