//! Settings of receivers behind rtl_tcp and of a KrakenSDR, and their errors.

use std::io;

use foxhunt_core::parameter::{FieldError, finite, in_range, positive, require};
use foxhunt_signal::detector::DetectorError;
use foxhunt_wire::receivers::{HttpError, RtlTcpError};
use serde::{Deserialize, Serialize};

/// Greatest delay of the next pulse after an interval, as a share of it.
const LATE: f64 = 0.02;

/// Interval of the search for pulses, in seconds.
pub(super) const SEARCH_EVERY_S: f64 = 0.05;

/// The share of the rate that is received on each side of the middle.
const RECEIVED: f64 = 0.48;

/// The bytes that a server hands on at a time.
const SERVER_BYTES: f64 = 262_144.0;

/// Settings for the power of beacons from an RTL-SDR behind rtl_tcp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RtlTcpConfig {
    /// The beacons' frequencies in Hz, in the order of the hunt's beacons.
    pub frequencies_hz: Vec<u32>,
    /// Samples per second.
    pub sample_rate_hz: u32,
    /// The tuner's gain in dB. It is never left to the tuner, which would hide the power.
    pub gain_db: f64,
    /// Error of the oscillator, in parts per million.
    pub correction_ppm: i32,
    /// Distance in Hz by which it is tuned below a beacon: away from the receiver's own spike in
    /// the middle.
    pub beside_hz: u32,
    /// The width of the band in which power is measured, in Hz: the beacon's, and what the
    /// oscillators drift.
    pub bandwidth_hz: f64,
    /// Time in seconds after a question during which samples are left out: they were on the way, or
    /// the tuner was not there yet. A server hands on 131072 samples at a time.
    pub settling_s: f64,
    /// Time for which power is gathered, in seconds: at least a period of a pulsed beacon.
    pub window_s: f64,
    /// The share of the window's powers that lie below the level: the pulses of a pulsed beacon,
    /// not the pauses. 1 is the peak.
    pub quantile: f64,
    /// The power of a tone at full scale, in dBm, at this gain: from a measurement.
    pub full_scale_dbm: f64,
    /// A power below this, in dBm, is noise, and dropped; absent, every power counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub floor_dbm: Option<f64>,
    /// Silence in seconds after which a server has failed, and is connected to again.
    pub silence_s: f64,
    /// The pulses that the beacons send; then a level is that of a pulse, and `bandwidth_hz`,
    /// `window_s` and `quantile` are not used. Absent for beacons that send all the time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pulse: Option<PulseConfig>,
}

/// The pulses of tags, and how they are searched.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PulseConfig {
    /// Length of a pulse in seconds.
    pub width_s: f64,
    /// From one to the next, in seconds: how long a question waits. The longest one of several
    /// tags.
    pub interval_s: f64,
    /// Greatest distance in Hz of a tag from its frequency, by its own oscillator and the
    /// receiver's; 5 kHz unless given.
    #[serde(default = "search_hz")]
    pub search_hz: f64,
    /// Number of times an hour that noise may be taken for a pulse, over all that is searched; 10
    /// unless given.
    #[serde(default = "false_alarms_per_hour")]
    pub false_alarms_per_hour: f64,
}

impl PulseConfig {
    /// Pulses of a width and an interval, both in seconds, anywhere within 5 kHz, with 10 false
    /// alarms an hour.
    #[must_use]
    pub fn new(width_s: f64, interval_s: f64) -> Self {
        let search_hz = search_hz();
        let false_alarms_per_hour = false_alarms_per_hour();
        Self { width_s, interval_s, search_hz, false_alarms_per_hour }
    }

    /// Longest time in seconds until a pulse is known, but for the delay on the way.
    pub(super) fn latency_s(&self) -> f64 {
        2.0 * SEARCH_EVERY_S + 5.0 * self.width_s
    }

    /// Time in seconds that a question waits after the receiver has settled: until a pulse must
    /// have come and be known.
    pub(super) fn wait_s(&self) -> f64 {
        (1.0 + LATE) * self.interval_s + self.width_s
    }

    fn check(&self) -> Result<(), FieldError> {
        in_range("width_s", self.width_s, 1e-3..=0.2, "from 0.001 to 0.2")?;
        in_range("interval_s", self.interval_s, self.width_s..=60.0, "from width_s to 60")?;
        let wide = self.search_hz >= 2.0 / self.width_s && self.search_hz <= 1e6;
        require(wide, "search_hz", self.search_hz, "from 2 / width_s to 1e6")?;
        let alarms = self.false_alarms_per_hour;
        in_range("false_alarms_per_hour", alarms, 1e-6..=1e4, "from 1e-6 to 1e4")?;
        Ok(())
    }
}

/// No frequencies, which a file has to name; 2.048 MS/s, 28 dB, 100 kHz beside, a band of 5 kHz,
/// 0.1 s to settle, 0.1 s of which the upper tenth counts; −30 dBm at full scale; no floor; 0.9 s;
/// no pulses.
impl Default for RtlTcpConfig {
    fn default() -> Self {
        Self {
            frequencies_hz: Vec::new(),
            sample_rate_hz: 2_048_000,
            gain_db: 28.0,
            correction_ppm: 0,
            beside_hz: 100_000,
            bandwidth_hz: 5_000.0,
            settling_s: 0.1,
            window_s: 0.1,
            quantile: 0.9,
            full_scale_dbm: -30.0,
            floor_dbm: None,
            silence_s: 0.9,
            pulse: None,
        }
    }
}

/// Settings for bearings from a `KrakenSDR`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct KrakenConfig {
    /// The beacons' frequencies in Hz, in the order of the hunt's beacons.
    pub frequencies_hz: Vec<f64>,
    /// Greatest distance of a channel's frequency from a beacon's, in Hz.
    pub tolerance_hz: f64,
    /// The name of the host, as its server wants to be called.
    pub host: String,
    /// The page.
    pub path: String,
    /// Direction of the array's front, in radians counter-clockwise of the nose.
    pub mount_offset_rad: f64,
    /// A line whose confidence is less is not taken.
    pub least_confidence: f64,
    /// Offset in dB that makes its powers dBm.
    pub calibration_db: f64,
    /// From one question for the page to the next, in seconds.
    pub spacing_s: f64,
    /// A page that has not come after this long, in seconds, has failed.
    pub page_timeout_s: f64,
    /// A beacon without a new line after this long, in seconds, was not received.
    pub turn_timeout_s: f64,
}

/// No frequencies, which a file has to name; 5 kHz, `krakensdr` and its page, the front along the
/// nose, any confidence, no calibration; the page every 0.25 s, 2 s for it, 5 s for a turn.
impl Default for KrakenConfig {
    fn default() -> Self {
        Self {
            frequencies_hz: Vec::new(),
            tolerance_hz: 5_000.0,
            host: "krakensdr".into(),
            path: "/DOA_value.html".into(),
            mount_offset_rad: 0.0,
            least_confidence: 0.0,
            calibration_db: 0.0,
            spacing_s: 0.25,
            page_timeout_s: 2.0,
            turn_timeout_s: 5.0,
        }
    }
}

impl RtlTcpConfig {
    /// Checks the ranges of all settings.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the first field that cannot.
    pub fn check(&self) -> Result<(), FieldError> {
        if self.frequencies_hz.is_empty() {
            return Err(FieldError::new("frequencies_hz", "empty", "at least one"));
        }
        let lowest = self.frequencies_hz.iter().min().copied().unwrap_or(0);
        let above = lowest > self.beside_hz;
        require(above, "frequencies_hz", f64::from(lowest), "above beside_hz")?;
        let rate = f64::from(self.sample_rate_hz);
        in_range("sample_rate_hz", rate, 1.0..=10e6, "at most 10 MHz")?;
        let within = self.beside_hz <= self.sample_rate_hz / 2;
        let beside = f64::from(self.beside_hz);
        require(within, "beside_hz", beside, "at most half of sample_rate_hz")?;
        let wide = self.bandwidth_hz <= rate;
        require(wide, "bandwidth_hz", self.bandwidth_hz, "at most sample_rate_hz")?;
        positive("bandwidth_hz", self.bandwidth_hz)?;
        let window = self.window_s * self.bandwidth_hz;
        require(window >= 1.0, "window_s", self.window_s, "at least 1 / bandwidth_hz")?;
        require(self.window_s <= 10.0, "window_s", self.window_s, "at most 10")?;
        in_range("settling_s", self.settling_s, 0.0..=10.0, "from 0 to 10")?;
        in_range("quantile", self.quantile, 0.0..=1.0, "from 0 to 1")?;
        require(self.gain_db.abs() <= 100.0, "gain_db", self.gain_db, "at most 100")?;
        finite("full_scale_dbm", self.full_scale_dbm)?;
        finite("floor_dbm", self.floor_dbm.unwrap_or(0.0))?;
        positive("silence_s", self.silence_s)?;
        let Some(pulse) = &self.pulse else { return Ok(()) };
        pulse.check().map_err(|error| error.within("pulse"))?;
        let reach = f64::from(self.beside_hz) + pulse.search_hz;
        let received = reach <= RECEIVED * rate;
        require(received, "pulse.search_hz", pulse.search_hz, "within the band with beside_hz")?;
        let aside = f64::from(self.beside_hz) >= pulse.search_hz;
        require(aside, "beside_hz", beside, "at least pulse.search_hz")?;
        Ok(())
    }

    /// Longest duration of a question in seconds, from the request to a level or nothing.
    #[must_use]
    pub fn longest_question_s(&self) -> f64 {
        let gathered = self.pulse.map_or(self.window_s, |p| p.wait_s() + p.latency_s());
        self.settling_s + gathered
    }

    /// Returns the frequency in Hz to which the receiver is tuned for all beacons together: below
    /// the lowest by `beside_hz`. `None` if they do not fit into one band.
    pub(super) fn common_center_hz(&self) -> Option<u32> {
        let pulse = self.pulse?;
        let (lowest, highest) =
            (self.frequencies_hz.iter().min()?, self.frequencies_hz.iter().max()?);
        let center = lowest.saturating_sub(self.beside_hz);
        let reach = f64::from(highest - center) + pulse.search_hz;
        (reach <= RECEIVED * f64::from(self.sample_rate_hz)).then_some(center)
    }

    /// Returns the receiver's first settings.
    pub(super) fn tuning(&self) -> RtlTcpTuning {
        let lowest = self.frequencies_hz.iter().min().copied().unwrap_or(0);
        let center = lowest.saturating_sub(self.beside_hz);
        let tuning = RtlTcpTuning::new(center, self.sample_rate_hz);
        RtlTcpTuning {
            gain_db: self.gain_db,
            correction_ppm: self.correction_ppm,
            settling_s: tuning.settling_s.max(self.settling_s),
            silence_s: self.silence_s,
            ..tuning
        }
    }
}

impl KrakenConfig {
    /// Checks the ranges of all settings.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the first field that cannot.
    pub fn check(&self) -> Result<(), FieldError> {
        if self.frequencies_hz.is_empty() {
            return Err(FieldError::new("frequencies_hz", "empty", "at least one"));
        }
        for frequency in &self.frequencies_hz {
            positive("frequencies_hz", *frequency)?;
        }
        positive("tolerance_hz", self.tolerance_hz)?;
        let word = |text: &str| !text.contains(|c: char| c.is_whitespace() || c.is_control());
        if !word(&self.host) {
            return Err(FieldError::new("host", &self.host, "one word"));
        }
        if !word(&self.path) || !self.path.starts_with('/') {
            return Err(FieldError::new("path", &self.path, "one word that begins with /"));
        }
        finite("mount_offset_rad", self.mount_offset_rad)?;
        finite("least_confidence", self.least_confidence)?;
        finite("calibration_db", self.calibration_db)?;
        positive("spacing_s", self.spacing_s)?;
        positive("page_timeout_s", self.page_timeout_s)?;
        positive("turn_timeout_s", self.turn_timeout_s)?;
        Ok(())
    }
}

/// Error of an RTL-SDR behind rtl_tcp: why it measures no power. The call may be repeated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RtlTcpRadioError {
    /// The connection failed.
    #[error("rtl_tcp: {0}")]
    Stream(#[source] io::Error),
    /// The server is another one.
    #[error("rtl_tcp: {0}")]
    Server(#[source] RtlTcpError),
    /// It sends nothing.
    #[error(
        "rtl_tcp has sent nothing for {seconds:.1} s: it serves one client at a time, and stops \
         when its receiver is unplugged"
    )]
    Silent {
        /// For how long.
        seconds: f64,
    },
    /// The samples cannot be searched for pulses.
    #[error("rtl_tcp: pulses: {0}")]
    Pulses(#[source] DetectorError),
    /// There is no such beacon.
    #[error("there is no frequency of beacon {beacon}; there are {beacons}, counted from 0")]
    Beacon {
        /// Requested beacon.
        beacon: u16,
        /// Number of beacons.
        beacons: usize,
    },
}

/// Error of a `KrakenSDR`: why it measures no bearings. It may be polled again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KrakenSourceError<V> {
    /// The connection failed.
    #[error("KrakenSDR: {0}")]
    Stream(#[source] io::Error),
    /// The `KrakenSDR`'s server does not send the page.
    #[error("KrakenSDR: {0}")]
    Http(#[source] HttpError),
    /// The page did not come in time.
    #[error("KrakenSDR: the page did not come in {seconds} s")]
    Timeout {
        /// The time that it had.
        seconds: f64,
    },
    /// The aircraft that carries the array failed.
    #[error("the vehicle failed: {0}")]
    Vehicle(#[source] V),
    /// There is no such beacon.
    #[error("there is no frequency of beacon {beacon}; there are {beacons}, counted from 0")]
    Beacon {
        /// Requested beacon.
        beacon: u16,
        /// Number of beacons.
        beacons: usize,
    },
}

fn search_hz() -> f64 {
    5_000.0
}

fn false_alarms_per_hour() -> f64 {
    10.0
}

/// Settings of an RTL-SDR behind rtl_tcp, and the silence after which its stream counts as stalled.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RtlTcpTuning {
    /// The frequency in the middle, in Hz.
    pub center_hz: u32,
    /// Samples per second.
    pub sample_rate_hz: u32,
    /// The tuner's gain in dB, fixed: automatic gain would hide the power.
    pub gain_db: f64,
    /// Error of the oscillator, in parts per million.
    pub correction_ppm: i32,
    /// Time in seconds after the receiver was set up during which samples are left out; in the
    /// second half their place in time is found.
    pub settling_s: f64,
    /// A stream that brings nothing for this long, in seconds, has stalled, and is opened again.
    pub silence_s: f64,
}

impl RtlTcpTuning {
    /// 28 dB, no correction; 50 ms and twice what a server hands on at a time to settle, 0.9 s of
    /// silence.
    #[must_use]
    pub fn new(center_hz: u32, sample_rate_hz: u32) -> Self {
        let block_s = SERVER_BYTES / 2.0 / f64::from(sample_rate_hz.max(1));
        Self {
            center_hz,
            sample_rate_hz,
            gain_db: 28.0,
            correction_ppm: 0,
            settling_s: 0.05 + 2.0 * block_s.min(1.0),
            silence_s: 0.9,
        }
    }

    /// Checks the ranges of all settings.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the first field that cannot.
    pub fn check(&self) -> Result<(), FieldError> {
        let rate = f64::from(self.sample_rate_hz);
        in_range("sample_rate_hz", rate, 1.0..=10e6, "at most 10 MHz")?;
        require(self.gain_db.abs() <= 100.0, "gain_db", self.gain_db, "at most 100")?;
        in_range("settling_s", self.settling_s, 0.0..=10.0, "from 0 to 10")?;
        positive("silence_s", self.silence_s)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_named_with_its_value() {
        let good = RtlTcpConfig { frequencies_hz: vec![433_920_000], ..RtlTcpConfig::default() };
        assert_eq!(good.check(), Ok(()));
        let pulsed = |width_s, interval_s, search_hz| {
            let pulse = PulseConfig { search_hz, ..PulseConfig::new(width_s, interval_s) };
            RtlTcpConfig { pulse: Some(pulse), ..good.clone() }
        };
        assert_eq!(pulsed(0.02, 1.3, 5e3).check(), Ok(()));
        for (config, text) in [
            (RtlTcpConfig::default(), "frequencies_hz is empty"),
            (RtlTcpConfig { bandwidth_hz: f64::NAN, ..good.clone() }, "bandwidth_hz is NaN"),
            (RtlTcpConfig { window_s: 1e-4, ..good.clone() }, "window_s is 0.0001"),
            (RtlTcpConfig { quantile: 1.5, ..good.clone() }, "quantile is 1.5"),
            (pulsed(0.0, 1.3, 5e3), "pulse.width_s is 0"),
            (pulsed(0.02, 0.01, 5e3), "pulse.interval_s is 0.01"),
            (pulsed(0.02, 1.3, 50.0), "pulse.search_hz is 50"),
            (pulsed(0.02, 1.3, 2e5), "beside_hz is 100000"),
        ] {
            let error = config.check().expect_err("it is wrong").to_string();
            assert!(error.contains(text), "{error}");
        }
        let good = KrakenConfig { frequencies_hz: vec![433.92e6], ..KrakenConfig::default() };
        assert_eq!(good.check(), Ok(()));
        for (config, text) in [
            (KrakenConfig::default(), "frequencies_hz is empty"),
            (KrakenConfig { path: "/a b".into(), ..good.clone() }, "path is /a b"),
            (KrakenConfig { spacing_s: 0.0, ..good }, "spacing_s is 0"),
        ] {
            let error = config.check().expect_err("it is wrong").to_string();
            assert!(error.contains(text), "{error}");
        }
    }
}
