//! What stands in a flight's file for each device of a drone.

use foxhunt_hardware::{
    ArDroneConfig, FirmataConfig, GnssConfig, KrakenConfig, MavlinkConfig, RtlTcpConfig, XbeeConfig,
};
use foxhunt_sensors::{BodyConfig, OmnidirectionalConfig, StepperConfig};
use foxhunt_wire::Endpoint;
use serde::{Deserialize, Serialize};

/// The device that flies a drone.
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
    /// A Parrot AR.Drone 2.0.
    ArDrone {
        /// Where it takes orders: `udpout:192.168.1.1:5556`.
        endpoint: Endpoint,
        /// Where its navdata come from: `udpout:192.168.1.1:5554`.
        navdata: Endpoint,
        /// How it is flown; where it stands is the drone's `launch_m`.
        #[serde(default)]
        settings: ArDroneConfig,
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

/// The device that receives beacons.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum RadioDevice {
    /// An XBee, which sends a request to each beacon at its address.
    Xbee {
        /// Where it is reached.
        endpoint: Endpoint,
        /// How requests are sent; the addresses stand with the beacons.
        #[serde(default)]
        settings: XbeeConfig,
    },
    /// An RTL-SDR behind rtl_tcp, which is tuned to each beacon's frequency.
    RtlTcp {
        /// Where it is reached.
        endpoint: Endpoint,
        /// How power is measured; the frequencies stand with the beacons.
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
        /// Where it is reached.
        endpoint: Endpoint,
        /// How it is driven.
        #[serde(default)]
        settings: FirmataConfig,
    },
}

/// How a drone listens.
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
        /// Where its page is: `tcp:HOST:8081`.
        endpoint: Endpoint,
        /// How the page is read; the frequencies stand with the beacons.
        #[serde(default)]
        settings: KrakenConfig,
    },
}

impl ListenConfig {
    /// Whether it looks along one direction after the other, in turns that may go on.
    pub(super) fn turns(&self) -> bool {
        matches!(self, Self::Stepper(_) | Self::RotatingBody(_))
    }
}
