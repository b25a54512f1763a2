use foxhunt_hardware::link::{BeaconView, ClockOffset, DroneView, Health, Stage, UnixTime, View};
use foxhunt_hunt::hunt::Hunt;

use super::remote::Remote;

/// The view of a hunt for whoever looks on.
pub(super) fn view(
    at: UnixTime,
    hunt: &Hunt,
    drones: &[Remote],
    silent: &[usize],
    hindrance: Option<&str>,
    clock_tolerance_s: f64,
) -> View {
    let believed = hunt.believed();
    let beacons = believed.iter().map(|known| BeaconView {
        number: known.beacon.0,
        name: known.name.to_owned(),
        estimate: known.estimate,
    });
    let shown = |drone: &Remote| DroneView {
        goal: drone.order.goal,
        path: drone.path.iter().copied().collect(),
    };
    let fusion = Health {
        name: "foxhunt: fusion".to_owned(),
        trouble: hindrance.map(str::to_owned),
        doing: hunt.phase().to_string(),
        values: vec![
            ("beacons".to_owned(), hunt.beacon_count().to_string()),
            ("done".to_owned(), hunt.fixes().len().to_string()),
        ],
    };
    let of = |(index, drone): (usize, &Remote)| {
        health(index, drone, silent.contains(&index), clock_tolerance_s)
    };
    View {
        at,
        beacons: beacons.collect(),
        drones: drones.iter().map(shown).collect(),
        health: std::iter::once(fusion).chain(drones.iter().enumerate().map(of)).collect(),
    }
}

fn health(index: usize, drone: &Remote, silent: bool, clock_tolerance_s: f64) -> Health {
    let late_s = drone.late_s;
    let trouble = if silent {
        Some("it is silent".to_owned())
    } else if !drone.failure.is_empty() {
        Some(drone.failure.clone())
    } else if late_s.abs() > clock_tolerance_s {
        Some(format!("its places come {late_s:.1} s late: its link is slow"))
    } else if drone.place.is_none() {
        Some("its clock is not known well enough yet".to_owned())
    } else {
        None
    };
    let doing = match (drone.order.number, drone.follows) {
        _ if drone.stage != Stage::Flying => &drone.stage.to_string(),
        (0, _) => "waits for the hunt to begin",
        (given, follows) if follows < given => "has not taken its last order yet",
        _ if drone.order.land => "is to land",
        _ if !drone.order.turn.beacons.is_empty() => "listens",
        _ => "flies or holds",
    };
    let of_clock = |number: fn(ClockOffset) -> f64| {
        drone.clock.map_or_else(|| "unknown".to_owned(), |clock| format!("{:.3}", number(clock)))
    };
    Health {
        name: format!("foxhunt: drone {index}"),
        trouble,
        doing: doing.to_owned(),
        values: vec![
            ("order".to_owned(), drone.order.number.to_string()),
            ("follows".to_owned(), drone.follows.to_string()),
            ("deliveries".to_owned(), drone.delivered.to_string()),
            ("doubled".to_owned(), drone.doubled.to_string()),
            ("late_s".to_owned(), format!("{late_s:.3}")),
            ("clock_offset_s".to_owned(), of_clock(|clock| clock.offset_s)),
            ("clock_uncertainty_s".to_owned(), of_clock(|clock| clock.uncertainty_s)),
        ],
    }
}
