//! Devices on board of a drone: its radio, its antenna stepper, its autopilot.

use std::time::{SystemTime, UNIX_EPOCH};

use foxhunt::{
    core::BeaconId,
    geodesy::Geodetic,
    scenario::Scenario,
    sim::{
        AutopilotConfig, EmulatedAutopilot, EmulatedStepper, EmulatedStepperConfig, EmulatedSwitch,
        EmulatedXbee, EmulatedXbeeConfig, World, xbee_address,
    },
    wire::{
        Endpoint, PtyStream,
        mavlink::{Autopilot, SigningKey},
        xbee::Protocol,
    },
};

use super::device::{Field, Placed, Pose, linked};
use crate::{error::CliError, output::warn};

/// An XBee radio, whose RSSI comes from the field
#[derive(Debug, clap::Args)]
pub struct XbeeArgs {
    #[command(flatten)]
    pub field: Field,
    #[command(flatten)]
    pub pose: Pose,
    /// Its API mode (AP): 0 transparent, 1 plain frames, 2 escaped frames
    #[arg(long, value_name = "AP", default_value_t = 1)]
    #[arg(value_parser = clap::value_parser!(u8).range(0..=2))]
    api: u8,
    /// The protocol of its firmware
    #[arg(long, value_enum, default_value_t = Firmware::Zigbee)]
    firmware: Firmware,
}

/// Protocol of a firmware.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Firmware {
    Zigbee,
    Digimesh,
    #[value(name = "802.15.4")]
    Ieee802154,
}

pub fn place_xbee(
    args: &XbeeArgs,
    _scenario: &Scenario,
    world: &World,
) -> Result<Placed, CliError> {
    let firmware = match args.firmware {
        Firmware::Zigbee => Protocol::Zigbee,
        Firmware::Digimesh => Protocol::DigiMesh,
        Firmware::Ieee802154 => Protocol::Ieee802154,
    };
    let config = EmulatedXbeeConfig { firmware, ap: args.api, ..EmulatedXbeeConfig::default() };
    let stream = PtyStream::open().map_err(CliError::failure)?;
    let port = stream.path().to_owned();
    let emulator =
        EmulatedXbee::new(world, args.field.drone, config, stream).map_err(CliError::input)?;
    let endpoint = format!("serial:{}:57600", linked(&port, args.field.link.as_deref())?);
    for beacon in (0..).map(BeaconId) {
        let Some(name) = world.beacon_name(beacon) else { break };
        let (long, short) = xbee_address(beacon);
        warn(&format!("beacon {} ({name}): {long}, or {short}", beacon.0));
    }
    Ok(Placed { device: "xbee", endpoint, emulator: Box::new(emulator) })
}

/// An antenna stepper: an Arduino with ConfigurableFirmata
#[derive(Debug, clap::Args)]
pub struct StepperArgs {
    #[command(flatten)]
    pub field: Field,
    #[command(flatten)]
    pub pose: Pose,
    /// The backlash of its gear, in degrees
    #[arg(long, value_name = "DEG", default_value_t = 3.0)]
    backlash_deg: f64,
    /// The initial direction of the antenna, in degrees counter-clockwise from the nose
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    start_deg: f64,
    /// The Arduino's pin of a home switch, which opens at the nose and closes 8 degrees before it
    #[arg(long, value_name = "PIN", value_parser = clap::value_parser!(u8).range(2..=13))]
    switch_pin: Option<u8>,
}

/// Width of the home switch.
const SWITCH_WIDTH_DEG: f64 = 8.0;

pub fn place_stepper(
    args: &StepperArgs,
    _scenario: &Scenario,
    world: &World,
) -> Result<Placed, CliError> {
    let switch = args.switch_pin.map(|pin| EmulatedSwitch {
        pin,
        opens_at_deg: 0.0,
        width_deg: SWITCH_WIDTH_DEG,
    });
    let config = EmulatedStepperConfig {
        backlash_deg: args.backlash_deg,
        start_deg: args.start_deg,
        switch,
        ..EmulatedStepperConfig::default()
    };
    let stream = PtyStream::open().map_err(CliError::failure)?;
    let port = stream.path().to_owned();
    let emulator =
        EmulatedStepper::new(world, args.field.drone, config, stream).map_err(CliError::input)?;
    let endpoint = format!("serial:{}:57600", linked(&port, args.field.link.as_deref())?);
    Ok(Placed { device: "stepper", endpoint, emulator: Box::new(emulator) })
}

/// An autopilot that speaks MAVLink: ArduCopter, or PX4
///
/// Sends to a UDP port of this machine, as the autopilots' own simulators do. Its drone begins on
/// the ground.
#[derive(Debug, clap::Args)]
pub struct VehicleArgs {
    #[command(flatten)]
    pub field: Field,
    /// The UDP port of this machine that it sends to [default: 14550, and 10 more for every drone]
    #[arg(long, value_name = "PORT")]
    port: Option<u16>,
    /// Behave like PX4, not like ArduCopter
    #[arg(long)]
    px4: bool,
    /// Its system number [default: 1 plus the drone's number]
    #[arg(long, value_name = "N")]
    system_id: Option<u8>,
    /// The latitude of the field's origin, in degrees
    #[arg(long, value_name = "DEG", default_value_t = -35.363_262, allow_negative_numbers = true)]
    lat: f64,
    /// The longitude of the field's origin, in degrees
    #[arg(long, value_name = "DEG", default_value_t = 149.165_237, allow_negative_numbers = true)]
    lon: f64,
    /// Sign all messages with this key of 64 hexadecimal digits, and take no others
    #[arg(long, value_name = "KEY")]
    signing_key: Option<SigningKey>,
}

/// The port of ground stations.
const PORT: u16 = 14_550;

/// Height of the field's ground above sea level, in metres.
const GROUND_ALT_M: f64 = 584.0;

pub fn place_vehicle(args: &VehicleArgs, _: &Scenario, world: &World) -> Result<Placed, CliError> {
    let drone = args.field.drone;
    let number = u8::try_from(drone).unwrap_or(u8::MAX);
    let port = args.port.unwrap_or(PORT.saturating_add(u16::from(number) * 10));
    let origin = Geodetic::new(args.lat, args.lon, GROUND_ALT_M).map_err(CliError::input)?;
    let unix = SystemTime::now().duration_since(UNIX_EPOCH).map_err(CliError::failure)?;
    let config = AutopilotConfig {
        autopilot: if args.px4 { Autopilot::Px4 } else { Autopilot::ArduPilot },
        system_id: args.system_id.unwrap_or(number.saturating_add(1)),
        origin,
        signing: args.signing_key,
        clock_origin_unix_s: unix.as_secs_f64(),
        ..AutopilotConfig::default()
    };
    let to = Endpoint::UdpOut { address: format!("127.0.0.1:{port}") };
    let stream = to.open().map_err(CliError::failure)?;
    let emulator = EmulatedAutopilot::new(config, world, drone, stream).map_err(CliError::input)?;
    let endpoint = format!("udpin:127.0.0.1:{port}");
    Ok(Placed { device: "vehicle", endpoint, emulator: Box::new(emulator) })
}
