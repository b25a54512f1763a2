use std::{cell::RefCell, f64::consts::TAU, io, rc::Rc};

use foxhunt::{
    core::{Clock, Rotator},
    hardware::{FirmataConfig, FirmataStepper, FirmataStepperError},
    sim::{
        EmulatedStepper, EmulatedStepperConfig, Emulator, SimClock, SimRotator, World, WorldConfig,
    },
    wire::{ByteStream, MemoryStream, memory_pair},
};

/// A cable with a plug: what is spoiled on the way, and whether it is in.
#[derive(Debug, Default)]
pub(crate) struct Cable {
    pub(crate) pulled: bool,
    pub(crate) connections: u32,
    /// Bytes that the host reads before anything else.
    pub(crate) noise: Vec<u8>,
    /// One byte in this number from the device is lost.
    pub(crate) loses_every: Option<u32>,
    pub(crate) count: u32,
    /// Number of messages to the device that are lost.
    pub(crate) swallows: u32,
    /// Bytes that are damaged, of those to the device and of those from it.
    pub(crate) damage: [Vec<Damage>; 2],
    /// Bytes that are replaced once: the ones sent to the device and the ones from it.
    pub(crate) swaps: [Vec<[Vec<u8>; 2]>; 2],
    /// Bytes that were sent to the device, and that came from it.
    pub(crate) passed: [usize; 2],
}

/// A byte of a direction, counted from 0, and what happens to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damage {
    pub(crate) at: usize,
    pub(crate) kind: DamageKind,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum DamageKind {
    Lost,
    Garbled(u8),
    /// One bit of it.
    Flipped(u8),
    Doubled,
    Inserted(u8),
}

pub(crate) const TO_DEVICE: usize = 0;
pub(crate) const FROM_DEVICE: usize = 1;

impl Cable {
    /// Bytes of a direction as they arrive.
    fn pass(&mut self, direction: usize, bytes: &[u8]) -> Vec<u8> {
        let mut swapped = bytes.to_vec();
        self.swaps[direction].retain(|[from, to]| {
            let at = swapped.windows(from.len()).position(|window| window == from);
            if let Some(at) = at {
                swapped.splice(at..at + from.len(), to.iter().copied());
            }
            at.is_none()
        });
        let mut arrived = Vec::new();
        for byte in &swapped {
            let at = self.passed[direction];
            self.passed[direction] += 1;
            let damage = self.damage[direction].iter().find(|damage| damage.at == at);
            match damage.map(|damage| damage.kind) {
                None => arrived.push(*byte),
                Some(DamageKind::Lost) => {}
                Some(DamageKind::Garbled(other)) => arrived.push(other),
                Some(DamageKind::Flipped(bit)) => arrived.push(byte ^ 1 << bit),
                Some(DamageKind::Doubled) => arrived.extend([*byte; 2]),
                Some(DamageKind::Inserted(other)) => arrived.extend([other, *byte]),
            }
        }
        arrived
    }
}

/// The host's end of a cable.
#[derive(Debug)]
pub(crate) struct Plug {
    stream: MemoryStream,
    pub(crate) cable: Rc<RefCell<Cable>>,
}

impl ByteStream for Plug {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut cable = self.cable.borrow_mut();
        if cable.pulled {
            // What comes meanwhile is lost.
            while self.stream.receive(into)? > 0 {}
            return Err(io::Error::new(io::ErrorKind::NotConnected, "it is pulled"));
        }
        if !cable.noise.is_empty() {
            let count = cable.noise.len().min(into.len());
            for (to, from) in into.iter_mut().zip(cable.noise.drain(..count)) {
                *to = from;
            }
            return Ok(count);
        }
        // Each byte may become two.
        let mut came = vec![0; into.len() / 4];
        let count = self.stream.receive(&mut came)?;
        let arrived = cable.pass(FROM_DEVICE, &came[..count]);
        into[..arrived.len()].copy_from_slice(&arrived);
        if arrived.is_empty() && count > 0 {
            drop(cable);
            return self.receive(into);
        }
        let count = arrived.len();
        let Some(every) = cable.loses_every else { return Ok(count) };
        let mut kept = 0;
        for i in 0..count {
            cable.count += 1;
            if !cable.count.is_multiple_of(every) {
                into[kept] = into[i];
                kept += 1;
            }
        }
        // Nothing kept is not nothing left.
        if kept == 0 && count > 0 {
            drop(cable);
            self.receive(into)
        } else {
            Ok(kept)
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut cable = self.cable.borrow_mut();
        if cable.pulled {
            return Err(io::Error::new(io::ErrorKind::NotConnected, "it is pulled"));
        }
        if cable.swallows > 0 {
            cable.swallows -= 1;
            return Ok(());
        }
        let arriving = cable.pass(TO_DEVICE, bytes);
        drop(cable);
        self.stream.send(&arriving)
    }

    fn connections(&self) -> u32 {
        self.cable.borrow().connections
    }
}

/// A driver, and the device that it drives.
pub(crate) struct Rig {
    pub(crate) world: World,
    pub(crate) driver: FirmataStepper<Plug, SimClock>,
    pub(crate) device: EmulatedStepper<MemoryStream>,
    pub(crate) cable: Rc<RefCell<Cable>>,
    truth: SimRotator,
    pub(crate) tick_s: f64,
}

impl Rig {
    pub(crate) fn new(config: FirmataConfig, emulated: EmulatedStepperConfig) -> Self {
        let drones = vec![foxhunt::sim::DroneConfig::default()];
        let config_of_world = WorldConfig { drones, ..WorldConfig::default() };
        let world = World::new(&config_of_world, 1).expect("it is in order");
        let (here, there) = memory_pair();
        let cable = Rc::new(RefCell::new(Cable { connections: 1, ..Cable::default() }));
        let plug = Plug { stream: here, cable: Rc::clone(&cable) };
        let driver = FirmataStepper::new(config, plug, world.clock()).expect("it is in order");
        let device = EmulatedStepper::new(&world, 0, emulated, there).expect("it is in order");
        let truth = world.rotator(0).expect("there is a drone");
        Self { world, driver, device, cable, truth, tick_s: 0.01 }
    }

    /// Replaces bytes once, of those to the device or from it.
    pub(crate) fn swap(&mut self, direction: usize, from: &[u8], to: &[u8]) {
        self.cable.borrow_mut().swaps[direction].push([from.to_vec(), to.to_vec()]);
    }

    /// Lets time pass, and polls the driver.
    pub(crate) fn tick(&mut self) -> Result<Option<f64>, FirmataStepperError> {
        self.world.advance(self.tick_s).expect("a step");
        self.device.serve().expect("the device's end holds");
        self.driver.poll()
    }

    /// Waits until the antenna stands, at most this long; returns the reported boresight.
    pub(crate) fn wait(&mut self, seconds: f64) -> Result<f64, FirmataStepperError> {
        let until = self.world.clock().now() + seconds;
        while self.world.clock().now() < until {
            if let Some(angle) = self.tick()? {
                return Ok(angle);
            }
        }
        panic!("it does not stand after {seconds} s: {:?}", self.driver);
    }

    /// Turns the antenna, and waits; returns the reported boresight and the true one.
    pub(crate) fn turn(&mut self, angle: f64) -> (f64, f64) {
        self.driver.turn_to(angle).expect("the order is accepted");
        let reported = self.wait(60.0).expect("it comes there");
        (reported, self.truth())
    }

    /// Returns the true direction of the antenna.
    pub(crate) fn truth(&mut self) -> f64 {
        self.truth.poll().expect("it works").expect("it is held")
    }
}

/// A half step of a 28BYJ-48, in radians.
pub(crate) fn half_step() -> f64 {
    TAU * 4455.0 / (64.0 * 283_712.0)
}
