//! Protocols of other receivers: [`rtl_tcp`](RtlTcpHeader), `KrakenSDR`'s page of bearings
//! ([`KrakenDoa`]), and the RSSI of [`SiK`](sik_dbm) telemetry radios.

mod kraken;
mod rtl_tcp;

pub use kraken::{HttpError, HttpResponse, KrakenDoa, KrakenError};
pub use rtl_tcp::{NarrowBand, RtlTcpCommand, RtlTcpError, RtlTcpHeader};

/// A SiK telemetry radio's report of its link: the fields of MAVLink's `RADIO_STATUS` (109).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SikStatus {
    /// Power at which the other radio is received.
    pub rssi: u8,
    /// Power at which the other radio receives this one.
    pub remrssi: u8,
    /// The noise here.
    pub noise: u8,
    /// The noise at the other radio.
    pub remnoise: u8,
}

/// The power in dBm of a SiK radio's number: a step is 1/1.9 dB above −127 dBm (`SiLabs` Si1000,
/// as in `ArduPilot`'s documentation); `None` for 255, which stands for no reading.
#[must_use]
pub fn sik_dbm(number: u8) -> Option<f64> {
    (number < u8::MAX).then(|| f64::from(number) / 1.9 - 127.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn numbers_are_powers() {
        assert_abs_diff_eq!(sik_dbm(0).expect("a power"), -127.0, epsilon = 1e-12);
        assert_abs_diff_eq!(sik_dbm(190).expect("a power"), -27.0, epsilon = 1e-12);
        assert_eq!(sik_dbm(255), None);
    }
}
