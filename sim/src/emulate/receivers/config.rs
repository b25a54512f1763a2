use foxhunt_core::parameter::{FieldError, finite, in_range, not_negative, positive, require};
use serde::{Deserialize, Serialize};

/// The settings of an emulated RTL-SDR, and the transmitters besides the beacons.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmulatedRtlTcpConfig {
    /// The power of a tone at full scale with a gain of 0, in dBm.
    pub full_scale_dbm: f64,
    /// σ of the noise of each I and Q, in steps of a byte.
    pub noise_steps: f64,
    /// The seed of the noise.
    pub seed: u64,
    /// σ of how far each beacon's oscillator is from its frequency, in Hz; the same at every
    /// receiver.
    pub carrier_sigma_hz: f64,
    /// The drift of the beacons' oscillators, in Hz per second.
    pub drift_hz_per_s: f64,
    /// The error of the receiver's own oscillator, in parts per million: its client has to correct
    /// it.
    pub oscillator_ppm: f64,
    /// Other transmitters.
    pub interferers: Vec<InterfererConfig>,
}

/// A transmitter that is no beacon: a carrier, all the time or now and then.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InterfererConfig {
    /// Its frequency, in Hz.
    pub frequency_hz: f64,
    /// Its power at every antenna, in dBm.
    pub level_dbm: f64,
    /// Duration of a transmission, in seconds; if absent, it sends all the time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on_s: Option<f64>,
    /// Time from one beginning to the next, in seconds; with `on_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every_s: Option<f64>,
}

/// 0 dBm, 0.7 steps; oscillators without an error, no interferers.
impl Default for EmulatedRtlTcpConfig {
    fn default() -> Self {
        Self {
            full_scale_dbm: 0.0,
            noise_steps: 0.7,
            seed: 1,
            carrier_sigma_hz: 0.0,
            drift_hz_per_s: 0.0,
            oscillator_ppm: 0.0,
            interferers: Vec::new(),
        }
    }
}

impl EmulatedRtlTcpConfig {
    pub(super) fn check(&self) -> Result<(), FieldError> {
        in_range("noise_steps", self.noise_steps, 0.0..=50.0, "from 0 to 50")?;
        finite("full_scale_dbm", self.full_scale_dbm)?;
        not_negative("carrier_sigma_hz", self.carrier_sigma_hz)?;
        finite("drift_hz_per_s", self.drift_hz_per_s)?;
        in_range("oscillator_ppm", self.oscillator_ppm, -1e3..=1e3, "from -1000 to 1000")?;
        for (i, interferer) in self.interferers.iter().enumerate() {
            interferer.check().map_err(|error| error.within(format_args!("interferers[{i}]")))?;
        }
        Ok(())
    }
}

impl InterfererConfig {
    fn check(&self) -> Result<(), FieldError> {
        positive("frequency_hz", self.frequency_hz)?;
        finite("level_dbm", self.level_dbm)?;
        match (self.on_s, self.every_s) {
            (None, None) => Ok(()),
            (Some(on), Some(every)) => {
                positive("on_s", on)?;
                // Not shorter than a block of samples is worth looking at.
                let apart = every.is_finite() && every > on && every >= 1e-3;
                require(apart, "every_s", every, "above on_s, and 0.001 at least")?;
                Ok(())
            }
            (Some(_), None) => Err(FieldError::new("every_s", "missing", "given with on_s")),
            (None, Some(_)) => Err(FieldError::new("on_s", "missing", "given with every_s")),
        }
    }
}
