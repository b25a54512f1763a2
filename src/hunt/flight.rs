use foxhunt_core::{BeaconId, PlanError, Pose, Station, Target, Waypoint};
use foxhunt_formation::{
    Airspace, Attendance, Duty, Endurance, Traffic, TrafficConfig, TrafficError, Travel,
};
use nalgebra::Vector3;

use super::{Command, Event, HuntConfig, HuntError, Outbox};

/// The drones of a hunt: where they are, who takes part, and how each gets to its goal.
#[derive(Debug)]
pub(super) struct Flight {
    pub(super) stations: Vec<Station>,
    pub(super) attendance: Vec<Attendance>,
    /// What was logged of each.
    pub(super) told: Vec<Duty>,
    pub(super) traffic: Traffic,
    /// What was logged of the way of each.
    pub(super) travel: Vec<Travel>,
    /// What was logged of the last order of each.
    pub(super) sent: Vec<Option<Vector3<f64>>>,
    pub(super) endurance: Option<Endurance>,
    /// Why the formation that was planned last is not flown to.
    pub(super) unaffordable: Option<String>,
    /// How long the last turn took, in seconds.
    pub(super) turn_s: f64,
    pub(super) listening: f64,
    pub(super) returns: bool,
    pub(super) homes: Vec<Vector3<f64>>,
    /// When it began, and since when the drones are on their way home.
    pub(super) began: f64,
    pub(super) recalled: Option<f64>,
    /// When the way home was measured last.
    pub(super) reckoned: f64,
    pub(super) move_timeout_s: f64,
    /// Whose sweeps each drone owes, and whether it is waited for.
    pub(super) owed: Vec<(Vec<BeaconId>, bool)>,
    pub(super) flown_m: f64,
    /// Since when each drone does not take its order to land, and when it is told again.
    pub(super) unlanded: Vec<Option<(f64, f64)>>,
}

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
                if matches!(duty, Duty::Still | Duty::Lost) {
                    // Nobody waits for it to make way any longer.
                    let _ = self.traffic.hold(drone);
                    let _ = self.traffic.give_up(drone);
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

    /// Takes note of what a drone has delivered of a turn that ended at `ended`, and says whether it
    /// is of the last turn and not of an earlier one; `None` where there is no such drone.
    pub(super) fn delivered(
        &mut self,
        time: f64,
        drone: usize,
        beacon: BeaconId,
        ended: f64,
    ) -> Option<bool> {
        let (owed, _) = self.owed.get_mut(drone)?;
        // One without a time is of no use and will not come again.
        let late = ended < self.listening;
        if !late {
            owed.retain(|other| *other != beacon);
            self.turn_s = time - self.listening;
        }
        if ended.is_finite() {
            self.attendance[drone].delivered();
        }
        Some(!late)
    }

    /// Whether a drone still owes a sweep, awaited or late.
    pub(super) fn owes(&self, drone: usize) -> bool {
        !self.owed_by(drone).is_empty()
    }

    /// Whose sweeps a drone still owes.
    pub(super) fn owed_by(&self, drone: usize) -> &[BeaconId] {
        self.owed.get(drone).map_or(&[], |(owed, _)| owed)
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
}

/// A formation that cannot be flown: its places are none.
fn no_place(_: TrafficError) -> PlanError {
    PlanError::NoPlace
}
