//! A flight before it begins: its checks, its plan (`fly --dry-run`), and its missions for ground
//! stations (`fly --mission-to`).

use std::{
    fs,
    path::{Path, PathBuf},
};

use foxhunt::{
    fly::{Check, CheckState, FlightConfig, FlightPlan, FlyError, MissionFormat},
    hunt::Hunt,
    registry::Registry,
};
use serde::Serialize;

use crate::{
    error::CliError,
    output::{Output, warn},
    table::{list, text},
};

pub fn print(config: &FlightConfig, hunt: Hunt, output: Output) -> Result<(), CliError> {
    let plan = config.plan(hunt).map_err(|error: FlyError| CliError::input(error))?;
    output.result(&plan, describe)
}

fn describe(plan: &FlightPlan) -> String {
    let mut heads = vec!["drone", "stands at m", "goes first to m", "device", "reached at"];
    let has_ground = plan.drones.iter().any(|drone| drone.ground_m.is_some());
    if has_ground {
        heads.insert(3, "ground there m");
        heads.insert(2, "ground m");
    }
    let mut drones = list(&heads);
    for drone in &plan.drones {
        let launch = drone.launch_m.map(|[east, north]| format!("{east:.1}, {north:.1}"));
        let goal = drone.first_goal_m.map(|[e, n, u]| format!("{e:.1}, {n:.1}, {u:.1}"));
        for (index, (device, endpoint)) in drone.devices.iter().enumerate() {
            // The drone is named once.
            let first = |cell: String| if index == 0 { cell } else { String::new() };
            let mut row = vec![
                first(drone.name.clone()),
                first(text(launch.clone())),
                first(text(goal.clone())),
                (*device).to_owned(),
                endpoint.clone(),
            ];
            if has_ground {
                let height = |m: Option<f64>| first(text(m.map(|m| format!("{m:.1}"))));
                row.insert(3, height(drone.first_ground_m));
                row.insert(2, height(drone.ground_m));
            }
            drones.add_row(row);
        }
    }
    let site = &plan.site;
    let rules = &plan.rules;
    let hunt = &plan.hunt;
    let mut plan_text = format!(
        "{}: East and North from {:.7}, {:.7}\nlooking for {}\n{drones}\n\
         take-off to {} m; at the end {}, if it is broken off {}\n\
         {} m between drones; a move takes at most {:.0} s, a turn {:.0} s\n",
        plan.name,
        site.lat_deg,
        site.lon_deg,
        plan.beacons.join(", "),
        rules.takeoff_up_m,
        rules.at_end,
        rules.on_abort,
        hunt.separation_m,
        hunt.move_timeout_s,
        hunt.turn_timeout_s,
    );
    let airspace = &hunt.airspace;
    if !airspace.fence_m.is_empty() {
        plan_text.push_str(&format!("fence: {:?}\n", airspace.fence_m));
    }
    if let Some([least, most]) = airspace.altitude_m {
        plan_text.push_str(&format!("between {least} and {most} m up\n"));
    }
    if let Some(endurance) = &hunt.endurance {
        plan_text.push_str(&format!(
            "{:.0} s in the air, {:.0} s of them kept\n",
            endurance.endurance_s, endurance.reserve_s
        ));
    }
    for remark in &plan.remarks {
        plan_text.push_str("note: ");
        plan_text.push_str(remark);
        plan_text.push('\n');
    }
    plan_text.push_str(&checklist(&plan.checklist));
    plan_text
}

/// The checklist as a table, and the number of its checks that do not hold. A finding that several
/// drones share stands there once.
pub fn checklist(checks: &[Check]) -> String {
    let mut lines: Vec<(&Check, Vec<&str>)> = Vec::new();
    for check in checks {
        let is_same = |(line, _): &&mut (&Check, Vec<&str>)| {
            line.finding == check.finding
                && line.state == check.state
                && line.drone.is_some() == check.drone.is_some()
        };
        match lines.iter_mut().find(is_same) {
            Some((_, drones)) => drones.extend(check.drone.as_deref()),
            None => lines.push((check, check.drone.as_deref().into_iter().collect())),
        }
    }
    let mut all: Vec<&str> = checks.iter().filter_map(|check| check.drone.as_deref()).collect();
    all.sort_unstable();
    all.dedup();
    let mut rows = list(&["who", "drone", "check", "", "found", "what to do"]);
    let mut before = None;
    for (Check { state, finding, .. }, drones) in &lines {
        // Whoever watches is named once.
        let watch = finding.watch;
        let is_new = before.replace(watch) != Some(watch);
        let mark = match state {
            CheckState::Good => "ok",
            CheckState::Bad => "NO",
            CheckState::Open => "look",
        };
        rows.add_row([
            if is_new { watch.to_string() } else { String::new() },
            match drones.len() {
                0 => "-".to_owned(),
                count if count > 1 && count == all.len() => "each".to_owned(),
                _ => drones.join(", "),
            },
            finding.subject.clone(),
            mark.to_owned(),
            finding.text.clone(),
            finding.remedy.clone().unwrap_or_default(),
        ]);
    }
    let count = |state| checks.iter().filter(|check| check.state == state).count();
    let bad = count(CheckState::Bad);
    let open = count(CheckState::Open);
    format!(
        "{rows}\nWho watches it while the drones fly. {bad} not as they should be, {open} for the \
         pilot to look at."
    )
}

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
pub fn write_missions(
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
