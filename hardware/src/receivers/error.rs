use std::io;

use foxhunt_signal::detector::DetectorError;
use foxhunt_wire::receivers::{HttpError, RtlTcpError};

/// Error of an RTL-SDR behind rtl_tcp: why it measures no power. The call may be repeated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RtlTcpRadioError {
    /// The connection failed.
    #[error("rtl_tcp: {0}")]
    Stream(#[source] io::Error),
    /// The server is another one.
    #[error("rtl_tcp: {0}")]
    Server(#[source] RtlTcpError),
    /// It sends nothing.
    #[error(
        "rtl_tcp has sent nothing for {seconds:.1} s: it serves one client at a time, and stops \
         when its receiver is unplugged"
    )]
    Silent {
        /// For how long.
        seconds: f64,
    },
    /// Its samples cannot be searched for pulses.
    #[error("rtl_tcp: pulses: {0}")]
    Pulses(#[source] DetectorError),
    /// There is no such beacon.
    #[error("there is no frequency of beacon {beacon}; there are {beacons}, counted from 0")]
    Beacon {
        /// Requested beacon.
        beacon: u16,
        /// Number of beacons.
        beacons: usize,
    },
}

/// Error of a `KrakenSDR`: why it measures no bearings. It may be polled again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KrakenSourceError<V> {
    /// The connection failed.
    #[error("KrakenSDR: {0}")]
    Stream(#[source] io::Error),
    /// Its server does not send the page.
    #[error("KrakenSDR: {0}")]
    Http(#[source] HttpError),
    /// The page did not come in time.
    #[error("KrakenSDR: the page did not come in {seconds} s")]
    Timeout {
        /// The time that it had.
        seconds: f64,
    },
    /// The aircraft that carries the array failed.
    #[error("the vehicle failed: {0}")]
    Vehicle(#[source] V),
    /// There is no such beacon.
    #[error("there is no frequency of beacon {beacon}; there are {beacons}, counted from 0")]
    Beacon {
        /// Requested beacon.
        beacon: u16,
        /// Number of beacons.
        beacons: usize,
    },
}
