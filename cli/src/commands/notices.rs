//! Notices on standard error while a hunt goes on.

use foxhunt::hunt::Event;

use crate::output::warn;

/// Prints an event that people want to know of.
pub(super) fn narrate(event: &Event) {
    match event {
        Event::BeaconStarted { time, name, .. } => {
            warn(&format!("{time:7.0} s  looking for {name}"))
        }
        Event::Missing { time, drone, waited_s } => {
            let drone = drone.saturating_add(1);
            warn(&format!("{time:7.0} s  drone {drone} delivered nothing in {waited_s:.0} s"));
        }
        Event::DeviceFailed { time, drone, reason } => {
            let who = match drone {
                Some(drone) => format!("drone {}", drone.saturating_add(1)),
                None => "the fleet".to_owned(),
            };
            warn(&format!("{time:7.0} s  {who}: {reason}"));
        }
        Event::Resumed { time } => warn(&format!("{time:7.0} s  the hunt goes on from its log")),
        Event::DutyChanged { time, drone, duty } => {
            warn(&format!("{time:7.0} s  drone {}: {duty}", drone.saturating_add(1)));
        }
        Event::Stopped { time, beacon, outcome, reason } => {
            let number = beacon.0.saturating_add(1);
            warn(&format!("{time:7.0} s  beacon number {number}: {outcome}, {reason}"));
        }
        Event::Recalled { time, reason } => {
            warn(&format!("{time:7.0} s  all drones fly home: {reason}"));
        }
        Event::Landed { time, drone, reason } => {
            warn(&format!("{time:7.0} s  drone {} lands: {reason}", drone.saturating_add(1)));
        }
        Event::FilterDiverged { time, average_nis, interval: [_, high], .. } => warn(&format!(
            "{time:7.0} s  the filter has diverged: its NIS is {average_nis:.1} on average, not \
             below {high:.1}"
        )),
        Event::BeaconFinished { time, fix } => {
            warn(&format!("{time:7.0} s  {}: {} after {} steps", fix.name, fix.outcome, fix.steps));
        }
        Event::FlightStage { time, stage, reason } => {
            warn(&format!("{time:7.0} s  {stage}: {reason}"));
        }
        Event::Aircraft { time, drone, mode, armed, airborne, hindrance, .. } => {
            let place = match (airborne, armed) {
                (true, _) => "in the air",
                (false, true) => "armed",
                (false, false) => "on the ground",
            };
            let hindrance = Some(hindrance).filter(|text| !text.is_empty());
            let hindrance = hindrance.map_or_else(String::new, |text| format!("; {text}"));
            let drone = drone.saturating_add(1);
            warn(&format!("{time:7.0} s  drone {drone}: {mode}, {place}{hindrance}"));
        }
        _ => {}
    }
}
