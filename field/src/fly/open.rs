//! Opening the devices of drones at their ports.

use std::io;

use foxhunt_core::Clock;
use foxhunt_hardware::{
    ArDrone, CarriedVehicle, Corrections, Finding, FirmataStepper, GnssDecoder, GnssReceiver,
    KrakenSource, MavlinkVehicle, MotionCapture, Placed, Reconnecting, RtlTcpRadio, Shared,
    SikFeed, SikRadio, XbeeRadio,
};
use foxhunt_hunt::hunt::{BoxedSource, boxed_source};
use foxhunt_sensors::{BodySource, OmnidirectionalSource, StepperSource, TurnGoal};
use foxhunt_wire::{ByteStream, Endpoint, SharedPort, SharedStream};

use super::{
    BoxedAircraft, BoxedRadio, BoxedRotator, DroneConfig, Examine, FlightConfig, FlownBeacon,
    FlownDrone, FlyError, GnssDevice, Ground, ListenConfig, RadioDevice, RotatorDevice, Site, Tap,
    Tapped, VehicleDevice,
    driver::{Driver, ExaminedAircraft},
    drone::{found_at, tuned, with_addresses, with_origin},
    eager::Eager,
    wrapped::{Advised, OverGround},
};

/// A GNSS receiver whose port is open.
type OpenGnss<C> = GnssReceiver<Box<dyn ByteStream>, C, Box<dyn GnssDecoder>>;

/// A KrakenSDR whose page is fetched again and again.
type OpenKraken<C> = KrakenSource<Box<dyn ByteStream>, Connector, Shared<BoxedAircraft>, C>;

/// A drone whose devices are open.
pub type OpenDrone = FlownDrone<Shared<BoxedAircraft>, BoxedSource>;

impl FlightConfig {
    /// Opens the devices of all drones at `ports`, whose turns go on for `goal` if there is one;
    /// their sweeps are passed to `tap` if there is one. The clock was 0 at `clock_origin_unix_s`
    /// of UNIX time, which signatures carry.
    ///
    /// # Errors
    ///
    /// [`FlyError`] names the drone, the device and what is wrong.
    pub fn open<C: Clock + Clone + 'static>(
        &self,
        ports: &mut dyn Ports,
        clock: &C,
        clock_origin_unix_s: f64,
        goal: Option<&TurnGoal>,
        tap: Option<&Tap>,
    ) -> Result<Vec<OpenDrone>, FlyError> {
        let ground = self.ground()?;
        let ground = ground.as_ref();
        let open = |(index, drone): (usize, &DroneConfig)| {
            let mut open = drone.open(self, ground, ports, clock, clock_origin_unix_s, goal)?;
            if let Some(tap) = tap {
                let tap = tap.clone();
                open.source = if drone.listens_on_the_way() {
                    let beacons = u16::try_from(self.beacons.len()).unwrap_or(u16::MAX);
                    let eager = Eager::new(open.source, index, beacons, tap);
                    open.listens_between = Some(eager.ordered());
                    boxed_source(eager)
                } else {
                    boxed_source(Tapped::new(open.source, index, tap))
                };
            }
            Ok(open)
        };
        self.drones.iter().enumerate().map(open).collect()
    }
}

impl DroneConfig {
    /// Opens its devices for a flight, over `ground` where that has an elevation model; its turns go
    /// on for `goal` if there is one.
    ///
    /// # Errors
    ///
    /// [`FlyError`] names the drone, the device and what is wrong.
    pub fn open<C: Clock + Clone + 'static>(
        &self,
        flight: &FlightConfig,
        ground: Option<&Ground>,
        ports: &mut dyn Ports,
        clock: &C,
        clock_origin_unix_s: f64,
        goal: Option<&TurnGoal>,
    ) -> Result<OpenDrone, FlyError> {
        let feed = SikFeed::default();
        let site = &flight.site;
        // Heights of what is carried or stands are above the ground already.
        let ground = ground.filter(|_| !self.vehicle.is_on_the_ground());
        let aircraft: BoxedAircraft = match ground {
            None => self.open_aircraft(site, &feed, ports, clock, clock_origin_unix_s)?,
            Some(ground) => {
                let wide = self.with_limits_over(ground);
                let aircraft =
                    wide.open_aircraft(site, &feed, ports, clock, clock_origin_unix_s)?;
                let limits_m = self.limits_up_m().into();
                Box::new(Driver(OverGround::new(aircraft, ground.clone(), limits_m)))
            }
        };
        let aircraft = Shared::new(aircraft);
        let source =
            self.open_source(&flight.beacons, aircraft.clone(), feed, ports, clock, goal)?;
        let drone = FlownDrone::new(self.name.clone(), aircraft, source);
        Ok(match ground {
            None => drone,
            Some(ground) => drone.with_height_tolerance(ground.height_tolerance_m()),
        })
    }

    /// Examines each of its devices, and calls `report` with its name and the findings as soon as
    /// they are known. `pause` is called while a device is waited for.
    pub fn examine<C: Clock + Clone + 'static>(
        &self,
        site: &Site,
        beacons: &[FlownBeacon],
        clock: &C,
        clock_origin_unix_s: f64,
        pause: &mut dyn FnMut(),
        report: &mut dyn FnMut(&'static str, Vec<Finding>),
    ) {
        let mut examine = |device, open: Result<Box<dyn Examine>, FlyError>| {
            let findings = open
                .map_or_else(|error| vec![unopened(&error)], |mut device| device.examine(pause));
            report(device, findings);
        };
        let feed = SikFeed::default();
        let ports = &mut SystemPorts::new(clock.clone());
        // A SiK radio reports through the autopilot's link, which is served while it is examined.
        let vehicle = self.open_aircraft(site, &feed, ports, clock, clock_origin_unix_s);
        examine("vehicle", vehicle.map(|device| Box::new(device) as _));
        match &self.source {
            ListenConfig::Kraken { .. } => {
                let aircraft = self.open_aircraft(site, &feed, ports, clock, clock_origin_unix_s);
                let aircraft = aircraft.map(Shared::new);
                let source = aircraft.and_then(|a| self.open_kraken(beacons, a, ports, clock));
                examine("kraken", source.map(|device| Box::new(device) as _));
            }
            _ => {
                let radio = self.open_radio(beacons, feed, ports, clock);
                examine("radio", radio.map(|device| Box::new(device) as _));
            }
        }
        if let Some(rotator) = &self.rotator {
            let rotator = self.open_rotator(rotator, ports, clock);
            examine("rotator", rotator.map(|device| Box::new(device) as _));
        }
    }

    fn open_aircraft<C: Clock + Clone + 'static>(
        &self,
        site: &Site,
        feed: &SikFeed,
        ports: &mut dyn Ports,
        clock: &C,
        clock_origin_unix_s: f64,
    ) -> Result<BoxedAircraft, FlyError> {
        match &self.vehicle {
            VehicleDevice::Mavlink { endpoint, settings } => {
                let settings = with_origin(settings, site).map_err(|error| self.wrong(error))?;
                let listen_only = settings.listen_only;
                let stream = self.stream("vehicle", endpoint, ports)?;
                let vehicle = MavlinkVehicle::new(settings, stream, clock.clone());
                let vehicle = vehicle.map_err(|error| self.wrong(error))?;
                let vehicle =
                    vehicle.with_clock_origin(clock_origin_unix_s).with_radio_reports(feed.clone());
                match listen_only {
                    true => self.placed(Advised(vehicle), site, ports, clock),
                    false => self.placed(vehicle, site, ports, clock),
                }
            }
            VehicleDevice::ArDrone { endpoint, navdata, motion_capture, settings } => {
                let orders = self.stream("vehicle", endpoint, ports)?;
                let navdata = self.stream("navdata", navdata, ports)?;
                let settings = self.with_launch(settings);
                let vehicle = ArDrone::new(settings, orders, navdata, clock.clone());
                let mut vehicle = vehicle.map_err(|error| self.wrong(error))?;
                if let Some(config) = motion_capture {
                    let stream = self.stream("motion capture", &config.endpoint, ports)?;
                    let capture = MotionCapture::new(config.clone(), stream);
                    vehicle =
                        vehicle.with_motion_capture(capture.map_err(|error| self.wrong(error))?);
                }
                self.placed(vehicle, site, ports, clock)
            }
            VehicleDevice::Carried { guide, settings } => {
                let gnss = self.gnss.as_ref().ok_or_else(|| self.wrong("there is no gnss"))?;
                let receiver = self.open_gnss(gnss, ports, clock)?;
                let carrier = CarriedVehicle::new(*settings, receiver, site.frame()?)
                    .with_antenna(gnss.settings.antenna());
                let carrier = match &self.source {
                    ListenConfig::Omnidirectional(_) => carrier.omnidirectional(),
                    _ => carrier,
                };
                let guide = guide.as_ref().map(|guide| self.stream("guide", guide, ports));
                Ok(match guide.transpose()? {
                    Some(guide) => Box::new(Driver(carrier.with_guide(guide))),
                    None => Box::new(Driver(carrier)),
                })
            }
            VehicleDevice::Fixed { settings } => {
                let place = self.launch_m.ok_or_else(|| self.wrong("there is no launch_m"))?;
                let station = CarriedVehicle::fixed(*settings, place, site.frame()?);
                Ok(Box::new(Driver(station)))
            }
        }
    }

    fn open_gnss<C: Clock + Clone + 'static>(
        &self,
        gnss: &GnssDevice,
        ports: &mut dyn Ports,
        clock: &C,
    ) -> Result<OpenGnss<C>, FlyError> {
        let stream = self.stream("gnss", &gnss.endpoint, ports)?;
        let receiver = GnssReceiver::new(gnss.settings, stream, clock.clone());
        let receiver = receiver.map_err(|error| self.wrong(error))?;
        let Some(config) = &gnss.corrections else { return Ok(receiver) };
        let kind = gnss.settings.kind;
        let corrections = match &config.endpoint {
            Some(endpoint) => {
                let stream = ports.open_own(endpoint).map_err(|source| FlyError::Open {
                    drone: self.name.clone(),
                    device: "corrections",
                    source,
                })?;
                Corrections::new(config.clone(), kind, stream)
            }
            None => Corrections::follow(config.clone(), kind),
        };
        let wrong = |error| self.wrong(format!("gnss.corrections: {error}"));
        Ok(receiver.with_corrections(corrections.map_err(wrong)?))
    }

    /// The aircraft, placed by its own GNSS receiver if it has one.
    fn placed<A: ExaminedAircraft + 'static, C: Clock + Clone + 'static>(
        &self,
        aircraft: A,
        site: &Site,
        ports: &mut dyn Ports,
        clock: &C,
    ) -> Result<BoxedAircraft, FlyError> {
        let Some(gnss) = &self.gnss else { return Ok(Box::new(Driver(aircraft))) };
        let receiver = self.open_gnss(gnss, ports, clock)?;
        let antenna = gnss.settings.antenna();
        Ok(Box::new(Driver(Placed::new(aircraft, receiver, site.frame()?, antenna))))
    }

    fn open_radio<C: Clock + Clone + 'static>(
        &self,
        beacons: &[FlownBeacon],
        feed: SikFeed,
        ports: &mut dyn Ports,
        clock: &C,
    ) -> Result<BoxedRadio, FlyError> {
        Ok(match &self.radio {
            Some(RadioDevice::Xbee { endpoint, settings }) => {
                let settings = with_addresses(settings, beacons).map_err(|e| self.wrong(e))?;
                let stream = self.stream("radio", endpoint, ports)?;
                let radio = XbeeRadio::new(settings, stream, clock.clone());
                Box::new(Driver(radio.map_err(|error| self.wrong(error))?))
            }
            Some(RadioDevice::RtlTcp { endpoint, settings }) => {
                let settings = tuned(settings, beacons).map_err(|error| self.wrong(error))?;
                let stream = self.stream("radio", endpoint, ports)?;
                let radio = RtlTcpRadio::new(settings, stream, clock.clone());
                Box::new(Driver(radio.map_err(|error| self.wrong(error))?))
            }
            Some(RadioDevice::Sik) => Box::new(Driver(SikRadio::new(feed))),
            None => return Err(self.wrong("there is no radio")),
        })
    }

    fn open_rotator<C: Clock + Clone + 'static>(
        &self,
        rotator: &RotatorDevice,
        ports: &mut dyn Ports,
        clock: &C,
    ) -> Result<BoxedRotator, FlyError> {
        let RotatorDevice::Firmata { endpoint, settings } = rotator;
        let stream = self.stream("rotator", endpoint, ports)?;
        let rotator = FirmataStepper::new(settings.clone(), stream, clock.clone());
        Ok(Box::new(Driver(rotator.map_err(|error| self.wrong(error))?)))
    }

    fn open_source<C: Clock + Clone + 'static>(
        &self,
        beacons: &[FlownBeacon],
        aircraft: Shared<BoxedAircraft>,
        feed: SikFeed,
        ports: &mut dyn Ports,
        clock: &C,
        goal: Option<&TurnGoal>,
    ) -> Result<BoxedSource, FlyError> {
        if matches!(self.source, ListenConfig::Kraken { .. }) {
            return Ok(boxed_source(self.open_kraken(beacons, aircraft, ports, clock)?));
        }
        let radio = self.open_radio(beacons, feed, ports, clock)?;
        let clock = clock.clone();
        Ok(match (&self.source, &self.rotator) {
            (ListenConfig::Stepper(config), Some(rotator)) => {
                let rotator = self.open_rotator(rotator, ports, &clock)?;
                let source = StepperSource::new(*config, radio, rotator, aircraft, clock);
                boxed_source(match goal {
                    Some(goal) => source.with_goal(goal.clone()),
                    None => source,
                })
            }
            (ListenConfig::RotatingBody(config), _) => {
                let source = BodySource::new(*config, radio, aircraft, clock);
                let source = source.map_err(|error| self.wrong(error))?;
                boxed_source(match goal {
                    Some(goal) => source.with_goal(goal.clone()),
                    None => source,
                })
            }
            (ListenConfig::Omnidirectional(config), _) => {
                let source = OmnidirectionalSource::new(*config, radio, aircraft, clock);
                boxed_source(source.map_err(|error| self.wrong(error))?)
            }
            (ListenConfig::Stepper(_) | ListenConfig::Kraken { .. }, _) => {
                return Err(self.wrong("source.kind does not go with its devices"));
            }
        })
    }

    fn open_kraken<C: Clock + Clone + 'static>(
        &self,
        beacons: &[FlownBeacon],
        aircraft: Shared<BoxedAircraft>,
        ports: &mut dyn Ports,
        clock: &C,
    ) -> Result<OpenKraken<C>, FlyError> {
        let ListenConfig::Kraken { endpoint, settings } = &self.source else {
            return Err(self.wrong("source.kind is not \"kraken\""));
        };
        let settings = found_at(settings, beacons).map_err(|error| self.wrong(error))?;
        let source =
            KrakenSource::new(settings, ports.connector(endpoint), aircraft, clock.clone());
        source.map_err(|error| self.wrong(error))
    }

    fn stream(
        &self,
        device: &'static str,
        endpoint: &Endpoint,
        ports: &mut dyn Ports,
    ) -> Result<Box<dyn ByteStream>, FlyError> {
        ports.open(endpoint).map_err(|source| FlyError::Open {
            drone: self.name.clone(),
            device,
            source,
        })
    }

    fn wrong(&self, reason: impl ToString) -> FlyError {
        FlyError::Drone { drone: self.name.clone(), reason: reason.to_string() }
    }
}

/// Opens the ports at which the devices of a flight are reached.
pub trait Ports {
    /// Opens one.
    ///
    /// # Errors
    ///
    /// Any error of the port, with its name or address.
    fn open(&mut self, endpoint: &Endpoint) -> io::Result<Box<dyn ByteStream>>;

    /// Opens a connection to a server that serves each client apart, such as an NTRIP caster.
    /// Unless overridden it is opened as any other.
    ///
    /// # Errors
    ///
    /// Any error of the port, with its name or address.
    fn open_own(&mut self, endpoint: &Endpoint) -> io::Result<Box<dyn ByteStream>> {
        self.open(endpoint)
    }

    /// Returns a maker of connections to a server that takes one for each question. Unless
    /// overridden the server is on the network.
    fn connector(&mut self, endpoint: &Endpoint) -> Connector {
        let endpoint = endpoint.clone();
        Box::new(move || Ok(endpoint.open()?))
    }
}

/// Maker of connections to a server.
pub type Connector = Box<dyn FnMut() -> io::Result<Box<dyn ByteStream>>>;

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

    fn open_own(&mut self, endpoint: &Endpoint) -> io::Result<Box<dyn ByteStream>> {
        Ok(Box::new(Reconnecting::open(endpoint.clone(), self.clock.clone())?))
    }
}

/// Returns the finding about a device whose port cannot be opened.
fn unopened(error: &FlyError) -> Finding {
    let remedy = match error {
        FlyError::Open { source, .. } if source.kind() == std::io::ErrorKind::PermissionDenied => {
            "allow yourself the port: add your user to the group dialout, and log in again"
        }
        FlyError::Open { .. } => {
            "plug it in and switch it on; without a file this command lists the ports that there \
             are"
        }
        _ => "correct the file",
    };
    Finding::bad("port", error, remedy)
}
