//! The Arduino itself: the commands that it obeys, and what it reports.

use std::io;

use foxhunt_wire::{
    ByteStream,
    firmata::{Decimal, Message, Reply},
};

use super::super::{Action, EmulatedStepperConfig, Gear, Motor, Wires, half_step};
use super::{COUNT, Parser, Pins, Taken, analog_channel, capabilities};
use crate::{Emulator, SimError, World, devices::OnBoard};

/// D0 to A5 are in three ports of eight.
const PORTS: usize = 3;
const STEPPERS: usize = 10;

/// Interval at which ports are looked at for levels that changed, in seconds.
const SAMPLE_S: f64 = 0.019;
const NAME: &str = "EmulatedFirmata";

/// Commands of AccelStepper.
const ACCEL_STEPPER: u8 = 0x62;
const CONFIGURE: u8 = 0x00;
const ZERO: u8 = 0x01;
const STEP: u8 = 0x02;
const TO: u8 = 0x03;
const ENABLE: u8 = 0x04;
const STOP: u8 = 0x05;
const REPORT: u8 = 0x06;
const ACCELERATION: u8 = 0x08;
const SPEED: u8 = 0x09;

/// An Arduino Nano with ConfigurableFirmata 3.4, and a 28BYJ-48 that turns the antenna of a drone.
///
/// It has the leniency of that firmware with damaged messages, which it takes with bytes that older
/// ones left, and its faults: it keeps its speed after a stop, and hangs when a Configure finds no
/// memory. The pins energise the coils; the rotor follows them or does not, whatever position is
/// reported.
#[derive(Debug)]
pub struct EmulatedStepper<S> {
    on_board: OnBoard,
    stream: S,
    parser: Parser,
    config: EmulatedStepperConfig,
    gear: Gear,
    pins: Pins,
    steppers: [Option<Stepper>; STEPPERS],
    /// Steppers that take up memory and are reached no more.
    leaked: u32,
    hung: bool,
    /// The levels that each port reported last; `None` for a port that does not report.
    sent: [Option<u8>; PORTS],
    sampled: f64,
    /// The error with which a reply could not be sent.
    failure: Option<io::Error>,
}

/// A stepper as it was configured.
#[derive(Clone, Copy, Debug)]
struct Stepper {
    motor: Motor,
    wires: Wires,
}

impl<S: ByteStream> EmulatedStepper<S> {
    /// The stepper under a drone, at the other end of `stream`.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Field`] names what is out of
    /// range in
    /// `config`.
    pub fn new(
        world: &World,
        drone: usize,
        config: EmulatedStepperConfig,
        stream: S,
    ) -> Result<Self, SimError> {
        config.check()?;
        let mut emulated = Self {
            on_board: world.on_board(drone)?,
            stream,
            parser: Parser::default(),
            gear: Gear::new(&config),
            config,
            pins: Pins::new(),
            steppers: [None; STEPPERS],
            leaked: 0,
            hung: false,
            sent: [None; PORTS],
            sampled: 0.0,
            failure: None,
        };
        emulated.reset();
        emulated.carry();
        Ok(emulated)
    }

    /// Presses the reset button: it forgets its steppers and where they were, and begins again.
    pub fn reset(&mut self) {
        (self.leaked, self.hung) = (0, false);
        self.begin();
        self.emit(&Reply::Version { major: 2, minor: 8 });
        self.emit(&Reply::Firmware { major: 3, minor: 4, name: NAME.to_owned() });
    }

    /// Half steps that the rotor has really made since the beginning, forwards less backwards.
    #[must_use]
    pub fn rotor(&self) -> i64 {
        self.gear.rotor()
    }

    fn begin(&mut self) {
        self.parser = Parser::default();
        self.steppers = [None; STEPPERS];
        self.pins = Pins::new();
        self.sent = [None; PORTS];
    }

    fn emit(&mut self, reply: &Reply) {
        let mut bytes = Vec::new();
        reply.encode(&mut bytes).expect("its replies are short");
        if let Err(error) = self.stream.send(&bytes) {
            self.failure.get_or_insert(error);
        }
    }

    /// Lets the motors run until `now`.
    fn run(&mut self, now: f64) {
        for device in 0..STEPPERS {
            while let Some(stepper) = &mut self.steppers[device] {
                let can_follow = |after_s: f64| {
                    let fastest = self.config.fastest_half_steps_per_s;
                    fastest.is_none_or(|fastest| after_s * fastest >= 1.0 - 1e-9)
                };
                let in_step = Some(self.gear.phase()) == half_step(coils(&self.pins, &self.config));
                let gain = stepper.wires.gain(self.config.pins).filter(|_| in_step);
                if let Some(gain) = gain {
                    let (steps, between_s) = stepper.motor.cruise(now);
                    if can_follow(between_s) {
                        self.gear.turn(steps * gain);
                    }
                    energise(&mut self.pins, stepper.wires.at(stepper.motor.position), steps != 0);
                }
                let action = stepper.motor.act(now);
                let position = stepper.motor.position;
                match action {
                    None => break,
                    Some(Action::Arrived) => {
                        let device = number(device);
                        let position = counted(position);
                        self.emit(&Reply::Done { device, position });
                    }
                    Some(Action::Step { after_s }) => {
                        energise(&mut self.pins, stepper.wires.at(position), true);
                        if can_follow(after_s) {
                            self.pull();
                        }
                    }
                }
            }
        }
    }

    /// Has the rotor follow its coils.
    fn pull(&mut self) {
        if let Some(phase) = half_step(coils(&self.pins, &self.config)) {
            self.gear.follow(phase);
        }
    }

    fn answer(&mut self, taken: Taken, now: f64) {
        match taken {
            Taken::Version => self.emit(&Reply::Version { major: 2, minor: 8 }),
            Taken::Reset => self.begin(),
            Taken::PinMode { pin, mode } => {
                self.pins.set_mode(pin, mode);
                if pin < 2 || usize::from(pin) >= COUNT {
                    self.emit(&Reply::Text("Unknown pin mode".to_owned()));
                }
            }
            Taken::PinLevel { pin, high } => self.pins.write(pin, high),
            Taken::Levels { port, levels } => {
                (0..8).for_each(|bit| self.pins.write(port * 8 + bit, levels >> bit & 1 == 1));
            }
            Taken::ReportDigital { port, on } => self.report(port, on),
            Taken::Sysex => self.sysex(now),
        }
        self.pull();
    }

    fn report(&mut self, port: u8, on: bool) {
        if usize::from(port) >= PORTS {
            return;
        }
        let levels = self.levels(port);
        self.sent[usize::from(port)] = on.then_some(levels);
        if on {
            self.emit(&Reply::Digital { port, levels });
        }
    }

    fn sysex(&mut self, now: f64) {
        let (command, length, arguments) = self.parser.sysex();
        let first = arguments[0];
        match command {
            0x79 => {
                let name = NAME.to_owned();
                self.emit(&Reply::Firmware { major: 3, minor: 4, name });
            }
            0x6B => {
                let has = self.config.accel_stepper;
                let pins = (0..number(COUNT)).map(|pin| capabilities(pin, has));
                self.emit(&Reply::Capabilities(pins.collect()));
            }
            0x69 => {
                let channels = (0..number(COUNT)).map(analog_channel);
                self.emit(&Reply::AnalogMapping(channels.collect()));
            }
            0x6D if length > 0 => {
                if let Some((mode, state)) = self.pins.mode_and_state(first) {
                    self.emit(&Reply::PinState { pin: first, mode, state });
                }
            }
            ACCEL_STEPPER if self.config.accel_stepper => {
                let mut argv = [0; 12];
                argv.copy_from_slice(&arguments[..12]);
                self.obey(argv, length, now);
            }
            // There is no room in a Nano's texts for the complaint about others.
            _ => {}
        }
    }

    fn obey(&mut self, argv: [u8; 12], length: usize, now: f64) {
        let command = argv[0];
        let device = usize::from(argv[1]);
        if device >= STEPPERS {
            return;
        }
        if command == CONFIGURE {
            self.configure(argv, length, now);
            return;
        }
        let Some(stepper) = &mut self.steppers[device] else { return };
        let Stepper { motor, wires } = stepper;
        let wires = *wires;
        let decimal = || Decimal::decode([argv[2], argv[3], argv[4], argv[5]]).to_f64();
        match command {
            ZERO => motor.zero(),
            STEP => motor.order(motor.position + whole(argv), now),
            TO => motor.order(whole(argv), now),
            ENABLE if argv[2] == 0 => energise(&mut self.pins, wires.off(), true),
            ENABLE => {
                let pins = wires.pins.into_iter().take(wires.count).chain(wires.enable_pin);
                pins.for_each(|pin| self.pins.drive(pin));
            }
            ACCELERATION => motor.set_acceleration(decimal()),
            SPEED => motor.set_speed(decimal()),
            STOP | REPORT => {
                if command == STOP {
                    motor.stop();
                }
                let device = number(device);
                let position = counted(motor.position);
                self.emit(&if command == STOP {
                    Reply::Done { device, position }
                } else {
                    Reply::Position { device, position }
                });
            }
            _ => {}
        }
    }

    fn configure(&mut self, argv: [u8; 12], length: usize, now: f64) {
        let device = usize::from(argv[1]);
        let interface = argv[2];
        let wanted = usize::from(interface >> 4 & 7).clamp(2, 4);
        let pins = [argv[3], argv[4], argv[5], argv[6]];
        pins.iter().take(wanted).for_each(|pin| self.pins.set_mode(*pin, 0x08));
        let mut next = 3 + wanted;
        let enable_pin = (interface & 1 == 1).then(|| {
            next += 1;
            argv[next - 1]
        });
        if let Some(wires) = Wires::new(interface, pins) {
            self.leaked += u32::from(self.steppers[device].is_some());
            let live = self.steppers.iter().enumerate();
            let live = live.filter(|(at, stepper)| *at != device && stepper.is_some()).count();
            if self.leaked + u32::from(number(live)) >= self.config.steppers_in_memory {
                self.hung = true;
                return;
            }
            self.steppers[device] = Some(Stepper { motor: Motor::new(now), wires });
        }
        let Some(stepper) = &mut self.steppers[device] else { return };
        if length >= next {
            stepper.wires.inverted = argv[next];
        }
        if let Some(pin) = enable_pin {
            stepper.wires.enable_pin = enable_pin;
            self.pins.drive(pin);
            self.pins.set_level(pin, stepper.wires.inverted >> 4 & 1 == 0);
        }
        // Even of a stepper that stays, as there is none of such wires.
        stepper.motor.set_speed(1.0);
        stepper.motor.set_acceleration(0.0);
    }

    fn levels(&self, port: u8) -> u8 {
        let angle = self.gear.angle().to_degrees();
        let closed = self.config.switch.filter(|switch| {
            let before = (switch.opens_at_deg - angle).rem_euclid(360.0);
            before > 0.0 && before <= switch.width_deg
        });
        self.pins.levels(port, closed.map(|switch| switch.pin), self.config.pins)
    }

    /// Turns the drone's antenna.
    fn carry(&mut self) {
        let angle = self.gear.angle();
        self.on_board.with(|drone, now| drone.hold_antenna_at(angle, now));
    }

    /// Reports levels that changed.
    fn sample(&mut self, now: f64) {
        if now < self.sampled + SAMPLE_S {
            return;
        }
        self.sampled = now;
        for (at, port) in (0..).take(PORTS).enumerate() {
            let levels = self.levels(port);
            if self.sent[at].is_some_and(|sent| sent != levels) {
                self.sent[at] = Some(levels);
                self.emit(&Reply::Digital { port, levels });
            }
        }
    }
}

impl<S: ByteStream> Emulator for EmulatedStepper<S> {
    fn serve(&mut self) -> io::Result<()> {
        let now = self.on_board.with(|_, now| now);
        if !self.hung {
            self.run(now);
        }
        let mut into = [0; 256];
        let outcome = loop {
            match self.stream.receive(&mut into) {
                Ok(0) => break Ok(()),
                Ok(count) => {
                    for byte in into.iter().take(count) {
                        if self.hung {
                            continue;
                        }
                        if let Some(taken) = self.parser.push(*byte) {
                            self.answer(taken, now);
                            self.run(now);
                        }
                    }
                }
                Err(error) => break Err(error),
            }
        };
        self.carry();
        if !self.hung {
            self.sample(now);
        }
        outcome.and(self.failure.take().map_or(Ok(()), Err))
    }
}

fn energise(pins: &mut Pins, levels: impl Iterator<Item = (u8, bool)>, changed: bool) {
    if changed {
        levels.for_each(|(pin, high)| pins.set_level(pin, high));
    }
}

/// Returns true for each of IN1 to IN4 through which current flows.
fn coils(pins: &Pins, config: &EmulatedStepperConfig) -> [bool; 4] {
    config.pins.map(|pin| pins.is_driven_high(pin))
}

/// A position as the firmware takes it, without the bits above 2²⁸ of which it loses sight.
fn whole(argv: [u8; 12]) -> i64 {
    let byte = |at: usize| i64::from(argv[at]);
    let magnitude = byte(2) | byte(3) << 7 | byte(4) << 14 | byte(5) << 21;
    if argv[6] >> 3 == 1 { -magnitude } else { magnitude }
}

/// A position as it is sent.
fn counted(position: i64) -> i32 {
    i32::try_from(position).unwrap_or(if position < 0 { -i32::MAX } else { i32::MAX })
}

fn number(index: usize) -> u8 {
    u8::try_from(index).unwrap_or(u8::MAX)
}
