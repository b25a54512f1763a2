use std::{vec, vec::Vec};

use nalgebra::{Vector2, Vector3};
use pathfinding::directed::astar::astar;

use super::{Airspace, Cloud, EXACT, Region, SLACK, Void, line, micrometres, ring_about};

/// Surroundings that a drone has to keep away from on its way.
pub(super) struct Surroundings<'a> {
    /// With the margin that is kept.
    pub airspace: &'a Airspace,
    /// The regions of the other drones …
    pub others: Vec<Region>,
    /// … and how far it keeps from them.
    pub keep: f64,
    /// Constraint on the distance from targets.
    pub void: Option<(Void, &'a [Cloud])>,
}

impl Surroundings<'_> {
    /// Returns true if a drone may rest at a place.
    pub(super) fn permit(&self, place: &Vector2<f64>) -> bool {
        self.airspace.holds(place)
            && self.others.iter().all(|other| other.distance_to(place) >= self.keep - EXACT)
            && self.void.is_none_or(|(void, clouds)| void.permits(clouds, place, place))
    }

    /// Returns true if a drone may fly straight from one place to another.
    fn leg(&self, from: &Vector2<f64>, to: &Vector2<f64>) -> bool {
        let way = line(from, to);
        self.others.iter().all(|other| other.distance(&way) >= self.keep - EXACT)
            && self.airspace.clear_by(from, to, self.airspace.margin())
            && self.void.is_none_or(|(void, clouds)| void.permits(clouds, from, to))
    }

    /// Returns true if a drone may fly its first leg straight. Where the drone is nearer to
    /// something than it should be it may fly away from it, to a place where it may rest, but no
    /// nearer.
    pub(super) fn first_leg(&self, from: &Vector2<f64>, to: &Vector2<f64>) -> bool {
        let way = line(from, to);
        let clear = self
            .others
            .iter()
            .all(|other| other.distance(&way) >= self.keep.min(other.distance_to(from)) - EXACT);
        let inside = || {
            let clearance = self.airspace.clearance(from);
            if clearance > EXACT {
                self.airspace.clear_by(from, to, clearance.min(self.airspace.margin()))
            } else if clearance >= -EXACT {
                // On an edge every leg touches it: the rest of the leg shows which side it takes.
                let off = from + (to - from).cap_magnitude(SLACK);
                let clearance = self.airspace.clearance(&off);
                clearance > EXACT
                    && self.airspace.clear_by(&off, to, clearance.min(self.airspace.margin()))
            } else {
                // Outside: the shortest way in.
                self.airspace
                    .nearest_over_ground(from)
                    .is_some_and(|nearest| (nearest - to).norm() <= EXACT)
            }
        };
        let away = || {
            self.void.is_none_or(|(void, clouds)| {
                void.permits(clouds, from, to) || void.leaves(clouds, from, to)
            })
        };
        clear && inside() && self.permit(to) && away()
    }

    /// The shortest way over ground, as the places after `from`: straight, or by way of places
    /// about whatever is in between (a visibility graph, searched by A*).
    pub(super) fn way(&self, from: &Vector2<f64>, to: &Vector2<f64>) -> Option<Vec<Vector2<f64>>> {
        if self.first_leg(from, to) {
            return Some(vec![*to]);
        }
        if !self.permit(to) {
            return None;
        }
        let mut places = vec![*from, *to];
        places.extend(self.bends(from));
        let length = |a: usize, b: usize| micrometres((places[a] - places[b]).norm());
        let next = |&here: &usize| {
            let there = (1..places.len()).filter(move |&there| there != here);
            let places = &places;
            let length = &length;
            there.filter_map(move |there| {
                let a = &places[here];
                let b = &places[there];
                let clear = if here == 0 { self.first_leg(a, b) } else { self.leg(a, b) };
                clear.then(|| (there, length(here, there)))
            })
        };
        let (way, _) = astar(&0, next, |&here| length(here, 1), |&here| here == 1)?;
        Some(way.into_iter().skip(1).map(|index| places[index]).collect())
    }

    fn bends(&self, from: &Vector2<f64>) -> Vec<Vector2<f64>> {
        let ends = self.others.iter().flat_map(Region::ends);
        let about = ends.flat_map(|end| ring_about(&end, self.keep + SLACK, 12));
        let mut bends: Vec<_> = self.airspace.corners().iter().copied().chain(about).collect();
        if let Some((void, clouds)) = self.void {
            bends.extend(void.bends(clouds));
        }
        if !self.airspace.holds(from) {
            bends.extend(self.airspace.nearest_over_ground(from));
        }
        bends.retain(|bend| self.permit(bend));
        bends
    }
}

/// Returns the length over ground of a way from one place to the next.
pub(super) fn length_over_ground(from: &Vector2<f64>, way: &[Vector2<f64>]) -> f64 {
    let before = core::iter::once(from).chain(way);
    before.zip(way).map(|(a, b)| (b - a).norm()).sum()
}

/// Gives a way over ground its altitudes: straight up or down to the band where the drone begins
/// outside of it, evenly to the goal's altitude along the way, and straight up or down to a goal
/// outside of the band.
pub(super) fn with_altitudes(
    airspace: &Airspace,
    from: &Vector3<f64>,
    goal_up: f64,
    way: &[Vector2<f64>],
) -> Vec<Vector3<f64>> {
    let at = |ground: &Vector2<f64>, up: f64| Vector3::new(ground.x, ground.y, up);
    let first = airspace.altitude(from.z);
    let last = airspace.altitude(goal_up);
    let mut places = vec![];
    if (first - from.z).abs() > EXACT {
        places.push(at(&from.xy(), first));
    }
    let total = length_over_ground(&from.xy(), way);
    let mut here = from.xy();
    let mut flown = 0.0;
    for (index, place) in way.iter().enumerate() {
        flown += (place - here).norm();
        here = *place;
        let share = if index + 1 == way.len() { 1.0 } else { flown / total };
        places.push(at(place, first + (last - first) * share));
    }
    if (last - goal_up).abs() > EXACT {
        places.push(at(&here, goal_up));
    }
    places
}
