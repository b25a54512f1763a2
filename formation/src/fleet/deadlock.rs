use std::vec::Vec;

use geo::{Distance, Euclidean, Point};
use nalgebra::{Vector2, Vector3};

use super::{
    OrderReason, Traffic,
    ground::{SLACK, line, point, ring_about},
};

/// Largest distance that a drone flies aside to let others pass, in distances that lines keep.
pub(super) const ASIDE: u32 = 6;

/// Attempts to end a wait in which no drone flies.
impl Traffic {
    /// Has two drones of the formation exchange their goals, if one of them can then set off.
    /// Every pair exchanges once per formation, so this ends.
    pub(super) fn exchange(&mut self) -> bool {
        let waiting: Vec<usize> = self.waiting().collect();
        let in_formation =
            |t: &Self, d: usize| t.flights[d].task.filter(|task| task.formation).map(|w| w.goal);
        for drone in waiting {
            for with in 0..self.flights.len() {
                let pair = [drone.min(with), drone.max(with)];
                let goals = (in_formation(self, drone), in_formation(self, with));
                let (Some(own), Some(other)) = goals else { continue };
                if drone == with || self.exchanged.contains(&pair) {
                    continue;
                }
                if self.reaches(with, &own) || self.reaches(drone, &other) {
                    self.exchanged.push(pair);
                    self.give(drone, other);
                    self.give(with, own);
                    self.set_off_exchanged(drone, with);
                    self.set_off_exchanged(with, drone);
                    return true;
                }
            }
        }
        false
    }

    fn give(&mut self, drone: usize, goal: Vector3<f64>) {
        if let Some(task) = &mut self.flights[drone].task {
            task.goal = goal;
        }
    }

    fn set_off_exchanged(&mut self, drone: usize, with: usize) {
        let Some(goal) = self.goal(drone).filter(|_| self.flights[drone].waits()) else { return };
        let from = self.flights[drone].end().xy();
        if let Some(way) = self.surroundings(drone, &[]).way(&from, &goal.xy()) {
            self.reserve(drone, goal.z, &way, OrderReason::Exchanged { with });
        }
    }

    fn reaches(&self, drone: usize, goal: &Vector3<f64>) -> bool {
        let from = self.flights[drone].end();
        (goal - from).norm() > SLACK
            && self.airspace.permits(goal)
            && self.surroundings(drone, &[]).way(&from.xy(), &goal.xy()).is_some()
    }

    /// Has one drone that is in another's way fly aside, to a place that is in nobody's way. Every
    /// drone does so once per task, so this ends.
    pub(super) fn step_aside(&mut self) -> bool {
        let in_the_way = |drone: usize| {
            let here = self.flights[drone].end().xy();
            self.waiting().filter(|&other| other != drone).any(|other| {
                let goal = self.goal(other).map_or(here, |goal| goal.xy());
                let from = self.flights[other].end().xy();
                self.airspace.holds(&goal)
                    && line_distance(&from, &goal, &here) < self.config.keep_m()
            })
        };
        let able = |&drone: &usize| self.flights[drone].task.is_some_and(|task| !task.aside);
        let drones = (0..self.flights.len()).filter(able).filter(|&drone| in_the_way(drone));
        // Those that wait themselves first.
        let mut drones: Vec<usize> = drones.collect();
        drones.sort_by_key(|&drone| !self.flights[drone].waits());
        for drone in drones {
            if let Some(place) = self.place_aside(drone) {
                if let Some(task) = &mut self.flights[drone].task {
                    task.aside = true;
                }
                let up = self.airspace.altitude(self.flights[drone].end().z);
                self.reserve(drone, up, &[place], OrderReason::Aside);
                return true;
            }
        }
        false
    }

    /// The nearest place, straight ahead, that keeps away from all drones, all goals, and best
    /// also from the lines of those that wait.
    fn place_aside(&self, drone: usize) -> Option<Vector2<f64>> {
        let from = self.flights[drone].end().xy();
        let keep = self.config.keep_m();
        let surroundings = self.surroundings(drone, &[]);
        let others = (0..self.flights.len()).filter(|&other| other != drone);
        let legs: Vec<_> = others
            .filter_map(|other| Some((self.flights[other].end().xy(), self.goal(other)?.xy())))
            .collect();
        let free_of = |lines: bool, place: &Vector2<f64>| {
            legs.iter().all(|(start, goal)| {
                let start = if lines { start } else { goal };
                line_distance(start, goal, place) >= keep
            })
        };
        let rings = || {
            (1..=2 * ASIDE).flat_map(|k| ring_about(&from, f64::from(k) * 0.5 * keep + SLACK, 16))
        };
        [true, false].into_iter().find_map(|lines| {
            rings().find(|place| free_of(lines, place) && surroundings.first_leg(&from, place))
        })
    }
}

fn line_distance(from: &Vector2<f64>, to: &Vector2<f64>, place: &Vector2<f64>) -> f64 {
    Euclidean.distance(&Point::from(point(place)), &line(from, to))
}
