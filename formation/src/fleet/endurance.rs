use core::f64::consts::PI;
use std::vec::Vec;

use foxhunt_core::parameter::{ParameterError, positive, require};
use nalgebra::Vector3;

use super::{
    Formation, Region, Traffic, Void,
    flight::ASIDE,
    way::{Surroundings, length_over_ground, with_altitudes},
};

/// Limits by the batteries, and the speeds of the drones.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct EnduranceConfig {
    /// Longest time of a drone in the air, in seconds.
    pub endurance_s: f64,
    /// Reserve of that time when it lands, in seconds.
    pub reserve_s: f64,
    /// Speed of a drone over ground, in metres per second; the least that it keeps against the
    /// wind.
    pub speed_mps: f64,
    /// Speed of climbing and sinking, in metres per second.
    pub climb_mps: f64,
}

impl Default for EnduranceConfig {
    /// 15 minutes in the air, of which 2 are kept; 2 m/s over ground, 1 m/s up and down.
    fn default() -> Self {
        Self { endurance_s: 900.0, reserve_s: 120.0, speed_mps: 2.0, climb_mps: 1.0 }
    }
}

/// Upper bounds of flight times, and checks that there is time for them.
///
/// Drones whose ways keep apart fly at the same time; those whose ways come nearer than lines may
/// are taken to fly one after the other, around one another, each flying aside once. A
/// drone that is stuck in the air is in no such bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Endurance {
    config: EnduranceConfig,
}

impl Endurance {
    /// Flights of drones with these batteries and speeds.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn new(config: EnduranceConfig) -> Result<Self, ParameterError> {
        let EnduranceConfig { endurance_s, reserve_s, speed_mps, climb_mps } = config;
        positive("endurance_s", endurance_s)?;
        let kept = (0.0..endurance_s).contains(&reserve_s);
        require(kept, "reserve_s", reserve_s, "from 0 to below endurance_s")?;
        positive("speed_mps", speed_mps)?;
        positive("climb_mps", climb_mps)?;
        Ok(Self { config })
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &EnduranceConfig {
        &self.config
    }

    /// Returns the seconds that a drone may still fly that has been in the air for `flown_s`
    /// seconds; negative where it eats up its reserve.
    #[must_use]
    pub fn left_s(&self, flown_s: f64) -> f64 {
        self.config.endurance_s - self.config.reserve_s - flown_s
    }

    /// Returns an upper bound of the time until each of `flights`, from one place to another, is
    /// over; `None` where there is no permitted way.
    ///
    /// Targets need not be kept away from. Drones of the traffic that have no such flight are flown
    /// around.
    fn flights_s(
        &self,
        traffic: &Traffic,
        flights: &[(usize, Vector3<f64>, Vector3<f64>)],
    ) -> Option<f64> {
        self.longest_s(traffic, flights, None)
    }

    /// Returns an upper bound of flights' time where targets are kept away from. A flight that they
    /// leave no way for takes at most what it takes without them: its drone stays.
    fn longest_s(
        &self,
        traffic: &Traffic,
        flights: &[(usize, Vector3<f64>, Vector3<f64>)],
        void: Option<Void>,
    ) -> Option<f64> {
        let keep = traffic.config().keep_m();
        let alone = |void: Option<Void>| Surroundings {
            airspace: &traffic.airspace,
            others: Vec::new(),
            keep,
            void: void.map(|void| (void, traffic.clouds.as_slice())),
        };
        let mut groups: Vec<Group> = Vec::new();
        for (_, from, to) in flights {
            let way = |void| alone(void).way(&from.xy(), &to.xy());
            let way = way(void).or_else(|| way(None))?;
            let length = length_over_ground(&from.xy(), &way);
            let places = with_altitudes(&traffic.airspace, from, to.z, &way);
            let mut region = Region::along(&[*from]);
            let mut climb = 0.0;
            let mut here = *from;
            for place in places {
                region.add(&here.xy(), &place.xy());
                climb += (place.z - here.z).abs();
                here = place;
            }
            let resting = (0..traffic.drones()).filter(|d| flights.iter().all(|(f, ..)| f != d));
            let around = resting
                .filter_map(|drone| traffic.place(drone))
                .filter(|place| region.distance_to(&place.xy()) < keep);
            // It stops before it turns, and flies half around every disc in between.
            let length = length
                + 2.0 * traffic.config().stopping_m
                + PI * keep * around.map(|_| 1.0).sum::<f64>();
            let seconds = length / self.config.speed_mps + climb / self.config.climb_mps;
            let mut group = Group { members: 1.0, seconds, regions: std::vec![region] };
            // A drone that comes near to this one flies in turn with it.
            let (near, far): (Vec<_>, Vec<_>) =
                groups.into_iter().partition(|other| other.meets(&group, keep));
            groups = far;
            near.into_iter().for_each(|other| group.join(other));
            groups.push(group);
        }
        let seconds = |group: &Group| {
            let others = group.members - 1.0;
            let aside = if others > 0.0 { 2.0 * f64::from(ASIDE) * keep } else { 0.0 };
            let detours = group.members * (aside + PI * keep * others);
            group.seconds + detours / self.config.speed_mps
        };
        Some(groups.iter().map(seconds).fold(0.0, f64::max))
    }

    /// Returns an upper bound of the time until the drones named are home from where they are taken
    /// to be; `homes` holds the home of every drone of the traffic. `None` where there is no
    /// permitted way.
    #[must_use]
    pub fn return_s(
        &self,
        traffic: &Traffic,
        drones: &[usize],
        homes: &[Vector3<f64>],
    ) -> Option<f64> {
        let flight = |&drone: &usize| Some((drone, traffic.place(drone)?, *homes.get(drone)?));
        self.flights_s(traffic, &drones.iter().map(flight).collect::<Option<Vec<_>>>()?)
    }

    /// Returns an upper bound of the time to fly to a formation, to listen there for `turn_s`
    /// seconds, and to return home from there: the time needed before the formation departs. On the
    /// way out targets are kept away from as [`Traffic::depart`] does, on the way home they are
    /// not.
    #[must_use]
    pub fn round_s(
        &self,
        traffic: &Traffic,
        formation: &Formation,
        homes: &[Vector3<f64>],
        turn_s: f64,
    ) -> Option<f64> {
        let out = |(drone, goal)| Some((drone, traffic.place(drone)?, goal));
        let out: Vec<_> = formation.iter().map(out).collect::<Option<_>>()?;
        let back = |(drone, goal)| Some((drone, goal, *homes.get(drone)?));
        let back: Vec<_> = formation.iter().map(back).collect::<Option<_>>()?;
        let out_s = self.longest_s(traffic, &out, traffic.config().void)?;
        Some(out_s + turn_s + self.flights_s(traffic, &back)?)
    }
}

/// Drones that may have to fly one after the other.
struct Group {
    members: f64,
    /// All their flights together.
    seconds: f64,
    regions: Vec<Region>,
}

impl Group {
    fn meets(&self, other: &Self, keep: f64) -> bool {
        self.regions.iter().any(|a| other.regions.iter().any(|b| a.distance_between(b) < keep))
    }

    fn join(&mut self, other: Self) {
        self.members += other.members;
        self.seconds += other.seconds;
        self.regions.extend(other.regions);
    }
}
