//! Advice to pilots while they fly (`fly --advise`), and to people who carry receivers.

use foxhunt::{
    core::Sweep,
    fly::{FlightConfig, Pitch, PitchConfig, VehicleDevice, Warmth},
    formation::Phase,
    geodesy::radians_to_compass_deg,
    hunt::{Event, FlightStage, Hunt},
};

use crate::output::warn;

/// Time from one report of a level to the next, in seconds.
const REPORT_S: f64 = 3.0;

/// Adviser of pilots and of people who carry receivers.
pub struct Adviser {
    /// True if every drone is flown by a pilot who is advised.
    pilots: bool,
    /// Receivers that are carried, by the drone's number.
    carried: Vec<Option<Carried>>,
    /// Times and levels that no tone has had yet.
    levels: Vec<(f64, f64)>,
}

/// Level of a receiver that is carried.
struct Carried {
    name: String,
    pitch: Pitch,
    reported: f64,
    /// True if a level came since the last report.
    is_new: bool,
}

impl Adviser {
    pub fn new(config: &FlightConfig, pilots: bool) -> Self {
        let carried = config.drones.iter().map(|drone| match drone.vehicle {
            VehicleDevice::Carried { .. } => {
                let pitch = Pitch::new(PitchConfig::default()).ok()?;
                let name = drone.name.clone();
                Some(Carried { name, pitch, reported: f64::NEG_INFINITY, is_new: false })
            }
            _ => None,
        });
        Self { pilots, carried: carried.collect(), levels: Vec::new() }
    }

    fn is_carried(&self, drone: usize) -> bool {
        self.carried.get(drone).is_some_and(Option::is_some)
    }

    /// Words for one whose hunt is over; `None` for a drone that its autopilot lands.
    fn landing(&self, drone: usize, reason: &str) -> Option<String> {
        if self.is_carried(drone) {
            return Some("stop, the hunt is over for you".to_owned());
        }
        self.pilots.then(|| format!("land: {reason}"))
    }

    /// Takes the levels of a sweep.
    pub fn received(&mut self, drone: usize, sweep: &Sweep<'_>) {
        let Some(Some(carried)) = self.carried.get_mut(drone) else { return };
        for sample in sweep.samples {
            carried.pitch.received(sample.time, sample.rss_dbm);
            carried.is_new = true;
            self.levels.push((sample.time, sample.rss_dbm));
        }
    }

    /// Prints the levels of carried receivers from time to time, and whether their ways lead
    /// nearer. Returns the times and levels since the last call.
    pub fn report(&mut self, time: f64, hunt: &Hunt) -> Vec<(f64, f64)> {
        let stations = hunt.stations();
        for (drone, carried) in self.carried.iter_mut().enumerate() {
            let Some(carried) = carried.as_mut().filter(|carried| carried.is_new) else { continue };
            if time - carried.reported < REPORT_S {
                continue;
            }
            let level = carried.pitch.level_dbm(time).zip(carried.pitch.peak_dbm());
            let Some((level, peak)) = level else { continue };
            carried.reported = time;
            carried.is_new = false;
            let warmth = stations.get(drone).and_then(|station| {
                let velocity = station.pose.velocity?.xy();
                let believed = hunt.believed();
                let [believed] = &believed[..] else { return None };
                Warmth::of(station.pose.position.xy(), velocity, &believed.estimate)
            });
            let warmth = warmth.map_or(String::new(), |warmth| format!("; {}", warmth.name()));
            let name = &carried.name;
            warn(&format!("{time:7.0} s  {name}: {level:.1} dBm, peak {peak:.1} dBm{warmth}"));
        }
        std::mem::take(&mut self.levels)
    }

    /// Prints the advice that an event is.
    pub fn advise(&self, event: &Event, config: &FlightConfig, hunt: &Hunt) {
        let some_walk = self.carried.iter().any(Option::is_some);
        if !self.pilots && !some_walk {
            return;
        }
        let name = |drone: usize| config.drones.get(drone).map_or("a drone", |d| d.name.as_str());
        match event {
            Event::Sent { drone, .. } if !self.pilots && !self.is_carried(*drone) => {}
            Event::Sent { time, drone, to, .. } => {
                let Some(station) = hunt.stations().into_iter().nth(*drone) else { return };
                let way = to - station.pose.position;
                let metres = way.xy().norm();
                let compass = radians_to_compass_deg(way.y.atan2(way.x));
                let name = name(*drone);
                let east = to.x;
                let north = to.y;
                let (go, up) = match self.is_carried(*drone) {
                    true => ("go", String::new()),
                    false => ("fly", format!(", {:.1} m up", to.z)),
                };
                warn(&format!(
                    "{time:7.0} s  {name}: {go} {metres:.0} m towards {compass:03.0}°, to \
                     {east:.1} m East, {north:.1} m North{up}",
                ));
            }
            Event::PhaseChanged { time, phase: Phase::Measuring(_) } => {
                let listens = |drone: usize| self.is_carried(drone) && hunt.awaits(drone);
                let some_listen = (0..self.carried.len()).any(listens);
                if self.pilots || some_listen {
                    let listen =
                        if some_walk { "the receivers listen" } else { "the antennas turn" };
                    warn(&format!("{time:7.0} s  stay where you are: {listen}"));
                }
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
                if let Some(word) = self.landing(*drone, reason) {
                    warn(&format!("{time:7.0} s  {}: {word}", name(*drone)));
                }
            }
            Event::FlightStage { time, stage: FlightStage::Leaving, .. } if !self.pilots => {
                warn(&format!("{time:7.0} s  all: come back"));
            }
            Event::FlightStage { time, stage: FlightStage::Climbing, .. } if self.pilots => {
                let up = config.flight.takeoff_up_m;
                warn(&format!("{time:7.0} s  all: take off, to {up:.1} m"));
            }
            Event::FlightStage { time, stage: FlightStage::Leaving, .. } => {
                warn(&format!("{time:7.0} s  all: come back and land"));
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pilots_are_told_to_land() {
        let walker = Carried {
            name: "me".to_owned(),
            pitch: Pitch::new(PitchConfig::default()).expect("in range"),
            reported: f64::NEG_INFINITY,
            is_new: false,
        };
        let mut adviser =
            Adviser { pilots: false, carried: vec![Some(walker), None], levels: Vec::new() };
        let walks = Some("stop, the hunt is over for you".to_owned());
        assert_eq!(adviser.landing(0, "it is at home"), walks);
        assert_eq!(adviser.landing(1, "it is at home"), None, "its autopilot lands it");
        adviser.pilots = true;
        assert_eq!(adviser.landing(0, "it is at home"), walks);
        assert_eq!(adviser.landing(1, "it is at home").as_deref(), Some("land: it is at home"));
    }
}
