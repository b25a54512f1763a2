use std::{fs, io, path::PathBuf};

use foxhunt::{
    fly::{EmulatedField, EmulatedFieldConfig},
    scenario::Scenario,
    sim::{Emulator, World},
};

use super::bench::{Field, Placed};
use crate::{
    error::{CliError, InFile},
    output::warn,
};

/// All devices of all drones, and the flight that meets them
///
/// Writes a flight's file that `foxhunt fly` takes, with every port where the devices are.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub(super) field: Field,
    /// The flight's file that is written
    #[arg(long, value_name = "FILE", default_value = "out/field.toml")]
    config: PathBuf,
    /// A TOML file with the faults and their times (docs/flying.md)
    #[arg(long, value_name = "FILE")]
    faults: Option<PathBuf>,
}

/// A whole field as one device.
struct Whole(EmulatedField);

impl Emulator for Whole {
    fn serve(&mut self) -> io::Result<()> {
        self.0.serve(|device, error| warn(&format!("{device}: {error}")));
        Ok(())
    }
}

pub(super) fn place(args: &Args, scenario: &Scenario, world: &World) -> Result<Placed, CliError> {
    let config = match &args.faults {
        Some(path) => faults(path)?,
        None => EmulatedFieldConfig::default(),
    };
    let folder = args.config.parent().map_or_else(PathBuf::new, |parent| parent.join("ports"));
    fs::create_dir_all(&folder).map_err(|error| CliError::writing(&folder, error))?;
    let folder = folder.canonicalize().map_err(|error| CliError::writing(&folder, error))?;
    let field = EmulatedField::new(scenario, world, &config, &folder).map_err(CliError::input)?;
    let text = toml::to_string(field.flight()).map_err(CliError::failure)?;
    fs::write(&args.config, text).map_err(|error| CliError::writing(&args.config, error))?;
    let endpoint = args.config.display().to_string();
    Ok(Placed { device: "field", endpoint, emulator: Box::new(Whole(field)) })
}

fn faults(path: &PathBuf) -> Result<EmulatedFieldConfig, CliError> {
    let wrong = |source: Box<dyn std::error::Error>| {
        CliError::input(InFile { file: path.display().to_string(), source })
    };
    let text = fs::read_to_string(path).map_err(|error| wrong(error.into()))?;
    toml::from_str(&text).map_err(|error| wrong(error.into()))
}
