//! Arguments and endpoints of all emulated devices, and the pose that some take from a vehicle.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use foxhunt::{
    fly::CarriedDrone,
    geodesy::Geodetic,
    hardware::{MavlinkConfig, MavlinkOrigin},
    scenario::DEFAULT_SCENARIO,
    sim::{Emulator, World},
    wire::Endpoint,
};

use crate::error::CliError;

/// The arguments of all emulated devices.
#[derive(Debug, clap::Args)]
pub struct Field {
    /// The field of the device: a built-in scenario or a TOML file
    #[arg(long, value_name = "SCENARIO", default_value = DEFAULT_SCENARIO)]
    pub scenario: String,
    /// The scenario's drone that carries it, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub drone: usize,
    /// The seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// The speed of the device's time relative to the wall clock, for programs that know it
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = positive)]
    pub speed: f64,
    /// End after this time of the field, in seconds
    #[arg(long = "for", value_name = "S", value_parser = positive)]
    pub duration_s: Option<f64>,
    /// A symbolic link to the serial port; an existing link is replaced
    #[arg(long, value_name = "PATH")]
    pub link: Option<PathBuf>,
}

/// A device that is ready to be served.
pub struct Placed {
    /// Kind of the device, such as `xbee`.
    pub device: &'static str,
    /// Endpoint of the device, as `foxhunt fly` takes it.
    pub endpoint: String,
    pub emulator: Box<dyn Emulator>,
}

/// Links to the pseudo-terminal of a device if a link is given; returns the link's name, or else
/// the port's.
pub fn linked(port: &Path, link: Option<&Path>) -> Result<String, CliError> {
    let Some(link) = link else { return Ok(port.display().to_string()) };
    let replaced = match fs::symlink_metadata(link) {
        Ok(there) if there.is_symlink() => fs::remove_file(link),
        Ok(_) => Err(io::Error::new(io::ErrorKind::AlreadyExists, "something else is there")),
        Err(_) => Ok(()),
    };
    replaced
        .and_then(|()| std::os::unix::fs::symlink(port, link))
        .map_err(|error| CliError::writing(link, error))?;
    Ok(link.display().to_string())
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err("not a positive number".into()),
    }
}

/// Place of a drone that another program flies.
#[derive(Debug, clap::Args)]
pub struct Pose {
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
    pub fn place(&self, field: &Field, world: &World) -> Result<Option<Placed>, CliError> {
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
