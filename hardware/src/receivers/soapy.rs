use std::fmt;

use foxhunt_core::{
    Clock,
    parameter::{FieldError, in_range, positive, require},
};
use foxhunt_signal::Complex32;
use soapysdr::{Device, Direction, ErrorCode, RxStream};

use super::{Placement, SampleLosses, Silence};

/// Samples in one read.
const CHUNK: usize = 1 << 16;

/// Time for which a read waits for samples, in microseconds.
const PATIENCE_US: i64 = 1000;

/// Timestamps are rounded: less than this many samples is no gap.
const LEAST_GAP: f64 = 2.0;

/// Settings of a receiver that `SoapySDR` has a driver for.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SoapyTuning {
    /// The receiver's name, as `SoapySDR` writes it: `driver=airspy,serial=...`.
    pub device: String,
    /// Channel of the receiver.
    pub channel: usize,
    /// The frequency in the middle, in Hz.
    pub center_hz: f64,
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// The gain in dB, fixed: automatic gain would hide the power.
    pub gain_db: f64,
    /// Error of the oscillator, in parts per million.
    pub correction_ppm: f64,
    /// Time in seconds after the receiver was set up during which samples are left out.
    pub settling_s: f64,
    /// A stream that brings nothing for this long, in seconds, has stalled, and is opened again.
    pub silence_s: f64,
}

impl SoapyTuning {
    /// Channel 0 with 28 dB and no correction; 0.1 s to settle, 0.9 s of silence.
    #[must_use]
    pub fn new(device: String, center_hz: f64, sample_rate_hz: f64) -> Self {
        Self {
            device,
            channel: 0,
            center_hz,
            sample_rate_hz,
            gain_db: 28.0,
            correction_ppm: 0.0,
            settling_s: 0.1,
            silence_s: 0.9,
        }
    }

    /// Checks the ranges of all settings.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the first field that cannot.
    pub fn check(&self) -> Result<(), FieldError> {
        in_range("center_hz", self.center_hz, 1.0..=1e12, "1 to 1e12")?;
        in_range("sample_rate_hz", self.sample_rate_hz, 1.0..=1e9, "1 to 1e9")?;
        require(self.gain_db.abs() <= 200.0, "gain_db", self.gain_db, "at most 200")?;
        in_range("correction_ppm", self.correction_ppm, -1e3..=1e3, "from -1000 to 1000")?;
        in_range("settling_s", self.settling_s, 0.0..=10.0, "from 0 to 10")?;
        positive("silence_s", self.silence_s)?;
        Ok(())
    }
}

/// Error of a receiver of `SoapySDR`: why it gives no samples.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SoapyError {
    /// A field of the tuning is invalid.
    #[error(transparent)]
    Tuning(#[from] FieldError),
    /// It cannot be opened or set.
    #[error("SoapySDR: {step}: {source}")]
    Device {
        /// The step that failed.
        step: &'static str,
        /// The driver's error.
        source: soapysdr::Error,
    },
    /// The driver has set something else.
    #[error("SoapySDR: {field} is {value} with this receiver, not {wanted}")]
    OtherValue {
        /// Name of the setting.
        field: &'static str,
        /// Value that the driver has set.
        value: f64,
        /// Configured value.
        wanted: f64,
    },
    /// It sends nothing.
    #[error("SoapySDR has brought nothing for {seconds:.1} s: is the receiver unplugged?")]
    Silent {
        /// For how long.
        seconds: f64,
    },
}

fn failed(step: &'static str) -> impl FnOnce(soapysdr::Error) -> SoapyError {
    move |source| SoapyError::Device { step, source }
}

/// The receivers that `SoapySDR` finds, each as it is named to open it.
///
/// # Errors
///
/// [`SoapyError::Device`] if they cannot be listed.
pub fn soapy_devices() -> Result<Vec<String>, SoapyError> {
    let found = soapysdr::enumerate("").map_err(failed("find receivers"))?;
    Ok(found.iter().map(ToString::to_string).collect())
}

/// The samples of a receiver that `SoapySDR` has a driver for, each at its place in time.
///
/// Where the receiver has a clock of its own, its timestamps show what was lost; elsewhere samples
/// are counted and held against the clock, as those of rtl_tcp. A stream that stalls is opened
/// again. A sample is never counted twice, and indices only rise.
pub struct SoapySamples<C> {
    tuning: SoapyTuning,
    clock: C,
    stream: Option<RxStream<Complex32>>,
    has_time: bool,
    /// The timestamp of the next sample.
    due_ns: Option<i64>,
    rounding_noise: f64,
    chunk: Vec<Complex32>,
    placement: Placement,
}

impl<C: Clock> SoapySamples<C> {
    /// Opens the receiver and sets it.
    ///
    /// # Errors
    ///
    /// [`SoapyError`] if something in the tuning is wrong, there is no such receiver, or it cannot
    /// be set so.
    pub fn open(tuning: SoapyTuning, clock: C) -> Result<Self, SoapyError> {
        tuning.check()?;
        let SoapyTuning { sample_rate_hz, settling_s, silence_s, .. } = tuning;
        let mut opened = Self {
            placement: Placement::new(sample_rate_hz, settling_s, silence_s),
            tuning,
            clock,
            stream: None,
            has_time: false,
            due_ns: None,
            rounding_noise: 0.0,
            chunk: vec![Complex32::default(); CHUNK],
        };
        opened.connect()?;
        Ok(opened)
    }

    fn connect(&mut self) -> Result<(), SoapyError> {
        const RX: Direction = Direction::Rx;
        let tuning = &self.tuning;
        let channel = tuning.channel;
        // A receiver can be opened once.
        self.stream = None;
        let device = Device::new(tuning.device.as_str()).map_err(failed("open"))?;
        let rate = tuning.sample_rate_hz;
        device.set_sample_rate(RX, channel, rate).map_err(failed("set the rate"))?;
        let set = device.sample_rate(RX, channel).map_err(failed("read the rate"))?;
        // Times are counted in samples: 10 ppm are 36 ms in an hour.
        if (set - rate).abs() > 1e-5 * rate {
            let field = "the sample rate";
            return Err(SoapyError::OtherValue { field, value: set, wanted: rate });
        }
        let ppm = tuning.correction_ppm;
        let corrected =
            device.set_component_frequency(RX, channel, "CORR", ppm, ()).is_ok() || ppm == 0.0;
        // Without a correction of its own it is tuned to where its oscillator takes it.
        let center = tuning.center_hz * if corrected { 1.0 } else { 1.0 - 1e-6 * ppm };
        device.set_frequency(RX, channel, center, ()).map_err(failed("tune"))?;
        if device.has_gain_mode(RX, channel).unwrap_or(false) {
            device.set_gain_mode(RX, channel, false).map_err(failed("end automatic gain"))?;
        }
        device.set_gain(RX, channel, tuning.gain_db).map_err(failed("set the gain"))?;
        let (_, full_scale) =
            device.native_stream_format(RX, channel).map_err(failed("read the format"))?;
        self.rounding_noise = rounding_noise(full_scale);
        self.has_time = device.has_hardware_time(None).unwrap_or(false);
        let mut stream = device.rx_stream(&[channel]).map_err(failed("open a stream"))?;
        stream.activate(None).map_err(failed("begin"))?;
        self.stream = Some(stream);
        self.due_ns = None;
        self.placement.settle(self.clock.now());
        Ok(())
    }

    /// Returns the receiver's settings.
    #[must_use]
    pub fn tuning(&self) -> &SoapyTuning {
        &self.tuning
    }

    /// Returns the losses until now.
    #[must_use]
    pub fn losses(&self) -> SampleLosses {
        self.placement.losses()
    }

    /// The power of the noise that rounding gave the samples, over that of a tone at full scale.
    #[must_use]
    pub fn rounding_noise(&self) -> f64 {
        self.rounding_noise
    }

    /// Returns the time in seconds of the clock at which the sample of an index was taken, to what
    /// driver and bus delay at least; `None` before the first sample.
    #[must_use]
    pub fn time_of(&self, index: f64) -> Option<f64> {
        self.placement.timeline().time_of(index)
    }

    /// Replaces the contents of `samples` by the samples received, and returns the index of the
    /// first; `None` if there are none now. There is no gap inside. To be called until it returns
    /// `None`, and often.
    ///
    /// # Errors
    ///
    /// [`SoapyError`] while nothing comes or the receiver is gone. It may be called again, and goes
    /// on when the receiver is there again.
    pub fn poll(&mut self, samples: &mut Vec<Complex32>) -> Result<Option<u64>, SoapyError> {
        samples.clear();
        let came = match &mut self.stream {
            Some(stream) => stream.read(&mut [&mut self.chunk], PATIENCE_US),
            None => Ok(0),
        };
        let now = self.clock.now();
        let count = match came {
            Ok(count) => count,
            Err(error) if error.code == ErrorCode::Overflow => {
                // The next timestamp shows what was lost; without one its place has to be found.
                if !self.has_time {
                    self.placement.settle(now);
                }
                return Ok(None);
            }
            Err(error) if error.code == ErrorCode::Timeout => 0,
            Err(source) => {
                self.stream = None;
                return Err(SoapyError::Device { step: "read", source });
            }
        };
        if count == 0 {
            self.placement.drained(now);
            return self.watch(now).map(|()| None);
        }
        if self.placement.received(now) {
            self.due_ns = None;
        }
        self.place(count);
        let first = self.placement.take(now, count as u64);
        if first.is_some() {
            samples.extend(self.chunk.get(..count).unwrap_or_default());
        }
        Ok(first)
    }

    /// Compares the timestamp of the samples received with the expected one, and counts a loss.
    fn place(&mut self, count: usize) {
        let Some(stream) = self.stream.as_ref().filter(|_| self.has_time) else { return };
        #[expect(clippy::cast_precision_loss, reason = "nanoseconds of a gap, samples of a chunk")]
        let float = |count: i64| count as f64;
        #[expect(clippy::cast_possible_truncation, reason = "it saturates")]
        let whole = |samples: f64| samples.round() as i64;
        let at = stream.time_ns();
        let rate = self.tuning.sample_rate_hz;
        let late = self.due_ns.map_or(0.0, |due| float(at.saturating_sub(due)) * 1e-9 * rate);
        if late >= LEAST_GAP {
            self.placement.lost(whole(late).unsigned_abs());
        }
        let length_ns = float(i64::try_from(count).unwrap_or(0)) / rate * 1e9;
        self.due_ns = Some(at.saturating_add(whole(length_ns)));
    }

    /// Notices that nothing comes, and opens the receiver again.
    fn watch(&mut self, now: f64) -> Result<(), SoapyError> {
        let Some(Silence { seconds, renews }) = self.placement.watch(now) else { return Ok(()) };
        if renews {
            self.connect()?;
        }
        Err(SoapyError::Silent { seconds })
    }
}

impl<C> fmt::Debug for SoapySamples<C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SoapySamples").field("tuning", &self.tuning).finish_non_exhaustive()
    }
}

/// The power of the noise of rounding to whole numbers, by the one at full scale: a twelfth of a
/// step's square for each of I and Q; next to nothing for floats.
fn rounding_noise(full_scale: f64) -> f64 {
    if full_scale > 1.0 { 2.0 / 12.0 / (full_scale * full_scale) } else { 1e-18 }
}
