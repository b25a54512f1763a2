//! The drones of a hunt in flight, and the orders and events that have not been polled yet.

use std::{
    collections::{BTreeSet, VecDeque},
    mem,
};

use foxhunt_core::{BeaconId, PlanError, Pose, Station, SteadyMotion, Target, Waypoint};
use foxhunt_formation::{
    Airspace, Attendance, Duty, Endurance, Traffic, TrafficConfig, TrafficError, Travel,
};
use nalgebra::Vector3;

use super::{Command, Event, HuntConfig, HuntError};

mod homeward;

pub(super) use homeward::Recall;

/// Commands and events of a hunt that have not been polled yet.
#[derive(Debug, Default)]
pub(super) struct Outbox {
    commands: VecDeque<Command>,
    events: VecDeque<Event>,
    /// Failures since the last change of phase, without their numbers, so that one fault makes one
    /// event however old it gets.
    failures: Vec<(Option<usize>, String)>,
}

impl Outbox {
    pub(super) fn order(&mut self, command: Command) {
        self.commands.push_back(command);
    }

    pub(super) fn emit(&mut self, event: Event) {
        if matches!(event, Event::PhaseChanged { .. }) {
            self.failures.clear();
        }
        self.events.push_back(event);
    }

    pub(super) fn failed(&mut self, time: f64, drone: Option<usize>, reason: String) {
        let fault = (drone, without_numbers(&reason));
        if !self.failures.contains(&fault) {
            self.failures.push(fault);
            self.emit(Event::DeviceFailed { time, drone, reason });
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.commands.is_empty() && self.events.is_empty()
    }

    pub(super) fn next_command(&mut self) -> Option<Command> {
        self.commands.pop_front()
    }

    pub(super) fn next_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }
}

/// The drones of a hunt: where they are, who takes part, and how each gets to its goal.
#[derive(Debug)]
pub(super) struct Flight {
    drones: Vec<FlownDrone>,
    traffic: Traffic,
    endurance: Option<Endurance>,
    /// Reason why the formation that was planned last is not flown to.
    unaffordable: Option<String>,
    /// Duration of the last turn, in seconds.
    turn_s: f64,
    /// Time when the present turn began.
    listening: f64,
    returns: bool,
    /// Time when it began; `recalled` is the time since when the drones are on their way home.
    began: f64,
    recalled: Option<f64>,
    /// Time when the duration of the way home was computed last.
    return_checked: f64,
    move_timeout_s: f64,
    flown_m: f64,
}

/// One drone of a flight.
#[derive(Debug)]
struct FlownDrone {
    station: Station,
    attendance: Attendance,
    home: Vector3<f64>,
    /// The duty that was logged last.
    logged_duty: Duty,
    /// The state of its way that was logged last.
    logged_travel: Travel,
    /// The last order that was logged.
    ordered: Option<Vector3<f64>>,
    /// The beacons of which it owes a sweep.
    owed: Vec<BeaconId>,
    /// True if its owed sweeps are waited for.
    awaited: bool,
    /// Order to land, while the drone does not take it.
    landing: Option<LandingRefused>,
}

/// An order to land that a drone does not take.
#[derive(Clone, Copy, Debug)]
struct LandingRefused {
    /// Time of the first refusal, in seconds.
    since: f64,
    /// Time when the order is repeated.
    repeat_at: f64,
}

impl Flight {
    pub(super) fn new(
        config: &HuntConfig,
        time: f64,
        stations: Vec<Station>,
        rooted: &BTreeSet<usize>,
    ) -> Result<Self, HuntError> {
        let starts: Vec<Vector3<f64>> = stations.iter().map(|s| s.pose.position).collect();
        let traffic = TrafficConfig {
            separation_m: config.separation_m,
            // Half of it is for arriving.
            tolerance_m: 2.0 * config.arrival_tolerance_m,
            stopping_m: config.stopping_m,
            void: config.void,
        };
        let airspace = Airspace::new(&config.airspace)?;
        let is_rooted = |drone: usize| rooted.contains(&drone);
        let traffic = Traffic::with_rooted(&airspace, traffic, &starts, is_rooted)?;
        let homes = traffic.homes(&starts);
        let drone = |(station, home): (Station, Vector3<f64>)| FlownDrone {
            attendance: Attendance::new(config.attendance, time, station.pose.position),
            station,
            home,
            logged_duty: Duty::Formation,
            logged_travel: Travel::There,
            ordered: None,
            owed: Vec::new(),
            awaited: false,
            landing: None,
        };
        let mut drones: Vec<FlownDrone> = stations.into_iter().zip(homes).map(drone).collect();
        for (index, drone) in drones.iter_mut().enumerate() {
            drone.attendance.set_rooted(is_rooted(index));
        }
        Ok(Self {
            drones,
            traffic,
            endurance: config
                .endurance
                .map(Endurance::new)
                .transpose()
                .map_err(|error| error.within("endurance"))?,
            unaffordable: None,
            turn_s: 0.0,
            listening: time,
            returns: config.return_home || config.endurance.is_some(),
            began: time,
            recalled: None,
            return_checked: time,
            move_timeout_s: config.move_timeout_s,
            flown_m: 0.0,
        })
    }

    pub(super) fn drone_count(&self) -> usize {
        self.drones.len()
    }

    pub(super) fn stations(&self) -> Vec<Station> {
        self.drones.iter().map(|drone| drone.station).collect()
    }

    pub(super) fn homes(&self) -> Vec<Vector3<f64>> {
        self.drones.iter().map(|drone| drone.home).collect()
    }

    /// Goes on with a flight that began at `began`, from where it had come.
    pub(super) fn continue_from(&mut self, began: f64, homes: &[Vector3<f64>]) {
        self.began = began;
        if homes.len() == self.drones.len() {
            for (drone, home) in self.drones.iter_mut().zip(self.traffic.homes(homes)) {
                drone.home = home;
            }
        }
    }

    pub(super) fn set_flown_m(&mut self, flown_m: f64) {
        self.flown_m = flown_m;
    }

    /// Returns the distance that all drones have flown together, in metres, between the places that
    /// were reported.
    pub(super) fn flown_m(&self) -> f64 {
        self.flown_m
    }

    /// Returns true if the drones fly home when all is done.
    pub(super) fn returns(&self) -> bool {
        self.returns
    }

    pub(super) fn located(&mut self, time: f64, drone: usize, pose: Pose) {
        let Some(located) = self.drones.get_mut(drone) else { return };
        self.flown_m += (pose.position - located.station.pose.position).norm();
        located.station.pose = pose;
        self.traffic.locate(drone, &pose.position);
        let under_way = self.traffic.status(drone) == Travel::UnderWay;
        located.attendance.located(time, pose.position, under_way);
    }

    /// Sets whether a drone takes orders. Nothing is expected of a drone that does not, not even
    /// what it received before.
    pub(super) fn set_away(&mut self, drone: usize, away: bool) {
        let Some(drone) = self.drones.get_mut(drone) else { return };
        drone.attendance.set_away(away);
        if away {
            (drone.owed, drone.awaited) = (Vec::new(), false);
        }
    }

    /// Sets whether a drone never goes anywhere.
    pub(super) fn set_rooted(&mut self, drone: usize, rooted: bool) {
        if let Some(drone) = self.drones.get_mut(drone) {
            drone.attendance.set_rooted(rooted);
        }
    }

    /// The drones that go anywhere, or all where none does: a station, which takes orders and knows
    /// its place for ever, keeps no hunt alive.
    fn movers(&self) -> impl Iterator<Item = &FlownDrone> {
        let all_rooted = self.drones.iter().all(|drone| drone.attendance.is_rooted());
        self.drones.iter().filter(move |drone| all_rooted || !drone.attendance.is_rooted())
    }

    /// Returns true if no drone takes orders that goes anywhere.
    pub(super) fn is_deserted(&self) -> bool {
        self.movers().all(|drone| drone.attendance.is_away())
    }

    /// Takes note that a drone did not take its order, which is repeated.
    pub(super) fn not_sent(&mut self, drone: usize) {
        // Only a drone that does not exist is an error, and that has no order.
        let _ = self.traffic.repeat(drone);
    }

    /// Lets time pass: sends drones that may fly on, and logs drones that drop out or come back.
    pub(super) fn pass(&mut self, time: f64, outbox: &mut Outbox) {
        for drone in &mut self.drones {
            drone.attendance.pass(time);
        }
        if self.recalled.is_some() {
            self.land_those_at_home(time, outbox);
        }
        for order in self.traffic.step() {
            let to = order.to;
            let Some(drone) = self.drones.get_mut(order.drone) else { continue };
            if drone.ordered.replace(to) != Some(to) {
                outbox.emit(Event::Sent { time, drone: order.drone, to, reason: order.reason });
            }
            outbox.order(Command::GoTo { drone: order.drone, goal: Waypoint { position: to } });
        }
        for (index, drone) in self.drones.iter_mut().enumerate() {
            let duty = drone.attendance.duty();
            if mem::replace(&mut drone.logged_duty, duty) != duty {
                outbox.emit(Event::DutyChanged { time, drone: index, duty });
                if matches!(duty, Duty::Still | Duty::Lost | Duty::Away) {
                    // Nobody waits for it to make way any longer.
                    let _ = self.traffic.hold(index);
                    let _ = self.traffic.give_up(index);
                }
            }
            // Drones of a formation may have exchanged their goals.
            if let Some(position) = self.traffic.goal(index) {
                drone.station.goal = Waypoint { position };
            }
            let travel = self.traffic.status(index);
            let before = mem::replace(&mut drone.logged_travel, travel);
            let reason = match travel {
                Travel::Waiting => "others are in its way",
                Travel::Blocked => "there is no permitted way to its goal",
                _ => continue,
            };
            if before != travel {
                outbox.emit(Event::Held { time, drone: index, reason: reason.to_owned() });
            }
        }
    }

    /// Returns the drones that take a place in the formation: drones in formation, else still or
    /// silent drones, else the lost ones.
    fn placed(&self) -> Vec<usize> {
        let ranks: [&[Duty]; 3] = [&[Duty::Formation], &[Duty::Still, Duty::Silent], &[Duty::Lost]];
        let of = |rank: &[Duty]| -> Vec<usize> {
            let drones = self.drones.iter().enumerate();
            let on_duty = drones.filter(|(_, drone)| rank.contains(&drone.attendance.duty()));
            on_duty.map(|(index, _)| index).collect()
        };
        ranks.into_iter().map(of).find(|placed| !placed.is_empty()).unwrap_or_default()
    }

    /// Has `plan` set the goals of the drones that take part, turns the goals into places that may
    /// be flown to, and sends each drone to one of them. On an error the drones' goals stay.
    pub(super) fn form<T>(
        &mut self,
        time: f64,
        targets: &[Target<'_>],
        outbox: &mut Outbox,
        plan: impl FnOnce(&mut [Station], &mut Outbox) -> Result<T, PlanError>,
    ) -> Result<T, PlanError> {
        for drone in &mut self.drones {
            drone.attendance.give_another_chance(time);
        }
        let drones = self.placed();
        let mut stations: Vec<Station> =
            drones.iter().map(|drone| self.drones[*drone].station).collect();
        let planned = plan(&mut stations, outbox)?;
        let places: Vec<Vector3<f64>> = stations.iter().map(|s| s.goal.position).collect();
        if let Some(bad) = places.iter().find(|place| !place.iter().all(|c| c.is_finite())) {
            return Err(PlanError::NotFinite { east: bad.x, north: bad.y });
        }
        let homes = self.homes();
        self.traffic.believe(targets.iter().map(|target| target.belief));
        // Every drone exists and every place is finite.
        let formation = self.traffic.form(&drones, &places).map_err(no_place)?;
        let elapsed = time - self.began;
        self.unaffordable = self.endurance.as_ref().and_then(|endurance| {
            let left_s = endurance.left_s(elapsed);
            // Where there is no way for one of them it will stay, and the way home of all is
            // computed again and again.
            let needed_s = endurance.round_s(&self.traffic, &formation, &homes, self.turn_s)?;
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
            self.drones[drone].station.goal = Waypoint { position };
        }
        let goals = self.drones.iter().map(|drone| drone.station.goal.position).collect();
        outbox.emit(Event::GoalsSet { time, goals });
        for moved in formation.moved {
            outbox.emit(Event::GoalMoved {
                time,
                drone: moved.drone,
                wanted: moved.wanted,
                goal: moved.goal,
                reason: moved.reason,
            });
        }
        Ok(planned)
    }

    /// Returns true if every drone is where it is to listen, as far as it will get there.
    pub(super) fn is_formed(&self) -> bool {
        let settled = |(index, drone): (usize, &FlownDrone)| {
            drone.attendance.is_astray()
                || matches!(self.traffic.status(index), Travel::There | Travel::Blocked)
        };
        self.drones.iter().enumerate().all(settled)
    }

    /// Has every drone in the air turn its antenna, also drones that deliver nothing.
    pub(super) fn listen(&mut self, time: f64, beacons: &[BeaconId], outbox: &mut Outbox) {
        self.listening = time;
        let counts =
            |drone: &FlownDrone| matches!(drone.attendance.duty(), Duty::Formation | Duty::Still);
        let some_count = self.drones.iter().any(counts);
        for (index, drone) in self.drones.iter_mut().enumerate() {
            if matches!(drone.attendance.duty(), Duty::Away | Duty::Returning | Duty::Landed) {
                continue;
            }
            drone.owed = beacons.to_vec();
            drone.awaited = counts(drone) || !some_count;
            outbox.order(Command::Listen { drone: index, beacons: beacons.to_vec() });
        }
    }

    /// Takes note of what a drone has delivered of a turn that ended at `ended`, and returns
    /// whether it is of the last turn and not of an earlier one; `None` where there is no such
    /// drone, or it takes no orders.
    pub(super) fn delivered(
        &mut self,
        time: f64,
        drone: usize,
        beacon: BeaconId,
        ended: f64,
    ) -> Option<bool> {
        let drone = self.drones.get_mut(drone).filter(|drone| !drone.attendance.is_away())?;
        // One without a time is of no use and will not come again.
        let late = ended < self.listening;
        if !late {
            drone.owed.retain(|other| *other != beacon);
            self.turn_s = time - self.listening;
        }
        if ended.is_finite() {
            drone.attendance.delivered();
        }
        Some(!late)
    }

    /// Returns the beacons of which a drone still owes a sweep, awaited or late.
    pub(super) fn owed_by(&self, drone: usize) -> &[BeaconId] {
        self.drones.get(drone).map_or(&[], |drone| &drone.owed)
    }

    /// Returns true if a sweep is waited for.
    pub(super) fn is_waiting(&self) -> bool {
        self.drones.iter().any(|drone| drone.awaited && !drone.owed.is_empty())
    }

    /// Returns true if every sweep that is owed is waited for.
    pub(super) fn waits_for_all(&self) -> bool {
        self.drones.iter().all(|drone| drone.awaited || drone.owed.is_empty())
    }

    /// The next time at which [`pass`](Self::pass), an arrival or the way home can change anything
    /// while every drone is located and goes on as it does at `time`; `None` where that is not
    /// known, or they are on their way home.
    pub(super) fn next_event(&self, time: f64, motions: &[SteadyMotion]) -> Option<f64> {
        if self.recalled.is_some() || self.is_deserted() || motions.len() != self.drones.len() {
            return None;
        }
        let going: Vec<_> = (self.drones.iter().zip(motions))
            .map(|(drone, motion)| (drone.station.pose.position, motion.velocity))
            .collect();
        let mut event = time + self.traffic.undisturbed_s(&going)?;
        for (index, (drone, motion)) in self.drones.iter().zip(motions).enumerate() {
            let under_way = self.traffic.status(index) == Travel::UnderWay;
            event = event.min(motion.until).min(drone.attendance.next_event(under_way)?);
        }
        Some(self.endurance.as_ref().map_or(event, |_| event.min(self.return_check_at())))
    }

    /// Stops waiting for owed sweeps; late sweeps are used.
    pub(super) fn give_up_turns(&mut self, time: f64, waited_s: f64, outbox: &mut Outbox) {
        for (index, drone) in self.drones.iter_mut().enumerate() {
            if mem::take(&mut drone.awaited) && !drone.owed.is_empty() {
                drone.attendance.missed();
                outbox.emit(Event::Missing { time, drone: index, waited_s });
            }
        }
    }
}

fn without_numbers(text: &str) -> String {
    text.chars().filter(|letter| !letter.is_ascii_digit()).collect()
}

/// Converts the error of a formation that cannot be flown to [`PlanError::NoPlace`].
fn no_place(_: TrafficError) -> PlanError {
    PlanError::NoPlace
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_station_on_a_mast_takes_part_and_keeps_no_hunt_alive() {
        let mut config = HuntConfig::default();
        config.airspace.altitude_m = Some([1.5, 1.5]);
        let mast = Pose::at(50.0, 0.0, 30.0);
        let stations = || vec![Station::holding(mast), Station::holding(Pose::at(0.0, 0.0, 1.5))];
        assert!(Flight::new(&config, 0.0, stations(), &BTreeSet::new()).is_err(), "too high");
        let mut flight =
            Flight::new(&config, 0.0, stations(), &BTreeSet::from([0])).expect("it is rooted");
        let late = config.move_timeout_s;
        flight.located(late, 0, mast);
        let recall = flight.must_return(late).expect("the walker is lost");
        assert_eq!(recall.reason, "no drone has reported its place for 120 s");
        assert!(!flight.is_deserted());
        flight.set_away(1, true);
        assert!(flight.is_deserted());
        // A hunt of stations alone goes on.
        flight.set_rooted(1, true);
        assert!(!flight.is_deserted() && flight.must_return(late).is_none());
    }
}
