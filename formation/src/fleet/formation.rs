//! Assignment of drones to the places of a formation.

use std::{vec, vec::Vec};

use nalgebra::{Vector2, Vector3};
use pathfinding::{kuhn_munkres::kuhn_munkres_min, matrix::Matrix};

use super::{
    Airspace, Region, SLACK, micrometres, ring_about,
    way::{Surroundings, length_over_ground},
};

/// Assignment of drones to the places of a formation.
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

/// A place of a formation that was moved from where the planner set it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// The drone that goes there.
    pub drone: usize,
    /// The wanted place.
    pub wanted: Vector3<f64>,
    /// The place that it goes to instead.
    pub goal: Vector3<f64>,
    /// The reason.
    pub reason: MovedReason,
}

/// Reason that a place of a formation was moved: the first of these that it was against.
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

/// A place of a formation that there is room for.
#[derive(Clone, Copy)]
struct Found {
    wanted: Vector3<f64>,
    goal: Vector3<f64>,
    /// Reason that it is not where it was wanted, if it is not.
    moved: Option<MovedReason>,
}

/// A goal for each of `drones`, which rest or end their flights at `starts`, among `places`; the
/// regions of all other drones are in the surroundings.
pub(super) fn form(
    mut surroundings: Surroundings<'_>,
    drones: &[usize],
    starts: &[Vector3<f64>],
    places: &[Vector3<f64>],
) -> Formation {
    let resting = surroundings.others.len();
    let mut found: Vec<Found> = vec![];
    for wanted in places {
        if let Some(ground) = nearest(&surroundings, &wanted.xy()) {
            let moved = reason(&surroundings, resting, wanted);
            let up = surroundings.airspace.altitude(wanted.z);
            let goal = Vector3::new(ground.x, ground.y, up);
            surroundings.others.push(Region::along(&[goal]));
            found.push(Found { wanted: *wanted, goal, moved });
        }
    }
    let Surroundings { airspace, keep, .. } = surroundings;
    let alone = Surroundings { airspace, others: vec![], keep, void: None };
    let places_of = assign_by(drones.len(), found.len(), |drone, place| {
        let from = starts[drone].xy();
        let way = alone.way(&from, &found[place].goal.xy());
        // Farther than any way where there is none.
        way.map_or(1e7, |way| length_over_ground(&from, &way))
    });
    let mut formation = Formation { drones: drones.to_vec(), ..Formation::default() };
    for (index, (&drone, place)) in drones.iter().zip(places_of).enumerate() {
        let stays =
            Found { wanted: places[index], goal: starts[index], moved: Some(MovedReason::NoPlace) };
        let Found { wanted, goal, moved } = place.map_or(stays, |place| found[place]);
        formation.goals.push(goal);
        formation.moved.extend(moved.map(|reason| Moved { drone, wanted, goal, reason }));
    }
    formation
}

/// The nearest places to `starts` where all drones can rest at once, at the altitudes of `starts`;
/// the start itself where there is no room.
pub(super) fn homes(airspace: &Airspace, keep: f64, starts: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut surroundings = Surroundings { airspace, others: vec![], keep, void: None };
    let home = |start: &Vector3<f64>| {
        let ground = nearest(&surroundings, &start.xy()).unwrap_or(start.xy());
        let home = Vector3::new(ground.x, ground.y, start.z);
        surroundings.others.push(Region::along(&[home]));
        home
    };
    starts.iter().map(home).collect()
}

/// Returns the reason that a drone may not rest where it is wanted; `resting` of the others are
/// drones, the rest places of the formation.
fn reason(
    surroundings: &Surroundings<'_>,
    resting: usize,
    wanted: &Vector3<f64>,
) -> Option<MovedReason> {
    let ground = wanted.xy();
    let near = |others: &[Region]| {
        others.iter().any(|other| other.distance_to(&ground) < surroundings.keep - 1e-9)
    };
    if !surroundings.airspace.holds(&ground) {
        Some(MovedReason::Airspace)
    } else if near(&surroundings.others[..resting]) {
        Some(MovedReason::Drone)
    } else if near(&surroundings.others[resting..]) {
        Some(MovedReason::Separation)
    } else if !surroundings.permit(&ground) {
        Some(MovedReason::Void)
    } else if !surroundings.airspace.permits(wanted) {
        Some(MovedReason::Altitude)
    } else {
        None
    }
}

/// The nearest place where a drone may rest: one of those where the limits are, or of rings
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

/// Assigns drones to places, so that all travel together as little as possible.
///
/// The result holds the place of each drone, in the order of `from`; None where there are fewer
/// places than drones and it is left out. Lengths count in whole micrometres. The Hungarian method
/// (Kuhn 1955; Munkres 1957), O(n³).
///
/// Straight ways of least total length do not cross properly: by the triangle inequality two that
/// do could be exchanged for two that are shorter together. (Turpin, Michael & Kumar 2014 minimise
/// the sum of squared distances instead, which also keeps drones apart that fly at the same time.)
#[must_use]
pub fn assign(from: &[Vector2<f64>], to: &[Vector2<f64>]) -> Vec<Option<usize>> {
    assign_by(from.len(), to.len(), |drone, place| (from[drone] - to[place]).norm())
}

/// Assigns drones to places by lengths of any kind, in metres.
fn assign_by(
    drones: usize,
    places: usize,
    length: impl Fn(usize, usize) -> f64,
) -> Vec<Option<usize>> {
    let mut places_of = std::vec![None; drones];
    if drones == 0 || places == 0 {
        return places_of;
    }
    // The method needs at least as many columns as rows.
    if drones <= places {
        let costs = Matrix::from_fn(drones, places, |(d, p)| micrometres(length(d, p)));
        let (_, columns) = kuhn_munkres_min(&costs);
        places_of.iter_mut().zip(columns).for_each(|(of, place)| *of = Some(place));
    } else {
        let costs = Matrix::from_fn(places, drones, |(p, d)| micrometres(length(d, p)));
        let (_, columns) = kuhn_munkres_min(&costs);
        columns.into_iter().enumerate().for_each(|(place, d)| places_of[d] = Some(place));
    }
    places_of
}
