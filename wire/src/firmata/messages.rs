//! Requests of a host and replies of a device, as bytes and back.

use super::{
    ANALOG_MAPPING, ANALOG_MAPPING_QUERY, CAPABILITIES, CAPABILITY_QUERY, DIGITAL, DONE, FIRMWARE,
    FirmataError, Message, PIN_MODE, PIN_STATE, REPORT, REPORT_DIGITAL, RESET, STEPPER,
    StepperRequest, TEXT, VERSION, at_most, decode_i32, decode_text, encode_i32, encode_text,
    sysex,
};

/// Byte that stands for nothing in lists of pins.
const NONE: u8 = 0x7F;

/// A message from a host to a Firmata device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Request {
    /// Requests the version of the protocol.
    Version,
    /// Requests the firmware's name and version.
    Firmware,
    /// Requests the capabilities of each pin.
    Capabilities,
    /// Requests the analog input of each pin.
    AnalogMapping,
    /// Sets the mode of a pin.
    PinMode {
        /// Number of the pin.
        pin: u8,
        /// Mode of the pin.
        mode: PinMode,
    },
    /// Switches reports of the levels of a port of eight pins, which come at once and on every
    /// change.
    ReportDigital {
        /// The port: pins 8 · port to 8 · port + 7.
        port: u8,
        /// True to switch them on.
        on: bool,
    },
    /// Resets the device as after switching on.
    Reset,
    /// Something of a stepper.
    Stepper {
        /// Number of the stepper, from 0 to 9.
        device: u8,
        /// The request to it.
        request: StepperRequest,
    },
}

/// The mode of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[repr(u8)]
pub enum PinMode {
    /// A digital input.
    Input = 0x00,
    /// A digital output.
    Output = 0x01,
    /// An analog input.
    Analog = 0x02,
    /// A coil of a stepper.
    Stepper = 0x08,
    /// A digital input that is high where nothing is connected.
    PullUp = 0x0B,
}

impl PinMode {
    fn from_code(code: u8) -> Option<Self> {
        [Self::Input, Self::Output, Self::Analog, Self::Stepper, Self::PullUp]
            .into_iter()
            .find(|mode| mode.code() == code)
    }

    /// The number that stands for it.
    #[must_use]
    pub fn code(self) -> u8 {
        self as u8
    }
}

impl Message for Request {
    fn data_length(status: u8) -> Option<usize> {
        match status {
            VERSION | RESET => Some(0),
            PIN_MODE => Some(2),
            _ if status & 0xF0 == REPORT_DIGITAL => Some(1),
            _ => None,
        }
    }

    fn from_short(status: u8, [first, second]: [u8; 2]) -> Option<Self> {
        match status {
            VERSION => Some(Self::Version),
            RESET => Some(Self::Reset),
            PIN_MODE => Some(Self::PinMode { pin: first, mode: PinMode::from_code(second)? }),
            _ if status & 0xF0 == REPORT_DIGITAL => {
                Some(Self::ReportDigital { port: status & 0x0F, on: first != 0 })
            }
            _ => None,
        }
    }

    fn from_sysex(payload: &[u8]) -> Option<Self> {
        match payload {
            [FIRMWARE] => Some(Self::Firmware),
            [CAPABILITY_QUERY] => Some(Self::Capabilities),
            [ANALOG_MAPPING_QUERY] => Some(Self::AnalogMapping),
            [STEPPER, rest @ ..] => {
                let (device, request) = StepperRequest::decode(rest)?;
                Some(Self::Stepper { device, request })
            }
            _ => None,
        }
    }

    fn encode(&self, into: &mut Vec<u8>) -> Result<(), FirmataError> {
        match self {
            Self::Version => into.push(VERSION),
            Self::Reset => into.push(RESET),
            Self::Firmware => sysex(&[FIRMWARE], into),
            Self::Capabilities => sysex(&[CAPABILITY_QUERY], into),
            Self::AnalogMapping => sysex(&[ANALOG_MAPPING_QUERY], into),
            Self::PinMode { pin, mode } => {
                into.extend([PIN_MODE, at_most("pin", *pin, 0x7F)?, mode.code()]);
            }
            Self::ReportDigital { port, on } => {
                into.extend([REPORT_DIGITAL | at_most("port", *port, 0x0F)?, (*on).into()]);
            }
            Self::Stepper { device, request } => sysex(&request.payload(*device)?, into),
        }
        Ok(())
    }
}

/// A message from a Firmata device to its host.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reply {
    /// The version of the protocol. A device that was reset sends it by itself, and its firmware
    /// next.
    Version {
        /// The first number.
        major: u8,
        /// The second number.
        minor: u8,
    },
    /// The firmware.
    Firmware {
        /// The first number of its version.
        major: u8,
        /// The second number of its version.
        minor: u8,
        /// The firmware's name.
        name: String,
    },
    /// Something to be read by people.
    Text(String),
    /// Capabilities of each pin, from pin 0 on.
    Capabilities(Vec<Vec<PinCapability>>),
    /// Analog input of each pin, from pin 0 on.
    AnalogMapping(Vec<Option<u8>>),
    /// The mode of a pin, and what was last written to it.
    PinState {
        /// Number of the pin.
        pin: u8,
        /// The code of a [`PinMode`](super::PinMode), or of one that is not listed there.
        mode: u8,
        /// The lowest seven bits; longer ones are not read.
        state: u8,
    },
    /// The levels of a port of eight pins.
    Digital {
        /// The port: pins 8 · port to 8 · port + 7.
        port: u8,
        /// Bit by bit.
        levels: u8,
    },
    /// A stepper's position, in steps.
    Position {
        /// Number of the stepper.
        device: u8,
        /// Position of the stepper, in steps.
        position: i32,
    },
    /// A stepper's move is complete.
    Done {
        /// Number of the stepper.
        device: u8,
        /// Position of the stepper, in steps.
        position: i32,
    },
}

/// Something that a pin can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PinCapability {
    /// The code of a [`PinMode`](super::PinMode), or of one that is not listed there.
    pub mode: u8,
    /// Number of bits.
    pub resolution: u8,
}

impl Message for Reply {
    fn data_length(status: u8) -> Option<usize> {
        (status == VERSION || status & 0xF0 == DIGITAL).then_some(2)
    }

    fn from_short(status: u8, [first, second]: [u8; 2]) -> Option<Self> {
        if status == VERSION {
            return Some(Self::Version { major: first, minor: second });
        }
        // The bits above the eighth are no pins.
        let levels = first | (second & 1) << 7;
        (status & 0xF0 == DIGITAL).then_some(Self::Digital { port: status & 0x0F, levels })
    }

    fn from_sysex(payload: &[u8]) -> Option<Self> {
        match payload {
            [FIRMWARE, major, minor, name @ ..] => {
                let major = *major;
                let minor = *minor;
                Some(Self::Firmware { major, minor, name: decode_text(name)? })
            }
            [TEXT, text @ ..] => Some(Self::Text(decode_text(text)?)),
            [CAPABILITIES, pins @ ..] => capabilities(pins).map(Self::Capabilities),
            [ANALOG_MAPPING, channels @ ..] => {
                let channel = |code: &u8| (*code != NONE).then_some(*code);
                Some(Self::AnalogMapping(channels.iter().map(channel).collect()))
            }
            [PIN_STATE, pin, mode, state] => {
                Some(Self::PinState { pin: *pin, mode: *mode, state: *state })
            }
            [STEPPER, kind, device, position @ ..] => {
                let device = *device;
                let position = decode_i32(position.try_into().ok()?)?;
                match *kind {
                    REPORT => Some(Self::Position { device, position }),
                    DONE => Some(Self::Done { device, position }),
                    _ => None,
                }
            }
            _ => None,
        }
    }

    fn encode(&self, into: &mut Vec<u8>) -> Result<(), FirmataError> {
        let mut payload = Vec::new();
        match self {
            Self::Version { major, minor } => {
                let (major, minor) =
                    (at_most("major", *major, 0x7F)?, at_most("minor", *minor, 0x7F)?);
                into.extend([VERSION, major, minor]);
                return Ok(());
            }
            Self::Digital { port, levels } => {
                into.extend([DIGITAL | at_most("port", *port, 0x0F)?, levels & 0x7F, levels >> 7]);
                return Ok(());
            }
            Self::Firmware { major, minor, name } => {
                payload.push(FIRMWARE);
                payload.push(at_most("major", *major, 0x7F)?);
                payload.push(at_most("minor", *minor, 0x7F)?);
                encode_text(name, &mut payload);
            }
            Self::Text(text) => {
                payload.push(TEXT);
                encode_text(text, &mut payload);
            }
            Self::Capabilities(pins) => {
                payload.push(CAPABILITIES);
                for pin in pins {
                    for capability in pin {
                        payload.push(at_most("mode", capability.mode, NONE - 1)?);
                        payload.push(at_most("resolution", capability.resolution, 0x7F)?);
                    }
                    payload.push(NONE);
                }
            }
            Self::AnalogMapping(channels) => {
                payload.push(ANALOG_MAPPING);
                for channel in channels {
                    let code = channel.map_or(Ok(NONE), |code| at_most("channel", code, NONE - 1));
                    payload.push(code?);
                }
            }
            Self::PinState { pin, mode, state } => {
                payload.extend([PIN_STATE, at_most("pin", *pin, 0x7F)?]);
                payload.extend([at_most("mode", *mode, 0x7F)?, at_most("state", *state, 0x7F)?]);
            }
            Self::Position { device, position } => {
                payload.extend([STEPPER, REPORT, at_most("device", *device, 0x7F)?]);
                payload.extend(encode_i32("position", *position)?);
            }
            Self::Done { device, position } => {
                payload.extend([STEPPER, DONE, at_most("device", *device, 0x7F)?]);
                payload.extend(encode_i32("position", *position)?);
            }
        }
        sysex(&payload, into);
        Ok(())
    }
}

/// Reads the capabilities of each pin, each ended by 7F.
fn capabilities(mut bytes: &[u8]) -> Option<Vec<Vec<PinCapability>>> {
    let mut pins = Vec::new();
    let mut pin = Vec::new();
    loop {
        match bytes {
            [] => return pin.is_empty().then_some(pins),
            [NONE, rest @ ..] => {
                pins.push(std::mem::take(&mut pin));
                bytes = rest;
            }
            [mode, resolution, rest @ ..] => {
                pin.push(PinCapability { mode: *mode, resolution: *resolution });
                bytes = rest;
            }
            [_] => return None,
        }
    }
}
