use foxhunt_core::parameter::FieldError;
use foxhunt_hardware::{
    ArDroneConfig, KrakenConfig, MavlinkConfig, MavlinkOrigin, RtlTcpConfig, XbeeConfig,
};
use foxhunt_wire::Endpoint;
use serde::{Deserialize, Serialize};

use super::{
    FlownBeacon, GnssDevice, Ground, ListenConfig, RadioDevice, RotatorDevice, Site, VehicleDevice,
};

/// A drone and its devices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DroneConfig {
    /// Name of the drone.
    pub name: String,
    /// Place before take-off, East and North of the site's origin in metres: for the plan of a dry
    /// run, and for aircraft without a position of their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub launch_m: Option<[f64; 2]>,
    /// Device that flies it.
    pub vehicle: VehicleDevice,
    /// A GNSS receiver whose place is better than that of the device that flies the drone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gnss: Option<GnssDevice>,
    /// Device that receives the beacons, unless its source does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radio: Option<RadioDevice>,
    /// Device that turns the antenna, if a motor of its own does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotator: Option<RotatorDevice>,
    /// Source with which it listens.
    pub source: ListenConfig,
}

impl DroneConfig {
    /// Refuses devices that do not fit together, and settings that are out of their range; no
    /// device is opened.
    pub(super) fn check(
        &self,
        site: &Site,
        beacons: &[FlownBeacon],
        takeoff_up_m: f64,
    ) -> Result<(), String> {
        let (least, most) = self.limits_up_m();
        if !(least..=most).contains(&takeoff_up_m) {
            return Err(format!(
                "flight.takeoff_up_m is {takeoff_up_m}; vehicle.settings allow {least} to {most} m"
            ));
        }
        match &self.vehicle {
            VehicleDevice::Mavlink { settings, .. } => {
                let settings = with_origin(settings, site)?;
                settings.check().map_err(|error| nested("vehicle.settings", error))?;
            }
            VehicleDevice::ArDrone { settings, motion_capture, .. } => {
                let settings = self.with_launch(settings);
                settings.check().map_err(|error| nested("vehicle.settings", error))?;
                if let Some(capture) = motion_capture {
                    capture.check().map_err(|error| nested("vehicle.motion_capture", error))?;
                    if self.gnss.is_some() {
                        return Err("vehicle.motion_capture and gnss both give its place; leave \
                                    one out"
                            .into());
                    }
                }
            }
            VehicleDevice::Carried { settings, .. } => {
                settings.check().map_err(|error| nested("vehicle.settings", error))?;
                if self.gnss.is_none() {
                    return Err("vehicle.kind is \"carried\", and there is no gnss".into());
                }
            }
            VehicleDevice::Fixed { settings } => {
                settings.check().map_err(|error| nested("vehicle.settings", error))?;
                if self.launch_m.is_none() || self.gnss.is_some() {
                    return Err(
                        "vehicle.kind is \"fixed\", which stands at launch_m and needs no \
                                gnss"
                            .into(),
                    );
                }
                if matches!(self.source, ListenConfig::RotatingBody(_)) {
                    return Err("source.kind is \"rotating-body\", and vehicle.kind \"fixed\", \
                                which nobody turns"
                        .into());
                }
            }
        }
        if self.is_listened_to() && matches!(self.source, ListenConfig::RotatingBody(_)) {
            return Err("source.kind is \"rotating-body\", which turns the drone, and \
                        vehicle.settings.listen_only is true"
                .into());
        }
        if let Some(gnss) = &self.gnss {
            if site.ground_alt_m.is_none() && !self.vehicle.is_on_the_ground() {
                return Err(
                    "a gnss of its own needs site.ground_alt_m, which heights are above".into()
                );
            }
            gnss.settings.check().map_err(|error| nested("gnss.settings", error))?;
            if let Some(corrections) = &gnss.corrections {
                let checked = corrections.check(gnss.settings.kind);
                checked.map_err(|error| format!("gnss.corrections: {error}"))?;
            }
        }
        match &self.radio {
            Some(RadioDevice::Xbee { settings, .. }) => {
                let settings = with_addresses(settings, beacons)?;
                settings.check().map_err(|error| nested("radio.settings", error))?;
            }
            Some(RadioDevice::RtlTcp { settings, .. }) => {
                let settings = tuned(settings, beacons)?;
                settings.check().map_err(|error| nested("radio.settings", error))?;
            }
            Some(RadioDevice::Sik) if beacons.len() > 1 => {
                return Err("radio.kind is \"sik\", which receives one beacon alone".into());
            }
            Some(RadioDevice::Sik) if !matches!(self.vehicle, VehicleDevice::Mavlink { .. }) => {
                return Err("radio.kind is \"sik\", and vehicle.kind not \"mavlink\"".into());
            }
            Some(RadioDevice::Sik) | None => {}
        }
        if let Some(RotatorDevice::Firmata { settings, .. }) = &self.rotator {
            settings.check().map_err(|error| nested("rotator.settings", error))?;
        }
        self.check_patience()?;
        match (&self.source, &self.rotator, &self.radio) {
            (ListenConfig::Kraken { settings, .. }, None, None) => {
                let settings = found_at(settings, beacons)?;
                settings.check().map_err(|error| nested("source.settings", error))
            }
            (ListenConfig::Kraken { .. }, ..) => {
                Err("source.kind is \"kraken\", which needs neither radio nor rotator".into())
            }
            (_, _, None) => Err("there is no radio".into()),
            (ListenConfig::Stepper(_), None, _) => {
                Err("source.kind is \"stepper\", and there is no rotator".into())
            }
            (ListenConfig::RotatingBody(_) | ListenConfig::Omnidirectional(_), Some(_), _) => {
                Err("there is a rotator, and source.kind is not \"stepper\"".into())
            }
            (ListenConfig::RotatingBody(config), ..) => {
                config.check().map_err(|error| nested("source", error))
            }
            _ => Ok(()),
        }
    }

    /// Refuses a source that gives a question up before a pulse can have come.
    fn check_patience(&self) -> Result<(), String> {
        let Some(RadioDevice::RtlTcp { settings, .. }) = &self.radio else { return Ok(()) };
        if settings.pulse.is_none() {
            return Ok(());
        }
        let question_s = settings.longest_question_s();
        let (field, patience_s) = match &self.source {
            ListenConfig::Stepper(config) => {
                let samples = f64::from(config.samples_per_position());
                ("position_timeout", config.position_timeout() / samples)
            }
            ListenConfig::RotatingBody(config) => ("answer_timeout_s", config.answer_timeout_s),
            ListenConfig::Omnidirectional(config) => ("answer_timeout_s", config.answer_timeout_s),
            ListenConfig::Kraken { .. } => return Ok(()),
        };
        if patience_s < question_s {
            return Err(format!(
                "source.{field} leaves {patience_s:.2} s for a sample, and radio.settings take up \
                 to {question_s:.2} s: settling_s, pulse.interval_s and what finding a pulse takes"
            ));
        }
        Ok(())
    }

    /// Returns the least and the greatest height to which it may be sent, in metres.
    pub(super) fn limits_up_m(&self) -> (f64, f64) {
        match &self.vehicle {
            VehicleDevice::Mavlink { settings, .. } => {
                (settings.limits.min_up_m, settings.limits.max_up_m)
            }
            VehicleDevice::ArDrone { settings, .. } => (settings.min_up_m, settings.max_up_m),
            VehicleDevice::Carried { .. } | VehicleDevice::Fixed { .. } => {
                (f64::NEG_INFINITY, f64::INFINITY)
            }
        }
    }

    /// Returns true if it listens between the turns of the hunt, too: somebody carries it, and
    /// nothing has to turn.
    pub(super) fn listens_on_the_way(&self) -> bool {
        matches!(self.vehicle, VehicleDevice::Carried { .. })
            && matches!(self.source, ListenConfig::Omnidirectional(_))
    }

    /// Returns its height above the ground in metres where that is not the one of take-off.
    pub(super) fn own_up_m(&self) -> Option<f64> {
        match &self.vehicle {
            VehicleDevice::Carried { settings, .. } => Some(settings.up_m),
            VehicleDevice::Fixed { settings } => Some(settings.up_m),
            _ => None,
        }
    }

    /// Returns this drone with its driver's limits, which count from its launch place, widened by
    /// the ground's relief.
    pub(super) fn with_limits_over(&self, ground: &Ground) -> Self {
        let mut drone = self.clone();
        if let VehicleDevice::Mavlink { settings, .. } = &mut drone.vehicle {
            settings.limits.min_up_m -= ground.relief_m();
            settings.limits.max_up_m += ground.relief_m();
        }
        drone
    }

    fn is_listened_to(&self) -> bool {
        matches!(&self.vehicle, VehicleDevice::Mavlink { settings, .. } if settings.listen_only)
    }

    /// Leaves it to its pilot: nothing is sent to what flies it.
    pub(super) fn listen_only(&mut self) -> Result<(), String> {
        match &mut self.vehicle {
            VehicleDevice::Mavlink { settings, .. } => {
                settings.listen_only = true;
                Ok(())
            }
            VehicleDevice::ArDrone { .. } => {
                Err("vehicle.kind is \"ar-drone\", which reports nothing unless it is flown".into())
            }
            VehicleDevice::Carried { .. } | VehicleDevice::Fixed { .. } => Ok(()),
        }
    }

    /// Describes its driver's limits of height and distance and its link time-out in words.
    pub(super) fn limits(&self) -> String {
        match &self.vehicle {
            VehicleDevice::Mavlink { settings, .. } => {
                let limits = &settings.limits;
                format!(
                    "{} to {} m up, {} m from where it stands, without a link after {} s",
                    limits.min_up_m,
                    limits.max_up_m,
                    limits.fence_radius_m,
                    settings.link_timeout_s
                )
            }
            VehicleDevice::ArDrone { settings, .. } => format!(
                "{} to {} m up, {} m from where it stands, without a link after {} s",
                settings.min_up_m,
                settings.max_up_m,
                settings.fence_radius_m,
                settings.link_timeout_s
            ),
            VehicleDevice::Carried { settings, .. } => {
                format!("carried {} m up, at {} m/s", settings.up_m, settings.speed_mps)
            }
            VehicleDevice::Fixed { settings } => format!("stands, {} m up", settings.up_m),
        }
    }

    /// Returns its speed in metres per second, if known.
    pub(super) fn speed_mps(&self) -> Option<f64> {
        match &self.vehicle {
            VehicleDevice::Mavlink { settings, .. } => settings.cruise_speed_mps,
            VehicleDevice::ArDrone { settings, .. } => Some(settings.speed_mps),
            VehicleDevice::Carried { settings, .. } => Some(settings.speed_mps),
            VehicleDevice::Fixed { .. } => None,
        }
    }

    /// Returns the devices of the drone, each with its endpoint.
    pub fn endpoints(&self) -> impl Iterator<Item = (&'static str, &Endpoint)> {
        let (vehicle, navdata, capture) = match &self.vehicle {
            VehicleDevice::Mavlink { endpoint, .. } => (Some(endpoint), None, None),
            VehicleDevice::ArDrone { endpoint, navdata, motion_capture, .. } => {
                let capture = motion_capture.as_ref().map(|capture| &capture.endpoint);
                (Some(endpoint), Some(navdata), capture)
            }
            VehicleDevice::Carried { .. } | VehicleDevice::Fixed { .. } => (None, None, None),
        };
        let guide = match &self.vehicle {
            VehicleDevice::Carried { guide, .. } => guide.as_ref(),
            _ => None,
        };
        let radio = match &self.radio {
            Some(RadioDevice::Xbee { endpoint, .. } | RadioDevice::RtlTcp { endpoint, .. }) => {
                Some(endpoint)
            }
            Some(RadioDevice::Sik) | None => None,
        };
        let array = match &self.source {
            ListenConfig::Kraken { endpoint, .. } => Some(endpoint),
            _ => None,
        };
        let rotator = self.rotator.as_ref().map(|RotatorDevice::Firmata { endpoint, .. }| endpoint);
        let gnss = self.gnss.as_ref().map(|gnss| &gnss.endpoint);
        let corrections =
            self.gnss.as_ref().and_then(|gnss| gnss.corrections.as_ref()?.endpoint.as_ref());
        [
            ("vehicle", vehicle),
            ("guide", guide),
            ("navdata", navdata),
            (MOTION_CAPTURE, capture),
            ("gnss", gnss),
            ("corrections", corrections),
            ("radio", radio),
            ("rotator", rotator),
            ("kraken", array),
        ]
        .into_iter()
        .filter_map(|(device, endpoint)| Some((device, endpoint?)))
    }

    /// Returns an AR.Drone's settings with the drone's launch place.
    pub(super) fn with_launch(&self, settings: &ArDroneConfig) -> ArDroneConfig {
        let [east_m, north_m] = self.launch_m.unwrap_or([settings.east_m, settings.north_m]);
        ArDroneConfig { east_m, north_m, ..*settings }
    }
}

/// Name of the system that gives a drone's place.
pub(super) const MOTION_CAPTURE: &str = "motion capture";

/// Returns the text of an error in a field of a nested table.
fn nested(table: &str, error: impl Into<FieldError>) -> String {
    error.into().within(table).to_string()
}

/// An autopilot's settings in the common frame.
pub(super) fn with_origin(settings: &MavlinkConfig, site: &Site) -> Result<MavlinkConfig, String> {
    if settings.origin.is_some() {
        return Err("vehicle.settings.origin: the origin stands in the site".into());
    }
    let origin = Some(MavlinkOrigin { lat_deg: site.lat_deg, lon_deg: site.lon_deg });
    Ok(MavlinkConfig { origin, ..settings.clone() })
}

/// An XBee's settings with the addresses of the flight's beacons.
pub(super) fn with_addresses(
    settings: &XbeeConfig,
    beacons: &[FlownBeacon],
) -> Result<XbeeConfig, String> {
    if !settings.beacons.is_empty() {
        return Err("radio.settings.beacons: the addresses stand with the beacons".into());
    }
    let address = |beacon: &FlownBeacon| {
        let text = beacon.address.as_deref();
        let text = text.ok_or_else(|| format!("beacon {:?} has no address", beacon.name))?;
        text.parse().map_err(|error| format!("beacon {:?}: address: {error}", beacon.name))
    };
    let beacons = beacons.iter().map(address).collect::<Result<_, String>>()?;
    Ok(XbeeConfig { beacons, ..settings.clone() })
}

/// The settings of an RTL-SDR with the frequencies of the flight's beacons.
pub(super) fn tuned(
    settings: &RtlTcpConfig,
    beacons: &[FlownBeacon],
) -> Result<RtlTcpConfig, String> {
    if !settings.frequencies_hz.is_empty() {
        return Err("radio.settings.frequencies_hz: the frequencies stand with the beacons".into());
    }
    let whole = |hz: f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
        (1.0..4.2e9)
            .contains(&hz)
            .then(|| hz.round() as u32)
            .ok_or_else(|| format!("rtl_tcp cannot be tuned to a frequency of {} MHz", hz / 1e6))
    };
    let frequencies_hz = frequencies(beacons)?.into_iter().map(whole).collect::<Result<_, _>>()?;
    Ok(RtlTcpConfig { frequencies_hz, ..settings.clone() })
}

/// The settings of a KrakenSDR with the frequencies of the flight's beacons.
pub(super) fn found_at(
    settings: &KrakenConfig,
    beacons: &[FlownBeacon],
) -> Result<KrakenConfig, String> {
    if !settings.frequencies_hz.is_empty() {
        return Err("source.settings.frequencies_hz: the frequencies stand with the beacons".into());
    }
    Ok(KrakenConfig { frequencies_hz: frequencies(beacons)?, ..settings.clone() })
}

/// The frequencies of the flight's beacons in Hz.
fn frequencies(beacons: &[FlownBeacon]) -> Result<Vec<f64>, String> {
    let frequency = |beacon: &FlownBeacon| {
        let mhz = beacon.frequency_mhz.filter(|mhz| mhz.is_finite() && *mhz > 0.0);
        let none = || format!("beacon {:?} has no frequency_mhz above 0", beacon.name);
        mhz.map(|mhz| mhz * 1e6).ok_or_else(none)
    };
    beacons.iter().map(frequency).collect()
}
