//! Advice to pilots while they fly (`fly --advise`).

use foxhunt::{
    fly::FlightConfig,
    formation::Phase,
    geodesy::radians_to_compass_deg,
    hunt::{Event, FlightStage, Hunt},
};

use crate::output::warn;

/// Prints the advice that an event is.
pub(super) fn advise(event: &Event, config: &FlightConfig, hunt: &Hunt) {
    let name = |drone: usize| config.drones.get(drone).map_or("a drone", |d| d.name.as_str());
    match event {
        Event::Sent { time, drone, to, .. } => {
            let Some(station) = hunt.stations().into_iter().nth(*drone) else { return };
            let way = to - station.pose.position;
            let metres = way.xy().norm();
            let compass = radians_to_compass_deg(way.y.atan2(way.x));
            let (name, [east, north, up]) = (name(*drone), [to.x, to.y, to.z]);
            warn(&format!(
                "{time:7.0} s  {name}: fly {metres:.0} m towards {compass:03.0}°, to {east:.1} m \
                 East, {north:.1} m North, {up:.1} m up",
            ));
        }
        Event::PhaseChanged { time, phase: Phase::Measuring(_) } => {
            warn(&format!("{time:7.0} s  stay where you are: the antennas turn"));
        }
        Event::GoalsSet { time, .. } => {
            for believed in hunt.believed() {
                let Some(ellipse) = believed.estimate.ellipse(0.95) else { continue };
                let name = believed.name;
                let mean = believed.estimate.mean;
                let east = mean.x;
                let north = mean.y;
                let within = ellipse.semi_major;
                warn(&format!(
                    "{time:7.0} s  {name}: {east:.1} m East, {north:.1} m North, within \
                     {within:.1} m (95 %)",
                ));
            }
        }
        Event::Landed { time, drone, reason } => {
            warn(&format!("{time:7.0} s  {}: land: {reason}", name(*drone)));
        }
        Event::FlightStage { time, stage: FlightStage::Climbing, .. } => {
            let up = config.flight.takeoff_up_m;
            warn(&format!("{time:7.0} s  all: take off, to {up:.1} m"));
        }
        Event::FlightStage { time, stage: FlightStage::Leaving, .. } => {
            warn(&format!("{time:7.0} s  all: come back and land"));
        }
        _ => {}
    }
}
