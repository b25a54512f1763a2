//! The protocol of rtl_tcp, and the power of its samples in a narrow band.

use core::f64::consts::TAU;

/// Header that a server of rtl_tcp sends first: 12 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RtlTcpHeader {
    /// The kind of tuner; 5 is an R820T.
    pub tuner: u32,
    /// Number of steps of its gain.
    pub gains: u32,
}

/// Error of a server whose first bytes are no header of rtl_tcp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the server sends {found:02X?} first; rtl_tcp sends \"RTL0\"")]
pub struct RtlTcpError {
    found: [u8; 4],
}

impl RtlTcpHeader {
    /// Length of the header in bytes.
    pub const LENGTH: usize = 12;

    /// Returns the bytes of the header.
    #[must_use]
    pub fn encode(&self) -> [u8; Self::LENGTH] {
        let [a, b, c, d] = self.tuner.to_be_bytes();
        let [e, f, g, h] = self.gains.to_be_bytes();
        [b'R', b'T', b'L', b'0', a, b, c, d, e, f, g, h]
    }

    /// The header that these bytes are.
    ///
    /// # Errors
    ///
    /// [`RtlTcpError`] if it begins otherwise.
    pub fn decode(bytes: [u8; Self::LENGTH]) -> Result<Self, RtlTcpError> {
        let [r, t, l, zero, a, b, c, d, e, f, g, h] = bytes;
        let found = [r, t, l, zero];
        if found != *b"RTL0" {
            return Err(RtlTcpError { found });
        }
        let tuner = u32::from_be_bytes([a, b, c, d]);
        let gains = u32::from_be_bytes([e, f, g, h]);
        Ok(Self { tuner, gains })
    }
}

/// A command of a client of rtl_tcp: a number, and a value of 32 bits, big endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RtlTcpCommand {
    /// 01: the frequency in the middle, in Hz.
    Frequency(u32),
    /// 02: samples per second.
    SampleRate(u32),
    /// 03: the gain is set by hand; otherwise by the tuner.
    ManualGain(bool),
    /// 04: the gain, in tenths of a dB.
    Gain(i32),
    /// 05: the correction of the oscillator, in parts per million.
    Correction(i32),
    /// 08: the digital gain control of the converter.
    DigitalGain(bool),
    /// Any other.
    Other(u8, u32),
}

impl RtlTcpCommand {
    /// Length of a command in bytes.
    pub const LENGTH: usize = 5;

    /// Returns the bytes of the command.
    #[must_use]
    pub fn encode(self) -> [u8; Self::LENGTH] {
        let (number, value) = match self {
            Self::Frequency(hz) => (1, hz.to_be_bytes()),
            Self::SampleRate(hz) => (2, hz.to_be_bytes()),
            Self::ManualGain(on) => (3, u32::from(on).to_be_bytes()),
            Self::Gain(tenths) => (4, tenths.to_be_bytes()),
            Self::Correction(ppm) => (5, ppm.to_be_bytes()),
            Self::DigitalGain(on) => (8, u32::from(on).to_be_bytes()),
            Self::Other(number, value) => (number, value.to_be_bytes()),
        };
        let [a, b, c, d] = value;
        [number, a, b, c, d]
    }

    /// The command that these bytes are.
    #[must_use]
    pub fn decode(bytes: [u8; Self::LENGTH]) -> Self {
        let [number, value @ ..] = bytes;
        let unsigned = u32::from_be_bytes(value);
        let signed = i32::from_be_bytes(value);
        match number {
            1 => Self::Frequency(unsigned),
            2 => Self::SampleRate(unsigned),
            3 => Self::ManualGain(unsigned != 0),
            4 => Self::Gain(signed),
            5 => Self::Correction(signed),
            8 => Self::DigitalGain(unsigned != 0),
            _ => Self::Other(number, unsigned),
        }
    }
}

/// The power in a narrow band of samples as an RTL-SDR gives them: I, then Q, a byte each, 127.5
/// for zero.
///
/// One frequency is wanted, so there is no spectrum: samples are turned back by it and averaged
/// over blocks of rate / bandwidth samples, which is one term of a Fourier transform (Goertzel
/// 1958). A block's noise bandwidth is its inverse length. A tone at full scale has 0 dBFS.
#[derive(Clone, Debug)]
pub struct NarrowBand {
    /// The frequency over the rate, in turns per sample.
    step: f64,
    /// Samples in a block.
    block: u32,
    /// Phase of the next sample, in turns.
    phase: f64,
    sum: [f64; 2],
    taken: u32,
    /// An I whose Q has not come.
    odd: Option<u8>,
}

impl NarrowBand {
    /// A band `bandwidth_hz` wide, `offset_hz` above the frequency in the middle.
    ///
    /// `None` if one of the numbers is not finite, the bandwidth is not above 0 and at most the
    /// rate, or the offset is beyond half the rate.
    #[must_use]
    pub fn new(rate_hz: f64, offset_hz: f64, bandwidth_hz: f64) -> Option<Self> {
        let good = rate_hz.is_finite()
            && bandwidth_hz > 0.0
            && bandwidth_hz <= rate_hz
            && offset_hz.abs() <= rate_hz / 2.0;
        let block = (rate_hz / bandwidth_hz).round();
        if !good || !(1.0..=1e9).contains(&block) {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 1e9")]
        let block = block as u32;
        let step = offset_hz / rate_hz;
        Some(Self { step, block, phase: 0.0, sum: [0.0; 2], taken: 0, odd: None })
    }

    /// Number of samples in a block.
    #[must_use]
    pub fn block(&self) -> u32 {
        self.block
    }

    /// Takes bytes, however they are divided; emits the power of every block that is complete, over
    /// that of a tone at full scale.
    pub fn push(&mut self, bytes: &[u8], mut emit: impl FnMut(f64)) {
        for byte in bytes {
            let Some(i) = self.odd.take() else {
                self.odd = Some(*byte);
                continue;
            };
            if let Some(power) = self.sample(i, *byte) {
                emit(power);
            }
        }
    }

    fn sample(&mut self, i: u8, q: u8) -> Option<f64> {
        let [i, q] = [i, q].map(|byte| (f64::from(byte) - 127.5) / 127.5);
        let (sin, cos) = libm::sincos(self.phase * TAU);
        self.sum[0] += i * cos + q * sin;
        self.sum[1] += q * cos - i * sin;
        self.phase = (self.phase + self.step).fract();
        self.taken += 1;
        if self.taken < self.block {
            return None;
        }
        let [i, q] = self.sum.map(|sum| sum / f64::from(self.block));
        (self.sum, self.taken) = ([0.0; 2], 0);
        Some(i * i + q * q)
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_bytes_are_those_of_the_original() {
        let header = RtlTcpHeader { tuner: 5, gains: 29 };
        assert_eq!(header.encode(), *b"RTL0\0\0\0\x05\0\0\0\x1d");
        assert_eq!(RtlTcpHeader::decode(header.encode()), Ok(header));
        let error = RtlTcpHeader::decode(*b"HTTP/1.1 400").expect_err("it is none");
        assert!(error.to_string().contains("48, 54"), "{error}");
        assert_eq!(RtlTcpCommand::Frequency(433_920_000).encode(), [1, 0x19, 0xDD, 0x18, 0]);
        assert_eq!(RtlTcpCommand::Gain(-10).encode(), [4, 0xFF, 0xFF, 0xFF, 0xF6]);
    }

    proptest! {
        #[test]
        fn commands_come_back(bytes: [u8; 5]) {
            let command = RtlTcpCommand::decode(bytes);
            prop_assert_eq!(RtlTcpCommand::decode(command.encode()), command);
        }
    }

    /// A tone's bytes.
    fn tone(rate: f64, hz: f64, amplitude: f64, samples: u32) -> Vec<u8> {
        (0..samples)
            .flat_map(|n| {
                let angle = TAU * hz / rate * f64::from(n);
                [angle.cos(), angle.sin()].map(|part| {
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "0 to 255"
                    )]
                    let byte = (127.5 + 127.5 * amplitude * part).round() as u8;
                    byte
                })
            })
            .collect()
    }

    fn powers(band: &NarrowBand, bytes: &[u8], chunk: usize) -> Vec<f64> {
        let mut band = band.clone();
        let mut levels = Vec::new();
        for some in bytes.chunks(chunk) {
            band.push(some, |power| levels.push(10.0 * power.log10()));
        }
        levels
    }

    #[test]
    fn a_tone_has_its_power_in_its_band_and_none_beside() {
        let band = NarrowBand::new(250e3, 30e3, 2e3).expect("it is in order");
        assert_eq!(band.block(), 125);
        for amplitude in [0.9, 0.1_f64] {
            let bytes = tone(250e3, 30e3, amplitude, 2500);
            let levels = powers(&band, &bytes, 5000);
            assert_eq!(levels.len(), 20);
            assert_eq!(levels, powers(&band, &bytes, 77), "division does not matter");
            for power in levels {
                // Rounding to bytes costs less than 0.1 dB here.
                assert_abs_diff_eq!(power, 20.0 * amplitude.log10(), epsilon = 0.1);
            }
        }
        // Four and a half bandwidths aside: the side lobe is 1/(4.5 pi) = -23 dB.
        let beside = powers(&band, &tone(250e3, 39e3, 0.9, 2500), 5000);
        assert!(beside.iter().all(|power| *power < -20.0), "{beside:?}");
    }

    #[test]
    fn bands_that_there_are_not_are_refused() {
        for (rate, offset, width) in
            [(250e3, 130e3, 1e3), (250e3, 0.0, 0.0), (250e3, 0.0, 300e3), (f64::NAN, 0.0, 1.0)]
        {
            assert!(NarrowBand::new(rate, offset, width).is_none());
        }
    }
}
