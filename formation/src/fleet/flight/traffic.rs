//! The traffic of a fleet: who flies where, and what ends a wait in which no drone flies.

use std::{vec, vec::Vec};

use foxhunt_core::Belief;
use geo::{Distance, Euclidean, Point};
use nalgebra::{Vector2, Vector3};

use super::{Flight, Located, Order, OrderReason, Task, Travel};
use crate::fleet::{
    Airspace, Cloud, EXACT, Formation, SLACK, TrafficConfig, TrafficError, formation, line, point,
    ring_about,
    way::{Surroundings, length_over_ground, with_altitudes},
};

/// A way around others is taken at once if it is at most this many times as long as one without
/// them; otherwise the drone waits for them as long as any flies.
const DETOUR: f64 = 1.2;

/// Largest distance that a drone flies aside to let others pass, in distances that lines keep.
pub(in crate::fleet) const ASIDE: u32 = 6;

/// The traffic of a fleet: who flies where, and which lines are reserved.
///
/// Safe by construction, whatever the timing: a drone's *region* is the remainder of its reserved
/// line, a point where it rests. It sets off only if its whole new line keeps the separation and
/// twice the tolerance from the regions of all others. So no two drones come nearer than the
/// separation, however slow they are, wherever they get stuck, and whether or not their places are
/// known; all that a drone has to do is to stay within the tolerance of its line.
#[derive(Clone, Debug)]
pub struct Traffic {
    /// With the tolerance as its margin.
    pub(in crate::fleet) airspace: Airspace,
    config: TrafficConfig,
    flights: Vec<Flight>,
    pub(in crate::fleet) clouds: Vec<Cloud>,
    /// Pairs that have exchanged their goals since the formation set off.
    exchanged: Vec<[usize; 2]>,
    /// Something happened that may open a way.
    changed: bool,
    /// Metres of line released since ways were looked for.
    released: f64,
}

impl Traffic {
    /// The traffic of drones that rest at `positions`.
    ///
    /// # Errors
    ///
    /// [`TrafficError`] names a field of the configuration, or the drones that begin too near to
    /// each other or outside the airspace; below the band is allowed.
    pub fn new(
        airspace: &Airspace,
        config: TrafficConfig,
        positions: &[Vector3<f64>],
    ) -> Result<Self, TrafficError> {
        Self::with_rooted(airspace, config, positions, |_| false)
    }

    /// The traffic of drones that rest at `positions`, some of which are `rooted`: they never go
    /// anywhere, and may stand above the band.
    ///
    /// # Errors
    ///
    /// The errors of [`new`](Self::new).
    pub fn with_rooted(
        airspace: &Airspace,
        config: TrafficConfig,
        positions: &[Vector3<f64>],
        rooted: impl Fn(usize) -> bool,
    ) -> Result<Self, TrafficError> {
        config.check()?;
        for (drone, place) in positions.iter().enumerate() {
            check_finite(drone, place)?;
            let [east, north, up] = [place.x, place.y, place.z];
            let too_high = airspace.altitude(up) < up && !rooted(drone);
            if !airspace.holds(&place.xy()) || too_high {
                return Err(TrafficError::Outside { drone, east, north, up });
            }
            for (second, other) in positions.iter().enumerate().skip(drone + 1) {
                let distance_m = (place - other).xy().norm();
                if distance_m < config.separation_m - EXACT {
                    let separation_m = config.separation_m;
                    return Err(TrafficError::TooNear {
                        first: drone,
                        second,
                        distance_m,
                        separation_m,
                    });
                }
            }
        }
        Ok(Self {
            airspace: airspace.with_margin(config.tolerance_m)?,
            config,
            flights: positions.iter().copied().map(Flight::resting).collect(),
            clouds: vec![],
            exchanged: vec![],
            changed: false,
            released: 0.0,
        })
    }

    /// Returns the number of drones.
    #[must_use]
    pub fn drones(&self) -> usize {
        self.flights.len()
    }

    /// The airspace, with the tolerance as its margin.
    #[must_use]
    pub fn airspace(&self) -> &Airspace {
        &self.airspace
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &TrafficConfig {
        &self.config
    }

    /// Sets the targets' beliefs for the void constraint. It holds for ways that are looked for
    /// from now on; without beliefs there is no constraint.
    pub fn believe<'a>(&mut self, targets: impl IntoIterator<Item = &'a dyn Belief>) {
        let constrained = targets.into_iter().filter(|_| self.config.void.is_some());
        self.clouds = constrained.map(Cloud::of).collect();
    }

    /// Takes note of where a drone is. What it has flown of its line is released; where it is
    /// elsewhere, it is taken from there. A place that is not finite is not taken.
    pub fn locate(&mut self, drone: usize, position: &Vector3<f64>) {
        if drone >= self.flights.len() || !position.iter().all(|x| x.is_finite()) {
            return;
        }
        self.changed |= self.flights[drone].turns();
        match self.flights[drone].locate(position, self.config.tolerance_m) {
            Located::OnLine(released) => self.released += released,
            Located::AtCorner => self.changed = true,
            Located::Astray => self.catch(drone, *position),
        }
    }

    /// A drone that is off its line flies on to its next corner, or back to where it rests, if that
    /// is permitted from where it is, and stops otherwise.
    fn catch(&mut self, drone: usize, position: Vector3<f64>) {
        self.changed = true;
        if self.flights[drone].is_given_up() {
            self.flights[drone].begin_at(position);
            return;
        }
        let flight = &self.flights[drone];
        let next = flight.way().get(1).copied().unwrap_or(flight.place());
        let permitted = self.surroundings(drone, &[]).first_leg(&position.xy(), &next.xy());
        let flight = &mut self.flights[drone];
        match (permitted, flight.flies()) {
            (true, true) => flight.begin_at(position),
            (true, false) => flight.return_from(position),
            (false, _) => flight.rest_at(position),
        }
    }

    /// Finds a goal for each of `drones`, one of `places` for each, in any order.
    ///
    /// Every place is moved to the nearest one that is permitted and far enough from the others,
    /// from drones that do not take part, and from targets; earlier places go first. Then the
    /// drones are assigned so that they travel as little as possible together, over permitted ways.
    /// Nothing is reserved; [`depart`](Self::depart) does.
    ///
    /// # Errors
    ///
    /// [`TrafficError`] where a drone does not exist or is named twice, there are not as many
    /// places as drones, or one is not finite.
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
        let surroundings = Surroundings {
            airspace: &self.airspace,
            others: others.map(|drone| self.flights[drone].region()).collect(),
            keep: self.config.keep_m(),
            void: self.config.void.map(|void| (void, self.clouds.as_slice())),
        };
        let starts: Vec<_> = drones.iter().map(|&drone| self.flights[drone].end()).collect();
        Ok(formation::form(surroundings, drones, &starts, places))
    }

    /// Returns the places to land for drones that begin at `starts`: the nearest places to these,
    /// in their order, that are permitted and far enough apart for all drones to rest there, at the
    /// altitudes of `starts`. Where there is no room, the start itself, though its drone may find
    /// it blocked.
    #[must_use]
    pub fn homes(&self, starts: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        formation::homes(&self.airspace, self.config.keep_m(), starts)
    }

    /// Sends a drone to a place. It sets off when its way is free.
    ///
    /// # Errors
    ///
    /// [`TrafficError`] where there is no such drone, or the place is not finite.
    pub fn go(&mut self, drone: usize, goal: &Vector3<f64>) -> Result<(), TrafficError> {
        self.set_task(drone, Task { goal: *goal, home: false, formation: false, aside: false })
    }

    /// Sends a drone home: like [`go`](Self::go), but it need not keep away from targets, and
    /// the place may lie below the band, on the ground.
    ///
    /// # Errors
    ///
    /// [`TrafficError`] where there is no such drone, or the place is not finite.
    pub fn recall(&mut self, drone: usize, home: &Vector3<f64>) -> Result<(), TrafficError> {
        self.set_task(drone, Task { goal: *home, home: true, formation: false, aside: false })
    }

    /// Sends the drones of a formation to their goals. Where they are in each other's way they
    /// may exchange them; [`goal`](Self::goal) has the last word on who goes where.
    ///
    /// # Errors
    ///
    /// [`TrafficError`] where there is no such drone; then none is sent anywhere.
    pub fn depart(&mut self, formation: &Formation) -> Result<(), TrafficError> {
        for (drone, goal) in formation.iter() {
            self.check_drone(drone)?;
            check_finite(drone, &goal)?;
        }
        self.exchanged.clear();
        for (drone, goal) in formation.iter() {
            self.set_task(drone, Task { goal, home: false, formation: true, aside: false })?;
        }
        Ok(())
    }

    /// Keeps a drone where it is. One that flies is ordered to stop.
    ///
    /// # Errors
    ///
    /// [`TrafficError`] where there is no such drone.
    pub fn hold(&mut self, drone: usize) -> Result<(), TrafficError> {
        self.check_drone(drone)?;
        self.changed = true;
        let flight = &mut self.flights[drone];
        flight.task = None;
        flight.stop(self.config.stopping_m);
        Ok(())
    }

    /// Counts on a drone no more: it has landed, is stuck in the air, or is lost.
    ///
    /// What is reserved for it stays so up to where it was last ordered to fly, less what it is
    /// located to have flown of that; but it counts as resting, so that others fly around it, or
    /// are blocked, and do not wait for it. It has no goal and gets no orders, but for the stop if
    /// it is [held](Self::hold). To send it somewhere takes it back.
    ///
    /// # Errors
    ///
    /// [`TrafficError`] where there is no such drone.
    pub fn give_up(&mut self, drone: usize) -> Result<(), TrafficError> {
        self.check_drone(drone)?;
        self.changed = true;
        self.flights[drone].give_up();
        Ok(())
    }

    /// The last order did not reach a drone: it is given again, and the drone may be wherever its
    /// last but one led it.
    ///
    /// # Errors
    ///
    /// [`TrafficError`] where there is no such drone.
    pub fn repeat(&mut self, drone: usize) -> Result<(), TrafficError> {
        self.check_drone(drone)?;
        self.flights[drone].repeat();
        Ok(())
    }

    /// Returns the orders that are due now. Cheap as long as nothing has changed.
    pub fn step(&mut self) -> Vec<Order> {
        if self.changed || self.released > self.release_m() - EXACT {
            let thorough = core::mem::take(&mut self.changed);
            self.released = 0.0;
            self.set_off(thorough);
        }
        let due = |(_, flight): &(usize, &mut Flight)| flight.due.is_some();
        let flights = self.flights.iter_mut().enumerate().filter(due);
        flights.filter_map(|(drone, flight)| flight.order(drone)).collect()
    }

    /// For how many seconds [`step`](Self::step) gives no order, and no drone arrives, while each
    /// goes on from its place at its velocity, East, North and Up in metres and metres per second,
    /// and is sent nowhere; `None` where that is not known, or at once. It may be too short.
    #[must_use]
    pub fn undisturbed_s(&self, drones: &[(Vector3<f64>, Vector3<f64>)]) -> Option<f64> {
        if self.changed || drones.len() != self.flights.len() {
            return None;
        }
        let mut least = f64::INFINITY;
        let mut speeds = 0.0;
        for (flight, (place, velocity)) in self.flights.iter().zip(drones) {
            least = least.min(flight.undisturbed_s(place, velocity, self.config.tolerance_m)?);
            speeds += velocity.norm();
        }
        // Those that wait look for a way whenever others have released so much of theirs.
        if self.waiting().next().is_some() && speeds > 0.0 {
            least = least.min((self.release_m() - self.released) / speeds);
        }
        Some(least)
    }

    /// After how many metres of released line ways are looked for again.
    fn release_m(&self) -> f64 {
        0.25 * self.config.keep_m()
    }

    /// Returns a drone's progress. One that does not exist is there.
    #[must_use]
    pub fn status(&self, drone: usize) -> Travel {
        self.flights.get(drone).map_or(Travel::There, Flight::travel)
    }

    /// Returns the goal of a drone; `None` where it has no goal.
    #[must_use]
    pub fn goal(&self, drone: usize) -> Option<Vector3<f64>> {
        Some(self.flights.get(drone)?.task?.goal)
    }

    /// Returns the place where a drone is taken to be, within the tolerance.
    #[must_use]
    pub fn place(&self, drone: usize) -> Option<Vector3<f64>> {
        self.flights.get(drone).map(Flight::place)
    }

    /// Returns the reservation of a drone: its supposed place, and the rest of its way.
    #[must_use]
    pub fn reserved(&self, drone: usize) -> &[Vector3<f64>] {
        self.flights.get(drone).map_or(&[], Flight::way)
    }

    fn check_drone(&self, drone: usize) -> Result<(), TrafficError> {
        let drones = self.flights.len();
        if drone < drones { Ok(()) } else { Err(TrafficError::Drone { drone, drones }) }
    }

    fn set_task(&mut self, drone: usize, task: Task) -> Result<(), TrafficError> {
        self.check_drone(drone)?;
        check_finite(drone, &task.goal)?;
        self.changed = true;
        let flight = &mut self.flights[drone];
        flight.set_task(task);
        if flight.waits() {
            flight.stop(self.config.stopping_m);
        }
        Ok(())
    }

    /// Returns the surroundings that a drone has to keep away from; without the drones named.
    fn surroundings(&self, drone: usize, without: &[usize]) -> Surroundings<'_> {
        let others = self.flights.iter().enumerate();
        let others = others.filter(|(other, _)| *other != drone && !without.contains(other));
        let home = self.flights[drone].task.is_some_and(|task| task.home);
        Surroundings {
            airspace: &self.airspace,
            others: others.map(|(_, flight)| flight.region()).collect(),
            keep: self.config.keep_m(),
            void: self.config.void.filter(|_| !home).map(|void| (void, self.clouds.as_slice())),
        }
    }

    fn set_off(&mut self, thorough: bool) {
        loop {
            // Those that have flown aside let the others go first.
            let aside = |flight: &Flight| flight.task.is_some_and(|task| task.aside);
            let mut waiting: Vec<usize> = self.waiting().collect();
            waiting.sort_by_key(|&drone| aside(&self.flights[drone]));
            for drone in waiting {
                if self.flights[drone].may_extend() {
                    self.try_set_off(drone, thorough);
                }
            }
            if self.flights.iter().any(Flight::flies) || !self.waiting().any(|_| true) {
                return;
            }
            if !self.exchange() {
                break;
            }
        }
        if !self.step_aside() {
            for flight in &mut self.flights {
                flight.blocked = flight.waits();
            }
        }
    }

    fn waiting(&self) -> impl Iterator<Item = usize> {
        (0..self.flights.len()).filter(|&drone| self.flights[drone].waits())
    }

    /// Reserves a drone's way to its goal if that is free.
    fn try_set_off(&mut self, drone: usize, thorough: bool) {
        let Some(Task { goal, home, .. }) = self.flights[drone].task else { return };
        if !home && !self.airspace.permits(&goal) {
            return;
        }
        let from = self.flights[drone].end().xy();
        let to = goal.xy();
        let surroundings = self.surroundings(drone, &[]);
        let (way, reason) = if surroundings.first_leg(&from, &to) {
            (vec![to], OrderReason::Straight)
        } else {
            let others_fly =
                self.flights.iter().enumerate().any(|(d, flight)| d != drone && flight.flies());
            if others_fly && !thorough {
                return;
            }
            let Some(way) = surroundings.way(&from, &to) else { return };
            if others_fly {
                let everyone: Vec<usize> = (0..self.flights.len()).collect();
                let alone = self.surroundings(drone, &everyone).way(&from, &to);
                let alone = alone.map_or(0.0, |way| length_over_ground(&from, &way));
                if length_over_ground(&from, &way) > DETOUR * alone + self.config.keep_m() {
                    return;
                }
            }
            (way, OrderReason::Around)
        };
        self.reserve(drone, goal.z, &way, reason);
    }

    fn reserve(&mut self, drone: usize, goal_up: f64, way: &[Vector2<f64>], reason: OrderReason) {
        let places = with_altitudes(&self.airspace, &self.flights[drone].end(), goal_up, way);
        self.flights[drone].extend(&places, reason);
    }
}

/// Attempts to end a wait in which no drone flies.
impl Traffic {
    /// Has two drones of the formation exchange their goals, if one of them can then set off.
    /// Every pair exchanges once per formation, so this ends.
    fn exchange(&mut self) -> bool {
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
    fn step_aside(&mut self) -> bool {
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

    /// Returns the nearest place, straight ahead, that keeps away from all drones, all goals, and
    /// best also from the lines of waiting drones.
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

fn check_finite(drone: usize, place: &Vector3<f64>) -> Result<(), TrafficError> {
    if place.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        let [east, north, up] = [place.x, place.y, place.z];
        Err(TrafficError::NotFinite { drone, east, north, up })
    }
}

fn line_distance(from: &Vector2<f64>, to: &Vector2<f64>, place: &Vector2<f64>) -> f64 {
    Euclidean.distance(&Point::from(point(place)), &line(from, to))
}
