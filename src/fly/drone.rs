use foxhunt_core::Clock;
use foxhunt_hardware::{
    Finding, FirmataConfig, FirmataStepper, GnssConfig, GnssReceiver, MavlinkConfig, MavlinkOrigin,
    MavlinkVehicle, Placed, Reconnecting, Shared, XbeeConfig, XbeeRadio,
};
use foxhunt_sensors::{
    BodyConfig, BodySource, OmnidirectionalConfig, OmnidirectionalSource, StepperConfig,
    StepperSource,
};
use foxhunt_wire::Endpoint;
use serde::{Deserialize, Serialize};

use super::{
    BoxedAircraft, BoxedRadio, BoxedRotator, Examine, FlownBeacon, FlownDrone, FlyError, Site, Tap,
    Tapped,
    erased::{Erased, ExaminedAircraft},
};
use crate::config::{BoxedSource, boxed};

/// A drone and its devices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DroneConfig {
    /// What people call it.
    pub name: String,
    /// Where it stands before take-off, East and North of the site's origin in metres: for the plan of a
    /// dry run, and to notice drones that were mistaken for each other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub launch_m: Option<[f64; 2]>,
    /// What flies it.
    pub vehicle: VehicleDevice,
    /// A GNSS receiver that knows better where it is than what flies it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gnss: Option<GnssDevice>,
    /// What hears the beacons.
    pub radio: RadioDevice,
    /// What turns the antenna, where it is on a motor of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotator: Option<RotatorDevice>,
    /// How it goes through a turn.
    pub source: ListenConfig,
}

/// What flies a drone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum VehicleDevice {
    /// ArduPilot or PX4.
    Mavlink {
        /// Where it is reached.
        endpoint: Endpoint,
        /// How it is flown.
        #[serde(default)]
        settings: MavlinkConfig,
    },
}

/// A GNSS receiver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GnssDevice {
    /// Where it is reached.
    pub endpoint: Endpoint,
    /// How it is read.
    #[serde(default)]
    pub settings: GnssConfig,
}

/// What hears beacons.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum RadioDevice {
    /// An XBee, which asks each beacon at its address.
    Xbee {
        /// Where it is reached.
        endpoint: Endpoint,
        /// How beacons are asked; their addresses stand with the beacons.
        #[serde(default)]
        settings: XbeeConfig,
    },
}

/// What turns an antenna.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum RotatorDevice {
    /// A stepper behind Firmata.
    Firmata {
        /// Where it is reached.
        endpoint: Endpoint,
        /// How it is driven.
        #[serde(default)]
        settings: FirmataConfig,
    },
}

/// How a drone goes through a turn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ListenConfig {
    /// An antenna on a motor.
    Stepper(StepperConfig),
    /// An antenna that is fixed to the drone, which turns as a whole.
    RotatingBody(BodyConfig),
    /// An antenna without a direction.
    Omnidirectional(OmnidirectionalConfig),
}

/// A drone whose devices are open.
pub type OpenDrone = FlownDrone<Shared<BoxedAircraft>, BoxedSource>;

impl DroneConfig {
    /// What is wrong, as far as no device is asked.
    pub(super) fn check(&self, beacons: &[FlownBeacon]) -> Result<(), String> {
        let VehicleDevice::Mavlink { settings, .. } = &self.vehicle;
        settings.check().map_err(|error| format!("vehicle.settings.{error}"))?;
        if settings.origin.is_some() {
            return Err("vehicle.settings.origin: the origin stands in the site".into());
        }
        if let Some(gnss) = &self.gnss {
            gnss.settings.check().map_err(|error| format!("gnss.settings.{error}"))?;
        }
        let RadioDevice::Xbee { settings, .. } = &self.radio;
        let settings = with_addresses(settings, beacons)?;
        settings.check().map_err(|error| format!("radio.settings.{error}"))?;
        if let Some(RotatorDevice::Firmata { settings, .. }) = &self.rotator {
            settings.check().map_err(|error| format!("rotator.settings.{error}"))?;
        }
        match (&self.source, &self.rotator) {
            (ListenConfig::Stepper(_), None) => {
                Err("source.kind is \"stepper\", and there is no rotator".into())
            }
            (ListenConfig::RotatingBody(_) | ListenConfig::Omnidirectional(_), Some(_)) => {
                Err("there is a rotator, and source.kind is not \"stepper\"".into())
            }
            (ListenConfig::RotatingBody(config), None) => {
                config.check().map_err(|error| format!("source: {error}"))
            }
            _ => Ok(()),
        }
    }

    /// Its devices, each with where it is reached.
    pub fn endpoints(&self) -> impl Iterator<Item = (&'static str, &Endpoint)> {
        let VehicleDevice::Mavlink { endpoint: vehicle, .. } = &self.vehicle;
        let RadioDevice::Xbee { endpoint: radio, .. } = &self.radio;
        let gnss = self.gnss.as_ref().map(|gnss| ("gnss", &gnss.endpoint));
        let rotator = self
            .rotator
            .as_ref()
            .map(|RotatorDevice::Firmata { endpoint, .. }| ("rotator", endpoint));
        [Some(("vehicle", vehicle)), gnss, Some(("radio", radio)), rotator].into_iter().flatten()
    }

    /// Opens its devices.
    ///
    /// # Errors
    ///
    /// [`FlyError`] names the drone, the device and what is wrong.
    pub fn open<C: Clock + Clone + 'static>(
        &self,
        site: &Site,
        beacons: &[FlownBeacon],
        clock: &C,
    ) -> Result<OpenDrone, FlyError> {
        let aircraft = Shared::new(self.open_aircraft(site, clock)?);
        let radio = self.open_radio(beacons, clock)?;
        let source = self.open_source(radio, aircraft.clone(), clock)?;
        Ok(FlownDrone { name: self.name.clone(), aircraft, source })
    }

    fn open_aircraft<C: Clock + Clone + 'static>(
        &self,
        site: &Site,
        clock: &C,
    ) -> Result<BoxedAircraft, FlyError> {
        let VehicleDevice::Mavlink { endpoint, settings } = &self.vehicle;
        let stream = self.stream("vehicle", endpoint, clock)?;
        let origin = MavlinkOrigin { lat_deg: site.lat_deg, lon_deg: site.lon_deg };
        let settings = MavlinkConfig { origin: Some(origin), ..settings.clone() };
        let vehicle = MavlinkVehicle::new(settings, stream, clock.clone());
        let vehicle = vehicle.map_err(self.wrong("vehicle.settings"))?;
        let Some(gnss) = &self.gnss else { return Ok(boxed_aircraft(vehicle)) };
        let stream = self.stream("gnss", &gnss.endpoint, clock)?;
        let receiver = GnssReceiver::new(gnss.settings, stream, clock.clone());
        let receiver = receiver.map_err(self.wrong("gnss.settings"))?;
        let antenna = gnss.settings.antenna();
        Ok(boxed_aircraft(Placed::new(vehicle, receiver, site.frame()?, antenna)))
    }

    fn open_radio<C: Clock + Clone + 'static>(
        &self,
        beacons: &[FlownBeacon],
        clock: &C,
    ) -> Result<BoxedRadio, FlyError> {
        let RadioDevice::Xbee { endpoint, settings } = &self.radio;
        let settings = with_addresses(settings, beacons).map_err(self.wrong("radio"))?;
        let stream = self.stream("radio", endpoint, clock)?;
        let radio = XbeeRadio::new(settings, stream, clock.clone());
        Ok(Box::new(Erased(radio.map_err(self.wrong("radio.settings"))?)))
    }

    fn open_rotator<C: Clock + Clone + 'static>(
        &self,
        rotator: &RotatorDevice,
        clock: &C,
    ) -> Result<BoxedRotator, FlyError> {
        let RotatorDevice::Firmata { endpoint, settings } = rotator;
        let stream = self.stream("rotator", endpoint, clock)?;
        let rotator = FirmataStepper::new(settings.clone(), stream, clock.clone());
        Ok(Box::new(Erased(rotator.map_err(self.wrong("rotator.settings"))?)))
    }

    /// Looks at each of its devices, and tells what was found of it as soon as it is known. `pause` is
    /// called while a device is waited for.
    pub fn examine<C: Clock + Clone + 'static>(
        &self,
        site: &Site,
        beacons: &[FlownBeacon],
        clock: &C,
        pause: &mut dyn FnMut(),
        tell: &mut dyn FnMut(&'static str, Vec<Finding>),
    ) {
        let mut look = |device, open: Result<Box<dyn Examine>, FlyError>| {
            let findings = open
                .map_or_else(|error| vec![unopened(&error)], |mut device| device.examine(pause));
            tell(device, findings);
        };
        look("vehicle", self.open_aircraft(site, clock).map(|device| Box::new(device) as _));
        look("radio", self.open_radio(beacons, clock).map(|device| Box::new(device) as _));
        if let Some(rotator) = &self.rotator {
            look("rotator", self.open_rotator(rotator, clock).map(|device| Box::new(device) as _));
        }
    }

    fn open_source<C: Clock + Clone + 'static>(
        &self,
        radio: BoxedRadio,
        aircraft: Shared<BoxedAircraft>,
        clock: &C,
    ) -> Result<BoxedSource, FlyError> {
        let clock = clock.clone();
        Ok(match (self.source, &self.rotator) {
            (ListenConfig::Stepper(config), Some(rotator)) => {
                let rotator = self.open_rotator(rotator, &clock)?;
                boxed(StepperSource::new(config, radio, rotator, aircraft, clock))
            }
            (ListenConfig::Stepper(_), None) => {
                return Err(self.wrong("source")("there is no rotator"));
            }
            (ListenConfig::RotatingBody(config), _) => {
                let source = BodySource::new(config, radio, aircraft, clock);
                boxed(source.map_err(self.wrong("source"))?)
            }
            (ListenConfig::Omnidirectional(config), _) => {
                let source = OmnidirectionalSource::new(config, radio, aircraft, clock);
                boxed(source.map_err(self.wrong("source"))?)
            }
        })
    }

    fn stream<C: Clock + Clone>(
        &self,
        device: &'static str,
        endpoint: &Endpoint,
        clock: &C,
    ) -> Result<Reconnecting<C>, FlyError> {
        Reconnecting::open(endpoint.clone(), clock.clone()).map_err(|source| FlyError::Open {
            drone: self.name.clone(),
            device,
            source,
        })
    }

    fn wrong<E: ToString>(&self, place: &str) -> impl FnOnce(E) -> FlyError {
        move |error| FlyError::Drone {
            drone: self.name.clone(),
            reason: format!("{place}: {}", error.to_string()),
        }
    }
}

impl super::FlightConfig {
    /// Opens the devices of all drones, whose sweeps `tap` sees if there is one.
    ///
    /// # Errors
    ///
    /// [`FlyError`] names the drone, the device and what is wrong.
    pub fn open<C: Clock + Clone + 'static>(
        &self,
        clock: &C,
        tap: Option<&Tap>,
    ) -> Result<Vec<OpenDrone>, FlyError> {
        let open = |(index, drone): (usize, &DroneConfig)| {
            let mut open = drone.open(&self.site, &self.beacons, clock)?;
            if let Some(tap) = tap {
                open.source = boxed(Tapped::new(open.source, index, tap.clone()));
            }
            Ok(open)
        };
        self.drones.iter().enumerate().map(open).collect()
    }
}

/// What is found of a device whose port cannot be opened.
fn unopened(error: &FlyError) -> Finding {
    let remedy = match error {
        FlyError::Open { source, .. } if source.kind() == std::io::ErrorKind::PermissionDenied => {
            "allow yourself the port: add your user to the group dialout, and log in again"
        }
        FlyError::Open { .. } => {
            "plug it in and switch it on; without a file this command lists the ports that there are"
        }
        _ => "correct the file",
    };
    Finding::bad("port", error, remedy)
}

fn boxed_aircraft<A: ExaminedAircraft + 'static>(aircraft: A) -> BoxedAircraft {
    Box::new(Erased(aircraft))
}

/// An XBee's settings with the addresses of the flight's beacons.
fn with_addresses(settings: &XbeeConfig, beacons: &[FlownBeacon]) -> Result<XbeeConfig, String> {
    if !settings.beacons.is_empty() {
        return Err("radio.settings.beacons: the addresses stand with the beacons".into());
    }
    let address = |beacon: &FlownBeacon| {
        let text = beacon.address.as_deref();
        let text = text.ok_or_else(|| format!("beacon {:?} has no address", beacon.name))?;
        text.parse().map_err(|error| format!("beacon {:?}: {error}", beacon.name))
    };
    let beacons = beacons.iter().map(address).collect::<Result<_, String>>()?;
    Ok(XbeeConfig { beacons, ..settings.clone() })
}
