use foxhunt::{
    fly::CarriedDrone,
    geodesy::Geodetic,
    hardware::{MavlinkConfig, MavlinkOrigin},
    sim::World,
    wire::Endpoint,
};

use super::device::{Field, Placed};
use crate::error::CliError;

/// Place of a drone that another program flies.
#[derive(Debug, clap::Args)]
pub(super) struct Pose {
    /// Follow the telemetry of a vehicle, such as an autopilot's own simulator: MAVLink received at
    /// this endpoint, such as udpin:127.0.0.1:14551; nothing is sent back
    #[arg(long = "pose", value_name = "ENDPOINT")]
    from: Option<Endpoint>,
    /// The place of the field's zero, in degrees North and East [default: the vehicle's first good
    /// position]
    #[arg(long, value_name = "LAT,LON", value_parser = origin, requires = "from",
        allow_hyphen_values = true)]
    origin: Option<MavlinkOrigin>,
    /// The vehicle's system number [default: the first autopilot's]
    #[arg(long, value_name = "N", requires = "from")]
    system_id: Option<u8>,
}

fn origin(text: &str) -> Result<MavlinkOrigin, String> {
    let (lat, lon) = text.split_once(',').ok_or("two numbers, such as -35.363262,149.165237")?;
    let number = |text: &str| text.trim().parse().map_err(|_| format!("{text:?} is not a number"));
    let lat_deg = number(lat)?;
    let lon_deg = number(lon)?;
    Geodetic::new(lat_deg, lon_deg, 0.0).map_err(|error| error.to_string())?;
    Ok(MavlinkOrigin { lat_deg, lon_deg })
}

impl Pose {
    /// Returns the vehicle that carries the device, if there is one.
    pub(super) fn place(&self, field: &Field, world: &World) -> Result<Option<Placed>, CliError> {
        let Some(from) = &self.from else { return Ok(None) };
        if field.speed.to_bits() != 1.0_f64.to_bits() {
            return Err(CliError::input("--speed: the vehicle of --pose keeps the wall's time"));
        }
        let Self { origin, system_id, .. } = *self;
        let config = MavlinkConfig { origin, system_id, ..MavlinkConfig::default() };
        let stream = from.open().map_err(CliError::failure)?;
        let carried =
            CarriedDrone::new(world, field.drone, config, stream).map_err(CliError::input)?;
        let endpoint = from.to_string();
        Ok(Some(Placed { device: "pose", endpoint, emulator: Box::new(carried) }))
    }
}
