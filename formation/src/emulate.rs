use alloc::{vec, vec::Vec};
use core::fmt;

use foxhunt_core::{
    Belief, Decision, FormationPlanner, PlanError, Reception, Stage, Station, Target, Waypoint,
};

use crate::{ParameterError, parameter::check, places::centroid};

/// The most virtual drones.
const MOST: usize = 64;

/// One drone, or fewer than a planner wants, flies the places of its virtual drones one after the
/// other; the planner is asked again when all were visited (Pritzl 2018, §7.2).
///
/// Each drone takes the nearest of the places that are left; one for which none is left stays
/// where it is. Where there are drones enough, the planner is asked as if there were nothing in
/// between.
#[derive(Clone, Debug, PartialEq)]
pub struct Emulate<P> {
    planner: P,
    /// The virtual drones; empty where there are real ones enough.
    stations: Vec<Station>,
    /// Which of them were listened from, or are being listened from.
    visited: Vec<bool>,
    wanted: usize,
    stage: Stage,
}

impl<P: FormationPlanner> Emulate<P> {
    /// Has `planner` plan for `drones` drones at least.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] when that is none, or more than 64.
    pub fn new(planner: P, drones: usize) -> Result<Self, ParameterError> {
        let given = crate::shape::number(drones);
        check("virtual_drones", given, "from 1 to 64", (1..=MOST).contains(&drones))?;
        Ok(Self {
            planner,
            stations: Vec::new(),
            visited: Vec::new(),
            wanted: drones,
            stage: Stage::default(),
        })
    }

    /// The planner for the virtual drones.
    #[must_use]
    pub fn planner(&self) -> &P {
        &self.planner
    }

    /// Lets the planner set goals for the virtual drones, and sends the real ones to the first.
    fn ask<T>(
        &mut self,
        stations: &mut [Station],
        ask: impl FnOnce(&mut P, &mut [Station]) -> Result<T, PlanError>,
    ) -> Result<T, PlanError> {
        centroid(stations)?;
        if stations.len() >= self.wanted {
            let answer = ask(&mut self.planner, stations)?;
            self.stations.clear();
            self.visited.clear();
            return Ok(answer);
        }
        // A virtual drone is where it was listened from, or else where a real one is.
        let mut planned = self.stations.clone();
        for index in planned.len()..self.wanted {
            planned.push(Station::holding(stations[index % stations.len()].pose));
        }
        let answer = ask(&mut self.planner, &mut planned)?;
        self.stations = planned;
        self.visited = vec![false; self.wanted];
        self.go(stations);
        Ok(answer)
    }

    /// Sends each real drone to the nearest place that is left.
    fn go(&mut self, stations: &mut [Station]) {
        for station in stations {
            let here = station.pose.position;
            let distance = |index: usize| (self.stations[index].goal.position - here).norm();
            let left = (0..self.stations.len()).filter(|&index| !self.visited[index]);
            let nearest = left.min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
            station.goal = match nearest {
                Some(index) => {
                    self.visited[index] = true;
                    // Where it flies to is where the virtual drone has listened by then.
                    self.stations[index].pose.position = self.stations[index].goal.position;
                    self.stations[index].goal
                }
                None => Waypoint { position: here },
            };
        }
    }

    /// Goes on to the places that are left, if there are any.
    fn next(&mut self, stations: &mut [Station]) -> Option<Result<Decision, PlanError>> {
        let left = self.visited.contains(&false);
        if !left || stations.len() >= self.wanted {
            return None;
        }
        Some(centroid(stations).map(|_| {
            self.go(stations);
            Decision::Listen(self.stage)
        }))
    }

    fn decided(&mut self, decision: Decision) -> Decision {
        if let Decision::Listen(stage) = decision {
            self.stage = stage;
        }
        decision
    }

    fn reset(&mut self) {
        self.stations.clear();
        self.visited.clear();
        self.stage = Stage::default();
    }
}

impl<P: FormationPlanner> FormationPlanner for Emulate<P> {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        centroid(stations)?;
        self.reset();
        self.ask(stations, |planner, virtual_ones| planner.begin(virtual_ones))
    }

    fn resume(&mut self, belief: &dyn Belief, stations: &mut [Station]) -> Result<(), PlanError> {
        centroid(stations)?;
        self.reset();
        self.ask(stations, |planner, virtual_ones| planner.resume(belief, virtual_ones))
    }

    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        if let Some(next) = self.next(stations) {
            return next;
        }
        let decision = self.ask(stations, |planner, all| planner.plan(belief, all))?;
        Ok(self.decided(decision))
    }

    fn plan_together(
        &mut self,
        targets: &[Target<'_>],
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        if targets.is_empty() {
            return Err(PlanError::NoPlace);
        }
        if let Some(next) = self.next(stations) {
            return next;
        }
        let decision = self.ask(stations, |planner, all| planner.plan_together(targets, all))?;
        Ok(self.decided(decision))
    }

    fn hear(&mut self, reception: &Reception) {
        self.planner.hear(reception);
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        if !self.visited.is_empty() {
            let visited = self.visited.iter().filter(|&&visited| visited).count();
            write!(to, "place {visited} of {}: ", self.visited.len())?;
        }
        self.planner.explain(to)
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::String;

    use foxhunt_core::{Estimate, Outcome, laws};
    use nalgebra::Vector2;

    use super::*;
    use crate::{
        FollowConfig, FollowEstimate,
        fake::{Shrinking, arrive, stations},
    };

    fn follow() -> FollowEstimate {
        FollowEstimate::new(FollowConfig::pritzl2018()).expect("the preset is in range")
    }

    fn emulated() -> Emulate<FollowEstimate> {
        Emulate::new(follow(), 3).expect("three drones")
    }

    #[test]
    fn one_drone_flies_the_triangle_of_three() {
        let belief = |sigma| Estimate::isotropic(Vector2::new(20.0, 10.0), sigma);
        let (mut planner, mut alone) = (emulated(), stations::<1>());
        planner.begin(&mut alone).expect("a drone");
        let mut three = [alone[0]; 3];
        let mut reference = follow();
        reference.begin(&mut three).expect("three drones");
        for triangle in 0..4 {
            let mut flown = Vec::new();
            for place in 0..3 {
                arrive(&mut alone);
                flown.push(alone[0].pose.position);
                let decision = planner.plan(&belief(9.0), &mut alone).expect("a place");
                if place < 2 {
                    assert!(matches!(decision, Decision::Listen(_)), "{decision:?}");
                }
            }
            for station in &three {
                let near =
                    |place: &nalgebra::Vector3<f64>| (place - station.goal.position).norm() < 1e-9;
                assert!(flown.iter().any(near), "triangle {triangle} was not flown: {flown:?}");
            }
            arrive(&mut three);
            reference.plan(&belief(9.0), &mut three).expect("a place");
        }
        let mut told = String::new();
        planner.explain(&mut told).expect("a string takes all");
        assert!(told.starts_with("place 1 of 3: "), "{told}");
    }

    #[test]
    fn two_share_the_places_and_three_need_nothing_of_it() {
        let (mut planner, mut pair) = (emulated(), stations::<2>());
        planner.begin(&mut pair).expect("drones");
        let apart = |pair: &[Station; 2]| (pair[0].goal.position - pair[1].goal.position).norm();
        assert!(apart(&pair) > 10.0);
        arrive(&mut pair);
        let belief = Estimate::isotropic(Vector2::new(2.0, 1.0), 9.0);
        planner.plan(&belief, &mut pair).expect("a place");
        // One goes to the third place; the other one stays.
        assert!(pair.iter().any(|s| (s.goal.position - s.pose.position).norm() < 1e-12));
        assert!(apart(&pair) > 10.0);

        let (mut all, mut expected) = (stations::<3>(), stations::<3>());
        let (mut planner, mut reference) = (emulated(), follow());
        planner.begin(&mut all).expect("drones");
        reference.begin(&mut expected).expect("drones");
        for _ in 0..5 {
            arrive(&mut all);
            arrive(&mut expected);
            let decisions = [
                planner.plan(&belief, &mut all).expect("a place"),
                reference.plan(&belief, &mut expected).expect("a place"),
            ];
            assert_eq!(decisions[0], decisions[1]);
            assert_eq!(all, expected);
        }
        // One drops out: the places of three are flown by two.
        let mut left = [all[0], all[2]];
        arrive(&mut left);
        planner.plan(&belief, &mut left).expect("a place");
        assert!(apart(&left) > 10.0);
    }

    #[test]
    fn it_ends_and_keeps_the_laws() {
        let mut target = Shrinking::towards(25.0, -10.0);
        let end = target.search(&mut emulated(), &mut stations::<1>(), |_, _| {});
        assert_eq!(end.outcome, Outcome::Converged);
        assert!(end.positions.is_multiple_of(3), "{end:?}");
        let belief = Estimate::isotropic(Vector2::new(2.0, 1.0), 9.0);
        laws::formation_planner(emulated, &belief, &mut stations::<1>());
        assert!(Emulate::new(follow(), 0).is_err());
        assert!(Emulate::new(follow(), 65).is_err());
    }
}
