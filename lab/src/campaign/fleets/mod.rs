//! Campaigns of random fleets, and the watch over a fleet's rules.

mod campaign;

pub use campaign::{FailedRun, FleetsReport, fleets_campaign};

pub(crate) use campaign::FleetRun;

use foxhunt_formation::{Airspace, AirspaceError, EnduranceConfig};
use foxhunt_hunt::{
    hunt::{Event, HuntConfig},
    scenario::Scenario,
};
use foxhunt_sim::{DroneConfig, World};
use nalgebra::{Vector2, Vector3};
use serde::Serialize;

/// A breach of a fleet's rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Breach {
    /// Two drones nearer to each other over ground than the separation.
    Separation,
    /// A drone outside the fence or in a zone to keep out of.
    Airspace,
    /// A drone above the band of altitudes.
    Altitude,
    /// A drone in the air when its batteries are empty, or left there by a hunt that is over
    /// without an order to land in time, though it could have flown home.
    Endurance,
    /// A hunt that is not over in time, or over without a result for a beacon.
    NoEnd,
}

impl Breach {
    /// Returns the name of the breach.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Separation => "separation",
            Self::Airspace => "airspace",
            Self::Altitude => "altitude",
            Self::Endurance => "endurance",
            Self::NoEnd => "no end",
        }
    }
}

/// Something that must not happen and did.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Violation {
    /// The seed of the hunt: `fleet-` and this is its scenario.
    pub seed: u64,
    /// The breach.
    pub breach: Breach,
    /// The time when it first happened, in simulated seconds.
    pub time_s: f64,
    /// The drones, counted from 0.
    pub drones: Vec<usize>,
    /// The value then: metres between drones, metres inside the fence or above the band, seconds in
    /// the air.
    pub value: f64,
    /// The limit of the value.
    pub limit: f64,
}

/// Rounding that is no breach, in metres and seconds.
const ROUNDING: f64 = 1e-6;

/// A drone that is not higher than this has landed, in metres.
const LANDED_M: f64 = 0.05;

/// Time that a drone whose failure is over has beyond its straight way home, in seconds: it has to
/// be noticed, sent home, and let past others.
const ROOM_S: f64 = 30.0;

/// Looks at where the drones of a hunt truly are.
#[derive(Debug)]
struct FleetWatch<'a> {
    seed: u64,
    config: &'a HuntConfig,
    drones: &'a [DroneConfig],
    airspace: Airspace,
    /// The time when they were called home.
    recalled: Option<f64>,
    /// The drones that were ordered to land.
    landing: Vec<usize>,
    /// The time when the last search was over.
    found_last_s: f64,
    places: Vec<Vector3<f64>>,
    /// The time until which each could not be at home, by its failures since they were called
    /// there.
    helpless_until: Vec<f64>,
    /// The time when they were last looked at.
    time_s: f64,
    findings: FleetFindings,
}

/// The findings of a watch.
#[derive(Clone, Debug, PartialEq)]
struct FleetFindings {
    /// The least distance over ground beyond the separation.
    spare_separation_m: f64,
    /// The least distance inside the fence and outside the zones.
    spare_airspace_m: f64,
    /// The least time in the air that was left, of drones that could fly home.
    spare_endurance_s: f64,
    /// Drones whose batteries ran out in the air because they could not be moved.
    stranded: u32,
    /// The first one of each kind.
    violations: Vec<Violation>,
}

impl Default for FleetFindings {
    fn default() -> Self {
        Self {
            spare_separation_m: f64::INFINITY,
            spare_airspace_m: f64::INFINITY,
            spare_endurance_s: f64::INFINITY,
            stranded: 0,
            violations: Vec::new(),
        }
    }
}

impl<'a> FleetWatch<'a> {
    fn new(scenario: &'a Scenario, seed: u64) -> Result<Self, AirspaceError> {
        Ok(Self {
            seed,
            config: &scenario.hunt,
            drones: &scenario.world.drones,
            airspace: Airspace::new(&scenario.hunt.airspace)?,
            recalled: None,
            landing: Vec::new(),
            found_last_s: 0.0,
            places: Vec::new(),
            helpless_until: vec![f64::NEG_INFINITY; scenario.world.drones.len()],
            time_s: 0.0,
            findings: FleetFindings::default(),
        })
    }

    /// The time when the drones were last looked at, in simulated seconds.
    fn looked_at_s(&self) -> f64 {
        self.time_s
    }

    /// The time when the last search was over.
    fn found_last_s(&self) -> f64 {
        self.found_last_s
    }

    fn note(&mut self, event: &Event) {
        match event {
            Event::Recalled { time, .. } => {
                self.recalled.get_or_insert(*time);
            }
            Event::Landed { drone, .. } => self.landing.push(*drone),
            Event::BeaconFinished { time, .. } => self.found_last_s = *time,
            _ => {}
        }
    }

    /// Looks at every drone.
    fn look(&mut self, world: &World) {
        let time = world.time();
        self.time_s = time;
        let places = (0..world.drone_count()).filter_map(|drone| world.pose(drone).ok());
        self.places.clear();
        self.places.extend(places.map(|pose| pose.position));
        for drone in 0..self.places.len() {
            self.look_at(drone, time);
        }
    }

    fn look_at(&mut self, drone: usize, time: f64) {
        let place = self.places[drone];
        let separation = self.config.separation_m;
        for other in 0..drone {
            let apart = (place - self.places[other]).xy().norm();
            let findings = &mut self.findings;
            findings.spare_separation_m = findings.spare_separation_m.min(apart - separation);
            if apart < separation - ROUNDING {
                self.breach(Breach::Separation, time, &[other, drone], apart, separation);
            }
        }
        let inside = self.airspace.clearance(&place.xy());
        self.findings.spare_airspace_m = self.findings.spare_airspace_m.min(inside);
        if inside.is_nan() || inside < -ROUNDING {
            self.breach(Breach::Airspace, time, &[drone], inside, 0.0);
        }
        let above = place.z - self.airspace.altitude(place.z);
        if above > ROUNDING {
            self.breach(Breach::Altitude, time, &[drone], above, 0.0);
        }
        let Some(endurance) = self.config.endurance else { return };
        self.look_for_failures(drone, time, &endurance);
        if place.z > LANDED_M && !self.is_helpless(drone, time) {
            let spare = endurance.endurance_s - time;
            self.findings.spare_endurance_s = self.findings.spare_endurance_s.min(spare);
            if spare < -ROUNDING {
                self.breach(Breach::Endurance, time, &[drone], time, endurance.endurance_s);
            }
        }
    }

    /// A drone that fails after all were called home could not be there before the end of the
    /// straight way from where it is, at the speed and climb of the hunt's configuration, and
    /// [`ROOM_S`].
    fn look_for_failures(&mut self, drone: usize, time: f64, endurance: &EnduranceConfig) {
        let config = &self.drones[drone];
        let mut failures = config.stuck.iter().chain(&config.lost);
        let fails = failures
            .any(|failure| failure.from_s <= time && failure.to_s.is_none_or(|end| end > time));
        if fails && self.recalled.is_some_and(|recalled| time >= recalled) {
            let place = self.places[drone];
            let way_m = (place.xy() - Vector2::new(config.east_m, config.north_m)).norm();
            let home_s = way_m / endurance.speed_mps + place.z / endurance.climb_mps;
            self.helpless_until[drone] = time + home_s + ROOM_S;
        }
    }

    /// Returns true if no hunt could have brought it home by now.
    fn is_helpless(&self, drone: usize, time: f64) -> bool {
        time <= self.helpless_until[drone]
    }

    /// The hunt is over at `time`; `silent` where it left a beacon without a word.
    fn end(mut self, time: f64, silent: bool) -> FleetFindings {
        if silent {
            self.breach(Breach::NoEnd, time, &[], time, 0.0);
        }
        if let Some(endurance) = self.config.endurance {
            for drone in 0..self.places.len() {
                // An order to land is carried out after the hunt.
                let down = time + self.places[drone].z / endurance.climb_mps;
                let lands = self.landing.contains(&drone) && down <= endurance.endurance_s;
                if self.places[drone].z > LANDED_M && self.is_helpless(drone, time) {
                    self.findings.stranded += 1;
                } else if self.places[drone].z > LANDED_M && !lands {
                    self.breach(Breach::Endurance, time, &[drone], time, endurance.endurance_s);
                }
            }
        }
        self.findings
    }

    fn breach(&mut self, breach: Breach, time_s: f64, drones: &[usize], value: f64, limit: f64) {
        if self.findings.violations.iter().all(|known| known.breach != breach) {
            let seed = self.seed;
            let drones = drones.to_vec();
            self.findings.violations.push(Violation { seed, breach, time_s, drones, value, limit });
        }
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_formation::AirspaceConfig;
    use foxhunt_sim::Interval;

    use super::*;
    use foxhunt_hunt::scenario::random_fleet;

    /// Two drones at rest, 5 m apart and 4 m up, for 20 s in the air; they have to keep the rules
    /// that `change` sets.
    fn watched(change: impl FnOnce(&mut Scenario), events: &[Event]) -> FleetFindings {
        watched_for(20, change, events)
    }

    /// Watches two drones at rest for `seconds`.
    fn watched_for(
        seconds: u32,
        change: impl FnOnce(&mut Scenario),
        events: &[Event],
    ) -> FleetFindings {
        let mut scenario = random_fleet(1);
        let drone = |east_m| DroneConfig { east_m, up_m: 4.0, ..DroneConfig::default() };
        scenario.world.drones = vec![drone(0.0), drone(5.0)];
        scenario.hunt = HuntConfig { separation_m: 4.0, ..HuntConfig::default() };
        change(&mut scenario);
        let world = World::new(&scenario.world, 1).expect("in order");
        let mut watch = FleetWatch::new(&scenario, 1).expect("in order");
        events.iter().for_each(|event| watch.note(event));
        for _ in 0..=seconds {
            watch.look(&world);
            world.advance(1.0).expect("a step");
        }
        watch.end(f64::from(seconds), false)
    }

    fn breaches(findings: &FleetFindings) -> Vec<(Breach, f64, &[usize])> {
        findings.violations.iter().map(|v| (v.breach, v.time_s, &v.drones[..])).collect()
    }

    fn recalled(time: f64) -> Event {
        Event::Recalled { time, reason: String::new() }
    }

    fn landed(drone: usize) -> Event {
        Event::Landed { time: 15.0, drone, reason: String::new() }
    }

    fn batteries(scenario: &mut Scenario, endurance_s: f64) {
        let endurance = EnduranceConfig { endurance_s, ..EnduranceConfig::default() };
        scenario.hunt.endurance = Some(endurance);
    }

    #[test]
    fn who_keeps_everything_breaks_nothing() {
        let findings = watched(|_| (), &[]);
        assert_eq!(findings.violations, []);
        assert_abs_diff_eq!(findings.spare_separation_m, 1.0, epsilon = 1e-12);
        assert!(findings.spare_endurance_s.is_infinite() && findings.stranded == 0);
    }

    #[test]
    fn each_breach_is_found_once_and_at_its_time() {
        let near = watched(|s| s.hunt.separation_m = 5.1, &[]);
        assert_eq!(breaches(&near), [(Breach::Separation, 0.0, &[0, 1][..])]);
        let fence_m = vec![[-9.0, -9.0], [4.0, -9.0], [4.0, 9.0], [-9.0, 9.0]];
        let outside = |s: &mut Scenario| {
            s.hunt.airspace = AirspaceConfig { fence_m, ..AirspaceConfig::default() };
        };
        assert_eq!(breaches(&watched(outside, &[])), [(Breach::Airspace, 0.0, &[1][..])]);
        let high = watched(|s| s.hunt.airspace.altitude_m = Some([1.0, 3.9]), &[]);
        assert_eq!(breaches(&high), [(Breach::Altitude, 0.0, &[0][..])]);
        let empty = watched(|s| batteries(s, 9.5), &[recalled(5.0)]);
        assert_eq!(breaches(&empty), [(Breach::Endurance, 10.0, &[0][..])]);
    }

    #[test]
    fn who_is_ordered_to_land_in_time_or_cannot_be_reached_breaks_nothing() {
        // 4 m down at 1 m/s.
        let orders = [recalled(5.0), landed(0), landed(1)];
        assert_eq!(watched(|s| batteries(s, 24.0), &orders).violations, []);
        assert_eq!(breaches(&watched(|s| batteries(s, 23.9), &orders)).len(), 1);
        let one = watched(|s| batteries(s, 24.0), &orders[..2]);
        assert_eq!(breaches(&one), [(Breach::Endurance, 20.0, &[1][..])]);
        // Lost until after the recall: nobody could bring it down. Lost before it: one could.
        let lost = |until: f64| {
            let lost = vec![Interval { from_s: 0.0, to_s: Some(until) }];
            move |s: &mut Scenario| {
                batteries(s, 24.0);
                s.world.drones[1].lost = lost;
            }
        };
        let after = watched(lost(6.0), &orders[..2]);
        assert_eq!((breaches(&after).len(), after.stranded), (0, 1));
        assert_eq!(breaches(&watched(lost(4.0), &orders[..2])).len(), 1);
        // The last second without a link is the 5th; home is 4 m down, and it has 30 s more.
        let late = |s: &mut Scenario| {
            lost(6.0)(s);
            s.world.drones[0].lost = vec![Interval { from_s: 0.0, to_s: None }];
        };
        let late = watched_for(60, late, &orders[..1]);
        assert_eq!(breaches(&late), [(Breach::Endurance, 40.0, &[1][..])]);
    }
}
