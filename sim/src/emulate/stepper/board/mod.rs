//! The Arduino that drives the motor: its pins, and the parser of its firmware.

mod device;

pub use device::EmulatedStepper;

use foxhunt_wire::firmata::{PinCapability, PinMode};

/// Most bytes between F0 and F7.
const LONGEST: usize = 64;

/// D0 to D13, A0 to A5.
const COUNT: usize = 20;
const FIRST_ANALOG: u8 = 14;

/// D0 and D1 are the serial port.
const FIRST_DIGITAL: u8 = 2;
const INPUT: u8 = PinMode::Input as u8;
const OUTPUT: u8 = PinMode::Output as u8;
const ANALOG: u8 = PinMode::Analog as u8;
const STEPPER: u8 = PinMode::Stepper as u8;
const PULL_UP: u8 = PinMode::PullUp as u8;

/// Bytes from the host as ConfigurableFirmata takes them.
///
/// It looks at no length and no high bit within a system exclusive message: a short one is taken
/// with the bytes that the message before left in the same places, and one whose end was lost
/// goes on with the next.
#[derive(Clone, Debug)]
struct Parser {
    stored: [u8; LONGEST],
    length: usize,
    in_sysex: bool,
    status: u8,
    waiting: usize,
}

/// A message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Taken {
    Version,
    Reset,
    PinMode { pin: u8, mode: u8 },
    PinLevel { pin: u8, high: bool },
    Levels { port: u8, levels: u8 },
    ReportDigital { port: u8, on: bool },
    Sysex,
}

impl Default for Parser {
    fn default() -> Self {
        Self { stored: [0; LONGEST], length: 0, in_sysex: false, status: 0, waiting: 0 }
    }
}

impl Parser {
    /// Takes a byte; the message that it completes.
    fn push(&mut self, byte: u8) -> Option<Taken> {
        if byte == 0xFF {
            *self = Self::default();
            return Some(Taken::Reset);
        }
        if self.in_sysex {
            return self.within(byte);
        }
        if self.waiting > 0 && byte < 0x80 {
            self.waiting -= 1;
            self.stored[self.waiting] = byte;
            return if self.waiting == 0 { self.short() } else { None };
        }
        match byte {
            0xF0 => (self.in_sysex, self.length) = (true, 0),
            0xF9 => return Some(Taken::Version),
            0xF4 | 0xF5 | 0x90..=0x9F | 0xE0..=0xEF => (self.status, self.waiting) = (byte, 2),
            0xC0..=0xDF => (self.status, self.waiting) = (byte, 1),
            _ => {}
        }
        None
    }

    /// The command of a system exclusive message, its length without that, and all places behind
    /// it, whatever they hold.
    fn sysex(&self) -> (u8, usize, &[u8]) {
        (self.stored[0], self.length - 1, &self.stored[1..])
    }

    fn within(&mut self, byte: u8) -> Option<Taken> {
        if byte == 0xF7 {
            self.in_sysex = false;
            return (self.length > 0).then_some(Taken::Sysex);
        }
        if let Some(place) = self.stored.get_mut(self.length) {
            *place = byte;
            self.length += 1;
        } else {
            (self.in_sysex, self.length, self.waiting) = (false, 0, 0);
        }
        None
    }

    fn short(&mut self) -> Option<Taken> {
        // The bytes stand there in reverse.
        let [last, first] = [self.stored[0], self.stored[1]];
        let status = std::mem::take(&mut self.status);
        let port = status & 0x0F;
        match status {
            0xF4 => Some(Taken::PinMode { pin: first, mode: last }),
            0xF5 => Some(Taken::PinLevel { pin: first, high: last != 0 }),
            0x90..=0x9F => Some(Taken::Levels { port, levels: first | (last & 1) << 7 }),
            0xD0..=0xDF => Some(Taken::ReportDigital { port, on: last != 0 }),
            _ => None,
        }
    }
}

/// Pins of an Arduino Nano, as ConfigurableFirmata keeps them.
#[derive(Clone, Copy, Debug)]
struct Pins {
    pins: [Pin; COUNT],
}

#[derive(Clone, Copy, Debug, Default)]
struct Pin {
    mode: u8,
    state: u8,
    /// True if it drives its level; otherwise `high` is its pull-up.
    drives: bool,
    high: bool,
    /// True if its level is reported.
    reported: bool,
}

impl Pins {
    /// Pins as after a system reset.
    fn new() -> Self {
        let mut pins = Self { pins: [Pin::default(); COUNT] };
        for pin in 0..FIRST_ANALOG {
            pins.set_mode(pin, OUTPUT);
        }
        (FIRST_ANALOG..20).for_each(|pin| pins.set_mode(pin, ANALOG));
        pins
    }

    fn set_mode(&mut self, pin: u8, mode: u8) {
        let Some(of) = self.pins.get_mut(usize::from(pin)) else { return };
        (of.mode, of.state) = (mode, 0);
        if pin < FIRST_DIGITAL {
            return;
        }
        of.reported = matches!(mode, INPUT | PULL_UP);
        match mode {
            INPUT => (of.drives, of.high) = (false, false),
            PULL_UP => (of.drives, of.high, of.state) = (false, true, 1),
            OUTPUT => (of.drives, of.high) = (true, false),
            STEPPER => of.drives = true,
            _ => {}
        }
    }

    /// Drives a pin as the library of the motor does, past Firmata.
    fn drive(&mut self, pin: u8) {
        if let Some(of) = self.pins.get_mut(usize::from(pin)) {
            of.drives = true;
        }
    }

    /// Sets a pin's output, or its pull-up.
    fn set_level(&mut self, pin: u8, high: bool) {
        if let Some(of) = self.pins.get_mut(usize::from(pin)) {
            of.high = high;
        }
    }

    /// Takes a level that the host sets.
    fn write(&mut self, pin: u8, high: bool) {
        let Some(of) = self.pins.get_mut(usize::from(pin)) else { return };
        match of.mode {
            OUTPUT => of.high = high,
            // This is how old hosts switch a pull-up on.
            INPUT if high && of.state != 1 => (of.drives, of.high) = (false, true),
            _ => return,
        }
        of.state = high.into();
    }

    /// Returns true if current flows into what is connected to an output.
    fn is_driven_high(&self, pin: u8) -> bool {
        self.pins.get(usize::from(pin)).is_some_and(|of| of.drives && of.high)
    }

    /// Levels of a port as they are reported, where `grounded` is connected to ground and the
    /// inputs of a motor's driver, `coils`, pull low what nothing drives.
    fn levels(&self, port: u8, grounded: Option<u8>, coils: [u8; 4]) -> u8 {
        (0..8).fold(0, |levels, bit| {
            let pin = port * 8 + bit;
            let Some(of) = self.pins.get(usize::from(pin)).filter(|of| of.reported) else {
                return levels;
            };
            let pulled_low = grounded == Some(pin) || coils.contains(&pin);
            let high = if of.drives { of.high } else { of.high && !pulled_low };
            levels | u8::from(high) << bit
        })
    }

    fn mode_and_state(&self, pin: u8) -> Option<(u8, u8)> {
        self.pins.get(usize::from(pin)).map(|of| (of.mode, of.state))
    }
}

/// Modes that a pin has.
fn capabilities(pin: u8, has_stepper: bool) -> Vec<PinCapability> {
    let can = |mode: PinMode, resolution| PinCapability { mode: mode.code(), resolution };
    if pin < FIRST_DIGITAL {
        return Vec::new();
    }
    let mut can_do = vec![can(PinMode::Input, 1), can(PinMode::PullUp, 1), can(PinMode::Output, 1)];
    if has_stepper {
        can_do.push(can(PinMode::Stepper, 21));
    }
    if pin >= FIRST_ANALOG {
        can_do.push(can(PinMode::Analog, 10));
    }
    can_do
}

/// Number of the analog input that a pin is.
fn analog_channel(pin: u8) -> Option<u8> {
    pin.checked_sub(FIRST_ANALOG)
}
