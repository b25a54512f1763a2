use foxhunt_core::{Clock, parameter::FieldError};
use foxhunt_wire::{
    ByteStream,
    receivers::{RtlTcpCommand, RtlTcpHeader},
};

use super::{Placement, RtlTcpRadioError, RtlTcpTuning, SampleLosses, Silence};

/// Bytes in one read.
const CHUNK: usize = 1 << 16;

/// The samples of an RTL-SDR behind rtl_tcp, each at its place in time.
///
/// rtl_tcp sends bytes and no times, so samples are counted, and the count is held against the
/// clock: the count lags behind by what is on its way, which comes in the end. What does not come
/// was lost, and the count jumps over it: after a connection that broke, or when the lag has not
/// gone back for a while. A stream that stalls is opened again. A sample is never counted twice,
/// and indices only rise.
#[derive(Debug)]
pub struct RtlTcpSamples<S, C> {
    tuning: RtlTcpTuning,
    stream: S,
    clock: C,
    connections: u32,
    /// Bytes of the header that have come.
    begun: Vec<u8>,
    header: Option<RtlTcpHeader>,
    /// An I whose Q has not come.
    odd: Option<u8>,
    chunk: Vec<u8>,
    placement: Placement,
}

impl<S: ByteStream, C: Clock> RtlTcpSamples<S, C> {
    /// The samples that come over a stream.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names what is wrong in `tuning`.
    pub fn new(tuning: RtlTcpTuning, stream: S, clock: C) -> Result<Self, FieldError> {
        tuning.check()?;
        Ok(Self {
            placement: Placement::new(
                f64::from(tuning.sample_rate_hz),
                tuning.settling_s,
                tuning.silence_s,
            ),
            tuning,
            connections: stream.connections(),
            stream,
            clock,
            begun: Vec::new(),
            header: None,
            odd: None,
            chunk: vec![0; CHUNK],
        })
    }

    /// Returns the receiver's settings.
    #[must_use]
    pub fn tuning(&self) -> &RtlTcpTuning {
        &self.tuning
    }

    /// Returns the server's header, once it has come.
    #[must_use]
    pub fn header(&self) -> Option<RtlTcpHeader> {
        self.header
    }

    /// Returns the losses until now.
    #[must_use]
    pub fn losses(&self) -> SampleLosses {
        self.placement.losses()
    }

    /// Returns the time in seconds of the clock at which the sample of an index was taken, to what
    /// the server and the network delay at least; `None` before the first sample.
    #[must_use]
    pub fn time_of(&self, index: f64) -> Option<f64> {
        self.placement.timeline().time_of(index)
    }

    /// The index of the sample that is taken at a time of the clock, as far as can be known; 0
    /// before the first sample.
    #[must_use]
    pub fn index_at(&self, time: f64) -> u64 {
        self.placement.timeline().index_at(time)
    }

    /// Tunes to another frequency. What is on its way is still of the old one.
    ///
    /// # Errors
    ///
    /// [`RtlTcpRadioError::Stream`]; a connection that is made later is tuned so all the same.
    pub fn tune(&mut self, center_hz: u32) -> Result<(), RtlTcpRadioError> {
        self.tuning.center_hz = center_hz;
        if self.header.is_none() {
            return Ok(());
        }
        self.send(RtlTcpCommand::Frequency(center_hz))
    }

    /// Replaces what is in `bytes` by whole samples that have come, I and Q, a byte each, and
    /// returns the index of the first; `None` where there is nothing now. There is no gap inside.
    /// To be called until there is nothing, and often.
    ///
    /// # Errors
    ///
    /// Any error of the connection, and [`RtlTcpRadioError::Silent`] while nothing comes. It may be
    /// called again, and goes on when the server is there again.
    pub fn poll(&mut self, bytes: &mut Vec<u8>) -> Result<Option<u64>, RtlTcpRadioError> {
        bytes.clear();
        loop {
            let now = self.clock.now();
            let came = self.stream.receive(&mut self.chunk);
            let connections = self.stream.connections();
            if connections != self.connections {
                self.connections = connections;
                self.restart(now);
            }
            let count = came.map_err(RtlTcpRadioError::Stream)?;
            if count == 0 {
                if self.header.is_some() {
                    self.placement.drained(now);
                }
                return self.watch(now).map(|()| None);
            }
            if self.placement.received(now) && self.header.is_some() {
                self.placement.settle(now);
            }
            if let Some(first) = self.take(count, now, bytes)? {
                return Ok(Some(first));
            }
        }
    }

    /// A new connection: a header comes first, and what comes then is not what was next.
    fn restart(&mut self, now: f64) {
        self.header = None;
        self.odd = None;
        self.begun.clear();
        self.placement.restart(now);
    }

    /// Takes the first `count` bytes of the chunk.
    fn take(
        &mut self,
        count: usize,
        now: f64,
        bytes: &mut Vec<u8>,
    ) -> Result<Option<u64>, RtlTcpRadioError> {
        let mut from = 0;
        if self.header.is_none() {
            from = RtlTcpHeader::LENGTH.saturating_sub(self.begun.len()).min(count);
            self.begun.extend(self.chunk.get(..from).unwrap_or_default());
            let Some(header) = self.begun.first_chunk() else { return Ok(None) };
            let header = RtlTcpHeader::decode(*header).map_err(RtlTcpRadioError::Server)?;
            self.header = Some(header);
            self.placement.settle(now);
            self.set_up()?;
        }
        bytes.extend(self.odd.take());
        bytes.extend(self.chunk.get(from..count).unwrap_or_default());
        if bytes.len() % 2 == 1 {
            self.odd = bytes.pop();
        }
        let samples = u64::try_from(bytes.len() / 2).unwrap_or(0);
        let first = self.placement.take(now, samples);
        if first.is_none() {
            bytes.clear();
        }
        Ok(first)
    }

    /// Notices that nothing comes.
    fn watch(&mut self, now: f64) -> Result<(), RtlTcpRadioError> {
        let Some(Silence { seconds, renews }) = self.placement.watch(now) else { return Ok(()) };
        if renews {
            self.stream.renew();
        }
        Err(RtlTcpRadioError::Silent { seconds })
    }

    fn send(&mut self, command: RtlTcpCommand) -> Result<(), RtlTcpRadioError> {
        self.stream.send(&command.encode()).map_err(RtlTcpRadioError::Stream)
    }

    fn set_up(&mut self) -> Result<(), RtlTcpRadioError> {
        #[expect(clippy::cast_possible_truncation, reason = "at most 100 dB")]
        let gain = (self.tuning.gain_db * 10.0).round() as i32;
        self.send(RtlTcpCommand::SampleRate(self.tuning.sample_rate_hz))?;
        self.send(RtlTcpCommand::Correction(self.tuning.correction_ppm))?;
        self.send(RtlTcpCommand::Frequency(self.tuning.center_hz))?;
        self.send(RtlTcpCommand::DigitalGain(false))?;
        self.send(RtlTcpCommand::ManualGain(true))?;
        self.send(RtlTcpCommand::Gain(gain))
    }
}
