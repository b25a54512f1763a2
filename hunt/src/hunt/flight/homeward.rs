//! Way home of a hunt's drones, and their landing.

use foxhunt_core::{Outcome, Waypoint};
use foxhunt_formation::{Duty, Travel};

use super::{Command, Event, Flight, FlownDrone, LandingRefused, Outbox};

/// Reason why all searches end.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::hunt) struct Recall {
    pub outcome: Outcome,
    pub reason: String,
}

/// Interval at which the duration of a return is computed, in seconds; the reserve covers changes
/// in between.
const RETURN_CHECKED_EVERY_S: f64 = 1.0;

/// Time after which an order to land is repeated, in seconds.
const LANDING_REPEATED_AFTER_S: f64 = 5.0;

impl Flight {
    /// Returns the reason why the drones have to fly home now, if they have to.
    pub(in crate::hunt) fn must_return(&mut self, time: f64) -> Option<Recall> {
        let unlocated_s = |drone: &FlownDrone| drone.attendance.unlocated_s(time);
        let unlocated_s = self.movers().map(unlocated_s).fold(f64::INFINITY, f64::min);
        if unlocated_s >= self.move_timeout_s {
            let reason = format!("no drone has reported its place for {unlocated_s:.0} s");
            return Some(Recall { outcome: Outcome::NoDrones, reason });
        }
        if time - self.return_checked < RETURN_CHECKED_EVERY_S {
            return None;
        }
        self.return_checked = time;
        let endurance = self.endurance.as_ref()?;
        let sound = |drone: &usize| !self.drones[*drone].attendance.is_astray();
        let drones: Vec<usize> = self.airborne().into_iter().filter(sound).collect();
        let left_s = endurance.left_s(time - self.began);
        let (outcome, reason) = match endurance.return_s(&self.traffic, &drones, &self.homes()) {
            Some(needed_s) if needed_s + RETURN_CHECKED_EVERY_S < left_s => return None,
            Some(needed_s) => (
                Outcome::BudgetSpent,
                format!("the way home takes up to {needed_s:.0} s, and {left_s:.0} s are left"),
            ),
            None => (Outcome::NoPlan, "a drone has no permitted way home".to_owned()),
        };
        Some(Recall { outcome, reason })
    }

    /// Returns the time when the way home is computed again.
    pub(in crate::hunt) fn return_check_at(&self) -> f64 {
        self.return_checked + RETURN_CHECKED_EVERY_S
    }

    /// Returns the reason why the formation that was just planned cannot be flown to, if it cannot;
    /// once.
    pub(in crate::hunt) fn cannot_afford(&mut self) -> Option<Recall> {
        let reason = self.unaffordable.take()?;
        Some(Recall { outcome: Outcome::BudgetSpent, reason })
    }

    /// The drones that are neither on the ground nor given up, and take orders.
    fn airborne(&self) -> Vec<usize> {
        let flies = |drone: &usize| {
            let attendance = &self.drones[*drone].attendance;
            attendance.duty() != Duty::Landed && !attendance.is_away()
        };
        (0..self.drones.len()).filter(flies).collect()
    }

    /// Sends everyone home.
    pub(in crate::hunt) fn go_home(&mut self, time: f64, reason: String, outbox: &mut Outbox) {
        outbox.emit(Event::Recalled { time, reason });
        self.recalled = Some(time);
        for drone in self.airborne() {
            let recalled = &mut self.drones[drone];
            recalled.station.goal = Waypoint { position: recalled.home };
            recalled.attendance.sent_home();
            // Its home is a finite place.
            let _ = self.traffic.recall(drone, &recalled.home);
        }
    }

    /// Returns true if nobody is on the way home any more.
    pub(in crate::hunt) fn is_over(&self) -> bool {
        self.recalled.is_none() && !self.returns || self.airborne().is_empty()
    }

    pub(in crate::hunt) fn land_those_at_home(&mut self, time: f64, outbox: &mut Outbox) {
        let Some(recalled) = self.recalled else { return };
        // Orders are given now and then, so a little early.
        let elapsed = time - self.began + RETURN_CHECKED_EVERY_S;
        // Who waits for one that was given up would wait for ever. Drones may fly one by one.
        let drones = f64::from(u32::try_from(self.drones.len()).unwrap_or(u32::MAX));
        let in_vain = time - recalled >= drones * self.move_timeout_s;
        for drone in self.airborne() {
            let landing = &self.drones[drone];
            let height = landing.station.pose.position.z;
            let empty = self.endurance.as_ref().is_some_and(|endurance| {
                let config = endurance.config();
                elapsed + height.max(0.0) / config.climb_mps >= config.endurance_s
            });
            let reason = match (landing.landing, self.traffic.status(drone)) {
                (Some(refused), _) if time - refused.since >= self.move_timeout_s => {
                    "it takes no order to land and is given up"
                }
                (Some(refused), _) if time < refused.repeat_at => continue,
                (Some(_), _) => "the order is repeated",
                (None, Travel::There) => "it is at home",
                (None, Travel::Blocked) => "there is no permitted way home",
                _ if empty => "its endurance is over",
                _ if landing.attendance.is_astray() && time - recalled >= self.move_timeout_s => {
                    "it does not come home"
                }
                _ if in_vain => "others are in its way home",
                _ => continue,
            };
            self.drones[drone].attendance.landed();
            let _ = self.traffic.give_up(drone);
            outbox.emit(Event::Landed { time, drone, reason: reason.to_owned() });
            outbox.order(Command::Land { drone });
        }
    }

    /// Lands a drone that had landed, or was to land, when the hunt was broken off.
    pub(in crate::hunt) fn land_again(&mut self, drone: usize, outbox: &mut Outbox) {
        if let Some(landing) = self.drones.get_mut(drone) {
            landing.attendance.landed();
            outbox.order(Command::Land { drone });
        }
    }

    /// Takes note that a drone did not take its order to land; it is repeated every few seconds,
    /// until the drone is given up.
    pub(in crate::hunt) fn not_landed(&mut self, time: f64, drone: usize) {
        let Some(drone) = self.drones.get_mut(drone) else { return };
        let since = drone.landing.map_or(time, |refused| refused.since);
        let repeat_at = time + LANDING_REPEATED_AFTER_S;
        drone.landing = Some(LandingRefused { since, repeat_at });
        if time - since < self.move_timeout_s {
            drone.attendance.sent_home();
        }
    }
}
