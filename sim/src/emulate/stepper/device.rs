use std::io;

use foxhunt_wire::{
    ByteStream,
    firmata::{
        Decoder, Message, PinCapability, PinMode, Reply, Request, StepperInterface, StepperRequest,
        Wiring,
    },
};

use super::{EmulatedStepperConfig, gear::Gear, motor::Motor};
use crate::{Emulator, SimError, World, devices::OnBoard};

/// An Arduino Nano with ConfigurableFirmata, and a 28BYJ-48 that turns the antenna of a drone.
///
/// It begins as after switching on, with the version and the firmware. Its stepper is to be
/// configured before it does anything; a motor that is wired otherwise than configured shivers and
/// stays, while its steps are counted.
#[derive(Debug)]
pub struct EmulatedStepper<S> {
    on_board: OnBoard,
    stream: S,
    decoder: Decoder<Request>,
    config: EmulatedStepperConfig,
    gear: Gear,
    stepper: Option<Stepper>,
    /// Which ports report their levels, and what they reported last.
    sent: [Option<Option<u8>>; PORTS],
    /// Why a reply could not be sent.
    failure: Option<io::Error>,
}

/// A stepper as it was configured.
#[derive(Clone, Copy, Debug)]
struct Stepper {
    device: u8,
    motor: Motor,
    /// Half steps that the rotor makes in a step forwards.
    gain: i64,
    has_enable_pin: bool,
    enabled: bool,
}

/// D0 to A5 are in three ports of eight.
const PORTS: usize = 3;
/// D0 to D13, A0 to A5.
const PINS: u8 = 20;
const FIRST_ANALOG: u8 = 14;
/// The real firmware loses what is above.
const COUNTED_BITS: i32 = 0x0FFF_FFFF;

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
            decoder: Decoder::default(),
            gear: Gear::new(&config),
            config,
            stepper: None,
            sent: [None; PORTS],
            failure: None,
        };
        emulated.reset();
        emulated.carry();
        Ok(emulated)
    }

    /// Presses the reset button: it forgets its stepper and where that was, and begins anew.
    pub fn reset(&mut self) {
        self.begin();
        self.emit(&Reply::Version { major: 2, minor: 6 });
        self.emit(&Reply::Firmware { major: 2, minor: 10, name: "EmulatedFirmata".to_owned() });
    }

    fn begin(&mut self) {
        self.stepper = None;
        self.sent = [None; PORTS];
    }

    fn emit(&mut self, reply: &Reply) {
        let mut bytes = Vec::new();
        reply.encode(&mut bytes).expect("its replies are short");
        if let Err(error) = self.stream.send(&bytes) {
            self.failure.get_or_insert(error);
        }
    }

    /// Lets the motor run until `now`.
    fn run(&mut self, now: f64) {
        while let Some(stepper) = &mut self.stepper
            && let Some(step) = stepper.motor.step(now)
        {
            let (device, position) = (stepper.device, stepper.motor.position);
            if step == 0 {
                let position = counted(position);
                self.emit(&Reply::Done { device, position });
            } else if stepper.enabled || !stepper.has_enable_pin {
                // Without an enable pin every step switches its coils on.
                stepper.enabled = true;
                self.gear.turn(step * stepper.gain);
            }
        }
    }

    fn answer(&mut self, request: &Request, now: f64) {
        match request {
            Request::Version => self.emit(&Reply::Version { major: 2, minor: 6 }),
            Request::Firmware => {
                let name = "EmulatedFirmata".to_owned();
                self.emit(&Reply::Firmware { major: 2, minor: 10, name });
            }
            Request::Capabilities => {
                self.emit(&Reply::Capabilities((0..PINS).map(capabilities).collect()));
            }
            Request::AnalogMapping => {
                let channel = |pin: u8| pin.checked_sub(FIRST_ANALOG);
                self.emit(&Reply::AnalogMapping((0..PINS).map(channel).collect()));
            }
            Request::ReportDigital { port, on } => {
                if let Some(sent) = self.sent.get_mut(usize::from(*port)) {
                    *sent = on.then_some(None);
                }
            }
            Request::Reset => self.begin(),
            Request::Stepper { device, request } => self.obey(*device, request, now),
            // Nothing but its switch is connected, which pulls to ground by itself.
            _ => {}
        }
    }

    fn obey(&mut self, device: u8, request: &StepperRequest, now: f64) {
        if let StepperRequest::Configure(interface) = request {
            if let Some(gain) = self.gain(interface) {
                let has_enable_pin = interface.enable_pin.is_some();
                let motor = Motor::new(now);
                self.stepper = Some(Stepper { device, motor, gain, has_enable_pin, enabled: true });
            }
            return;
        }
        let Some(stepper) = self.stepper.as_mut().filter(|stepper| stepper.device == device) else {
            return;
        };
        let motor = &mut stepper.motor;
        match request {
            StepperRequest::Zero => motor.zero(),
            StepperRequest::Step(steps) => motor.order(motor.position + i64::from(*steps), now),
            StepperRequest::To(position) => {
                let kept = (position.abs() & COUNTED_BITS) * position.signum();
                motor.order(i64::from(kept), now);
            }
            StepperRequest::Enable(on) => stepper.enabled = *on,
            StepperRequest::Acceleration(acceleration) => {
                motor.set_acceleration(acceleration.to_f64());
            }
            StepperRequest::Speed(speed) => motor.set_speed(speed.to_f64()),
            StepperRequest::Stop => {
                motor.stop();
                let position = counted(motor.position);
                self.emit(&Reply::Done { device, position });
            }
            StepperRequest::Report => {
                let position = counted(motor.position);
                self.emit(&Reply::Position { device, position });
            }
            StepperRequest::Configure(_) => {}
        }
    }

    /// Half steps that the rotor makes in a step forwards; `None` for a stepper of another kind.
    fn gain(&self, interface: &StepperInterface) -> Option<i64> {
        let Wiring::FourWire([a, c, b, d]) = interface.wiring else { return None };
        let size = match interface.divisor_log2 {
            0 => 2,
            1 => 1,
            _ => return None,
        };
        let coil = |pin: u8| self.config.pins.iter().position(|wired| *wired == pin);
        // The coils as they take turns.
        let order = [coil(a)?, coil(b)?, coil(c)?, coil(d)?];
        let follows = |by: usize| (0..4).all(|i| (order[i] + by) % 4 == order[(i + 1) % 4]);
        Some(if follows(1) {
            size
        } else if follows(3) {
            -size
        } else {
            0
        })
    }

    /// Turns the drone's antenna, and reports its switch.
    fn carry(&mut self) {
        let angle = self.gear.angle();
        self.on_board.with(|drone, now| drone.hold_antenna_at(angle, now));
        let closed = self.config.switch.filter(|switch| {
            let before = (switch.opens_at_deg - angle.to_degrees()).rem_euclid(360.0);
            before > 0.0 && before <= switch.width_deg
        });
        for port in 0..PORTS {
            let of_port =
                closed.map(|switch| switch.pin).filter(|pin| usize::from(pin / 8) == port);
            let levels = !of_port.map_or(0, |pin| 1 << (pin % 8));
            if self.sent[port].is_some_and(|sent| sent != Some(levels)) {
                self.sent[port] = Some(Some(levels));
                let port = u8::try_from(port).unwrap_or_default();
                self.emit(&Reply::Digital { port, levels });
            }
        }
    }
}

impl<S: ByteStream> Emulator for EmulatedStepper<S> {
    fn serve(&mut self) -> io::Result<()> {
        let now = self.on_board.with(|_, now| now);
        self.run(now);
        let mut into = [0; 256];
        let outcome = loop {
            match self.stream.receive(&mut into) {
                Ok(0) => break Ok(()),
                Ok(count) => {
                    for byte in into.iter().take(count) {
                        if let Some(request) = self.decoder.push(*byte) {
                            self.answer(&request, now);
                            self.run(now);
                        }
                    }
                }
                Err(error) => break Err(error),
            }
        };
        self.carry();
        outcome.and(self.failure.take().map_or(Ok(()), Err))
    }
}

/// A position as it is sent.
fn counted(position: i64) -> i32 {
    i32::try_from(position).unwrap_or(if position < 0 { -i32::MAX } else { i32::MAX })
}

/// What a pin of a Nano can do; the first two are the serial port's.
fn capabilities(pin: u8) -> Vec<PinCapability> {
    let can = |mode: PinMode, resolution| PinCapability { mode: mode.code(), resolution };
    if pin < 2 {
        return Vec::new();
    }
    let digital = [(PinMode::Input, 1), (PinMode::PullUp, 1), (PinMode::Output, 1)];
    let last = if pin < FIRST_ANALOG { (PinMode::Stepper, 21) } else { (PinMode::Analog, 10) };
    digital.into_iter().chain([last]).map(|(mode, resolution)| can(mode, resolution)).collect()
}
