use foxhunt_core::parameter::{FieldError, positive};
use foxhunt_wire::xbee::{Address, Address16, Address64};
use serde::{Deserialize, Serialize};

/// Queries of beacons through an XBee.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct XbeeConfig {
    /// The beacons' addresses, in the order of the hunt's beacons: 16 hexadecimal digits (`SH`,
    /// then `SL`), or 4 (`MY`).
    pub beacons: Vec<Address>,
    /// The query to a beacon, and where the power of its answer stands.
    pub question: XbeeQuestion,
    /// Payload of a question to a beacon that a program answers for.
    pub payload: String,
    /// Such an answer begins with what was sent, so that two bytes of number behind the payload
    /// separate a late answer from a new one. Where it does not, a beacon that left a question
    /// without an answer is not queried again before another time-out has passed.
    pub echoed: bool,
    /// Time for which a beacon's answer is awaited, in seconds.
    pub answer_timeout_s: f64,
    /// Time for which the radio's own answer is awaited while it is set up, in seconds; it is
    /// queried three times.
    pub setup_timeout_s: f64,
}

/// The query to a beacon.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum XbeeQuestion {
    /// [`ReceivedRssi`](Self::ReceivedRssi) with an 802.15.4 firmware, otherwise
    /// [`TransmitDb`](Self::TransmitDb).
    #[default]
    Auto,
    /// A packet, which the beacon's program answers; the power stands in the frame that brings the
    /// answer. 802.15.4 firmware.
    ReceivedRssi,
    /// A packet, which the beacon's program answers; then the radio is queried for the power of the
    /// last packet (`DB`). A sample is dropped if another packet came in between.
    TransmitDb,
    /// The beacon's radio is queried for the power at which it received the question (remote `DB`):
    /// no program is needed at the beacon.
    RemoteDb,
}

/// No beacons, as of a radio that is only examined; the question by the firmware; `ASK`, echoed;
/// 0.4 s for an answer, 0.5 s for the radio's own.
impl Default for XbeeConfig {
    fn default() -> Self {
        Self {
            beacons: Vec::new(),
            question: XbeeQuestion::Auto,
            payload: "ASK".into(),
            echoed: true,
            answer_timeout_s: 0.4,
            setup_timeout_s: 0.5,
        }
    }
}

/// The longest payload: with number and head it fits every firmware's packet, encrypted or not.
const LONGEST_PAYLOAD: usize = 60;

impl XbeeConfig {
    /// Checks the ranges of all settings.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the first field that cannot.
    pub fn check(&self) -> Result<(), FieldError> {
        for (index, beacon) in self.beacons.iter().enumerate() {
            let field = format!("beacons[{index}]");
            let everyone = [
                Address::Long(Address64::BROADCAST),
                Address::Long(Address64::UNKNOWN),
                Address::Short(Address16(u16::MAX)),
                Address::Short(Address16::UNKNOWN),
            ];
            if everyone.contains(beacon) {
                return Err(FieldError::new(field, beacon, "the address of one radio"));
            }
            if self.beacons.iter().take(index).any(|other| other == beacon) {
                return Err(FieldError::new(field, beacon, "unlike those before it"));
            }
        }
        let length = self.payload.len();
        if !(1..=LONGEST_PAYLOAD).contains(&length) {
            let value = format_args!("{length} bytes long");
            return Err(FieldError::new("payload", value, "1 to 60 bytes long"));
        }
        positive("answer_timeout_s", self.answer_timeout_s)?;
        positive("setup_timeout_s", self.setup_timeout_s)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_named_with_its_value() {
        let beacons = |list: &[&str]| list.iter().map(|a| a.parse().expect("an address")).collect();
        let good = XbeeConfig { beacons: beacons(&["0013A20040AABBCC"]), ..XbeeConfig::default() };
        assert_eq!(good.check(), Ok(()));
        let cases = [
            (XbeeConfig { beacons: beacons(&["0001", "FFFE"]), ..good.clone() }, "[1] is FFFE"),
            (XbeeConfig { beacons: beacons(&["0001", "0001"]), ..good.clone() }, "[1] is 0001"),
            (XbeeConfig { payload: String::new(), ..good.clone() }, "payload is 0 bytes"),
            (XbeeConfig { answer_timeout_s: -1.0, ..good.clone() }, "answer_timeout_s is -1"),
            (XbeeConfig { setup_timeout_s: f64::NAN, ..good }, "setup_timeout_s is NaN"),
        ];
        for (config, text) in cases {
            let error = config.check().expect_err("it is wrong").to_string();
            assert!(error.contains(text), "{error}");
        }
    }

    #[test]
    fn a_file_names_what_differs_from_the_default() {
        let text = r#"{"beacons": ["0013a20040aabbcc", "5001"], "question": "remote-db"}"#;
        let config: XbeeConfig = serde_json::from_str(text).expect("it is in order");
        assert_eq!(config.question, XbeeQuestion::RemoteDb);
        assert_eq!(config.beacons[0].to_string(), "0013A20040AABBCC");
        assert!(serde_json::from_str::<XbeeConfig>(r#"{"beacon": []}"#).is_err());
        assert!(serde_json::from_str::<XbeeConfig>(r#"{"beacons": ["x"]}"#).is_err());
    }
}
