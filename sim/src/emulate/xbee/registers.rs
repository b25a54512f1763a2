use std::collections::BTreeMap;

use foxhunt_wire::xbee::{Address16, Address64, AtCommand, AtStatus, Protocol};

/// A radio's answers to AT commands.
#[derive(Clone, Debug)]
pub(super) struct Registers {
    values: BTreeMap<[u8; 2], Vec<u8>>,
}

/// The commands that can be set, besides the mode.
const SETTABLE: [&[u8; 2]; 16] = [
    b"AP", b"NI", b"MY", b"ID", b"CH", b"CE", b"NT", b"NO", b"SM", b"BD", b"DH", b"DL", b"PL",
    b"AO", b"MM", b"SC",
];
/// Commands that act rather than query.
const ACTIONS: [&[u8; 2]; 3] = [b"AC", b"CN", b"WR"];

impl Registers {
    pub(super) fn new(
        firmware: Protocol,
        ap: u8,
        long: Address64,
        short: Address16,
        name: &str,
    ) -> Self {
        let (version, short) = match firmware {
            Protocol::Ieee802154 => ([0x20, 0x03], short),
            Protocol::DigiMesh => ([0x90, 0x02], Address16::UNKNOWN),
            _ => ([0x40, 0x60], short),
        };
        let address = long.0.to_be_bytes();
        let mut values: BTreeMap<[u8; 2], Vec<u8>> = [
            (*b"AP", vec![ap]),
            (*b"HV", vec![0x2E, 0x47]),
            (*b"VR", version.to_vec()),
            (*b"SH", address[..4].to_vec()),
            (*b"SL", address[4..].to_vec()),
            (*b"MY", short.0.to_be_bytes().to_vec()),
            (*b"NI", name.as_bytes().to_vec()),
            (*b"ID", vec![0x33, 0x32]),
            (*b"CH", vec![0x0C]),
            (*b"CE", vec![0]),
            (*b"NT", vec![0x03]),
            (*b"NO", vec![0]),
            (*b"SM", vec![0]),
            (*b"BD", vec![0, 0, 0, 6]),
            (*b"DH", vec![0, 0, 0, 0]),
            (*b"DL", vec![0, 0, 0, 0]),
            (*b"PL", vec![4]),
            (*b"AI", vec![0]),
            // Nothing was received yet.
            (*b"DB", vec![0]),
            (*b"%V", vec![0x0C, 0xE4]),
        ]
        .into();
        if firmware == Protocol::Zigbee {
            values.insert(*b"OP", vec![0, 0, 0, 0, 0, 0, 0x33, 0x32]);
            values.insert(*b"OI", vec![0x1A, 0x2B]);
        }
        if firmware != Protocol::Ieee802154 {
            values.insert(*b"AO", vec![0]);
        }
        Self { values }
    }

    /// Queries, where there is no parameter; otherwise sets.
    pub(super) fn query(&mut self, command: AtCommand, parameter: &[u8]) -> (AtStatus, Vec<u8>) {
        let key = command.0;
        if ACTIONS.contains(&&key) {
            return (AtStatus::OK, Vec::new());
        }
        let Some(value) = self.values.get_mut(&key) else {
            return (AtStatus::INVALID_COMMAND, Vec::new());
        };
        if parameter.is_empty() {
            return (AtStatus::OK, value.clone());
        }
        let longest = if key == *b"NI" { 20 } else { 8 };
        let wrong_mode = key == *b"AP" && !matches!(parameter, [0..=2]);
        if !SETTABLE.contains(&&key) || parameter.len() > longest || wrong_mode {
            return (AtStatus::INVALID_PARAMETER, Vec::new());
        }
        *value = parameter.to_vec();
        (AtStatus::OK, Vec::new())
    }

    /// The API mode that is set.
    pub(super) fn ap(&self) -> u8 {
        self.values.get(b"AP").and_then(|value| value.first()).copied().unwrap_or(0)
    }

    /// A packet came in with this power.
    pub(super) fn received(&mut self, neg_dbm: u8) {
        self.values.insert(*b"DB", vec![neg_dbm]);
    }

    /// Its name.
    pub(super) fn name(&self) -> &[u8] {
        self.values.get(b"NI").map_or(&[], Vec::as_slice)
    }
}
