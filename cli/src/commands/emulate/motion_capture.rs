use std::io;

use foxhunt::{
    sim::{
        EmulatedArDrone, EmulatedMotionCapture, EmulatedMotionCaptureConfig, Emulator, Interval,
        World,
    },
    wire::{Endpoint, UdpStream},
};

use super::device::{Field, Placed};
use crate::error::CliError;

/// A motion-capture system, as JSON lines over UDP
///
/// Sends the true pose of the scenario's drone, which stays where it is unless `--ar-drone` has it
/// flown.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub(super) field: Field,
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

pub(super) fn place(args: &Args, world: &World) -> Result<Placed, CliError> {
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
pub(super) fn ar_drone(args: &Args, world: &World) -> Result<Vec<Placed>, CliError> {
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
