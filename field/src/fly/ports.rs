use std::io;

use foxhunt_core::Clock;
use foxhunt_hardware::Reconnecting;
use foxhunt_wire::{ByteStream, Endpoint};

/// Opens the ports at which the devices of a flight are reached.
pub trait Ports {
    /// Opens one.
    ///
    /// # Errors
    ///
    /// Any error of the port, with its name or address.
    fn open(&mut self, endpoint: &Endpoint) -> io::Result<Box<dyn ByteStream>>;
}

/// The ports of this machine. One that disappears is opened again when it is back.
#[derive(Clone, Debug)]
pub struct SystemPorts<C> {
    clock: C,
}

impl<C: Clock + Clone + 'static> SystemPorts<C> {
    /// Ports that are tried again by this clock.
    pub fn new(clock: C) -> Self {
        Self { clock }
    }
}

impl<C: Clock + Clone + 'static> Ports for SystemPorts<C> {
    fn open(&mut self, endpoint: &Endpoint) -> io::Result<Box<dyn ByteStream>> {
        Ok(Box::new(Reconnecting::open(endpoint.clone(), self.clock.clone())?))
    }
}
