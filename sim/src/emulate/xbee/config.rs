use foxhunt_core::{
    BeaconId,
    parameter::{FieldError, positive, require},
};
use foxhunt_wire::xbee::{Address16, Address64, Protocol};
use serde::{Deserialize, Serialize};

/// The kind of XBee that is emulated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmulatedXbeeConfig {
    /// Its firmware's protocol on the air.
    pub firmware: Protocol,
    /// `AP`: 0 transparent, 1 plain frames, 2 escaped frames.
    pub ap: u8,
    /// Time from a question to a beacon that does not answer to the report of that, in seconds.
    pub no_answer_s: f64,
}

/// Zigbee, plain frames, 0.2 s.
impl Default for EmulatedXbeeConfig {
    fn default() -> Self {
        Self { firmware: Protocol::Zigbee, ap: 1, no_answer_s: 0.2 }
    }
}

impl EmulatedXbeeConfig {
    pub(super) fn check(&self) -> Result<(), FieldError> {
        require(self.ap <= 2, "ap", f64::from(self.ap), "0, 1 or 2")?;
        positive("no_answer_s", self.no_answer_s)?;
        Ok(())
    }
}

/// The addresses of a beacon in an emulated network, of 64 bits and of 16.
#[must_use]
pub fn xbee_address(beacon: BeaconId) -> (Address64, Address16) {
    let number = beacon.0;
    (Address64(0x0013_A200_4B00_0000 | u64::from(number)), Address16(0x5000 ^ number))
}

/// The address of the radio of a drone.
pub(super) fn drone_address(drone: usize) -> Address64 {
    Address64(0x0013_A200_4D00_0000 | u64::try_from(drone & 0xFFFF).unwrap_or(0))
}
