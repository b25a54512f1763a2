//! Sources of a drone's place: a GNSS receiver with its caster, and motion capture.

use std::{
    io,
    time::{SystemTime, UNIX_EPOCH},
};

use clap::ValueEnum;
use foxhunt::{
    geodesy::Geodetic,
    scenario::Scenario,
    sim::{
        EmulatedArDrone, EmulatedCaster, EmulatedCasterConfig, EmulatedGnss, EmulatedGnssConfig,
        EmulatedGnssKind, EmulatedMotionCapture, EmulatedMotionCaptureConfig, Emulator, Interval,
        World,
    },
    wire::{ByteStream, Endpoint, FixQuality, PtyStream, TcpServerStream, UdpStream},
};

use super::device::{Field, Placed, linked};
use crate::error::CliError;

/// A GNSS receiver
#[derive(Debug, clap::Args)]
pub struct GnssArgs {
    #[command(flatten)]
    pub field: Field,
    /// The protocol
    #[arg(long, value_enum, default_value_t = Kind::Nmea)]
    kind: Kind,
    /// The address at which gpsd listens
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:2947")]
    listen: String,
    /// The place of the field's zero: degrees North, degrees East, metres above the ellipsoid
    #[arg(long, value_name = "LAT,LON,ALT", value_parser = place_on_earth,
        allow_hyphen_values = true, default_value = "50.1,14.5,250")]
    origin: Geodetic,
    /// The quality of its fix, which sets the size of its errors
    #[arg(long, value_enum, default_value_t = Quality::Autonomous)]
    quality: Quality,
    /// The number of fixes per second
    #[arg(long, value_name = "HZ", default_value_t = 5.0)]
    rate: f64,
    /// The address at which an NTRIP caster listens; RTK is then reached only while its
    /// corrections come back to the receiver
    #[arg(long, value_name = "ADDRESS:PORT")]
    caster: Option<String>,
    /// The caster's only stream
    #[arg(long, value_name = "NAME", default_value = "FOX", requires = "caster")]
    mountpoint: String,
    /// The only user whom the caster serves [default: anybody]
    #[arg(long, value_name = "USER:PASSWORD", requires = "caster", value_parser = credentials)]
    user: Option<(String, String)>,
}

/// Age in seconds up to which an emulated receiver uses corrections.
const CORRECTIONS_S: f64 = 10.0;

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    /// NMEA 0183 on a serial port: RMC, GGA, GSA, GST
    Nmea,
    /// A receiver by u-blox on a serial port: NMEA, and NAV-PVT once it is switched on
    Ublox,
    /// gpsd at a TCP port
    Gpsd,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Quality {
    None,
    Estimated,
    Autonomous,
    Differential,
    RtkFloat,
    RtkFixed,
}

pub fn place_gnss(
    args: &GnssArgs,
    _scenario: &Scenario,
    world: &World,
) -> Result<Placed, CliError> {
    let kind = match args.kind {
        Kind::Nmea => EmulatedGnssKind::Nmea,
        Kind::Ublox => EmulatedGnssKind::Ublox,
        Kind::Gpsd => EmulatedGnssKind::Gpsd,
    };
    let quality = match args.quality {
        Quality::None => FixQuality::None,
        Quality::Estimated => FixQuality::Estimated,
        Quality::Autonomous => FixQuality::Autonomous,
        Quality::Differential => FixQuality::Differential,
        Quality::RtkFloat => FixQuality::RtkFloat,
        Quality::RtkFixed => FixQuality::RtkFixed,
    };
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_err(CliError::failure)?;
    let config = EmulatedGnssConfig {
        kind,
        origin: args.origin,
        rate_hz: args.rate,
        corrections_s: args.caster.is_some().then_some(CORRECTIONS_S),
        utc_start_s: now.as_secs_f64(),
        ..EmulatedGnssConfig::default().with_quality(quality)
    };
    let link = args.field.link.as_deref();
    let (stream, endpoint): (Box<dyn ByteStream>, _) = match args.kind {
        Kind::Gpsd => {
            let server = TcpServerStream::listen(&args.listen).map_err(CliError::failure)?;
            let address = server.local_address().map_err(CliError::failure)?;
            (Box::new(server), format!("tcp:{address}"))
        }
        Kind::Nmea | Kind::Ublox => {
            let port = PtyStream::open().map_err(CliError::failure)?;
            let name = linked(port.path(), link)?;
            (Box::new(port), format!("serial:{name}:115200"))
        }
    };
    let Field { drone, seed, .. } = args.field;
    let emulator: Box<dyn Emulator> =
        Box::new(EmulatedGnss::new(world, drone, config, seed, stream).map_err(CliError::input)?);
    Ok(Placed { device: "gnss", endpoint, emulator })
}

/// The caster beside the receiver, if there is one.
pub fn caster(args: &GnssArgs, world: &World) -> Result<Option<Placed>, CliError> {
    let Some(address) = &args.caster else { return Ok(None) };
    let server = TcpServerStream::listen(address).map_err(CliError::failure)?;
    let endpoint = format!("tcp:{}", server.local_address().map_err(CliError::failure)?);
    let config = EmulatedCasterConfig {
        mountpoint: args.mountpoint.clone(),
        credentials: args.user.clone(),
        station: args.origin,
        ..EmulatedCasterConfig::default()
    };
    let emulator = EmulatedCaster::new(world, config, server).map_err(CliError::input)?;
    Ok(Some(Placed { device: "caster", endpoint, emulator: Box::new(emulator) }))
}

fn credentials(text: &str) -> Result<(String, String), String> {
    let (user, password) =
        text.split_once(':').ok_or("not a user and a password: USER:PASSWORD")?;
    Ok((user.to_owned(), password.to_owned()))
}

fn place_on_earth(text: &str) -> Result<Geodetic, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    match numbers.as_deref() {
        Ok([lat, lon, alt]) => Geodetic::new(*lat, *lon, *alt).map_err(|error| error.to_string()),
        _ => Err("not three numbers, such as 50.1,14.5,250".into()),
    }
}

/// A motion-capture system, as JSON lines over UDP
///
/// Sends the true pose of the scenario's drone, which stays where it is unless `--ar-drone` has it
/// flown.
#[derive(Debug, clap::Args)]
pub struct MotionCaptureArgs {
    #[command(flatten)]
    pub field: Field,
    /// The address and port that the poses are sent to
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:5005")]
    to: String,
    /// The name of the rigid body
    #[arg(long, value_name = "NAME", default_value = "drone-1")]
    body: String,
    /// The number of poses per second
    #[arg(long, value_name = "HZ", default_value_t = 100.0)]
    rate: f64,
    /// The σ of a position on each axis, in metres
    #[arg(long, value_name = "M", default_value_t = 0.001)]
    sigma_m: f64,
    /// Hide the body from the cameras from this time on, for 5 s, in seconds of the field's time
    #[arg(long, value_name = "S")]
    hide_at_s: Option<f64>,
    /// Also emulate an AR.Drone, whose pose it is: orders arrive at UDP port 5556 of this machine,
    /// navdata are served at 5554
    #[arg(long)]
    ar_drone: bool,
}

/// Time in seconds for which a body is hidden.
const HIDDEN_S: f64 = 5.0;

pub fn place_motion_capture(args: &MotionCaptureArgs, world: &World) -> Result<Placed, CliError> {
    let hidden = args.hide_at_s.map(|from_s| Interval { from_s, to_s: Some(from_s + HIDDEN_S) });
    let config = EmulatedMotionCaptureConfig {
        body: args.body.clone(),
        rate_hz: args.rate,
        sigma_m: args.sigma_m,
        hidden: hidden.into_iter().collect(),
    };
    let stream = UdpStream::to(&args.to).map_err(CliError::failure)?;
    let Field { drone, seed, .. } = args.field;
    let emulator = EmulatedMotionCapture::new(world, drone, config, seed, stream);
    let emulator = emulator.map_err(CliError::input)?;
    let endpoint = Endpoint::UdpIn { address: args.to.clone() }.to_string();
    Ok(Placed { device: "motion capture", endpoint, emulator: Box::new(emulator) })
}

/// The AR.Drone that is seen, if there is one, and its port of navdata.
pub fn ar_drone(args: &MotionCaptureArgs, world: &World) -> Result<Vec<Placed>, CliError> {
    if !args.ar_drone {
        return Ok(Vec::new());
    }
    let listen = |port: u16| {
        let address = format!("127.0.0.1:{port}");
        let stream = UdpStream::listen(&address).map_err(CliError::failure)?;
        Ok::<_, CliError>((stream, Endpoint::UdpOut { address }.to_string()))
    };
    let (orders, endpoint) = listen(5556)?;
    let (navdata, navdata_endpoint) = listen(5554)?;
    let emulator = EmulatedArDrone::new(world, args.field.drone, orders, navdata);
    let emulator = Box::new(emulator.map_err(CliError::input)?);
    Ok(vec![
        Placed { device: "vehicle", endpoint, emulator },
        Placed { device: "navdata", endpoint: navdata_endpoint, emulator: Box::new(Beside) },
    ])
}

/// A port of a device that another emulator serves.
struct Beside;

impl Emulator for Beside {
    fn serve(&mut self) -> io::Result<()> {
        Ok(())
    }
}
