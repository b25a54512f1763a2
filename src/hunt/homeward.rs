//! When the drones of a hunt fly home, and how they land.

use foxhunt_core::{Outcome, Waypoint};
use foxhunt_formation::{Attendance, Duty, Travel};

use super::{Command, Event, Flight, Outbox, searching::Recall};

/// How often the time that a return takes is reckoned, in seconds; the reserve covers what changes
/// in between.
const RECKONED_EVERY_S: f64 = 1.0;

/// After how many seconds a drone is told again to land.
const LANDED_AGAIN_AFTER_S: f64 = 5.0;

impl Flight {
    /// Why the drones have to fly home now, if they have to.
    pub(super) fn must_return(&mut self, time: f64) -> Option<Recall> {
        let unseen_s = |attendance: &Attendance| attendance.unseen_s(time);
        let unseen_s = self.attendance.iter().map(unseen_s).fold(f64::INFINITY, f64::min);
        if unseen_s >= self.move_timeout_s {
            let reason = format!("no drone was seen for {unseen_s:.0} s");
            return Some(Recall { outcome: Outcome::NoDrones, reason });
        }
        if time - self.reckoned < RECKONED_EVERY_S {
            return None;
        }
        self.reckoned = time;
        let endurance = self.endurance.as_ref()?;
        let sound = |drone: &usize| !self.attendance[*drone].is_astray();
        let drones: Vec<usize> = self.airborne().into_iter().filter(sound).collect();
        let left_s = endurance.left_s(time - self.began);
        let (outcome, reason) = match endurance.return_s(&self.traffic, &drones, &self.homes) {
            Some(needed_s) if needed_s + RECKONED_EVERY_S < left_s => return None,
            Some(needed_s) => (
                Outcome::BudgetSpent,
                format!("the way home takes up to {needed_s:.0} s, and {left_s:.0} s are left"),
            ),
            None => (Outcome::NoPlan, "a drone has no permitted way home".to_owned()),
        };
        Some(Recall { outcome, reason })
    }

    /// Why the formation that was just planned cannot be flown to, if it cannot; told once.
    pub(super) fn cannot_afford(&mut self) -> Option<Recall> {
        let reason = self.unaffordable.take()?;
        Some(Recall { outcome: Outcome::BudgetSpent, reason })
    }

    /// The drones that are neither on the ground nor given up.
    fn airborne(&self) -> Vec<usize> {
        let flies = |drone: &usize| self.attendance[*drone].duty() != Duty::Landed;
        (0..self.stations.len()).filter(flies).collect()
    }

    /// Sends everyone home.
    pub(super) fn go_home(&mut self, time: f64, reason: String, outbox: &mut Outbox) {
        outbox.tell(Event::Recalled { time, reason });
        self.recalled = Some(time);
        for drone in self.airborne() {
            let home = self.homes[drone];
            self.stations[drone].goal = Waypoint { position: home };
            self.attendance[drone].sent_home();
            // Its home is a finite place.
            let _ = self.traffic.recall(drone, &home);
        }
    }

    /// Whether nobody is on the way home any more.
    pub(super) fn is_over(&self) -> bool {
        self.recalled.is_none() && !self.returns || self.airborne().is_empty()
    }

    pub(super) fn land_those_at_home(&mut self, time: f64, outbox: &mut Outbox) {
        let Some(recalled) = self.recalled else { return };
        // Orders are given now and then, so a little early.
        let elapsed = time - self.began + RECKONED_EVERY_S;
        // Who waits for one that was given up would wait for ever. Drones may fly one by one.
        let drones = f64::from(u32::try_from(self.stations.len()).unwrap_or(u32::MAX));
        let in_vain = time - recalled >= drones * self.move_timeout_s;
        for drone in self.airborne() {
            let height = self.stations[drone].pose.position.z;
            let empty = self.endurance.as_ref().is_some_and(|endurance| {
                let config = endurance.config();
                elapsed + height.max(0.0) / config.climb_mps >= config.endurance_s
            });
            let reason = match (self.unlanded[drone], self.traffic.status(drone)) {
                (Some((since, _)), _) if time - since >= self.move_timeout_s => {
                    "it takes no order to land and is given up"
                }
                (Some((_, again)), _) if time < again => continue,
                (Some(_), _) => "it is told again",
                (None, Travel::There) => "it is at home",
                (None, Travel::Blocked) => "there is no permitted way home",
                _ if empty => "its endurance is over",
                _ if self.attendance[drone].is_astray()
                    && time - recalled >= self.move_timeout_s =>
                {
                    "it does not come home"
                }
                _ if in_vain => "others are in its way home",
                _ => continue,
            };
            self.attendance[drone].landed();
            let _ = self.traffic.give_up(drone);
            outbox.tell(Event::Landed { time, drone, reason: reason.to_owned() });
            outbox.order(Command::Land { drone });
        }
    }

    /// Takes note that a drone did not take its order to land; it is told again every few seconds,
    /// until it is given up.
    pub(super) fn not_landed(&mut self, time: f64, drone: usize) {
        let Some(unlanded) = self.unlanded.get_mut(drone) else { return };
        let since = unlanded.map_or(time, |(since, _)| since);
        *unlanded = Some((since, time + LANDED_AGAIN_AFTER_S));
        if time - since < self.move_timeout_s {
            self.attendance[drone].sent_home();
        }
    }
}
