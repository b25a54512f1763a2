//! Sections of a flight's file: its origin, its beacons, and the devices of a drone.

use foxhunt_hardware::{
    ArDroneConfig, CarriedConfig, CorrectionsConfig, FirmataConfig, FixedConfig, GnssConfig,
    KrakenConfig, MavlinkConfig, MotionCaptureConfig, RtlTcpConfig, XbeeConfig,
};
use foxhunt_sensors::{BodyConfig, OmnidirectionalConfig, StepperConfig};
use foxhunt_wire::{
    Endpoint,
    geodesy::{Geodetic, LocalFrame},
};
use serde::{Deserialize, Serialize};

use super::FlyError;

/// The origin of the common frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Site {
    /// Latitude in degrees, WGS84, North positive.
    pub lat_deg: f64,
    /// Longitude in degrees, WGS84, East positive.
    pub lon_deg: f64,
    /// Height above the ellipsoid of the ground where the drones stand, in metres: what Up is
    /// counted from for drones with a GNSS receiver of their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ground_alt_m: Option<f64>,
}

impl Site {
    /// The common East-North-Up frame.
    ///
    /// # Errors
    ///
    /// [`FlyError::Site`] when there is no such place.
    pub fn frame(&self) -> Result<LocalFrame, FlyError> {
        Ok(LocalFrame::new(Geodetic::new(
            self.lat_deg,
            self.lon_deg,
            self.ground_alt_m.unwrap_or(0.0),
        )?)?)
    }
}

/// A beacon that is to be found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlownBeacon {
    /// Name of the beacon.
    pub name: String,
    /// XBee address of the beacon: 16 hexadecimal digits, or 4.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub address: Option<String>,
    /// The frequency that a receiver is tuned to, in MHz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency_mhz: Option<f64>,
}

/// The device that flies a drone, or the way in which a receiver is carried or stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum VehicleDevice {
    /// ArduPilot or PX4.
    Mavlink {
        /// Endpoint of the autopilot.
        endpoint: Endpoint,
        /// Settings of the autopilot's driver.
        #[serde(default)]
        settings: MavlinkConfig,
    },
    /// A Parrot AR.Drone 2.0.
    ArDrone {
        /// Endpoint for orders: `udpout:192.168.1.1:5556`.
        endpoint: Endpoint,
        /// Endpoint of its navdata: `udpout:192.168.1.1:5554`.
        navdata: Endpoint,
        /// Motion capture that gives its place and heading; its own odometry alone where absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        motion_capture: Option<MotionCaptureConfig>,
        /// Settings of its driver; its place before take-off is the drone's `launch_m`.
        #[serde(default)]
        settings: ArDroneConfig,
    },
    /// A person, a car or a boat, whose place the drone's `gnss` knows. Goals are proposals.
    Carried {
        /// Endpoint that each goal is sent to, as a waypoint of NMEA 0183: a plotter or a phone.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        guide: Option<Endpoint>,
        /// Settings of the carrier.
        #[serde(default)]
        settings: CarriedConfig,
    },
    /// A station that stands at the drone's `launch_m`.
    Fixed {
        /// Settings of the station.
        #[serde(default)]
        settings: FixedConfig,
    },
}

impl VehicleDevice {
    /// Returns true if it is carried: it goes somewhere, and does not fly.
    #[must_use]
    pub fn is_carried(&self) -> bool {
        matches!(self, Self::Carried { .. })
    }

    /// Returns true if nothing flies: it is carried, or stands.
    #[must_use]
    pub fn is_on_the_ground(&self) -> bool {
        matches!(self, Self::Carried { .. } | Self::Fixed { .. })
    }
}

/// A GNSS receiver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GnssDevice {
    /// Endpoint of the receiver.
    pub endpoint: Endpoint,
    /// Settings of its reader.
    #[serde(default)]
    pub settings: GnssConfig,
    /// Corrections that are forwarded to it; none where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corrections: Option<CorrectionsConfig>,
}

/// The device that receives beacons.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum RadioDevice {
    /// An XBee, which sends a request to each beacon at its address.
    Xbee {
        /// Endpoint of the XBee.
        endpoint: Endpoint,
        /// Settings of the requests; the addresses stand with the beacons.
        #[serde(default)]
        settings: XbeeConfig,
    },
    /// An RTL-SDR behind rtl_tcp, which is tuned to each beacon's frequency.
    RtlTcp {
        /// Endpoint of rtl_tcp.
        endpoint: Endpoint,
        /// Settings of the power measurement; the frequencies stand with the beacons.
        #[serde(default)]
        settings: RtlTcpConfig,
    },
    /// The SiK radio of the autopilot's own link: the one at its other end is the only beacon.
    Sik,
}

/// The device that turns an antenna.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum RotatorDevice {
    /// A stepper behind Firmata.
    Firmata {
        /// Endpoint of Firmata.
        endpoint: Endpoint,
        /// Settings of the stepper's driver.
        #[serde(default)]
        settings: FirmataConfig,
    },
}

/// Source with which a drone listens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ListenConfig {
    /// An antenna on a motor.
    Stepper(StepperConfig),
    /// An antenna that is fixed to the drone, which turns as a whole.
    RotatingBody(BodyConfig),
    /// An antenna without a direction.
    Omnidirectional(OmnidirectionalConfig),
    /// A KrakenSDR, whose array needs no turning, and no radio beside it.
    Kraken {
        /// Endpoint of its page: `tcp:HOST:8081`.
        endpoint: Endpoint,
        /// Settings for reading the page; the frequencies stand with the beacons.
        #[serde(default)]
        settings: KrakenConfig,
    },
}

impl ListenConfig {
    /// Returns true if it looks along one direction after the other, in turns that may go on.
    pub(super) fn turns(&self) -> bool {
        matches!(self, Self::Stepper(_) | Self::RotatingBody(_))
    }
}
