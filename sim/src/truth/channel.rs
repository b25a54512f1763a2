use foxhunt_sensors::{LogDistance, Propagation, SharedAntenna};

use crate::{ChannelConfig, SimError};

/// What the channel does to every sample; what it draws lies in the receivers.
#[derive(Clone, Debug)]
pub(crate) struct Channel {
    law: LogDistance,
    antenna: SharedAntenna,
    mean_gain_db: f64,
    pub(super) pattern_sigma_db: f64,
    pub(super) sample_sigma_db: f64,
    /// In radians.
    pub(super) bearing_sigma: f64,
    whole_db: bool,
    floor_dbm: Option<f64>,
    pub(super) loss_probability: f64,
}

impl Channel {
    /// The channel of a configuration that was checked but for its antenna.
    pub(crate) fn new(config: &ChannelConfig) -> Result<Self, SimError> {
        let antenna = config.antenna.build()?;
        Ok(Self {
            law: config.path_loss,
            mean_gain_db: antenna.mean_gain_db(0.0),
            antenna,
            pattern_sigma_db: config.pattern_sigma_db,
            sample_sigma_db: config.sample_sigma_db,
            bearing_sigma: config.bearing_sigma_deg.to_radians(),
            whole_db: config.whole_db,
            floor_dbm: config.floor_dbm,
            loss_probability: config.loss_probability,
        })
    }

    /// The mean level over a turn, in dBm, at a slant range in metres.
    pub(super) fn level_dbm(&self, range: f64) -> f64 {
        self.law.rss_dbm(range)
    }

    /// The gain over its mean in dB, for a wave from `arrival` radians counter-clockwise of
    /// boresight.
    pub(super) fn relative_gain_db(&self, arrival: f64) -> f64 {
        self.antenna.gain_dbi(arrival, 0.0) - self.mean_gain_db
    }

    /// What the receiver reads at a power in dBm; `None` below its floor.
    pub(super) fn reading_dbm(&self, power_dbm: f64) -> Option<f64> {
        let reading = if self.whole_db { libm::round(power_dbm) } else { power_dbm };
        self.floor_dbm.is_none_or(|floor| reading >= floor).then_some(reading)
    }

    /// The weakest reading, if there is one.
    pub(crate) fn floor_dbm(&self) -> Option<f64> {
        self.floor_dbm
    }
}
