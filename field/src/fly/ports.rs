use std::io;

use foxhunt_core::Clock;
use foxhunt_hardware::Reconnecting;
use foxhunt_wire::{ByteStream, Endpoint, SharedPort, SharedStream};

/// Opens the ports at which the devices of a flight are reached.
pub trait Ports {
    /// Opens one.
    ///
    /// # Errors
    ///
    /// Any error of the port, with its name or address.
    fn open(&mut self, endpoint: &Endpoint) -> io::Result<Box<dyn ByteStream>>;
}

/// The ports of this machine. One that disappears is opened again when it is back; one that several
/// devices are behind, vehicles of one radio or router, is shared.
#[derive(Debug)]
pub struct SystemPorts<C> {
    clock: C,
    opened: Vec<(Endpoint, SharedPort)>,
}

impl<C: Clock + Clone + 'static> SystemPorts<C> {
    /// Ports that are tried again by this clock.
    pub fn new(clock: C) -> Self {
        Self { clock, opened: Vec::new() }
    }
}

impl<C: Clock + Clone + 'static> Ports for SystemPorts<C> {
    fn open(&mut self, endpoint: &Endpoint) -> io::Result<Box<dyn ByteStream>> {
        let mut opened = self.opened.iter().filter(|(of, _)| of == endpoint);
        if let Some(shared) = opened.find_map(|(_, port)| port.share()) {
            return Ok(Box::new(shared));
        }
        let stream = Reconnecting::open(endpoint.clone(), self.clock.clone())?;
        let stream = SharedStream::new(Box::new(stream));
        self.opened.retain(|(of, _)| of != endpoint);
        self.opened.push((endpoint.clone(), stream.port()));
        Ok(Box::new(stream))
    }
}
