use foxhunt_wire::firmata::{PinCapability, PinMode};

/// Pins of an Arduino Nano, as ConfigurableFirmata keeps them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pins {
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

/// D0 to D13, A0 to A5.
pub(super) const COUNT: usize = 20;
const FIRST_ANALOG: u8 = 14;
/// D0 and D1 are the serial port.
const FIRST_DIGITAL: u8 = 2;

const INPUT: u8 = PinMode::Input as u8;
const OUTPUT: u8 = PinMode::Output as u8;
const ANALOG: u8 = PinMode::Analog as u8;
const STEPPER: u8 = PinMode::Stepper as u8;
const PULL_UP: u8 = PinMode::PullUp as u8;

impl Pins {
    /// Pins as after a system reset.
    pub(super) fn new() -> Self {
        let mut pins = Self { pins: [Pin::default(); COUNT] };
        for pin in 0..FIRST_ANALOG {
            pins.set_mode(pin, OUTPUT);
        }
        (FIRST_ANALOG..20).for_each(|pin| pins.set_mode(pin, ANALOG));
        pins
    }

    pub(super) fn set_mode(&mut self, pin: u8, mode: u8) {
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
    pub(super) fn drive(&mut self, pin: u8) {
        if let Some(of) = self.pins.get_mut(usize::from(pin)) {
            of.drives = true;
        }
    }

    /// Sets a pin's output, or its pull-up.
    pub(super) fn set_level(&mut self, pin: u8, high: bool) {
        if let Some(of) = self.pins.get_mut(usize::from(pin)) {
            of.high = high;
        }
    }

    /// Takes a level that the host sets.
    pub(super) fn write(&mut self, pin: u8, high: bool) {
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
    pub(super) fn is_driven_high(&self, pin: u8) -> bool {
        self.pins.get(usize::from(pin)).is_some_and(|of| of.drives && of.high)
    }

    /// Levels of a port as they are reported, where `grounded` is connected to ground and the
    /// inputs of a motor's driver, `coils`, pull low what nothing drives.
    pub(super) fn levels(&self, port: u8, grounded: Option<u8>, coils: [u8; 4]) -> u8 {
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

    pub(super) fn mode_and_state(&self, pin: u8) -> Option<(u8, u8)> {
        self.pins.get(usize::from(pin)).map(|of| (of.mode, of.state))
    }
}

/// Modes that a pin has.
pub(super) fn capabilities(pin: u8, has_stepper: bool) -> Vec<PinCapability> {
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
pub(super) fn analog_channel(pin: u8) -> Option<u8> {
    pin.checked_sub(FIRST_ANALOG)
}
