use std::fmt;

/// Reason why a message is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Refusal {
    /// It is longer than any message is.
    Oversize,
    /// It is no message of a foxhunt node.
    Garbage,
    /// It is not signed, and this node has a key.
    Unsigned,
    /// It is signed, and this node has no key.
    Signed,
    /// It was signed with another key, or changed on its way.
    WrongKey,
    /// It came before.
    Replayed,
    /// It was sent to an earlier run of this node, or by an earlier run of its sender.
    Stale,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Oversize => "too long for a message",
            Self::Garbage => "no message of a foxhunt node",
            Self::Unsigned => "not signed; every node needs the key of the team",
            Self::Signed => "signed, and this node has no key",
            Self::WrongKey => "not signed with the key of this node",
            Self::Replayed => "came before",
            Self::Stale => "of an earlier run",
        })
    }
}
