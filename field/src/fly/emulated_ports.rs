//! Ports of emulated devices, their tags, and the reasons why a field cannot be emulated.

use std::{
    cell::RefCell,
    collections::HashMap,
    fs, io,
    net::UdpSocket,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
    rc::Rc,
};

use foxhunt_core::BeaconId;
use foxhunt_hardware::{PulseConfig, RtlTcpConfig};
use foxhunt_sim::{CableFaults, Cabled, Port, PulseTrain, SimError, World};
use foxhunt_wire::{
    ByteStream, Endpoint, MemoryStream, PtyStream, TcpServerStream, UdpStream,
    geodesy::GeodesyError, memory_pair,
};

use super::{CarriedDroneError, Connector, Ports};

/// The bits per second of the serial ports.
const BAUD: u32 = 57_600;

/// The UDP port of the first autopilot in memory.
const FIRST_PORT: u16 = 14_550;

/// Reason why a field cannot be emulated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EmulatedFieldError {
    /// A port cannot be had.
    #[error(transparent)]
    Open(#[from] io::Error),
    /// There are no more ports.
    #[error("there is no UDP port for drone {drone}, counted from 0, after {first}")]
    Port {
        /// The first one.
        first: u16,
        /// Index of the drone, from 0.
        drone: usize,
    },
    /// A number is out of its range.
    #[error(transparent)]
    Device(#[from] SimError),
    /// There is no emulated device of this kind.
    #[error(
        "drone {drone}, counted from 0: no emulated device is a source of kind \"{kind}\"; \
         foxhunt hunt SCENARIO flies it in a simulated world without devices"
    )]
    Source {
        /// Index of the drone, from 0.
        drone: usize,
        /// The kind of its source.
        kind: &'static str,
    },
    /// A vehicle of another program cannot be followed.
    #[error(transparent)]
    Carried(#[from] CarriedDroneError),
    /// A vehicle of another program keeps the time of the wall.
    #[error(
        "vehicles[{drone}]: fly --emulate keeps a time of its own, which another program's vehicle \
         does not; emulate field goes with the clock on the wall"
    )]
    Foreign {
        /// Index of the vehicle's drone, from 0.
        drone: usize,
    },
    /// There are more vehicles than drones.
    #[error("there are {vehicles} vehicles for {drones} drones")]
    Vehicles {
        /// Number of vehicles.
        vehicles: usize,
        /// Number of drones.
        drones: usize,
    },
    /// There are more platforms than drones.
    #[error("there are {platforms} platforms for {drones} drones")]
    Platforms {
        /// Number of platforms.
        platforms: usize,
        /// Number of drones.
        drones: usize,
    },
    /// The beacons do not all pulse alike, so that no one receiver is set for them.
    #[error(
        "beacon {beacon}, counted from 0: a field with tags that pulse has tags alone, with pulses \
         of {pulse_s} s each"
    )]
    Pulses {
        /// The first that is otherwise.
        beacon: usize,
        /// Pulse length of the first tag, in seconds.
        pulse_s: f64,
    },
    /// The site is not where the world's tiles have their origin.
    #[error(
        "site: world.terrain of the scenario has its origin at {lat_deg}°, {lon_deg}°; leave the \
         site out, or give that"
    )]
    Origin {
        /// Latitude of the tiles' origin in degrees.
        lat_deg: f64,
        /// Longitude.
        lon_deg: f64,
    },
    /// The site is no place.
    #[error("site: {0}")]
    Site(#[from] GeodesyError),
}

/// The tags of a field, all of which pulse alike.
pub(super) struct Tags {
    pulse: PulseConfig,
}

impl Tags {
    /// Returns the tags of a world's first beacons; `None` if the beacons answer.
    pub(super) fn of(world: &World, count: usize) -> Result<Option<Self>, EmulatedFieldError> {
        let trains: Vec<Option<PulseTrain>> =
            (0..).map(|beacon| world.pulses(BeaconId(beacon))).take(count).collect();
        let Some(first) = trains.iter().flatten().next() else { return Ok(None) };
        let same = |train: &Option<PulseTrain>| {
            train.is_some_and(|train| train.pulse_s.to_bits() == first.pulse_s.to_bits())
        };
        if let Some(beacon) = trains.iter().position(|train| !same(train)) {
            return Err(EmulatedFieldError::Pulses { beacon, pulse_s: first.pulse_s });
        }
        let longest = |interval_s: f64, train: &PulseTrain| {
            interval_s.max(train.interval_s + 2.0 * train.jitter_s)
        };
        let interval_s = trains.iter().flatten().fold(0.0, longest);
        Ok(Some(Self { pulse: PulseConfig::new(first.pulse_s, interval_s) }))
    }

    /// A receiver of them, where a tone at full scale has this power without gain.
    pub(super) fn receiver(&self, full_scale_dbm: f64) -> RtlTcpConfig {
        let config = RtlTcpConfig::default();
        RtlTcpConfig {
            sample_rate_hz: 250_000,
            beside_hz: 20_000,
            // Emulated servers hand on what they have at once.
            settling_s: 0.02,
            full_scale_dbm: full_scale_dbm - config.gain_db,
            pulse: Some(self.pulse),
            ..config
        }
    }
}

/// The ports of an [`EmulatedField`](super::EmulatedField) in memory: what is sent is there at
/// once, so that a flight takes no other time than the world's, whatever else the computer has to
/// do.
#[derive(Debug, Default)]
pub struct EmulatedPorts {
    streams: HashMap<Endpoint, MemoryStream>,
    /// Servers that take a connection for each question.
    servers: HashMap<Endpoint, Rc<RefCell<MemoryStream>>>,
}

/// One of the connections to a server in memory, which are all the same stream.
#[derive(Debug)]
struct Connection(Rc<RefCell<MemoryStream>>);

impl ByteStream for Connection {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.0.borrow_mut().receive(into)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.borrow_mut().send(bytes)
    }
}

impl Ports for EmulatedPorts {
    fn open(&mut self, endpoint: &Endpoint) -> io::Result<Box<dyn ByteStream>> {
        let none = || io::Error::new(io::ErrorKind::NotFound, format!("{endpoint}: no free port"));
        Ok(Box::new(self.streams.remove(endpoint).ok_or_else(none)?))
    }

    fn connector(&mut self, endpoint: &Endpoint) -> Connector {
        let server = self.servers.get(endpoint).cloned();
        let none = format!("{endpoint}: no server");
        Box::new(move || match &server {
            Some(server) => Ok(Box::new(Connection(Rc::clone(server)))),
            None => Err(io::Error::new(io::ErrorKind::NotFound, none.clone())),
        })
    }
}

impl EmulatedPorts {
    /// The device's end of a port.
    fn add(&mut self, endpoint: &Endpoint) -> MemoryStream {
        let (near, far) = memory_pair();
        self.streams.insert(endpoint.clone(), near);
        far
    }
}

/// Place where the devices of a field are put.
pub(super) enum Place<'a> {
    /// Pseudo-terminals with links in a folder, and UDP.
    Folder(&'a Path),
    Memory(&'a mut EmulatedPorts),
}

impl Place<'_> {
    /// An autopilot's end of a link, with the endpoint of the other end.
    pub(super) fn datagrams(
        &mut self,
        first_port: Option<u16>,
        drone: usize,
    ) -> Result<(Box<dyn ByteStream>, Endpoint), EmulatedFieldError> {
        let first = match self {
            Self::Folder(_) => first_port,
            Self::Memory(_) => first_port.or(Some(FIRST_PORT)),
        };
        let address = format!("127.0.0.1:{}", port(first, drone)?);
        let endpoint = Endpoint::UdpIn { address: address.clone() };
        let stream: Box<dyn ByteStream> = match self {
            Self::Folder(_) => Box::new(UdpStream::to(&address)?),
            Self::Memory(ports) => Box::new(ports.add(&endpoint)),
        };
        Ok((stream, endpoint))
    }

    /// The port of a server of rtl_tcp, with the endpoint of its client.
    pub(super) fn server(
        &mut self,
        world: &World,
        drone: &str,
        faults: CableFaults,
    ) -> Result<(Cabled<Box<dyn ByteStream>>, Endpoint), EmulatedFieldError> {
        match self {
            Self::Folder(_) => {
                let server = TcpServerStream::listen("127.0.0.1:0")?;
                let address = server.local_address()?.to_string();
                let port = ServerPort { address: address.clone() };
                let cabled = Cabled::new(Box::new(server) as _, world.clock(), faults, seed(drone));
                Ok((cabled.with_port(port), Endpoint::Tcp { address }))
            }
            Self::Memory(ports) => {
                let endpoint = Endpoint::Tcp { address: format!("{drone}:1234") };
                let stream: Box<dyn ByteStream> = Box::new(ports.add(&endpoint));
                Ok((Cabled::new(stream, world.clock(), faults, seed(drone)), endpoint))
            }
        }
    }

    /// The end of a KrakenSDR's server, with the endpoint of its page.
    pub(super) fn page(
        &mut self,
        drone: &str,
    ) -> Result<(Box<dyn ByteStream>, Endpoint), EmulatedFieldError> {
        match self {
            Self::Folder(_) => {
                let server = TcpServerStream::listen("127.0.0.1:0")?;
                let address = server.local_address()?.to_string();
                Ok((Box::new(server), Endpoint::Tcp { address }))
            }
            Self::Memory(ports) => {
                let endpoint = Endpoint::Tcp { address: format!("{drone}:8081") };
                let (near, far) = memory_pair();
                ports.servers.insert(endpoint.clone(), Rc::new(RefCell::new(near)));
                Ok((Box::new(far), endpoint))
            }
        }
    }

    /// A device's end of a cable, with the endpoint of the other end.
    pub(super) fn cable(
        &mut self,
        world: &World,
        drone: &str,
        device: &str,
        faults: CableFaults,
    ) -> Result<(Cabled<Box<dyn ByteStream>>, Endpoint), EmulatedFieldError> {
        let seed = seed(&format!("{drone}{device}"));
        let name = format!("{drone}-{device}");
        match self {
            Self::Folder(folder) => {
                let link = folder.join(name);
                let endpoint = Endpoint::Serial { port: link.display().to_string(), baud: BAUD };
                let mut port = LinkedPty { link };
                let cabled = Cabled::new(port.open()?, world.clock(), faults, seed);
                Ok((cabled.with_port(port), endpoint))
            }
            Self::Memory(ports) => {
                let endpoint = Endpoint::Serial { port: name, baud: BAUD };
                let stream: Box<dyn ByteStream> = Box::new(ports.add(&endpoint));
                Ok((Cabled::new(stream, world.clock(), faults, seed), endpoint))
            }
        }
    }
}

/// A pseudo-terminal behind a link.
struct LinkedPty {
    link: PathBuf,
}

impl Port<Box<dyn ByteStream>> for LinkedPty {
    fn open(&mut self) -> io::Result<Box<dyn ByteStream>> {
        let stream = PtyStream::open()?;
        self.close()?;
        symlink(stream.path(), &self.link)?;
        Ok(Box::new(stream))
    }

    fn close(&mut self) -> io::Result<()> {
        if fs::symlink_metadata(&self.link).is_ok_and(|there| there.is_symlink()) {
            fs::remove_file(&self.link)?;
        }
        Ok(())
    }
}

impl Drop for LinkedPty {
    fn drop(&mut self) {
        // Another field may have put its own there; that is no concern of ours any more.
        let _ = self.close();
    }
}

/// A TCP port that is listened at again.
struct ServerPort {
    address: String,
}

impl Port<Box<dyn ByteStream>> for ServerPort {
    fn open(&mut self) -> io::Result<Box<dyn ByteStream>> {
        Ok(Box::new(TcpServerStream::listen(&self.address)?))
    }

    fn close(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The seed of a cable's garbage.
fn seed(name: &str) -> u64 {
    name.bytes().fold(0, |seed: u64, byte| seed.wrapping_mul(31).wrapping_add(u64::from(byte)))
}

/// The UDP port of a drone's autopilot.
fn port(first: Option<u16>, drone: usize) -> Result<u16, EmulatedFieldError> {
    match first {
        Some(first) => u16::try_from(drone)
            .ok()
            .and_then(|drone| first.checked_add(drone))
            .ok_or(EmulatedFieldError::Port { first, drone }),
        None => Ok(UdpSocket::bind("127.0.0.1:0")?.local_addr()?.port()),
    }
}
