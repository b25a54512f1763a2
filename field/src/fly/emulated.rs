use std::{io, path::Path};

use foxhunt_core::BeaconId;
use foxhunt_formation::EnduranceConfig;
use foxhunt_hardware::{
    CarriedConfig, FirmataConfig, FixedConfig, FlightLimits, GnssConfig, KrakenConfig,
    MavlinkConfig, MavlinkOrigin, XbeeConfig,
};
use foxhunt_hunt::{config::SourceConfig, scenario::Scenario};
use foxhunt_sensors::{BodyConfig, OmnidirectionalConfig};
use foxhunt_sim::{
    AutopilotConfig, AutopilotFaults, CableFaults, EmulatedAutopilot, EmulatedCarrier,
    EmulatedGnss, EmulatedGnssConfig, EmulatedKraken, EmulatedKrakenConfig, EmulatedRtlTcp,
    EmulatedRtlTcpConfig, EmulatedStepper, EmulatedStepperConfig, EmulatedXbee, EmulatedXbeeConfig,
    Emulator, ReliefConfig, World, xbee_address,
};
use foxhunt_wire::{
    geodesy::{Geodetic, radians_to_compass_deg},
    mavlink::Autopilot,
};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::{
    CarriedDrone, DroneConfig, EmulatedFieldError, FlightConfig, FlightRules, FlownBeacon,
    ForeignVehicle, GnssDevice, ListenConfig, RadioDevice, RotatorDevice, Site, TerrainConfig,
    VehicleDevice,
    emulated_ports::{EmulatedPorts, Place, Tags},
};

/// Longest time of a position and of the first one of a turn with a real motor, in seconds.
const STEP_S: f64 = 1.0;
const FIRST_STEP_S: f64 = 10.0;

/// Frequency of the first beacon that a KrakenSDR receives, and from one to the next, in MHz.
const CHANNELS_MHZ: f64 = 433.92;
const CHANNEL_MHZ: f64 = 0.05;

/// Longest time of a turn with a real motor, in seconds.
const TURN_S: f64 = 150.0;

/// Greatest distance of goals from the prior's middle, in its standard deviations.
const PRIOR_REACH: f64 = 4.0;

/// Share of the height of a drone's start at which it may fly; it may rise to the height over this.
const LEAST_UP: f64 = 0.5;

/// Settings of an emulated field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmulatedFieldConfig {
    /// Origin of its East and North; with a world's tiles it is their origin.
    pub site: Site,
    /// Firmware that flies its drones.
    pub autopilot: Autopilot,
    /// Least and greatest distance in metres that the autopilots' downward rangefinders measure;
    /// absent for no rangefinders.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rangefinder_m: Option<[f64; 2]>,
    /// True if the autopilots have the world's terrain, and report their heights above it.
    pub terrain_data: bool,
    /// The UDP port that the first drone's autopilot sends to, the next ones to those after it; any
    /// free ones where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_port: Option<u16>,
    /// Vehicles of other programs, drone by drone, with which the radios and motors fly; drones
    /// that are left out are emulated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub vehicles: Vec<ForeignVehicle>,
    /// Platforms, drone by drone: drones that are left out fly by autopilots, with the scenario's
    /// own receivers.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub platforms: Vec<EmulatedPlatform>,
    /// Faults, drone by drone; drones that are left out have no faults.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<DroneFaults>,
    /// The RTL-SDRs by which tags that pulse are received, and what is on air besides; each drone's
    /// has noise of its own.
    pub rtl_tcp: EmulatedRtlTcpConfig,
}

/// Platform of a receiver of an emulated field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmulatedPlatform {
    /// Way in which it moves.
    pub vehicle: EmulatedVehicle,
    /// Receiver, if not the scenario's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub receiver: Option<EmulatedReceiver>,
}

/// Way in which the receiver of an emulated field moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EmulatedVehicle {
    /// An autopilot flies it.
    #[default]
    Autopilot,
    /// Somebody who follows each proposal carries it, beside an NMEA receiver.
    Carried,
    /// It stands where the scenario's drone begins.
    Fixed,
}

/// Receiver of an emulated field in place of the scenario's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EmulatedReceiver {
    /// An antenna without a direction, on the scenario's radio.
    Omnidirectional,
    /// A KrakenSDR.
    Kraken,
}

/// Faults of a drone's devices.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DroneFaults {
    /// With the radio's cable.
    pub radio: CableFaults,
    /// With the motor's cable.
    pub rotator: CableFaults,
    /// With the autopilot.
    pub vehicle: AutopilotFaults,
}

/// A field in the middle of Europe, ArduCopter without rangefinders and terrain, on free ports,
/// without faults.
impl Default for EmulatedFieldConfig {
    fn default() -> Self {
        let site = Site { lat_deg: 50.0755, lon_deg: 14.4378, ground_alt_m: None };
        let autopilot = Autopilot::ArduPilot;
        let rtl_tcp = EmulatedRtlTcpConfig::default();
        let vehicles = Vec::new();
        let platforms = Vec::new();
        let faults = Vec::new();
        Self {
            site,
            autopilot,
            rangefinder_m: None,
            terrain_data: false,
            first_port: None,
            vehicles,
            platforms,
            faults,
            rtl_tcp,
        }
    }
}

/// All devices of all drones of a simulated world: radios and motors on pseudo-terminals,
/// autopilots on UDP, or all of them in memory. A [`FlightConfig`] made for them flies them as it
/// would the real ones. Beacons that answer are received with XBees, tags that pulse with RTL-SDRs
/// behind rtl_tcp.
///
/// Nothing happens by itself: let the world's time pass, then [`serve`](Self::serve).
pub struct EmulatedField {
    devices: Vec<(String, Box<dyn Emulator>)>,
    flight: FlightConfig,
}

impl std::fmt::Debug for EmulatedField {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("EmulatedField").field("flight", &self.flight).finish_non_exhaustive()
    }
}

impl EmulatedField {
    /// Puts the devices of a scenario's `world` in place. `folder`, which has to exist, gets links
    /// to the pseudo-terminals, named after drone and device.
    ///
    /// # Errors
    ///
    /// [`EmulatedFieldError`] when a port cannot be had, a number is out of its range, or a source
    /// cannot be emulated.
    pub fn new(
        scenario: &Scenario,
        world: &World,
        config: &EmulatedFieldConfig,
        folder: &Path,
    ) -> Result<Self, EmulatedFieldError> {
        Self::placed(scenario, world, config, Place::Folder(folder))
    }

    /// Puts the devices of a scenario's `world` in memory, for a flight in the same program that
    /// takes them from the ports returned. A pulled cable leaves a port there, and silent.
    ///
    /// # Errors
    ///
    /// The errors of [`new`](Self::new).
    pub fn in_memory(
        scenario: &Scenario,
        world: &World,
        config: &EmulatedFieldConfig,
    ) -> Result<(Self, EmulatedPorts), EmulatedFieldError> {
        let mut ports = EmulatedPorts::default();
        let field = Self::placed(scenario, world, config, Place::Memory(&mut ports))?;
        Ok((field, ports))
    }

    fn placed(
        scenario: &Scenario,
        world: &World,
        config: &EmulatedFieldConfig,
        mut place: Place<'_>,
    ) -> Result<Self, EmulatedFieldError> {
        // A flight's file may be elsewhere than the scenario.
        let here = std::env::current_dir()?;
        let terrain = scenario.world.terrain.clone().map(|terrain| terrain.in_folder(&here));
        let config = &EmulatedFieldConfig {
            site: site_of(config.site, terrain.as_ref())?,
            ..config.clone()
        };
        let kraken = Some(EmulatedReceiver::Kraken);
        let tunes = config.platforms.iter().any(|platform| platform.receiver == kraken);
        // Beacons that appear later are looked for from the start: a flight's list is of all.
        let tags = Tags::of(world, scenario.world.beacons.len())?;
        let beacons = (0..).map(BeaconId).map_while(|beacon| {
            let name = world.beacon_name(beacon)?;
            let (address, _) = xbee_address(beacon);
            let address = tags.is_none().then(|| address.to_string());
            let channel_mhz = tunes.then(|| CHANNELS_MHZ + CHANNEL_MHZ * f64::from(beacon.0));
            let frequency_mhz = world.frequency_mhz(beacon).filter(|_| tags.is_some());
            let frequency_mhz = frequency_mhz.or(channel_mhz);
            Some(FlownBeacon { name, address, frequency_mhz })
        });
        let mut field = Self {
            devices: Vec::new(),
            flight: FlightConfig {
                name: format!("{}, emulated", scenario.name),
                site: config.site,
                beacons: beacons.collect(),
                estimator: scenario.estimator.clone(),
                model: scenario.model.clone().in_folder(&here),
                extractor: scenario.extractor.clone(),
                bearings: scenario.bearings,
                turns: scenario.turns,
                planner: scenario.planner.clone(),
                hunt: scenario.hunt.clone(),
                terrain: terrain.as_ref().map(TerrainConfig::of_world),
                flight: FlightRules::default(),
                cot: None,
                drones: Vec::new(),
            },
        };
        let platform = |drone: usize| config.platforms.get(drone).copied().unwrap_or_default();
        let drones = scenario.world.drones.len();
        let flies = (0..drones).any(|drone| platform(drone).vehicle == EmulatedVehicle::Autopilot);
        let hunt = &mut field.flight.hunt;
        hunt.turn_timeout_s = hunt.turn_timeout_s.max(TURN_S);
        let known = scenario.field();
        let usual = EnduranceConfig::default();
        let battery = EnduranceConfig {
            endurance_s: AutopilotConfig::default().endurance_s,
            speed_mps: known.speed_mps.unwrap_or(usual.speed_mps),
            climb_mps: known.climb_mps.unwrap_or(usual.climb_mps),
            ..usual
        };
        // Legs have no battery.
        hunt.endurance = hunt.endurance.or(Some(battery)).filter(|_| flies);
        let vehicles = config.vehicles.len();
        if config.platforms.len() > drones {
            let platforms = config.platforms.len();
            return Err(EmulatedFieldError::Platforms { platforms, drones });
        }
        if vehicles > drones {
            return Err(EmulatedFieldError::Vehicles { vehicles, drones });
        }
        for (drone, stands) in scenario.world.drones.iter().enumerate() {
            let place = &mut place;
            if platform(drone).vehicle == EmulatedVehicle::Autopilot {
                field.flight.flight.takeoff_up_m = stands.up_m;
            }
            let source = scenario.sources.get(drone).unwrap_or(&scenario.source);
            field.add(world, drone, config, source, tags.as_ref(), place)?;
            // Where a foreign vehicle stands is its own affair.
            let ours = drone >= vehicles;
            if let Some(flown) = field.flight.drones.last_mut().filter(|_| ours) {
                flown.launch_m = Some([stands.east_m, stands.north_m]);
            }
        }
        field.flight.widen_for_carriers();
        Ok(field)
    }

    fn add(
        &mut self,
        world: &World,
        drone: usize,
        config: &EmulatedFieldConfig,
        source: &SourceConfig,
        tags: Option<&Tags>,
        place: &mut Place<'_>,
    ) -> Result<(), EmulatedFieldError> {
        let name = name(drone);
        let faults = config.faults.get(drone).cloned().unwrap_or_default();
        let platform = config.platforms.get(drone).copied().unwrap_or_default();
        let up_m = world.pose(drone)?.position.z;
        let mut gnss = None;
        let vehicle = match (platform.vehicle, config.vehicles.get(drone)) {
            (EmulatedVehicle::Carried, _) => {
                let (carrier, receiver) = self.carry(world, drone, config.site, up_m, place)?;
                gnss = Some(receiver);
                carrier
            }
            (EmulatedVehicle::Fixed, _) => {
                let heading = world.pose(drone)?.heading;
                let heading_deg_compass = radians_to_compass_deg(heading);
                let settings = FixedConfig { up_m, heading_deg_compass, ..FixedConfig::default() };
                VehicleDevice::Fixed { settings }
            }
            (EmulatedVehicle::Autopilot, Some(foreign)) => {
                self.follow(world, drone, config.site, foreign, place)?
            }
            (EmulatedVehicle::Autopilot, None) => {
                self.fly(world, drone, config, faults.vehicle, place)?
            }
        };
        if platform.receiver == Some(EmulatedReceiver::Kraken) {
            let (stream, endpoint) = place.page(&name)?;
            let mhz = self.flight.beacons.iter().filter_map(|beacon| beacon.frequency_mhz);
            let emulated = EmulatedKrakenConfig {
                frequencies_hz: mhz.map(|mhz| mhz * 1e6).collect(),
                seed: u64::try_from(drone).unwrap_or(0).wrapping_add(1),
                ..EmulatedKrakenConfig::default()
            };
            self.keep(&name, "kraken", EmulatedKraken::new(world, drone, emulated, stream)?);
            let source = ListenConfig::Kraken { endpoint, settings: KrakenConfig::default() };
            let drone = DroneConfig {
                name,
                launch_m: None,
                vehicle,
                gnss,
                radio: None,
                rotator: None,
                source,
            };
            self.flight.drones.push(drone);
            return Ok(());
        }
        // A second or four pulses at a place, so that a walker hears the level on the way.
        let questions = if tags.is_some() { 4 } else { 32 };
        let plain = OmnidirectionalConfig { questions, ..OmnidirectionalConfig::default() };
        let plain = SourceConfig::Omnidirectional(plain);
        let source = match platform.receiver {
            Some(EmulatedReceiver::Omnidirectional) => &plain,
            _ => source,
        };
        let directional = !matches!(source, SourceConfig::Omnidirectional(_));

        let radio = if let Some(tags) = tags {
            let (stream, endpoint) = place.server(world, &name, faults.radio)?;
            let seed = config.rtl_tcp.seed.wrapping_add(u64::try_from(drone).unwrap_or(0));
            let settings = EmulatedRtlTcpConfig { seed, directional, ..config.rtl_tcp.clone() };
            self.keep(&name, "radio", EmulatedRtlTcp::new(world, drone, settings, stream)?);
            RadioDevice::RtlTcp { endpoint, settings: tags.receiver(config.rtl_tcp.full_scale_dbm) }
        } else {
            let (stream, endpoint) = place.cable(world, &name, "radio", faults.radio)?;
            let emulated = EmulatedXbeeConfig { directional, ..EmulatedXbeeConfig::default() };
            let device = EmulatedXbee::new(world, drone, emulated, stream)?;
            self.keep(&name, "radio", device);
            RadioDevice::Xbee { endpoint, settings: XbeeConfig::default() }
        };
        // How long a sample takes at most.
        let sample_s = match &radio {
            RadioDevice::RtlTcp { settings, .. } => settings.longest_question_s(),
            _ => 0.0,
        };

        let mut rotator = None;
        let source = match source {
            SourceConfig::Stepper(config) => {
                let (stream, endpoint) = place.cable(world, &name, "rotator", faults.rotator)?;
                let device =
                    EmulatedStepper::new(world, drone, EmulatedStepperConfig::default(), stream)?;
                self.keep(&name, "rotator", device);
                let settings = FirmataConfig::default();
                rotator = Some(RotatorDevice::Firmata { endpoint, settings });
                // A step backwards goes beyond its place and comes back, before six requests.
                let samples_s = f64::from(config.samples_per_position()) * sample_s;
                let step_s = STEP_S + samples_s;
                let first_s = FIRST_STEP_S + samples_s;
                let config = config.with_timeouts(step_s, first_s).expect("they are positive");
                let beacons = u16::try_from(self.flight.beacons.len()).unwrap_or(u16::MAX);
                let turn_s = &mut self.flight.hunt.turn_timeout_s;
                *turn_s = turn_s.max(config.longest_turn(beacons));
                ListenConfig::Stepper(config)
            }
            SourceConfig::RotatingBody(config) => ListenConfig::RotatingBody(BodyConfig {
                answer_timeout_s: config.answer_timeout_s.max(sample_s),
                ..*config
            }),
            SourceConfig::Omnidirectional(config) => {
                ListenConfig::Omnidirectional(OmnidirectionalConfig {
                    answer_timeout_s: config.answer_timeout_s.max(sample_s),
                    ..*config
                })
            }
            other => return Err(EmulatedFieldError::Source { drone, kind: other.kind() }),
        };
        let radio = Some(radio);
        let launch_m = None;
        let drone = DroneConfig { name, launch_m, vehicle, gnss, radio, rotator, source };
        self.flight.drones.push(drone);
        Ok(())
    }

    /// An emulated autopilot.
    fn fly(
        &mut self,
        world: &World,
        drone: usize,
        config: &EmulatedFieldConfig,
        faults: AutopilotFaults,
        place: &mut Place<'_>,
    ) -> Result<VehicleDevice, EmulatedFieldError> {
        let site = config.site;
        // Each its own, so that several may be behind one router; 251 to 255 are ground stations.
        let system_id = u8::try_from(drone % 250 + 1).unwrap_or(1);
        let autopilot = AutopilotConfig {
            system_id,
            origin: Geodetic::new(site.lat_deg, site.lon_deg, site.ground_alt_m.unwrap_or(0.0))?,
            autopilot: config.autopilot,
            rangefinder_m: config.rangefinder_m,
            terrain_data: config.terrain_data,
            faults,
            ..AutopilotConfig::default()
        };
        let (stream, endpoint) = place.datagrams(config.first_port, drone)?;
        let vehicle = EmulatedAutopilot::new(autopilot, world, drone, stream)?;
        self.keep(&name(drone), "vehicle", vehicle);
        let settings = MavlinkConfig {
            system_id: Some(system_id),
            limits: self.limits(world, drone)?,
            ..MavlinkConfig::default()
        };
        Ok(VehicleDevice::Mavlink { endpoint, settings })
    }

    /// Somebody who carries a receiver, and the GNSS receiver beside it.
    fn carry(
        &mut self,
        world: &World,
        drone: usize,
        site: Site,
        up_m: f64,
        place: &mut Place<'_>,
    ) -> Result<(VehicleDevice, GnssDevice), EmulatedFieldError> {
        let name = name(drone);
        let origin = Geodetic::new(site.lat_deg, site.lon_deg, site.ground_alt_m.unwrap_or(0.0))?;
        let (stream, endpoint) = place.cable(world, &name, "gnss", CableFaults::default())?;
        let seed = u64::try_from(drone).unwrap_or(0).wrapping_add(1);
        let emulated =
            EmulatedGnssConfig { origin, compass: true, ..EmulatedGnssConfig::default() };
        self.keep(&name, "gnss", EmulatedGnss::new(world, drone, emulated, seed, stream)?);
        let (stream, guide) = place.cable(world, &name, "guide", CableFaults::default())?;
        self.keep(&name, "guide", EmulatedCarrier::new(world, drone, origin, stream)?);
        let settings = CarriedConfig { up_m, ..CarriedConfig::default() };
        let vehicle = VehicleDevice::Carried { guide: Some(guide), settings };
        Ok((vehicle, GnssDevice { endpoint, settings: GnssConfig::default(), corrections: None }))
    }

    /// Returns limits within which a drone reaches the places and heights of its world: the
    /// driver's own, widened where the world needs it.
    fn limits(&self, world: &World, drone: usize) -> Result<FlightLimits, EmulatedFieldError> {
        let limits = FlightLimits::default();
        let start = world.pose(drone)?.position;
        let hunt = &self.flight.hunt;
        let centre = hunt.prior_centre_m.map_or(start.xy(), Vector2::from);
        let farthest_m = (centre - start.xy()).norm() + PRIOR_REACH * hunt.prior_sigma_m;
        Ok(FlightLimits {
            min_up_m: limits.min_up_m.min(LEAST_UP * start.z),
            max_up_m: limits.max_up_m.max(start.z / LEAST_UP),
            fence_radius_m: limits.fence_radius_m.max(farthest_m),
            ..limits
        })
    }

    /// A vehicle of another program, which the drone's other devices follow.
    fn follow(
        &mut self,
        world: &World,
        drone: usize,
        site: Site,
        foreign: &ForeignVehicle,
        place: &Place<'_>,
    ) -> Result<VehicleDevice, EmulatedFieldError> {
        if matches!(place, Place::Memory(_)) {
            return Err(EmulatedFieldError::Foreign { drone });
        }
        let Site { lat_deg, lon_deg, .. } = site;
        let settings = MavlinkConfig { system_id: foreign.system_id, ..MavlinkConfig::default() };
        let origin = Some(MavlinkOrigin { lat_deg, lon_deg });
        let followed = MavlinkConfig { origin, ..settings.clone() };
        let carried = CarriedDrone::new(world, drone, followed, foreign.pose.open()?)?;
        self.keep(&name(drone), "pose", carried);
        Ok(VehicleDevice::Mavlink { endpoint: foreign.flown.clone(), settings })
    }

    fn keep(&mut self, drone: &str, device: &str, emulator: impl Emulator + 'static) {
        self.devices.push((format!("{drone}: {device}"), Box::new(emulator)));
    }

    /// The flight whose devices these are.
    #[must_use]
    pub fn flight(&self) -> &FlightConfig {
        &self.flight
    }

    /// Lets all devices read and write their ports at the world's present time. For a device whose
    /// port fails `failed` is called; it is served again next time.
    pub fn serve(&mut self, mut failed: impl FnMut(&str, io::Error)) {
        for (name, device) in &mut self.devices {
            if let Err(error) = device.serve() {
                failed(name, error);
            }
        }
    }
}

/// Returns the name of a drone, counted from 0.
fn name(drone: usize) -> String {
    format!("drone-{}", drone + 1)
}

/// Returns the site of a field: the origin of its world's tiles, if there is one.
fn site_of(site: Site, terrain: Option<&ReliefConfig>) -> Result<Site, EmulatedFieldError> {
    let origin = terrain.and_then(|terrain| terrain.lat_deg.zip(terrain.lon_deg));
    let Some((lat_deg, lon_deg)) = origin else { return Ok(site) };
    let there = Site { lat_deg, lon_deg, ..site };
    if site != there && site != EmulatedFieldConfig::default().site {
        return Err(EmulatedFieldError::Origin { lat_deg, lon_deg });
    }
    Ok(there)
}
