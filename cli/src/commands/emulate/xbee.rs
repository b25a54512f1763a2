use foxhunt::{
    core::BeaconId,
    scenario::Scenario,
    sim::{EmulatedXbee, EmulatedXbeeConfig, World, xbee_address},
    wire::{PtyStream, xbee::Protocol},
};

use super::{
    device::{Field, Placed, linked},
    pose::Pose,
};
use crate::{error::CliError, output::warn};

/// An XBee radio, whose RSSI comes from the field
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub(super) field: Field,
    #[command(flatten)]
    pub(super) pose: Pose,
    /// Its API mode (AP): 0 transparent, 1 plain frames, 2 escaped frames
    #[arg(long, value_name = "AP", default_value_t = 1, value_parser = clap::value_parser!(u8).range(0..=2))]
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

pub(super) fn place(args: &Args, _scenario: &Scenario, world: &World) -> Result<Placed, CliError> {
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
