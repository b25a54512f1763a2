use foxhunt_core::BeaconId;
use foxhunt_hardware::{PulseConfig, RtlTcpConfig};
use foxhunt_sim::{PulseTrain, World};

use super::EmulatedFieldError;

/// The tags of a field, all of which pulse alike.
pub(super) struct Tags {
    pulse: PulseConfig,
}

impl Tags {
    /// Returns the tags of a world's first beacons; `None` if the beacons answer.
    pub(super) fn of(world: &World, count: usize) -> Result<Option<Self>, EmulatedFieldError> {
        let trains: Vec<Option<PulseTrain>> =
            (0..).map(|beacon| world.pulses(BeaconId(beacon))).take(count).collect();
        let Some(first) = trains.iter().flatten().next() else { return Ok(None) };
        let same = |train: &Option<PulseTrain>| {
            train.is_some_and(|train| train.pulse_s.to_bits() == first.pulse_s.to_bits())
        };
        if let Some(beacon) = trains.iter().position(|train| !same(train)) {
            return Err(EmulatedFieldError::Pulses { beacon, pulse_s: first.pulse_s });
        }
        let longest = |interval_s: f64, train: &PulseTrain| {
            interval_s.max(train.interval_s + 2.0 * train.jitter_s)
        };
        let interval_s = trains.iter().flatten().fold(0.0, longest);
        Ok(Some(Self { pulse: PulseConfig::new(first.pulse_s, interval_s) }))
    }

    /// A receiver of them, where a tone at full scale has this power without gain.
    pub(super) fn receiver(&self, full_scale_dbm: f64) -> RtlTcpConfig {
        let config = RtlTcpConfig::default();
        RtlTcpConfig {
            sample_rate_hz: 250_000,
            beside_hz: 20_000,
            // Emulated servers hand on what they have at once.
            settling_s: 0.02,
            full_scale_dbm: full_scale_dbm - config.gain_db,
            pulse: Some(self.pulse),
            ..config
        }
    }
}
