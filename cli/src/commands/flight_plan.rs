//! The plan of a flight, as `fly --dry-run` prints it.

use foxhunt::{
    fly::{FlightConfig, FlightPlan, FlyError},
    hunt::Hunt,
};

use super::checklist::checklist;
use crate::{
    error::CliError,
    output::Output,
    table::{list, text},
};

pub(super) fn print(config: &FlightConfig, hunt: Hunt, output: Output) -> Result<(), CliError> {
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
