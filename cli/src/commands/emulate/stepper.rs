use foxhunt::{
    scenario::Scenario,
    sim::{EmulatedStepper, EmulatedStepperConfig, EmulatedSwitch, World},
    wire::PtyStream,
};

use super::{
    device::{Field, Placed, linked},
    pose::Pose,
};
use crate::error::CliError;

/// An antenna stepper: an Arduino with ConfigurableFirmata
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub(super) field: Field,
    #[command(flatten)]
    pub(super) pose: Pose,
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

pub(super) fn place(args: &Args, _scenario: &Scenario, world: &World) -> Result<Placed, CliError> {
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
