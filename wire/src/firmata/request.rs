use super::{
    FirmataError, Message, StepperRequest,
    error::at_most,
    message::{
        ANALOG_MAPPING_QUERY, CAPABILITY_QUERY, FIRMWARE, PIN_MODE, REPORT_DIGITAL, RESET, STEPPER,
        VERSION, sysex,
    },
};

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
        /// Its number.
        pin: u8,
        /// Its mode.
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
        /// Its number, from 0 to 9.
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
