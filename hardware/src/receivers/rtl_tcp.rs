use foxhunt_core::{BeaconId, Clock, Radio, parameter::FieldError};
use foxhunt_wire::{
    ByteStream,
    receivers::{RtlTcpCommand, RtlTcpHeader},
};

use super::{RtlTcpConfig, RtlTcpRadioError, gather::Gather};
use crate::Finding;

/// What is read at once, and how often at most: a poll ends.
const CHUNK: usize = 1 << 14;
const CHUNKS: usize = 256;
/// Waiting ends after so many pauses, whatever the clock shows.
const PAUSES: u32 = 1_000_000;

/// An RTL-SDR behind rtl_tcp, as a receiver of beacons that send by themselves.
///
/// A question tunes to its beacon, lets the receiver settle and gathers a window of power, of which
/// a high quantile is the level: that is the pulses' level where a beacon is pulsed. It sets rate
/// and gain when it is connected, and again after a connection was lost.
#[derive(Debug)]
pub struct RtlTcpRadio<S, C> {
    config: RtlTcpConfig,
    stream: S,
    clock: C,
    connections: u32,
    /// What has come of the header.
    begun: Vec<u8>,
    header: Option<RtlTcpHeader>,
    tuned: Option<u32>,
    /// Whether an I has come without its Q.
    odd: bool,
    requested: Option<u32>,
    gather: Option<Gather>,
    overdriven: bool,
    received_at: Option<f64>,
    level_dbm: Option<f64>,
}

impl<S: ByteStream, C: Clock> RtlTcpRadio<S, C> {
    /// A receiver behind a stream.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names what is wrong in `config`.
    pub fn new(config: RtlTcpConfig, stream: S, clock: C) -> Result<Self, FieldError> {
        config.check()?;
        Ok(Self {
            config,
            connections: stream.connections(),
            stream,
            clock,
            begun: Vec::new(),
            header: None,
            tuned: None,
            odd: false,
            requested: None,
            gather: None,
            overdriven: false,
            received_at: None,
            level_dbm: None,
        })
    }

    fn send(&mut self, command: RtlTcpCommand) -> Result<(), RtlTcpRadioError> {
        self.stream.send(&command.encode()).map_err(RtlTcpRadioError::Stream)
    }

    /// Takes what has come and does what is to be done now.
    fn serve(&mut self) -> Result<(), RtlTcpRadioError> {
        let now = self.clock.now();
        let mut chunk = vec![0; CHUNK];
        for _ in 0..CHUNKS {
            let came = self.stream.receive(&mut chunk);
            let connections = self.stream.connections();
            if connections != self.connections {
                self.connections = connections;
                (self.header, self.tuned, self.gather, self.odd) = (None, None, None, false);
                self.begun.clear();
                self.received_at = None;
            }
            match came.map_err(RtlTcpRadioError::Stream)? {
                0 => break,
                count => {
                    self.received_at = Some(now);
                    self.take(chunk.get(..count).unwrap_or_default())?;
                }
            }
        }
        self.tune()?;
        let since = *self.received_at.get_or_insert(now);
        let seconds = now - since;
        if seconds > self.config.silence_s {
            return Err(RtlTcpRadioError::Silent { seconds });
        }
        Ok(())
    }

    fn take(&mut self, mut bytes: &[u8]) -> Result<(), RtlTcpRadioError> {
        if self.header.is_none() {
            let missing = RtlTcpHeader::LENGTH.saturating_sub(self.begun.len());
            let (head, rest) = bytes.split_at(missing.min(bytes.len()));
            self.begun.extend(head);
            let Some(header) = self.begun.first_chunk() else { return Ok(()) };
            let header = RtlTcpHeader::decode(*header).map_err(RtlTcpRadioError::Server)?;
            self.header = Some(header);
            self.set_up()?;
            bytes = rest;
        }
        self.odd ^= bytes.len() % 2 == 1;
        if let Some(gather) = &mut self.gather
            && gather.push(bytes)
        {
            let level = gather.level_dbfs(self.config.quantile) + self.config.full_scale_dbm;
            self.overdriven = gather.is_overdriven();
            (self.gather, self.requested) = (None, None);
            self.level_dbm =
                self.config.floor_dbm.is_none_or(|floor| level >= floor).then_some(level);
        }
        Ok(())
    }

    fn set_up(&mut self) -> Result<(), RtlTcpRadioError> {
        #[expect(clippy::cast_possible_truncation, reason = "at most 100 dB")]
        let gain = (self.config.gain_db * 10.0).round() as i32;
        self.send(RtlTcpCommand::SampleRate(self.config.sample_rate_hz))?;
        self.send(RtlTcpCommand::Correction(self.config.correction_ppm))?;
        self.send(RtlTcpCommand::DigitalGain(false))?;
        self.send(RtlTcpCommand::ManualGain(true))?;
        self.send(RtlTcpCommand::Gain(gain))
    }

    /// Tunes to the requested beacon, and begins to gather.
    fn tune(&mut self) -> Result<(), RtlTcpRadioError> {
        let (Some(frequency), true) = (self.requested, self.header.is_some()) else {
            return Ok(());
        };
        if self.tuned != Some(frequency) {
            self.send(RtlTcpCommand::Frequency(frequency.saturating_sub(self.config.beside_hz)))?;
            self.tuned = Some(frequency);
            self.gather = None;
        }
        if self.gather.is_none() {
            self.gather = Gather::new(&self.config, self.odd);
        }
        Ok(())
    }

    /// Looks at the receiver: what its tuner is, and how strong each beacon is now. `pause` is
    /// called while it waits, and has to let a little time pass.
    pub fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        let mut findings = Vec::new();
        for beacon in (0..).map(BeaconId).take(self.config.frequencies_hz.len()) {
            let subject = format!("beacon {}", beacon.0);
            match self.look(beacon, pause) {
                Err(error) => {
                    let remedy =
                        "start rtl_tcp, check its address, and that it has no other client";
                    findings.push(Finding::bad("rtl_tcp", error, remedy));
                    return findings;
                }
                Ok(level) if self.overdriven => {
                    let level =
                        level.map_or("too strong".into(), |level| format!("{level:.1} dBm"));
                    let remedy = "the receiver is overdriven: lower gain_db, and measure \
                                  full_scale_dbm again";
                    findings.push(Finding::bad(&subject, format_args!("now {level}"), remedy));
                }
                Ok(Some(level)) => {
                    findings.push(Finding::good(&subject, format_args!("now {level:.1} dBm")));
                }
                Ok(None) => findings.push(Finding::bad(
                    &subject,
                    "now below floor_dbm",
                    "switch the beacon on, go closer, and check its frequency and correction_ppm",
                )),
            }
        }
        let tuner = self.header.map(|header| {
            Finding::good("rtl_tcp", format_args!("tuner {}, {} gains", header.tuner, header.gains))
        });
        findings.splice(0..0, tuner);
        findings
    }

    /// The power of a beacon, if it is above the floor.
    fn look(
        &mut self,
        beacon: BeaconId,
        pause: &mut dyn FnMut(),
    ) -> Result<Option<f64>, RtlTcpRadioError> {
        self.request(beacon)?;
        for _ in 0..PAUSES {
            let level = self.poll()?;
            if level.is_some() || self.requested.is_none() {
                return Ok(level);
            }
            pause();
        }
        Ok(None)
    }
}

impl<S: ByteStream, C: Clock> Radio for RtlTcpRadio<S, C> {
    type Error = RtlTcpRadioError;

    /// # Errors
    ///
    /// [`RtlTcpRadioError::Beacon`] if there is no frequency of it; an older question stays then.
    /// Any error of the connection.
    fn request(&mut self, beacon: BeaconId) -> Result<(), RtlTcpRadioError> {
        let frequencies = &self.config.frequencies_hz;
        let missing = RtlTcpRadioError::Beacon { beacon: beacon.0, beacons: frequencies.len() };
        let frequency = *frequencies.get(usize::from(beacon.0)).ok_or(missing)?;
        // What has come until now was received before the question.
        (self.requested, self.gather) = (None, None);
        let before = self.serve();
        self.level_dbm = None;
        before?;
        self.requested = Some(frequency);
        self.tune()
    }

    fn poll(&mut self) -> Result<Option<f64>, RtlTcpRadioError> {
        let served = self.serve();
        match self.level_dbm.take() {
            Some(level) => Ok(Some(level)),
            None => served.map(|()| None),
        }
    }
}
