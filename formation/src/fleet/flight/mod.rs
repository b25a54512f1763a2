//! Flights: what is reserved for each drone, and the traffic of all.

mod traffic;

pub use traffic::Traffic;

pub(super) use traffic::ASIDE;

use std::{vec, vec::Vec};

use nalgebra::{Vector2, Vector3};

use super::Region;

/// An order to a drone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    /// Index of the drone.
    pub drone: usize,
    /// Place to fly to, straight from where it is; East, North and Up in metres.
    pub to: Vector3<f64>,
    /// The reason.
    pub reason: OrderReason,
}

/// Reason that a drone is to fly somewhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum OrderReason {
    /// The drone's way to its goal is straight and free.
    Straight,
    /// The drone's way to its goal goes around something; this is the first corner.
    Around,
    /// The drone has reached a corner of its way; this is the next.
    Corner,
    /// It stops: it is held, it is off its line, or its goal has changed and the new way is not
    /// free yet.
    Stop,
    /// It flies back to where it rested, having been moved away.
    Return,
    /// It took the goal of another drone of its formation, to which its way is free.
    Exchanged {
        /// Index of the drone that goes to its former goal instead.
        with: usize,
    },
    /// It flies aside to let others pass, and to its goal afterwards.
    Aside,
}

/// Progress of a drone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Travel {
    /// It is at its goal, or has none and rests.
    There,
    /// It flies.
    UnderWay,
    /// It rests until others have made way.
    Waiting,
    /// It rests, nobody moves, and there is no permitted way to its goal.
    Blocked,
}

/// Goal of a drone, and the rules for it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Task {
    goal: Vector3<f64>,
    /// True if targets need not be kept away from, and the goal may lie below the band.
    home: bool,
    /// True if it may exchange its goal with others of the formation.
    formation: bool,
    /// True if it has flown aside for others already.
    aside: bool,
}

/// One drone: where it is, and what is reserved for it.
#[derive(Clone, Debug)]
struct Flight {
    /// Rest of its way, at least one place: the first is where it is taken to be, within the
    /// tolerance; the second is where it is ordered to fly next.
    way: Vec<Vector3<f64>>,
    /// Places where the last accepted order led it, and the one before.
    ordered: [Vector3<f64>; 2],
    /// Leg that it may be flying along instead, until it is located again.
    former: Option<[Vector2<f64>; 2]>,
    /// The last order was not accepted.
    unsent: bool,
    /// The drone has been located since.
    located: bool,
    task: Option<Task>,
    /// The order that has not been given yet.
    due: Option<OrderReason>,
    last: OrderReason,
    blocked: bool,
    /// Nobody counts on it any more.
    given_up: bool,
}

/// Position of a drone on its line.
enum Located {
    /// It is where it should be, and that many metres of its line are released.
    OnLine(f64),
    /// It is at the next corner of its line, or at its end.
    AtCorner,
    /// It is elsewhere.
    Astray,
}

impl Flight {
    fn resting(place: Vector3<f64>) -> Self {
        Self {
            way: vec![place],
            ordered: [place; 2],
            former: None,
            unsent: false,
            located: true,
            task: None,
            due: None,
            last: OrderReason::Stop,
            blocked: false,
            given_up: false,
        }
    }

    /// Returns the place where it is taken to be.
    fn place(&self) -> Vector3<f64> {
        self.way[0]
    }

    /// Returns the end of its reserved way.
    fn end(&self) -> Vector3<f64> {
        self.way[self.way.len() - 1]
    }

    /// Returns true if it flies, or may be flying because it has not been located since it was to
    /// stop. One that was given up does not count.
    fn flies(&self) -> bool {
        !self.given_up && (self.way.len() > 1 || self.former.is_some())
    }

    fn is_given_up(&self) -> bool {
        self.given_up
    }

    /// Gets a place to reach, and is counted on to reach it.
    fn set_task(&mut self, task: Task) {
        self.task = Some(task);
        self.blocked = false;
        self.given_up = false;
    }

    /// Keeps the leg that it was ordered to fly, and gets no more orders but to stop.
    fn give_up(&mut self) {
        self.task = None;
        self.given_up = true;
        match self.due {
            Some(OrderReason::Stop) => {}
            None => self.way.truncate(2),
            Some(_) => {
                // It flies on as the last order had it.
                self.due = None;
                self.way = vec![self.way[0], self.ordered[0]];
                self.way.dedup();
            }
        }
    }

    /// Returns true if a way may be added to the end of its line. Not where it was to stop at once
    /// and has not been located since: it would fly there from wherever it is.
    fn may_extend(&self) -> bool {
        self.way.len() > 1 || self.former.is_none()
    }

    fn way(&self) -> &[Vector3<f64>] {
        &self.way
    }

    fn region(&self) -> Region {
        let mut region = Region::along(&self.way);
        if let Some([from, to]) = &self.former {
            region.add(from, to);
        }
        region
    }

    /// Returns true if it has somewhere to go and is not on its way there.
    fn waits(&self) -> bool {
        self.task.is_some_and(|task| (task.goal - self.end()).norm() > 1e-9)
    }

    fn travel(&self) -> Travel {
        match (self.flies(), self.waits()) {
            (true, _) => Travel::UnderWay,
            (false, false) => Travel::There,
            (false, true) if self.blocked => Travel::Blocked,
            (false, true) => Travel::Waiting,
        }
    }

    /// For how many seconds nothing changes but how far it is on its line, while it goes on from
    /// `place` at `velocity`; `None` where that is not known.
    fn undisturbed_s(
        &self,
        place: &Vector3<f64>,
        velocity: &Vector3<f64>,
        tolerance: f64,
    ) -> Option<f64> {
        if self.due.is_some() || self.former.is_some() || self.unsent {
            return None;
        }
        let speed = velocity.norm();
        let Some(to) = self.way.get(1) else { return (speed <= 0.0).then_some(f64::INFINITY) };
        if speed <= 0.0 {
            return Some(f64::INFINITY);
        }
        let way = to - place;
        let distance = way.norm();
        // One that goes elsewhere may leave its line at any time.
        let straight = (way * speed - velocity * distance).norm() <= 1e-6 * speed * distance;
        straight.then_some((distance - 0.5 * tolerance) / speed)
    }

    /// Returns true if the leg that it was ordered to leave is released when it is next located.
    fn turns(&self) -> bool {
        self.former.is_some() && self.due.is_none()
    }

    /// Takes note of where it is.
    fn locate(&mut self, place: &Vector3<f64>, tolerance: f64) -> Located {
        self.located = true;
        // As long as it has not accepted another order it flies where the last one led it.
        self.former = self.due.map(|_| [place.xy(), self.ordered[0].xy()]);
        let from = self.way[0].xy();
        let Some(to) = self.way.get(1) else {
            let astray = (place.xy() - from).norm() > tolerance;
            return if astray { Located::Astray } else { Located::OnLine(0.0) };
        };
        let leg = to.xy() - from;
        let length = leg.norm();
        // Over ground: a drone that climbs early is not farther on its line.
        let along = if length > 0.0 { leg.dot(&(place.xy() - from)) / length } else { 0.0 };
        let along = along.clamp(0.0, length);
        let nearest = if length > 0.0 { from + leg * (along / length) } else { from };
        // Before it turns it may be no farther off than where it arrives: it strays afterwards.
        let limit = if self.due.is_some() { 0.5 * tolerance } else { tolerance };
        if (place.xy() - nearest).norm() > limit {
            return Located::Astray;
        }
        if (place - to).norm() <= 0.5 * tolerance {
            self.way.remove(0);
            if self.way.len() > 1 {
                self.due = Some(OrderReason::Corner);
            }
            return Located::AtCorner;
        }
        let up = if length > 0.0 {
            self.way[0].z + (to.z - self.way[0].z) * (along / length)
        } else {
            place.z
        };
        self.way[0] = Vector3::new(nearest.x, nearest.y, up);
        Located::OnLine(along)
    }

    /// Begins the line at another place.
    fn begin_at(&mut self, place: Vector3<f64>) {
        self.way[0] = place;
    }

    /// It has been moved away from where it rests, and returns.
    fn return_from(&mut self, place: Vector3<f64>) {
        self.way = vec![place, self.way[0]];
        self.due = Some(OrderReason::Return);
    }

    /// It stops at a place off its line.
    fn rest_at(&mut self, place: Vector3<f64>) {
        self.former = Some([place.xy(), self.ordered[0].xy()]);
        self.due = Some(OrderReason::Stop);
        self.way = vec![place];
    }

    /// Ends its line as soon as it can stop. The leg that it flies stays reserved until it is
    /// located again.
    fn stop(&mut self, stopping: f64) {
        let Some(to) = self.way.get(1).copied() else { return };
        let from = self.way[0];
        let length = (to - from).xy().norm();
        if self.way.len() == 2 && length <= stopping {
            return;
        }
        self.former.get_or_insert([from.xy(), self.ordered[0].xy()]);
        let share = if length > stopping { stopping / length } else { 1.0 };
        self.way = vec![from, from.lerp(&to, share)];
        if stopping <= 0.0 || length <= 0.0 {
            self.way = vec![from];
        }
        self.due = Some(OrderReason::Stop);
    }

    /// Flies on from the end of its line.
    fn extend(&mut self, places: &[Vector3<f64>], reason: OrderReason) {
        if self.way.len() == 1 || self.due.is_some() {
            self.due = Some(reason);
        }
        self.way.extend_from_slice(places);
        self.blocked = false;
    }

    /// The order that is due, once. One that was not accepted is given again when it is known
    /// where the drone is by then.
    fn order(&mut self, drone: usize) -> Option<Order> {
        if self.unsent && !self.located {
            return None;
        }
        if self.given_up && self.due != Some(OrderReason::Stop) {
            return None;
        }
        let reason = self.due.take()?;
        let to = *self.way.get(1).unwrap_or(&self.way[0]);
        self.ordered = [to, self.ordered[0]];
        self.last = reason;
        self.unsent = false;
        Some(Order { drone, to, reason })
    }

    /// The last order did not reach it: it flies on as it did.
    fn repeat(&mut self) {
        if !self.unsent {
            self.ordered = [self.ordered[1]; 2];
            let from = self.way[0].xy();
            self.former.get_or_insert([from, self.ordered[0].xy()]);
            self.unsent = true;
            self.located = false;
            self.due.get_or_insert(self.last);
        }
    }
}
