use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

/// A radio's 64-bit address, which it was made with: `SH` and `SL`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address64(pub u64);

impl Address64 {
    /// Everyone.
    pub const BROADCAST: Self = Self(0xFFFF);
    /// Placeholder where the 16-bit address counts instead.
    pub const UNKNOWN: Self = Self(u64::MAX);
}

/// A radio's 16-bit address in its network: `MY`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address16(pub u16);

impl Address16 {
    /// Placeholder where the 64-bit address counts instead.
    pub const UNKNOWN: Self = Self(0xFFFE);
}

/// One of the two, as it stands in configurations: 16 hexadecimal digits, or 4.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Address {
    /// A 64-bit one.
    Long(Address64),
    /// A 16-bit one.
    Short(Address16),
}

/// Error of a text that is no address.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text:?} is no address of an XBee: 16 hexadecimal digits (SH, then SL), or 4 (MY)")]
pub struct AddressError {
    text: String,
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let wrong = || AddressError { text: text.to_owned() };
        if !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return Err(wrong());
        }
        match text.len() {
            16 => u64::from_str_radix(text, 16).map(|a| Self::Long(Address64(a))),
            4 => u16::from_str_radix(text, 16).map(|a| Self::Short(Address16(a))),
            _ => return Err(wrong()),
        }
        .map_err(|_| wrong())
    }
}

impl fmt::Display for Address64 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016X}", self.0)
    }
}

impl fmt::Display for Address16 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}", self.0)
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Long(address) => address.fmt(f),
            Self::Short(address) => address.fmt(f),
        }
    }
}

impl TryFrom<String> for Address {
    type Error = AddressError;

    fn try_from(text: String) -> Result<Self, AddressError> {
        text.parse()
    }
}

impl From<Address> for String {
    fn from(address: Address) -> Self {
        address.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_as_they_are_written() {
        for text in ["0013A20040AABBCC", "5001", "FFFE", "000000000000FFFF"] {
            assert_eq!(text.parse::<Address>().expect("an address").to_string(), text);
        }
        assert_eq!("abcd".parse(), Ok(Address::Short(Address16(0xABCD))));
        for text in ["", "13A20040AABBCC", "0013A20040AABBCX", "+001", "0x5001", "ß01"] {
            let error = text.parse::<Address>().expect_err("no address").to_string();
            assert!(error.contains(&format!("{text:?}")), "{error}");
        }
    }
}
