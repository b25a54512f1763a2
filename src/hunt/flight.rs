use foxhunt_core::{BeaconId, Outcome, PlanError, Pose, Station, Sweep, Target, Waypoint};
use foxhunt_formation::{
    Airspace, Attendance, Duty, Endurance, Traffic, TrafficConfig, TrafficError, Travel,
};
use nalgebra::Vector3;

use super::{Command, Event, HuntConfig, HuntError, Outbox, searching::Recall};

/// The drones of a hunt: where they are, who takes part, and how each gets to its goal.
#[derive(Debug)]
pub(super) struct Flight {
    stations: Vec<Station>,
    attendance: Vec<Attendance>,
    /// What was logged of each.
    told: Vec<Duty>,
    traffic: Traffic,
    /// What was logged of the way of each.
    travel: Vec<Travel>,
    /// What was logged of the last order of each.
    sent: Vec<Option<Vector3<f64>>>,
    endurance: Option<Endurance>,
    /// Why the formation that was planned last is not flown to.
    unaffordable: Option<String>,
    /// How long the last turn took, in seconds.
    turn_s: f64,
    listening: f64,
    returns: bool,
    homes: Vec<Vector3<f64>>,
    /// When it began, and since when the drones are on their way home.
    began: f64,
    recalled: Option<f64>,
    /// When the way home was measured last.
    reckoned: f64,
    move_timeout_s: f64,
    /// Whose sweeps each drone owes, and whether it is waited for.
    owed: Vec<(Vec<BeaconId>, bool)>,
    flown_m: f64,
    /// Since when each drone does not take its order to land, and when it is told again.
    unlanded: Vec<Option<(f64, f64)>>,
}

/// How often the time that a return takes is reckoned, in seconds; the reserve covers what changes
/// in between.
const RECKONED_EVERY_S: f64 = 1.0;

/// After how many seconds a drone is told again to land.
const LANDED_AGAIN_AFTER_S: f64 = 5.0;

impl Flight {
    pub(super) fn new(
        config: &HuntConfig,
        time: f64,
        stations: Vec<Station>,
    ) -> Result<Self, HuntError> {
        let starts: Vec<Vector3<f64>> = stations.iter().map(|s| s.pose.position).collect();
        let traffic = TrafficConfig {
            separation_m: config.separation_m,
            // Half of it is for arriving.
            tolerance_m: 2.0 * config.arrival_tolerance_m,
            stopping_m: config.stopping_m,
            void: config.void,
        };
        let traffic = Traffic::new(&Airspace::new(&config.airspace)?, traffic, &starts)?;
        let attendance = |start: &Vector3<f64>| Attendance::new(config.attendance, time, *start);
        Ok(Self {
            attendance: starts.iter().map(attendance).collect(),
            told: vec![Duty::Formation; stations.len()],
            homes: traffic.homes(&starts),
            traffic,
            travel: vec![Travel::There; stations.len()],
            sent: vec![None; stations.len()],
            endurance: config.endurance.map(Endurance::new).transpose()?,
            unaffordable: None,
            turn_s: 0.0,
            listening: time,
            returns: config.return_home || config.endurance.is_some(),
            owed: vec![(Vec::new(), false); stations.len()],
            stations,
            began: time,
            recalled: None,
            reckoned: time,
            move_timeout_s: config.move_timeout_s,
            flown_m: 0.0,
            unlanded: vec![None; starts.len()],
        })
    }

    pub(super) fn stations(&self) -> &[Station] {
        &self.stations
    }

    /// How far all drones have flown together, in metres, as far as they were seen.
    pub(super) fn flown_m(&self) -> f64 {
        self.flown_m
    }

    /// Whether the drones fly home when all is done.
    pub(super) fn returns(&self) -> bool {
        self.returns
    }

    pub(super) fn located(&mut self, time: f64, drone: usize, pose: Pose) {
        let Some(station) = self.stations.get_mut(drone) else { return };
        self.flown_m += (pose.position - station.pose.position).norm();
        station.pose = pose;
        self.traffic.locate(drone, &pose.position);
        let under_way = self.traffic.status(drone) == Travel::UnderWay;
        self.attendance[drone].located(time, pose.position, under_way);
    }

    /// Takes note that a drone did not take its order; it is told again.
    pub(super) fn not_sent(&mut self, drone: usize) {
        // Only a drone that does not exist is an error, and that has no order.
        let _ = self.traffic.repeat(drone);
    }

    /// Lets time pass: sends whoever may fly on, and tells who drops out and who comes back.
    pub(super) fn pass(&mut self, time: f64, outbox: &mut Outbox) {
        for attendance in &mut self.attendance {
            attendance.pass(time);
        }
        if self.recalled.is_some() {
            self.land_those_at_home(time, outbox);
        }
        for order in self.traffic.step() {
            let (drone, to) = (order.drone, order.to);
            if self.sent[drone].replace(to) != Some(to) {
                outbox.tell(Event::Sent { time, drone, to, reason: order.reason });
            }
            outbox.order(Command::GoTo { drone, goal: Waypoint { position: to } });
        }
        for drone in 0..self.stations.len() {
            let duty = self.attendance[drone].duty();
            if std::mem::replace(&mut self.told[drone], duty) != duty {
                outbox.tell(Event::DutyChanged { time, drone, duty });
                if duty == Duty::Still {
                    // Nobody waits for it to make way any longer.
                    let _ = self.traffic.hold(drone);
                }
            }
            // Drones of a formation may have exchanged their goals.
            if let Some(position) = self.traffic.goal(drone) {
                self.stations[drone].goal = Waypoint { position };
            }
            let travel = self.traffic.status(drone);
            let before = std::mem::replace(&mut self.travel[drone], travel);
            let reason = match travel {
                Travel::Waiting => "others are in its way",
                Travel::Blocked => "there is no permitted way to its goal",
                _ => continue,
            };
            if before != travel {
                outbox.tell(Event::Held { time, drone, reason: reason.to_owned() });
            }
        }
    }

    /// The drones that take a place in the formation: those that can, or else those of which
    /// anything may still be hoped for.
    fn placed(&self) -> Vec<usize> {
        let ranks: [&[Duty]; 3] = [&[Duty::Formation], &[Duty::Still, Duty::Silent], &[Duty::Lost]];
        let of = |rank: &[Duty]| -> Vec<usize> {
            let on_duty = |drone: &usize| rank.contains(&self.attendance[*drone].duty());
            (0..self.stations.len()).filter(on_duty).collect()
        };
        ranks.into_iter().map(of).find(|placed| !placed.is_empty()).unwrap_or_default()
    }

    /// Has `plan` set the goals of those that take part, makes places of them that may be flown to,
    /// and sends each drone to one of them. On an error the drones' goals stay.
    pub(super) fn form<T>(
        &mut self,
        time: f64,
        targets: &[Target<'_>],
        outbox: &mut Outbox,
        plan: impl FnOnce(&mut [Station], &mut Outbox) -> Result<T, PlanError>,
    ) -> Result<T, PlanError> {
        for attendance in &mut self.attendance {
            attendance.give_another_chance(time);
        }
        let drones = self.placed();
        let mut stations: Vec<Station> = drones.iter().map(|drone| self.stations[*drone]).collect();
        let planned = plan(&mut stations, outbox)?;
        let places: Vec<Vector3<f64>> = stations.iter().map(|s| s.goal.position).collect();
        if let Some(bad) = places.iter().find(|place| !place.iter().all(|c| c.is_finite())) {
            return Err(PlanError::NotFinite { east: bad.x, north: bad.y });
        }
        self.traffic.believe(targets.iter().map(|target| target.belief));
        // Every drone exists and every place is finite.
        let formation = self.traffic.form(&drones, &places).map_err(no_place)?;
        let elapsed = time - self.began;
        self.unaffordable = self.endurance.as_ref().and_then(|endurance| {
            let left_s = endurance.left_s(elapsed);
            // Where there is no way for one of them it will stay, and the way home of all is reckoned
            // again and again.
            let needed_s =
                endurance.round_s(&self.traffic, &formation, &self.homes, self.turn_s)?;
            (needed_s >= left_s).then(|| {
                format!(
                    "the next turn and the way home take up to {needed_s:.0} s, and {left_s:.0} s \
                     are left"
                )
            })
        });
        if self.unaffordable.is_some() {
            return Ok(planned);
        }
        self.traffic.depart(&formation).map_err(no_place)?;
        for (drone, position) in formation.iter() {
            self.stations[drone].goal = Waypoint { position };
        }
        let goals = self.stations.iter().map(|s| s.goal.position).collect();
        outbox.tell(Event::GoalsSet { time, goals });
        for moved in formation.moved {
            let (drone, wanted, goal, reason) =
                (moved.drone, moved.wanted, moved.goal, moved.reason);
            outbox.tell(Event::GoalMoved { time, drone, wanted, goal, reason });
        }
        Ok(planned)
    }

    /// Whether every drone is where it is to listen, as far as it will get there.
    pub(super) fn is_formed(&self) -> bool {
        let settled = |drone: usize| {
            self.attendance[drone].is_astray()
                || matches!(self.traffic.status(drone), Travel::There | Travel::Blocked)
        };
        (0..self.stations.len()).all(settled)
    }

    /// Has every drone in the air turn its antenna, those that deliver nothing included.
    pub(super) fn listen(&mut self, time: f64, beacons: &[BeaconId], outbox: &mut Outbox) {
        self.listening = time;
        let duties: Vec<Duty> = self.attendance.iter().map(Attendance::duty).collect();
        let counts = |duty: &Duty| matches!(duty, Duty::Formation | Duty::Still);
        let some_count = duties.iter().any(counts);
        for (drone, duty) in duties.into_iter().enumerate() {
            if matches!(duty, Duty::Returning | Duty::Landed) {
                continue;
            }
            self.owed[drone] = (beacons.to_vec(), counts(&duty) || !some_count);
            outbox.order(Command::Listen { drone, beacons: beacons.to_vec() });
        }
    }

    /// Takes note of a sweep that a drone has delivered, and says whether it is of the last turn and
    /// not of an earlier one; `None` where there is no such drone.
    pub(super) fn delivered(&mut self, time: f64, drone: usize, sweep: &Sweep<'_>) -> Option<bool> {
        let (owed, _) = self.owed.get_mut(drone)?;
        // One without a time is of no use and will not come again.
        let late = sweep.time < self.listening;
        if !late {
            owed.retain(|other| *other != sweep.beacon);
            self.turn_s = time - self.listening;
        }
        if sweep.time.is_finite() {
            self.attendance[drone].delivered();
        }
        Some(!late)
    }

    /// Whether a drone still owes a sweep, awaited or late.
    pub(super) fn owes(&self, drone: usize) -> bool {
        self.owed.get(drone).is_some_and(|(owed, _)| !owed.is_empty())
    }

    /// Whether a sweep is waited for.
    pub(super) fn is_waiting(&self) -> bool {
        self.owed.iter().any(|(owed, awaited)| *awaited && !owed.is_empty())
    }

    /// Waits no longer for the sweeps that are owed; those that come late are welcome.
    pub(super) fn give_up_turns(&mut self, time: f64, waited_s: f64, outbox: &mut Outbox) {
        for (drone, (owed, awaited)) in self.owed.iter_mut().enumerate() {
            if std::mem::take(awaited) && !owed.is_empty() {
                self.attendance[drone].missed();
                outbox.tell(Event::Missing { time, drone, waited_s });
            }
        }
    }

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

    fn land_those_at_home(&mut self, time: f64, outbox: &mut Outbox) {
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
            let _ = self.traffic.hold(drone);
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

/// A formation that cannot be flown: its places are none.
fn no_place(_: TrafficError) -> PlanError {
    PlanError::NoPlace
}
