use foxhunt_formation::OrderReason;
use foxhunt_hunt::hunt::Event;

/// Something that happened, in words.
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// Time in seconds.
    pub time: f64,
    /// The event, with its reason.
    pub text: String,
    /// True if a person who follows the hunt has to know it.
    pub important: bool,
}

/// A clock that is off by more than this, in seconds, is worth setting.
const OFF_S: f64 = 0.5;

/// Below this share of its battery a drone has to come home.
const LOW_BATTERY: f64 = 0.3;

/// Describes an event in words; `None` for receptions, corrections and clouds.
#[must_use]
pub fn notice(event: &Event) -> Option<Notice> {
    let of_drone = |drone: usize, text: String| format!("drone {} {text}", drone.saturating_add(1));
    let (time, important, text) = match event {
        Event::BeaconStarted { time, name, .. } => (time, true, format!("looking for {name}")),
        Event::Resumed { time } => (time, true, "the hunt goes on from its log".to_owned()),
        Event::PhaseChanged { time, phase } => (time, false, phase.to_string()),
        Event::Planned { time, reason, .. } => (time, false, format!("plan: {reason}")),
        Event::GoalMoved { time, drone, reason, .. } => {
            let text = format!("goes elsewhere than planned: {reason:?}").to_lowercase();
            (time, false, of_drone(*drone, text))
        }
        Event::Sent { time, drone, to, reason } => {
            let text = format!("is sent to {:.1} E {:.1} N{}", to.x, to.y, why_sent(*reason));
            (time, false, of_drone(*drone, text))
        }
        Event::Held { time, drone, reason } => {
            (time, false, of_drone(*drone, format!("waits: {reason}")))
        }
        Event::DutyChanged { time, drone, duty } => {
            (time, true, format!("drone {}: {duty}", drone.saturating_add(1)))
        }
        Event::Stopped { time, beacon, outcome, reason } => {
            let number = beacon.0.saturating_add(1);
            (time, true, format!("beacon number {number}: {outcome}, {reason}"))
        }
        Event::Recalled { time, reason } => (time, true, format!("all drones fly home: {reason}")),
        Event::Landed { time, drone, reason } => {
            (time, true, of_drone(*drone, format!("lands: {reason}")))
        }
        Event::FilterDiverged { time, average_nis, interval: [_, high], .. } => {
            let text = format!(
                "the filter has diverged: its NIS is {average_nis:.1} on average, not below \
                 {high:.1}; do not rely on the ellipse, and look at compass, antenna and model"
            );
            (time, true, text)
        }
        Event::Refused { time, drone, reason } => {
            (time, false, format!("a turn of drone {} is refused: {reason}", drone + 1))
        }
        Event::Missing { time, drone, waited_s } => {
            let text = format!(
                "delivered nothing in {waited_s:.0} s; look at its radio and its motor, the others \
                 go on"
            );
            (time, true, of_drone(*drone, text))
        }
        Event::FlightStage { time, stage, reason } => (time, true, format!("{stage}: {reason}")),
        Event::Aircraft { time, drone, mode, armed, airborne, hindrance, .. } => {
            let place = match (airborne, armed) {
                // Carried receivers and stations count as in the air while they take part.
                (true, _) if matches!(mode.as_str(), "CARRIED" | "FIXED") => "takes part",
                (true, _) => "in the air",
                (false, true) => "armed",
                (false, false) => "on the ground",
            };
            let hindrance = Some(hindrance).filter(|text| !text.is_empty());
            let hindrance = hindrance.map_or_else(String::new, |text| format!("; {text}"));
            let drone = drone.saturating_add(1);
            let mode = Some(mode.as_str()).filter(|mode| !mode.is_empty()).unwrap_or("no mode yet");
            (time, true, format!("drone {drone}: {mode}, {place}{hindrance}"))
        }
        Event::Health { time, drone, battery, linked, position_sigma_m, above_ground } => {
            let mut parts = Vec::new();
            parts.extend(battery.map(|left| format!("{:.0} % of its battery left", left * 100.0)));
            // What is in the way of its orders says so itself.
            parts.extend((!linked).then(|| "no messages".to_owned()));
            parts.extend(position_sigma_m.map(|sigma| format!("position to {sigma:.1} m (σ)")));
            parts.extend(above_ground.map(|height| {
                format!("{:.1} m to the ground below ({})", height.metres, height.source)
            }));
            let low = battery.is_some_and(|left| left < LOW_BATTERY);
            parts.extend(low.then(|| "bring it home soon".to_owned()));
            if parts.is_empty() {
                return None;
            }
            (time, low, of_drone(*drone, format!("has {}", parts.join(", "))))
        }
        Event::HeightDiffers { time, drone, reported, expected_m, tolerance_m } => {
            let text = format!(
                "is {:.1} m above the ground by {}, {expected_m:.1} m by [terrain], more than \
                 {tolerance_m} m apart; look at it, take it over if it is low, and check the \
                 tiles of terrain.folder",
                reported.metres, reported.source
            );
            (time, true, of_drone(*drone, text))
        }
        Event::ClockOffset { time, drone, offset_s, uncertainty_s, jumps } => {
            let set = if *jumps > 0 { "was set and " } else { "" };
            let off = if *offset_s > 0.0 { "behind" } else { "ahead" };
            let text = format!(
                "drone {}: its clock {set}is {:.2} s {off}, to within {uncertainty_s:.2} s; its \
                 times are corrected",
                drone.saturating_add(1),
                offset_s.abs(),
            );
            (time, *jumps > 0 || offset_s.abs() > OFF_S, text)
        }
        Event::DeviceFailed { time, drone, reason } => {
            let who = match drone {
                Some(drone) => format!("drone {}", drone.saturating_add(1)),
                None => "the fleet".to_owned(),
            };
            let remedy = "the hunt goes on; bring it home if it stays so";
            (time, true, format!("{who}: {reason}; {remedy}"))
        }
        Event::BeaconFinished { time, fix } => {
            (time, true, format!("{}: {} after {} steps", fix.name, fix.outcome, fix.steps))
        }
        // Goals follow from plans; receptions, corrections and clouds are drawn.
        _ => return None,
    };
    Some(Notice { time: *time, text, important })
}

/// Reason why a drone was sent, unless it simply goes to its goal.
fn why_sent(reason: OrderReason) -> String {
    match reason {
        OrderReason::Around => ", the first corner of its way round".to_owned(),
        OrderReason::Corner => ", the next corner of its way".to_owned(),
        OrderReason::Stop => ", to stop".to_owned(),
        OrderReason::Return => ", back to where it rested".to_owned(),
        OrderReason::Exchanged { with } => {
            format!(", the goal of drone {}", with.saturating_add(1))
        }
        OrderReason::Aside => ", aside to let others pass".to_owned(),
        _ => String::new(),
    }
}
