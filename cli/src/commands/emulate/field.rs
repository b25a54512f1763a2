use std::{
    fs, io,
    path::{Path, PathBuf},
};

use foxhunt::{
    document,
    fly::{EmulatedField, EmulatedFieldConfig, EmulatedPorts, FlightConfig},
    scenario::Scenario,
    sim::{Emulator, World},
};

use super::device::{Field, Placed};
use crate::{
    commands::choice,
    error::{CliError, InFile},
    output::warn,
};

/// All devices of all drones, and a flight's file for them
///
/// Writes a flight's file for `foxhunt fly`, with the port of every device.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub field: Field,
    /// The flight's file to write
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

pub fn place(args: &Args, scenario: &Scenario, world: &World) -> Result<Placed, CliError> {
    if args.field.speed.to_bits() != 1.0_f64.to_bits() {
        return Err(CliError::input(
            "--speed: a flight in another program keeps the time of the wall; \
             fly --emulate SCENARIO flies the field in its own time, which is faster",
        ));
    }
    let config = config(args.faults.as_deref())?;
    let folder = args.config.parent().map_or_else(PathBuf::new, |parent| parent.join("ports"));
    fs::create_dir_all(&folder).map_err(|error| CliError::writing(&folder, error))?;
    let folder = folder.canonicalize().map_err(|error| CliError::writing(&folder, error))?;
    let field = EmulatedField::new(scenario, world, &config, &folder).map_err(CliError::input)?;
    let text = document::to_toml(field.flight()).map_err(CliError::failure)?;
    fs::write(&args.config, text).map_err(|error| CliError::writing(&args.config, error))?;
    let endpoint = args.config.display().to_string();
    Ok(Placed { device: "field", endpoint, emulator: Box::new(Whole(field)) })
}

/// Returns the settings of a field, from a file if one is given.
fn config(path: Option<&Path>) -> Result<EmulatedFieldConfig, CliError> {
    let Some(path) = path else { return Ok(EmulatedFieldConfig::default()) };
    let wrong = |source: Box<dyn std::error::Error>| {
        CliError::input(InFile { file: path.display().to_string(), source })
    };
    let text = fs::read_to_string(path).map_err(|error| wrong(error.into()))?;
    document::from_toml(&text).map_err(|error| wrong(error.into()))
}

/// A field that is flown by this program, in its own time.
pub struct Emulated {
    pub world: World,
    field: EmulatedField,
    tick_s: f64,
    /// Drones that are lost for good, each with when it is.
    losses: Vec<(usize, f64)>,
}

/// An emulated field, the flight for it, and the ports for that.
pub struct Emulation {
    pub emulated: Emulated,
    pub ports: EmulatedPorts,
    pub config: FlightConfig,
}

impl Emulated {
    pub fn place(scenario: &str, faults: Option<&Path>, seed: u64) -> Result<Emulation, CliError> {
        let scenario = choice::scenario(scenario)?;
        let world = World::new(&scenario.world, seed).map_err(CliError::input)?;
        let (field, ports) = EmulatedField::in_memory(&scenario, &world, &config(faults)?)
            .map_err(CliError::input)?;
        let config = field.flight().clone();
        let drones = scenario.world.drones.iter().enumerate();
        let for_good = drones.flat_map(|(drone, stands)| {
            let endless = stands.lost.iter().filter(|lost| lost.to_s.is_none());
            endless.map(move |lost| (drone, lost.from_s))
        });
        let losses = for_good.collect();
        let emulated = Self { world, field, tick_s: scenario.simulation.tick_s, losses };
        Ok(Emulation { emulated, ports, config })
    }

    /// Returns the drones that are lost for good by a time, in seconds.
    pub fn lost(&self, time: f64) -> Vec<usize> {
        self.losses.iter().filter(|(_, from_s)| time >= *from_s).map(|(drone, _)| *drone).collect()
    }

    /// Lets a tick of the world's time pass, and serves the devices.
    pub fn pass(&mut self) -> Result<(), CliError> {
        self.world.advance(self.tick_s).map_err(CliError::failure)?;
        self.field.serve(|device, error| warn(&format!("{device}: {error}")));
        Ok(())
    }
}
