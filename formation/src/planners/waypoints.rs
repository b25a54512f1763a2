//! Planners that look at no estimate: from place to place, or nowhere.

use core::fmt;

use foxhunt_core::{
    Belief, Decision, FormationPlanner, Outcome, PlanError, Stage, Station, Target, Waypoint,
};
use nalgebra::{Vector2, Vector3};

use super::finite_place;
use crate::shape::{Polygon, Shape, arrange_or_centre};

/// A formation, a polygon or any other shape, that visits a list of places in their order, listens
/// at each and has finished after the last, whatever it received: the sweep of an area (Pritzl
/// 2018, §7.3 and §7.4).
///
/// A place is the formation's centre and its altitude. The places may be an array, a slice or a
/// `Vec`. One drone flies to the places themselves.
#[derive(Clone, Debug, PartialEq)]
pub struct Waypoints<C, S = Polygon> {
    centres: C,
    shape: S,
    rotation: f64,
    visited: usize,
}

impl<C: AsRef<[Vector3<f64>]>, S: Shape> Waypoints<C, S> {
    /// A sweep over `centres`, East, North and Up in metres, by a shape that is turned by
    /// `rotation` radians.
    ///
    /// # Errors
    ///
    /// [`PlanError::NotFinite`] for a place, or a rotation or shape, that is not finite;
    /// [`PlanError::NoPlace`] when there is no place.
    pub fn new(centres: C, shape: S, rotation: f64) -> Result<Self, PlanError> {
        let places = centres.as_ref();
        if places.is_empty() {
            return Err(PlanError::NoPlace);
        }
        for place in places {
            finite_place(place.xy())?;
            finite_place(Vector2::new(place.z, rotation))?;
        }
        finite_place(shape.offset(0, 2))?;
        Ok(Self { centres, shape, rotation, visited: 0 })
    }

    fn place(&self, stations: &mut [Station]) {
        let centres = self.centres.as_ref();
        let Some(centre) = centres.get(self.visited.min(centres.len() - 1)) else { return };
        arrange_or_centre(&self.shape, &centre.xy(), self.rotation, centre.z, stations);
    }
}

impl<C: AsRef<[Vector3<f64>]>, S: Shape> FormationPlanner for Waypoints<C, S> {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        if stations.is_empty() {
            return Err(PlanError::TooFew { needed: 1, have: 0 });
        }
        self.visited = 0;
        self.place(stations);
        Ok(())
    }

    fn plan(
        &mut self,
        _belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        self.plan_together(&[], stations)
    }

    /// The next place, whatever is believed, and of however many targets.
    fn plan_together(
        &mut self,
        _targets: &[Target<'_>],
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        self.visited = self.visited.saturating_add(1);
        self.place(stations);
        Ok(if self.visited >= self.centres.as_ref().len() {
            Decision::Finish(Outcome::PathDone)
        } else {
            Decision::Listen(Stage::Searching)
        })
    }

    fn goes_on_without_signal(&self) -> bool {
        true
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        let all = self.centres.as_ref().len();
        write!(to, "{} of {all} places visited", self.visited.min(all))
    }
}

/// Everyone stays and listens for a number of turns: fixed stations, or one place judged well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hold {
    turns: u32,
    done: u32,
}

impl Hold {
    /// A planner that finishes a target after `turns` turns of the antenna; 0 counts as 1.
    #[must_use]
    pub const fn new(turns: u32) -> Self {
        Self { turns, done: 0 }
    }
}

impl FormationPlanner for Hold {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        self.done = 0;
        hold(stations);
        Ok(())
    }

    fn plan(
        &mut self,
        _belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        self.done = self.done.saturating_add(1);
        hold(stations);
        Ok(if self.done >= self.turns {
            Decision::Finish(Outcome::MoveLimit)
        } else {
            Decision::Listen(Stage::Searching)
        })
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        write!(to, "turn {} of {}", self.done, self.turns.max(1))
    }
}

fn hold(stations: &mut [Station]) {
    for station in stations {
        station.goal = Waypoint { position: station.pose.position };
    }
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use foxhunt_core::{Estimate, Pose, laws};
    use nalgebra::Vector2;

    use super::*;

    const PLACES: [Vector3<f64>; 2] = [Vector3::new(1.0, 2.0, 4.0), Vector3::new(-30.0, 4.0, 2.5)];

    const TRIANGLE: Polygon = Polygon { circumradius: 6.0 };

    #[test]
    fn every_place_is_visited_once_for_each_target() {
        let belief = Estimate::isotropic(Vector2::new(500.0, 0.0), 10.0);
        let sweep = || Waypoints::new(PLACES, TRIANGLE, 0.3).expect("finite places");
        let mut stations = [Station::default(); 3];
        laws::formation_planner(sweep, &belief, &mut stations);
        let mut sweep = sweep();
        for _ in 0..2 {
            sweep.begin(&mut stations).expect("there are drones");
            let centre = |stations: &[Station; 3]| {
                stations.iter().map(|s| s.goal.position.xy()).sum::<Vector2<f64>>() / 3.0
            };
            assert!((centre(&stations) - PLACES[0].xy()).norm() < 1e-12);
            assert!(stations.iter().all(|s| abs_diff_eq!(s.goal.position.z, 4.0, epsilon = 1e-12)));
            let radius = (stations[0].goal.position.xy() - PLACES[0].xy()).norm();
            assert_abs_diff_eq!(radius, 6.0, epsilon = 1e-12);
            assert_eq!(sweep.plan(&belief, &mut stations), Ok(Decision::Listen(Stage::Searching)));
            assert!((centre(&stations) - PLACES[1].xy()).norm() < 1e-12);
            assert!(stations.iter().all(|s| abs_diff_eq!(s.goal.position.z, 2.5, epsilon = 1e-12)));
            let done = sweep.plan(&belief, &mut stations);
            assert_eq!(done, Ok(Decision::Finish(Outcome::PathDone)));
            assert!((centre(&stations) - PLACES[1].xy()).norm() < 1e-12);
        }
        let mut alone = [Station::default()];
        sweep.begin(&mut alone).expect("there is a drone");
        assert!((alone[0].goal.position.xy() - PLACES[0].xy()).norm() < 1e-12);
    }

    #[test]
    fn places_that_are_none_are_refused() {
        let none: [Vector3<f64>; 0] = [];
        assert_eq!(Waypoints::new(none, TRIANGLE, 0.0), Err(PlanError::NoPlace));
        for nowhere in [Vector3::new(0.0, f64::NAN, 4.0), Vector3::new(0.0, 0.0, f64::NAN)] {
            assert!(Waypoints::new([nowhere], TRIANGLE, 0.0).is_err());
        }
        assert!(Waypoints::new(PLACES, TRIANGLE, f64::INFINITY).is_err());
        let mut sweep = Waypoints::new(PLACES, TRIANGLE, 0.0).expect("finite places");
        assert!(sweep.begin(&mut []).is_err());
    }

    #[test]
    fn it_listens_as_often_as_configured() {
        let belief = Estimate::isotropic(Vector2::new(50.0, 50.0), 10.0);
        let mut stations = [Station { pose: Pose::at(1.0, 2.0, 3.0), ..Station::default() }];
        laws::formation_planner(|| Hold::new(2), &belief, &mut stations);
        let mut hold = Hold::new(2);
        for _ in 0..2 {
            hold.begin(&mut stations).expect("holding needs nothing");
            assert_eq!(hold.plan(&belief, &mut stations), Ok(Decision::Listen(Stage::Searching)));
            assert_eq!(hold.plan(&belief, &mut stations), Ok(Decision::Finish(Outcome::MoveLimit)));
            assert_eq!(stations[0].goal.position, stations[0].pose.position);
        }
    }
}
