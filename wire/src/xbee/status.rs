use std::fmt;

/// The status of an AT command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AtStatus(pub u8);

impl AtStatus {
    /// It was executed.
    pub const OK: Self = Self(0);
    /// It failed.
    pub const ERROR: Self = Self(1);
    /// There is no such command.
    pub const INVALID_COMMAND: Self = Self(2);
    /// Its parameter is out of range.
    pub const INVALID_PARAMETER: Self = Self(3);
    /// The other radio, which was to execute it, does not answer.
    pub const NO_ANSWER: Self = Self(4);
}

impl fmt::Display for AtStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self.0 {
            0 => "done",
            1 => "error",
            2 => "invalid command",
            3 => "invalid parameter",
            4 => "the other radio does not answer",
            other => return write!(f, "status {other:#04x}"),
        };
        f.write_str(text)
    }
}

/// The status of a packet that was sent with a Zigbee or `DigiMesh` firmware: the delivery byte
/// of frame 8B.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DeliveryStatus(pub u8);

impl DeliveryStatus {
    /// It was delivered.
    pub const SUCCESS: Self = Self(0x00);
    /// The network's acknowledgement did not come.
    pub const NO_NETWORK_ACK: Self = Self(0x21);

    /// Returns true if nobody at that address answers: no acknowledgement, no such address, no
    /// route.
    #[must_use]
    pub fn is_silence(self) -> bool {
        matches!(self.0, 0x01 | 0x21 | 0x24 | 0x25)
    }
}

impl fmt::Display for DeliveryStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self.0 {
            0x00 => "delivered",
            0x01 => "no acknowledgement from the next radio",
            0x02 => "the channel was not free",
            0x03 => "purged before it was sent",
            0x15 => "invalid destination endpoint",
            0x21 => "no acknowledgement from the network",
            0x22 => "not joined to a network",
            0x23 => "addressed to itself",
            0x24 => "no such address",
            0x25 => "no route",
            0x2C => "invalid request",
            0x31 => "internal error",
            0x32 => "the radio lacks resources",
            0x74 => "the payload is too long",
            other => return write!(f, "delivery status {other:#04x}"),
        };
        f.write_str(text)
    }
}

/// The status of a packet that was sent with an 802.15.4 firmware: frame 89.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TransmitStatus(pub u8);

impl TransmitStatus {
    /// It was sent, and acknowledged where that was requested.
    pub const SUCCESS: Self = Self(0);
    /// No acknowledgement came.
    pub const NO_ACK: Self = Self(1);

    /// Returns true if nobody at that address answers.
    #[must_use]
    pub fn is_silence(self) -> bool {
        matches!(self.0, 0x01 | 0x21)
    }
}

impl fmt::Display for TransmitStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self.0 {
            0x00 => "sent",
            0x01 => "no acknowledgement",
            0x02 => "the channel was not free",
            0x03 => "purged before it was sent",
            0x21 => "no acknowledgement from the network",
            0x22 => "not joined to a network",
            0x31 => "internal error",
            0x32 => "the radio lacks resources",
            0x74 => "the payload is too long",
            other => return write!(f, "transmit status {other:#04x}"),
        };
        f.write_str(text)
    }
}

/// An event of the radio itself: frame 8A.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ModemStatus(pub u8);

impl ModemStatus {
    /// It was switched on.
    pub const HARDWARE_RESET: Self = Self(0);
    /// Its watchdog bit.
    pub const WATCHDOG_RESET: Self = Self(1);

    /// Returns true if the radio has just started.
    #[must_use]
    pub fn is_reset(self) -> bool {
        self == Self::HARDWARE_RESET || self == Self::WATCHDOG_RESET
    }
}

impl fmt::Display for ModemStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self.0 {
            0x00 => "hardware reset",
            0x01 => "watchdog reset",
            0x02 => "joined a network",
            0x03 => "left its network",
            0x06 => "coordinator started",
            0x0D => "the supply's voltage is too high",
            other => return write!(f, "modem status {other:#04x}"),
        };
        f.write_str(text)
    }
}
