use foxhunt_sensors::Antenna;

/// The antenna that a signal comes in through.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Port<'a> {
    /// The antenna of the channel.
    Directional,
    /// An antenna with the same gain in all directions, the mean of that of the channel.
    Omnidirectional,
    /// A user's own.
    Own(&'a dyn Antenna),
}

impl Port<'_> {
    /// Returns the port if its antenna is one of the channel's own.
    pub(super) fn of_the_channel(self) -> Option<Port<'static>> {
        match self {
            Self::Directional => Some(Port::Directional),
            Self::Omnidirectional => Some(Port::Omnidirectional),
            Self::Own(_) => None,
        }
    }

    /// Returns true if both are the same antenna of the channel.
    pub(super) fn is_same(self, other: Port<'_>) -> bool {
        use Port::{Directional, Omnidirectional};
        matches!((self, other), (Directional, Directional) | (Omnidirectional, Omnidirectional))
    }
}
