//! Missions that ground stations upload, as `fly --mission-to` writes them.

use std::{
    fs,
    path::{Path, PathBuf},
};

use foxhunt::{
    fly::{FlightConfig, MissionFormat},
    registry::Registry,
};
use serde::Serialize;

use crate::{
    error::CliError,
    output::{Output, warn},
};

/// The result in JSON.
#[derive(Serialize)]
struct Written {
    missions: Vec<DroneMission>,
}

/// The mission of a drone.
#[derive(Serialize)]
struct DroneMission {
    drone: String,
    file: PathBuf,
    /// Number of places that it listens at.
    places: usize,
}

/// Writes the mission of each drone. With several drones each file's name has its drone's name.
pub(super) fn write(
    config: &FlightConfig,
    registry: &Registry,
    file: &Path,
    hold_s: f64,
    output: Output,
) -> Result<(), CliError> {
    let format = MissionFormat::of_file(file)
        .map_err(|error| CliError::input(format!("--mission-to {}: {error}", file.display())))?;
    if !(hold_s.is_finite() && hold_s >= 0.0) {
        return Err(CliError::input(format!(
            "--hold-s is {hold_s}; it must be finite, zero or more"
        )));
    }
    let frame = config.site.frame().map_err(CliError::input)?;
    let routes = config.routes(registry).map_err(CliError::input)?;
    if routes.len() > 1 {
        warn(
            "each autopilot flies its own mission at its own pace: nothing keeps the drones apart \
             but their places",
        );
    }
    let mut missions = Vec::new();
    for route in &routes {
        let path = if routes.len() > 1 { of_drone(file, &route.drone) } else { file.to_owned() };
        fs::write(&path, route.mission(&frame, hold_s, format))
            .map_err(|error| CliError::writing(&path, error))?;
        let drone = route.drone.clone();
        let places = route.places_m.len();
        missions.push(DroneMission { drone, file: path, places });
    }
    output.result(&Written { missions }, |written| {
        let line = |one: &DroneMission| {
            format!("{}: {} places, {}", one.drone, one.places, one.file.display())
        };
        written.missions.iter().map(line).collect::<Vec<_>>().join("\n")
    })
}

/// Returns the file of one of several drones, with a hyphen for characters that file names cannot
/// hold.
fn of_drone(file: &Path, drone: &str) -> PathBuf {
    let plain = |c: char| if c.is_alphanumeric() || c == '_' { c } else { '-' };
    let drone: String = drone.chars().map(plain).collect();
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let ending = file.extension().unwrap_or_default().to_string_lossy();
    file.with_file_name(format!("{stem}-{drone}.{ending}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_have_the_names_of_drones() {
        assert_eq!(of_drone(Path::new("a/m.plan"), "north 1/2"), Path::new("a/m-north-1-2.plan"));
    }
}
