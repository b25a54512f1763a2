use std::{vec, vec::Vec};

use nalgebra::{Vector2, Vector3};

use super::{
    Traffic, TrafficError,
    assignment::assign_by,
    ground::{Region, SLACK, ring_about},
    traffic::check_finite,
    way::{Surroundings, length_over_ground},
};

/// Which drone flies to which place of a formation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Formation {
    /// The drones that take part.
    pub drones: Vec<usize>,
    /// The goal of each, in the same order; East, North and Up in metres.
    pub goals: Vec<Vector3<f64>>,
    /// The places that are not where they were wanted.
    pub moved: Vec<Moved>,
}

impl Formation {
    /// Each drone with its goal.
    pub fn iter(&self) -> impl Iterator<Item = (usize, Vector3<f64>)> {
        self.drones.iter().copied().zip(self.goals.iter().copied())
    }
}

/// A place of a formation that is not where it was wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// The drone that goes there.
    pub drone: usize,
    /// Where it was wanted.
    pub wanted: Vector3<f64>,
    /// Where it goes instead.
    pub goal: Vector3<f64>,
    /// Why.
    pub reason: MovedReason,
}

/// Why a place of a formation was moved: the first of these that it was against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum MovedReason {
    /// Outside the fence, in a keep-out, or too near to either.
    Airspace,
    /// Below or above the band of altitudes.
    Altitude,
    /// Too near to a drone that does not take part.
    Drone,
    /// Too near to another place of the formation.
    Separation,
    /// Too near to a target.
    Void,
    /// There is no place left for it: the drone stays where it is.
    NoPlace,
}

impl Traffic {
    /// Finds a goal for each of `drones`, one of `places` for each, in any order.
    ///
    /// Every place is moved to the nearest one that is permitted and far enough from the others,
    /// from drones that do not take part, and from targets; earlier places go first. Then the
    /// drones are assigned so that they travel as little as possible together, over permitted ways.
    /// Nothing is reserved; [`depart`](Self::depart) does.
    ///
    /// # Errors
    ///
    /// [`TrafficError`] where a drone does not exist or is named twice, there are not as many places as drones, or
    /// one is not finite.
    pub fn form(
        &self,
        drones: &[usize],
        places: &[Vector3<f64>],
    ) -> Result<Formation, TrafficError> {
        if drones.len() != places.len() {
            return Err(TrafficError::Places { places: places.len(), drones: drones.len() });
        }
        for (index, (&drone, place)) in drones.iter().zip(places).enumerate() {
            self.check_drone(drone)?;
            check_finite(drone, place)?;
            if drones[..index].contains(&drone) {
                return Err(TrafficError::Drone { drone, drones: self.drones() });
            }
        }
        let others = (0..self.drones()).filter(|drone| !drones.contains(drone));
        let mut surroundings = Surroundings {
            airspace: &self.airspace,
            others: others.map(|drone| self.flights[drone].region()).collect(),
            keep: self.config.keep_m(),
            void: self.config.void.map(|void| (void, self.clouds.as_slice())),
        };
        let resting = surroundings.others.len();
        // Each place that there is room for: where it was wanted, where it is, and why.
        let mut found: Vec<(Vector3<f64>, Vector3<f64>, Option<MovedReason>)> = vec![];
        for wanted in places {
            if let Some(ground) = nearest(&surroundings, &wanted.xy()) {
                let reason = self.reason(&surroundings, resting, wanted);
                let goal = Vector3::new(ground.x, ground.y, self.airspace.altitude(wanted.z));
                surroundings.others.push(Region::along(&[goal]));
                found.push((*wanted, goal, reason));
            }
        }
        Ok(self.assigned(drones, places, &found))
    }

    /// Where drones can land that begin at `starts`: the nearest places to these, in their order, that
    /// are permitted and far enough apart for all drones to rest there, at the altitudes of
    /// `starts`. Where there is no room, the start itself, though its drone may find it blocked.
    #[must_use]
    pub fn homes(&self, starts: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut surroundings = Surroundings {
            airspace: &self.airspace,
            others: vec![],
            keep: self.config.keep_m(),
            void: None,
        };
        let home = |start: &Vector3<f64>| {
            let ground = nearest(&surroundings, &start.xy()).unwrap_or(start.xy());
            let home = Vector3::new(ground.x, ground.y, start.z);
            surroundings.others.push(Region::along(&[home]));
            home
        };
        starts.iter().map(home).collect()
    }

    fn reason(
        &self,
        surroundings: &Surroundings<'_>,
        resting: usize,
        wanted: &Vector3<f64>,
    ) -> Option<MovedReason> {
        let ground = wanted.xy();
        let near = |others: &[Region]| {
            others.iter().any(|other| other.distance_to(&ground) < self.config.keep_m() - 1e-9)
        };
        if !self.airspace.holds(&ground) {
            Some(MovedReason::Airspace)
        } else if near(&surroundings.others[..resting]) {
            Some(MovedReason::Drone)
        } else if near(&surroundings.others[resting..]) {
            Some(MovedReason::Separation)
        } else if !surroundings.permit(&ground) {
            Some(MovedReason::Void)
        } else if !self.airspace.permits(wanted) {
            Some(MovedReason::Altitude)
        } else {
            None
        }
    }

    fn assigned(
        &self,
        drones: &[usize],
        places: &[Vector3<f64>],
        found: &[(Vector3<f64>, Vector3<f64>, Option<MovedReason>)],
    ) -> Formation {
        let alone = Surroundings {
            airspace: &self.airspace,
            others: vec![],
            keep: self.config.keep_m(),
            void: None,
        };
        let places_of = assign_by(drones.len(), found.len(), |drone, place| {
            let from = self.flights[drones[drone]].end().xy();
            let way = alone.way(&from, &found[place].1.xy());
            // Farther than any way where there is none.
            way.map_or(1e7, |way| length_over_ground(&from, &way))
        });
        let mut formation = Formation { drones: drones.to_vec(), ..Formation::default() };
        for (index, (&drone, place)) in drones.iter().zip(places_of).enumerate() {
            let (wanted, goal, reason) = match place {
                Some(place) => found[place],
                None => (places[index], self.flights[drone].end(), Some(MovedReason::NoPlace)),
            };
            formation.goals.push(goal);
            formation.moved.extend(reason.map(|reason| Moved { drone, wanted, goal, reason }));
        }
        formation
    }
}

/// The nearest place where a drone may rest: one of those where the limits say so, or of rings
/// about where it was wanted.
fn nearest(surroundings: &Surroundings<'_>, wanted: &Vector2<f64>) -> Option<Vector2<f64>> {
    if surroundings.permit(wanted) {
        return Some(*wanted);
    }
    let keep = surroundings.keep + SLACK;
    let mut candidates: Vec<Vector2<f64>> = vec![];
    candidates.extend(surroundings.airspace.nearest_over_ground(wanted));
    let centres: Vec<Vector2<f64>> = surroundings.others.iter().flat_map(Region::ends).collect();
    for (index, centre) in centres.iter().enumerate() {
        if let Some(direction) = (wanted - centre).try_normalize(SLACK) {
            let place = centre + direction * keep;
            candidates.push(place);
            candidates.extend(surroundings.airspace.nearest_over_ground(&place));
        }
        for other in &centres[..index] {
            candidates.extend(at_distance(centre, other, keep));
        }
    }
    let distance = |place: &Vector2<f64>| (place - wanted).norm();
    candidates.retain(|place| surroundings.permit(place));
    let best = candidates.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let step = 0.25 * keep;
    let limit = best.map_or(f64::INFINITY, |best| distance(&best));
    let rings = (1..=200_u32).map(|k| f64::from(k) * step).take_while(|radius| *radius < limit);
    let ring = rings.flat_map(|radius| ring_about(wanted, radius, 32));
    ring.into_iter().find(|place| distance(place) < limit && surroundings.permit(place)).or(best)
}

/// The two places at `distance` from both.
fn at_distance(a: &Vector2<f64>, b: &Vector2<f64>, distance: f64) -> Vec<Vector2<f64>> {
    let half = (b - a) * 0.5;
    let height = distance * distance - half.norm_squared();
    match Vector2::new(-half.y, half.x).try_normalize(SLACK) {
        Some(across) if height >= 0.0 => {
            let across = across * libm::sqrt(height);
            vec![a + half + across, a + half - across]
        }
        _ => vec![],
    }
}
