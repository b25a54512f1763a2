use std::time::{SystemTime, UNIX_EPOCH};

use foxhunt::{
    geodesy::Geodetic,
    scenario::Scenario,
    sim::{AutopilotConfig, EmulatedAutopilot, World},
    wire::{
        Endpoint,
        mavlink::{Autopilot, SigningKey},
    },
};

use super::device::{Field, Placed};
use crate::error::CliError;

/// An autopilot that speaks MAVLink: ArduCopter, or PX4
///
/// Sends to a UDP port of this machine, as the autopilots' own simulators do. Its drone begins on
/// the ground.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub(super) field: Field,
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

pub(super) fn place(args: &Args, _: &Scenario, world: &World) -> Result<Placed, CliError> {
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
