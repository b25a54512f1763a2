use alloc::{vec, vec::Vec};
use core::fmt;

use foxhunt_core::{
    Belief, Decision, FormationPlanner, PlanError, Reception, Stage, Station, Target, Waypoint,
    parameter::{ParameterError, as_value, require},
};

use super::centroid;

/// The most virtual drones.
const MOST: usize = 64;

/// One drone, or fewer than a planner needs, flies the places of its virtual drones one after the
/// other; the planner plans again when all were visited (Pritzl 2018, §7.2).
///
/// Each drone takes the nearest of the places that are left; one for which none is left stays
/// where it is. The planner gets the places that were really listened from; one whose drone dropped
/// out on the way is flown to again. Where there are drones enough, the planner plans for them
/// directly.
#[derive(Clone, Debug, PartialEq)]
pub struct Emulate<P> {
    planner: P,
    /// The virtual drones; empty where there are real ones enough.
    stations: Vec<Station>,
    /// True for each that was listened from, or is being listened from.
    visited: Vec<bool>,
    /// Indices of the ones that real drones have been sent to last.
    under_way: Vec<usize>,
    wanted: usize,
    stage: Stage,
}

impl<P: FormationPlanner> Emulate<P> {
    /// Has `planner` plan for `drones` drones at least.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] when that is zero, or more than 64.
    pub fn new(planner: P, drones: usize) -> Result<Self, ParameterError> {
        let in_range = (1..=MOST).contains(&drones);
        require(in_range, "virtual_drones", as_value(drones), "from 1 to 64")?;
        Ok(Self {
            planner,
            stations: Vec::new(),
            visited: Vec::new(),
            under_way: Vec::new(),
            wanted: drones,
            stage: Stage::default(),
        })
    }

    /// The planner for the virtual drones.
    #[must_use]
    pub fn planner(&self) -> &P {
        &self.planner
    }

    /// Lets the planner set goals for the virtual drones, who are at `places`, and sends the real
    /// ones to the first.
    fn plan_all<T>(
        &mut self,
        mut places: Vec<Station>,
        stations: &mut [Station],
        plan: impl FnOnce(&mut P, &mut [Station]) -> Result<T, PlanError>,
    ) -> Result<T, PlanError> {
        if stations.len() >= self.wanted {
            let decision = plan(&mut self.planner, stations)?;
            self.clear();
            return Ok(decision);
        }
        // A virtual drone is where it was listened from, or else where a real one is.
        for index in places.len()..self.wanted {
            places.push(Station::holding(stations[index % stations.len()].pose));
        }
        let decision = plan(&mut self.planner, &mut places)?;
        self.stations = places;
        self.visited = vec![false; self.wanted];
        self.go(stations);
        Ok(decision)
    }

    /// The virtual drones after the real ones have listened, and which of them have been visited.
    /// The drones may have exchanged their goals: each place goes to the nearest of them.
    fn listened(&self, stations: &[Station]) -> (Vec<Station>, Vec<bool>) {
        let mut places = self.stations.clone();
        let mut visited = self.visited.clone();
        let mut under_way = self.under_way.clone();
        let mut there: Vec<usize> = (0..stations.len()).collect();
        let distance = |&(place, drone): &(usize, usize)| {
            let goal = self.stations[under_way[place]].goal.position;
            (goal - stations[drone].pose.position).norm()
        };
        let mut pairs: Vec<(f64, usize, usize)> = (0..under_way.len())
            .flat_map(|place| (0..stations.len()).map(move |drone| (place, drone)))
            .map(|pair| (distance(&pair), under_way[pair.0], pair.1))
            .collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, place, drone) in pairs {
            if under_way.contains(&place) && there.contains(&drone) {
                places[place].pose = stations[drone].pose;
                under_way.retain(|&left| left != place);
                there.retain(|&left| left != drone);
            }
        }
        for place in under_way {
            visited[place] = false;
        }
        (places, visited)
    }

    /// Sends each real drone to the nearest place that is left.
    fn go(&mut self, stations: &mut [Station]) {
        self.under_way.clear();
        for station in stations {
            let here = station.pose.position;
            let distance = |index: usize| (self.stations[index].goal.position - here).norm();
            let left = (0..self.stations.len()).filter(|&index| !self.visited[index]);
            let nearest = left.min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
            station.goal = match nearest {
                Some(index) => {
                    self.visited[index] = true;
                    self.under_way.push(index);
                    self.stations[index].goal
                }
                None => Waypoint { position: here },
            };
        }
    }

    /// Goes on to the remaining places; without any, plans the next ones.
    fn next(
        &mut self,
        stations: &mut [Station],
        plan: impl FnOnce(&mut P, &mut [Station]) -> Result<Decision, PlanError>,
    ) -> Result<Decision, PlanError> {
        centroid(stations)?;
        let (places, visited) = self.listened(stations);
        if visited.contains(&false) && stations.len() < self.wanted {
            (self.stations, self.visited) = (places, visited);
            self.go(stations);
            return Ok(Decision::Listen(self.stage));
        }
        let decision = self.plan_all(places, stations, plan)?;
        Ok(self.decided(decision))
    }

    /// Starts again.
    fn start(
        &mut self,
        stations: &mut [Station],
        plan: impl FnOnce(&mut P, &mut [Station]) -> Result<(), PlanError>,
    ) -> Result<(), PlanError> {
        centroid(stations)?;
        self.plan_all(Vec::new(), stations, plan)?;
        self.stage = Stage::default();
        Ok(())
    }

    fn decided(&mut self, decision: Decision) -> Decision {
        if let Decision::Listen(stage) = decision {
            self.stage = stage;
        }
        decision
    }

    fn clear(&mut self) {
        self.stations.clear();
        self.visited.clear();
        self.under_way.clear();
    }
}

impl<P: FormationPlanner> FormationPlanner for Emulate<P> {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        self.start(stations, |planner, all| planner.begin(all))
    }

    fn resume(&mut self, belief: &dyn Belief, stations: &mut [Station]) -> Result<(), PlanError> {
        self.start(stations, |planner, all| planner.resume(belief, all))
    }

    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        self.next(stations, |planner, all| planner.plan(belief, all))
    }

    fn plan_together(
        &mut self,
        targets: &[Target<'_>],
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        if targets.is_empty() && !self.goes_on_without_signal() {
            return Err(PlanError::NoPlace);
        }
        self.next(stations, |planner, all| planner.plan_together(targets, all))
    }

    fn observe(&mut self, reception: &Reception) {
        self.planner.observe(reception);
    }

    fn goes_on_without_signal(&self) -> bool {
        self.planner.goes_on_without_signal()
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

    use foxhunt_core::{Estimate, Outcome, Pose, laws};
    use nalgebra::{Vector2, Vector3};

    use super::*;
    use crate::planners::{
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
        let mut planner = emulated();
        let mut alone = stations::<1>();
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
        let mut why = String::new();
        planner.explain(&mut why).expect("a string takes all");
        assert!(why.starts_with("place 1 of 3: "), "{why}");
    }

    #[test]
    fn two_share_the_places_and_three_need_nothing_of_it() {
        let mut planner = emulated();
        let mut pair = stations::<2>();
        planner.begin(&mut pair).expect("drones");
        let apart = |pair: &[Station; 2]| (pair[0].goal.position - pair[1].goal.position).norm();
        assert!(apart(&pair) > 10.0);
        arrive(&mut pair);
        let belief = Estimate::isotropic(Vector2::new(2.0, 1.0), 9.0);
        planner.plan(&belief, &mut pair).expect("a place");
        // One goes to the third place; the other one stays.
        assert!(pair.iter().any(|s| (s.goal.position - s.pose.position).norm() < 1e-12));
        assert!(apart(&pair) > 10.0);

        let mut all = stations::<3>();
        let mut expected = stations::<3>();
        let mut planner = emulated();
        let mut reference = follow();
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

    /// Records where the virtual drones are.
    #[derive(Clone, Debug, Default, PartialEq)]
    struct Recorder(Vec<Vector3<f64>>);

    impl FormationPlanner for Recorder {
        fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
            for (index, station) in stations.iter_mut().enumerate() {
                let east = 10.0 * crate::shape::number(index);
                station.goal.position = Vector3::new(east, 0.0, 2.0);
            }
            Ok(())
        }

        fn plan(
            &mut self,
            belief: &dyn Belief,
            stations: &mut [Station],
        ) -> Result<Decision, PlanError> {
            if !belief.position().mean.x.is_finite() {
                return Err(PlanError::NoPlace);
            }
            self.0 = stations.iter().map(|station| station.pose.position).collect();
            self.begin(stations)?;
            Ok(Decision::Listen(Stage::Searching))
        }

        fn resume(&mut self, belief: &dyn Belief, all: &mut [Station]) -> Result<(), PlanError> {
            self.plan(belief, all).map(|_| ())
        }
    }

    #[test]
    fn the_planner_gets_the_places_that_were_really_listened_from() {
        let belief = Estimate::isotropic(Vector2::zeros(), 9.0);
        let mut planner = Emulate::new(Recorder::default(), 3).expect("three drones");
        let mut pair = [10.0, 1.0].map(|e| Station::holding(Pose::at(e, 0.0, 2.0)));
        planner.begin(&mut pair).expect("drones");
        let goals: Vec<f64> = pair.iter().map(|station| station.goal.position.x).collect();
        assert_eq!(goals, [10.0, 0.0]);
        // They exchange their goals, and both stop short of them.
        pair[0].pose.position = Vector3::new(0.5, 1.0, 2.0);
        pair[1].pose.position = Vector3::new(9.0, 1.0, 2.0);
        planner.plan(&belief, &mut pair).expect("a place is left");
        assert!(planner.planner().0.is_empty(), "planned too early");
        // Nobody gets to the third one.
        planner.plan(&belief, &mut pair).expect("a place");
        let places: Vec<f64> = planner.planner().0.iter().map(|place| place.x).collect();
        assert_eq!(places, [0.5, 9.0, 9.0]);
        // One drops out on the way: its place is flown to again.
        let mut alone = [Station { pose: Pose::at(9.0, 0.0, 2.0), ..pair[1] }];
        planner.plan(&belief, &mut alone).expect("a place");
        planner.plan(&belief, &mut alone).expect("a place");
        let before = planner.clone();
        let nowhere = Estimate::isotropic(Vector2::repeat(f64::NAN), 1.0);
        assert!(planner.resume(&nowhere, &mut alone).is_err());
        assert_eq!(planner, before);
        arrive(&mut alone);
        let at = alone;
        let again = planner.clone();
        assert!(planner.plan(&nowhere, &mut alone).is_err());
        assert_eq!((planner.clone(), alone), (again, at));
        planner.plan(&belief, &mut alone).expect("a place");
        assert_eq!(planner.planner().0[2], alone[0].pose.position);
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
