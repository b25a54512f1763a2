/// State that the drone reports (Developer Guide, chapter 7): its state and, where they are in it,
/// the numbers of the `demo` and `magneto` options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArDroneNavdata {
    /// State of the drone.
    pub state: DroneState,
    /// Number of the datagram; one that is not above the last one is late.
    pub sequence: u32,
    /// The numbers of flight; absent after boot until they are requested.
    pub demo: Option<ArDroneDemo>,
}

/// Bits of the drone's state (`ARDRONE_STATES` of the SDK).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DroneState(pub u32);

impl DroneState {
    /// Returns true if the drone is off the ground.
    #[must_use]
    pub fn is_flying(self) -> bool {
        self.bit(0)
    }

    /// Returns true if the drone acknowledges a configuration.
    #[must_use]
    pub fn acknowledges(self) -> bool {
        self.bit(6)
    }

    /// Returns true if the drone has not been configured since it was switched on: the `demo`
    /// option is missing.
    #[must_use]
    pub fn is_in_bootstrap(self) -> bool {
        self.bit(11)
    }

    /// Returns true if the battery is nearly empty.
    #[must_use]
    pub fn is_battery_low(self) -> bool {
        self.bit(15)
    }

    /// Returns true if the drone has received nothing for a while.
    #[must_use]
    pub fn is_watchdog_set(self) -> bool {
        self.bit(30)
    }

    /// Returns true if the motors were stopped in an emergency.
    #[must_use]
    pub fn is_emergency(self) -> bool {
        self.bit(31)
    }

    fn bit(self, bit: u32) -> bool {
        self.0 >> bit & 1 == 1
    }
}

/// The state of a drone's flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FlightState {
    /// The state is not reported, or has a number without a name.
    Unknown,
    /// On the ground.
    Landed,
    /// In the air, under orders or hovering.
    Flying,
    /// Climbing after the order to.
    TakingOff,
    /// Sinking after the order to.
    Landing,
}

/// The numbers of a drone's flight: navdata's option `demo`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArDroneDemo {
    /// The state of its flight.
    pub flight: FlightState,
    /// Charge of the battery, in percent.
    pub battery_percent: u32,
    /// Angle of the nose above the horizon, in radians.
    pub pitch: f64,
    /// Angle of the right side below the left, in radians.
    pub roll: f64,
    /// Angle of the nose clockwise from its direction at power-up, in radians.
    pub yaw: f64,
    /// Height above the ground, in metres.
    pub altitude_m: f64,
    /// Speed forward, in metres per second.
    pub forward_mps: f64,
    /// Speed to the right, in metres per second.
    pub right_mps: f64,
}

/// Reason for refusing a datagram of navdata.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ArDroneNavdataError {
    /// It does not begin as navdata do.
    #[error("navdata must begin with 0x55667788, but begin with {header:#010x}")]
    Header {
        /// First four bytes of the datagram.
        header: u32,
    },
    /// An option is longer than the datagram, or shorter than its own head.
    #[error("the option {tag} has {length} bytes, of which {left} are there")]
    Option {
        /// Tag of the option.
        tag: u16,
        /// Declared length of the option in bytes.
        length: u16,
        /// Number of bytes left in the datagram.
        left: usize,
    },
    /// The datagram ends in the middle.
    #[error("navdata of {length} bytes end before their checksum")]
    Cut {
        /// Length of the datagram.
        length: usize,
    },
    /// The checksum is another one.
    #[error("the checksum is {declared:#x}, and the bytes make {computed:#x}")]
    Checksum {
        /// The declared checksum.
        declared: u32,
        /// The sum of the bytes.
        computed: u32,
    },
}

const HEADER: u32 = 0x5566_7788;
const DEMO: u16 = 0;
const CHECKSUM: u16 = 0xFFFF;

/// Length of the head and of the `demo` option that we write, which is the SDK's.
const HEAD: usize = 16;
const DEMO_LENGTH: u16 = 148;

impl ArDroneNavdata {
    /// Reads a datagram.
    ///
    /// # Errors
    ///
    /// [`ArDroneNavdataError`] names what is wrong with it.
    pub fn parse(datagram: &[u8]) -> Result<Self, ArDroneNavdataError> {
        let length = datagram.len();
        let cut = ArDroneNavdataError::Cut { length };
        let header = word(datagram, 0).ok_or(cut)?;
        if header != HEADER {
            return Err(ArDroneNavdataError::Header { header });
        }
        let (state, sequence) = word(datagram, 4).zip(word(datagram, 8)).ok_or(cut)?;
        let mut navdata = Self { state: DroneState(state), sequence, demo: None };
        let mut rest = datagram.get(HEAD..).ok_or(cut)?;
        loop {
            let (tag, size) = half(rest, 0).zip(half(rest, 2)).ok_or(cut)?;
            let wrong = ArDroneNavdataError::Option { tag, length: size, left: rest.len() };
            let (body, next) = rest.split_at_checked(usize::from(size)).ok_or(wrong)?;
            let body = body.get(4..).ok_or(wrong)?;
            match tag {
                DEMO => navdata.demo = Some(ArDroneDemo::parse(body).ok_or(wrong)?),
                CHECKSUM => {
                    let declared = word(body, 0).ok_or(wrong)?;
                    let covered = datagram.get(..length - rest.len()).ok_or(cut)?;
                    let computed = sum(covered);
                    if declared != computed {
                        return Err(ArDroneNavdataError::Checksum { declared, computed });
                    }
                    return Ok(navdata);
                }
                _ => {}
            }
            rest = next;
        }
    }

    /// The datagram that holds this.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for number in [HEADER, self.state.0, self.sequence, 0] {
            bytes.extend(number.to_le_bytes());
        }
        if let Some(demo) = &self.demo {
            bytes.extend(DEMO.to_le_bytes());
            bytes.extend(DEMO_LENGTH.to_le_bytes());
            let end = bytes.len() + usize::from(DEMO_LENGTH) - 4;
            demo.encode(&mut bytes);
            bytes.resize(end, 0);
        }
        let computed = sum(&bytes);
        bytes.extend(CHECKSUM.to_le_bytes());
        bytes.extend(8_u16.to_le_bytes());
        bytes.extend(computed.to_le_bytes());
        bytes
    }
}

/// Codes of the flight states, in the upper half of the state.
const FLIGHT_STATES: [(u32, FlightState); 7] = [
    (2, FlightState::Landed),
    (3, FlightState::Flying),
    (4, FlightState::Flying),
    (6, FlightState::TakingOff),
    (7, FlightState::Flying),
    (8, FlightState::Landing),
    (9, FlightState::Flying),
];

impl ArDroneDemo {
    /// State, battery, pitch, roll and yaw in thousandths of a degree, altitude in millimetres, and
    /// the speeds in millimetres per second.
    fn parse(body: &[u8]) -> Option<Self> {
        let number = |at| Some(f64::from(f32::from_bits(word(body, at)?)));
        let angle = |at| Some((number(at)? * 1e-3).to_radians());
        let flight = word(body, 0)? >> 16;
        let flight = FLIGHT_STATES.iter().find(|(known, _)| *known == flight);
        let demo = Self {
            flight: flight.map_or(FlightState::Unknown, |(_, flight)| *flight),
            battery_percent: word(body, 4)?,
            pitch: angle(8)?,
            roll: angle(12)?,
            yaw: angle(16)?,
            altitude_m: f64::from(word(body, 20)?.cast_signed()) * 1e-3,
            forward_mps: number(24)? * 1e-3,
            right_mps: number(28)? * 1e-3,
        };
        let Self { pitch, roll, yaw, forward_mps, right_mps, .. } = demo;
        let finite = [pitch, roll, yaw, forward_mps, right_mps].iter().all(|n| n.is_finite());
        finite.then_some(demo)
    }

    fn encode(&self, bytes: &mut Vec<u8>) {
        let flight = FLIGHT_STATES.iter().find(|(_, known)| *known == self.flight);
        bytes.extend((flight.map_or(0, |(number, _)| *number) << 16).to_le_bytes());
        bytes.extend(self.battery_percent.to_le_bytes());
        #[expect(clippy::cast_possible_truncation, reason = "they have no more digits")]
        let mut number = |value: f64| bytes.extend((value as f32).to_bits().to_le_bytes());
        number(self.pitch.to_degrees() * 1e3);
        number(self.roll.to_degrees() * 1e3);
        number(self.yaw.to_degrees() * 1e3);
        #[expect(clippy::cast_possible_truncation, reason = "it saturates")]
        let altitude = (self.altitude_m * 1e3).round() as i32;
        bytes.extend(altitude.to_le_bytes());
        #[expect(clippy::cast_possible_truncation, reason = "they have no more digits")]
        for speed in [self.forward_mps, self.right_mps, 0.0].map(|speed| (speed * 1e3) as f32) {
            bytes.extend(speed.to_bits().to_le_bytes());
        }
    }
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let bytes = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(bytes.try_into().ok()?))
}

fn half(bytes: &[u8], at: usize) -> Option<u16> {
    let bytes = bytes.get(at..at.checked_add(2)?)?;
    Some(u16::from_le_bytes(bytes.try_into().ok()?))
}

fn sum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |sum: u32, byte| sum.wrapping_add(u32::from(*byte)))
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use proptest::prelude::*;

    use super::*;

    fn flying() -> ArDroneNavdata {
        let demo = ArDroneDemo {
            flight: FlightState::Flying,
            battery_percent: 71,
            pitch: 0.1,
            roll: -0.2,
            yaw: 1.5,
            altitude_m: 1.25,
            forward_mps: 0.5,
            right_mps: -0.25,
        };
        ArDroneNavdata { state: DroneState(0x0000_0001), sequence: 77, demo: Some(demo) }
    }

    #[test]
    fn bytes_of_the_sdk_are_read() {
        // Head, a demo option of 148 bytes, an unknown option, the checksum.
        let mut bytes = vec![0x88, 0x77, 0x66, 0x55, 1, 8, 0, 0xC0, 5, 0, 0, 0, 0, 0, 0, 0];
        let begin = bytes.len();
        bytes.extend([0, 0, 148, 0]);
        bytes.extend(0x0004_0000_u32.to_le_bytes());
        bytes.extend(55_u32.to_le_bytes());
        for angle in [-1000.0_f32, 2000.0, 90_000.0] {
            bytes.extend(angle.to_le_bytes());
        }
        bytes.extend(850_i32.to_le_bytes());
        for speed in [120.0_f32, -30.0, 0.0] {
            bytes.extend(speed.to_le_bytes());
        }
        bytes.resize(begin + 148, 0);
        bytes.extend([19, 0, 8, 0, 1, 2, 3, 4]);
        let computed = sum(&bytes);
        bytes.extend([0xFF, 0xFF, 8, 0]);
        bytes.extend(computed.to_le_bytes());
        let navdata = ArDroneNavdata::parse(&bytes).expect("navdata");
        let state = navdata.state;
        assert!(state.is_flying() && state.is_in_bootstrap());
        assert!(state.is_emergency() && state.is_watchdog_set() && !state.is_battery_low());
        let demo = navdata.demo.expect("a demo option");
        assert_eq!((demo.flight, demo.battery_percent), (FlightState::Flying, 55));
        assert_abs_diff_eq!(demo.pitch + 1_f64.to_radians(), 0.0, epsilon = 1e-9);
        assert_abs_diff_eq!(demo.roll, 2_f64.to_radians(), epsilon = 1e-9);
        assert_abs_diff_eq!(demo.yaw, 90_f64.to_radians(), epsilon = 1e-9);
        assert_abs_diff_eq!(demo.altitude_m, 0.85, epsilon = 1e-12);
        assert_abs_diff_eq!(demo.forward_mps, 0.12, epsilon = 1e-6);
        assert_abs_diff_eq!(demo.right_mps, -0.03, epsilon = 1e-6);
        bytes[30] ^= 1;
        let error = ArDroneNavdata::parse(&bytes).expect_err("a changed byte");
        assert!(matches!(error, ArDroneNavdataError::Checksum { .. }), "{error}");
    }

    #[test]
    fn every_cut_is_refused() {
        let bytes = flying().encode();
        let back = ArDroneNavdata::parse(&bytes).expect("navdata").demo.expect("a demo option");
        assert_abs_diff_eq!(back.yaw, 1.5, epsilon = 1e-6);
        assert_abs_diff_eq!(back.altitude_m, 1.25, epsilon = 1e-9);
        for end in 0..bytes.len() {
            assert!(ArDroneNavdata::parse(&bytes[..end]).is_err(), "{end} bytes");
        }
    }

    proptest! {
        #[test]
        fn no_bytes_are_too_much(
            mut bytes in prop::collection::vec(any::<u8>(), 0..400),
            headed in any::<bool>(),
        ) {
            if headed {
                bytes.splice(..bytes.len().min(4), [0x88, 0x77, 0x66, 0x55]);
            }
            let _ = ArDroneNavdata::parse(&bytes);
        }

        #[test]
        fn what_is_written_is_read(
            state in any::<u32>(), sequence in any::<u32>(), battery in 0u32..101,
            yaw in -3.0..3.0f64, altitude_mm in -1000i32..20_000, speed in -5.0..5.0f64,
        ) {
            let mut declared = flying();
            (declared.state, declared.sequence) = (DroneState(state), sequence);
            let demo = declared.demo.as_mut().expect("a demo option");
            (demo.battery_percent, demo.yaw, demo.forward_mps) = (battery, yaw, speed);
            demo.altitude_m = f64::from(altitude_mm) * 1e-3;
            let back = ArDroneNavdata::parse(&declared.encode()).expect("our own");
            prop_assert_eq!((back.state, back.sequence), (declared.state, declared.sequence));
            let back = back.demo.expect("demo");
            let declared = declared.demo.expect("demo");
            prop_assert_eq!(back.battery_percent, battery);
            prop_assert!((back.yaw - yaw).abs() < 1e-5 && (back.forward_mps - speed).abs() < 1e-5);
            prop_assert!((back.altitude_m - declared.altitude_m).abs() < 1e-9);
        }
    }
}
