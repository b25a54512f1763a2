use std::io;

use foxhunt_wire::xbee::{Address, AtCommand, AtStatus, Protocol};

use super::XbeeQuestion;

/// Error of an XBee: why it does not do what is requested. The call may be repeated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum XbeeError {
    /// The port failed.
    #[error("the XBee's port: {0}")]
    Stream(#[source] io::Error),
    /// It sends nothing at all.
    #[error(
        "the XBee does not answer: check its power, the port and its speed (BD, which must be the \
         port's baud rate)"
    )]
    NotAnswering,
    /// It is not in an API mode.
    #[error(
        "the XBee's AP is {ap}, and it must be 1 or 2: set it with XCTU (API without or with \
         escapes), or with +++, ATAP 1, ATWR in a terminal"
    )]
    Mode {
        /// Its mode.
        ap: u8,
    },
    /// It refuses a question about itself.
    #[error("the XBee refuses {command}: {status}")]
    Refused {
        /// The refused command.
        command: AtCommand,
        /// Status that it returned.
        status: AtStatus,
    },
    /// Its firmware has no such query.
    #[error("an XBee with {protocol} firmware cannot be used with question {question:?}")]
    Question {
        /// Its firmware's protocol on the air.
        protocol: Protocol,
        /// The query.
        question: XbeeQuestion,
    },
    /// Its firmware knows no such addresses.
    #[error(
        "beacon address {address} is of 16 bits, which DigiMesh firmware does not have: use SH \
         and SL"
    )]
    Address {
        /// The beacon's address.
        address: Address,
    },
    /// There is no such beacon.
    #[error("there is no address of beacon {beacon}; there are {beacons}, counted from 0")]
    Beacon {
        /// Requested beacon.
        beacon: u16,
        /// Number of beacons.
        beacons: usize,
    },
    /// The question did not go out.
    #[error("the question to {address} did not go out: {reason}")]
    NotSent {
        /// To whom.
        address: Address,
        /// The radio's status.
        reason: String,
    },
    /// The beacon's radio does not report its `DB`.
    #[error("{address} refuses DB: {status}")]
    RemoteRefused {
        /// Address of the beacon's radio.
        address: Address,
        /// Status that it returned.
        status: AtStatus,
    },
}
