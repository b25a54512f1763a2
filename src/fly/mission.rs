use std::{collections::VecDeque, fmt};

use super::{Ending, FlightRules};
use crate::hunt::{BoxedHunt, Event, FlightStage, drive};
use foxhunt_core::{PatternSource, Station, Waypoint};
use foxhunt_hardware::{Aircraft, AircraftState};

/// A drone that is flown.
#[derive(Debug)]
pub struct FlownDrone<A, S> {
    /// What people call it.
    pub name: String,
    /// What flies.
    pub aircraft: A,
    /// What it listens with.
    pub source: S,
}

/// A flight of real aircraft from the ground to the ground, with a hunt in the middle.
///
/// No aircraft is armed before all of them are ready; an aircraft that the pilot takes is not told
/// anything any more; whatever goes wrong ends with the pilot's rules. It reads no clock and never waits:
/// call [`step`](Self::step) some hundred times a second until it [is over](Self::is_over).
pub struct Mission<A, S> {
    rules: FlightRules,
    hunt: BoxedHunt,
    names: Vec<String>,
    aircraft: Vec<A>,
    sources: Vec<S>,
    /// What was told of each last, and the mode in which each took our orders last.
    told: Vec<Option<AircraftState>>,
    ours: Vec<String>,
    stage: FlightStage,
    since: f64,
    /// By which rule the aircraft leave, and when they were told last.
    ending: Ending,
    ordered: Vec<f64>,
    /// Which have taken the order to leave.
    told_to_leave: Vec<bool>,
    /// Whether take-off waits for a word, and has it.
    waits: bool,
    ready: bool,
    /// Why the flight ended before its time.
    failure: Option<String>,
    events: VecDeque<Event>,
}

impl<A, S> fmt::Debug for Mission<A, S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mission")
            .field("rules", &self.rules)
            .field("drones", &self.aircraft.len())
            .field("stage", &self.stage)
            .field("failure", &self.failure)
            .finish_non_exhaustive()
    }
}

/// How often an order to come back that was not taken is repeated, in seconds.
const ORDER_AGAIN_S: f64 = 2.0;

impl<A: Aircraft, S: PatternSource> Mission<A, S> {
    /// A flight that begins at `time` with aircraft on the ground, each with what it listens with.
    ///
    /// # Errors
    ///
    /// [`MissionError`] when there is none, or a rule is out of its range.
    pub fn new(
        rules: FlightRules,
        hunt: BoxedHunt,
        drones: Vec<FlownDrone<A, S>>,
        time: f64,
    ) -> Result<Self, MissionError> {
        if let Some((field, value)) = rules.out_of_range() {
            return Err(MissionError::Field { field, value });
        }
        if drones.is_empty() {
            return Err(MissionError::Nobody);
        }
        let (mut names, mut aircraft, mut sources) = (Vec::new(), Vec::new(), Vec::new());
        for drone in drones {
            names.push(drone.name);
            aircraft.push(drone.aircraft);
            sources.push(drone.source);
        }
        let mut mission = Self {
            rules,
            hunt,
            told: vec![None; names.len()],
            ours: vec![String::new(); names.len()],
            ordered: vec![f64::NEG_INFINITY; names.len()],
            told_to_leave: vec![false; names.len()],
            names,
            aircraft,
            sources,
            stage: FlightStage::Preparing,
            since: time,
            ending: rules.at_end,
            waits: false,
            ready: false,
            failure: None,
            events: VecDeque::new(),
        };
        mission.enter(time, FlightStage::Preparing, "the log begins".into());
        Ok(mission)
    }

    /// Whether drones that are ready wait for a [word](Self::go) before they take off; they do not
    /// unless told here.
    pub fn wait_for_go(&mut self, waits: bool) {
        self.waits = waits;
    }

    /// Lets them take off.
    pub fn go(&mut self) {
        self.waits = false;
    }

    /// Whether all drones are ready, and wait for the word to take off.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.stage == FlightStage::Preparing && self.ready && self.waits
    }

    /// Does what can be done now.
    pub fn step(&mut self, time: f64) {
        let states = self.look(time);
        match self.stage {
            FlightStage::Preparing => self.prepare(time, &states),
            FlightStage::Climbing => self.climb(time, &states),
            FlightStage::Hunting => self.fly(time, &states),
            FlightStage::Leaving => self.leave(time, &states),
            FlightStage::Over => {}
        }
        while let Some(event) = self.hunt.poll_event() {
            self.events.push_back(event);
        }
    }

    /// Breaks off: the aircraft leave by the pilot's rule for that.
    pub fn abort(&mut self, time: f64, reason: &str) {
        match self.stage {
            FlightStage::Preparing => {
                self.failure = Some(reason.to_owned());
                self.enter(time, FlightStage::Over, reason.to_owned());
            }
            FlightStage::Climbing | FlightStage::Hunting => {
                self.failure = Some(reason.to_owned());
                self.end(time, self.rules.on_abort, reason.to_owned());
            }
            FlightStage::Leaving if self.ending != self.rules.on_abort => {
                self.end(time, self.rules.on_abort, reason.to_owned());
            }
            FlightStage::Leaving | FlightStage::Over => {}
        }
    }

    /// The next thing to be logged, each once.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// What it is about.
    #[must_use]
    pub fn stage(&self) -> FlightStage {
        self.stage
    }

    /// Whether nothing is left to do.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.stage == FlightStage::Over
    }

    /// Why it ended before its time, if it did.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// The hunt.
    #[must_use]
    pub fn hunt(&self) -> &BoxedHunt {
        &self.hunt
    }

    /// Asks every aircraft what it is doing, which serves its link, and tells what has changed;
    /// `None` for those that do not say.
    fn look(&mut self, time: f64) -> Vec<Option<AircraftState>> {
        let mut states = Vec::with_capacity(self.aircraft.len());
        for (drone, aircraft) in self.aircraft.iter_mut().enumerate() {
            let state = match aircraft.state() {
                Ok(state) => state,
                Err(error) => {
                    self.hunt.device_failed(time, Some(drone), error.to_string());
                    states.push(None);
                    continue;
                }
            };
            let same = |told: &AircraftState| {
                told.mode == state.mode
                    && told.hindrance == state.hindrance
                    && (told.armed, told.airborne, told.commanded)
                        == (state.armed, state.airborne, state.commanded)
            };
            if !self.told[drone].as_ref().is_some_and(same) {
                self.events.push_back(Event::Aircraft {
                    time,
                    drone,
                    mode: state.mode.clone(),
                    armed: state.armed,
                    airborne: state.airborne,
                    commanded: state.commanded,
                    hindrance: state.hindrance.clone(),
                });
                self.told[drone] = Some(state.clone());
            }
            if state.commanded {
                self.ours[drone].clone_from(&state.mode);
            }
            states.push(Some(state));
        }
        states
    }

    /// Waits until all are ready, then has all take off.
    fn prepare(&mut self, time: f64, states: &[Option<AircraftState>]) {
        let unready = self.aircraft.iter_mut().zip(states).enumerate().find_map(
            |(drone, (aircraft, state))| {
                let why = match state {
                    None => "its link has failed".to_owned(),
                    Some(state) if state.airborne || state.hindrance.is_empty() => {
                        aircraft.pose().err()?.to_string()
                    }
                    Some(state) => state.hindrance.clone(),
                };
                Some(format!("{} is not ready: {why}", self.names[drone]))
            },
        );
        self.ready = unready.is_none();
        match unready {
            None if self.waits => self.since = time,
            None => self.enter(time, FlightStage::Climbing, "all are ready".into()),
            Some(why) if time - self.since >= self.rules.ready_timeout_s => self.abort(time, &why),
            Some(_) => {}
        }
    }

    /// Has them take off until all are up, and begins the hunt.
    fn climb(&mut self, time: f64, states: &[Option<AircraftState>]) {
        let commanded = |state: &Option<AircraftState>| state.as_ref().is_some_and(|s| s.commanded);
        let mut waiting = None;
        for (drone, state) in states.iter().enumerate() {
            if commanded(state) {
                continue;
            }
            let why = state.as_ref().map_or("its link has failed", |s| s.hindrance.as_str());
            let mut why = format!("{} is not up: {why}", self.names[drone]);
            if time - self.ordered[drone] >= ORDER_AGAIN_S {
                self.ordered[drone] = time;
                let aircraft = &mut self.aircraft[drone];
                // One that is up already, from a flight that was cut short, is taken as it is.
                let taken = if state.as_ref().is_some_and(|state| state.airborne) {
                    aircraft.take_over()
                } else {
                    aircraft.take_off(self.rules.takeoff_up_m)
                };
                if let Err(error) = taken {
                    why = format!("{} does not take off: {error}", self.names[drone]);
                    self.hunt.device_failed(time, Some(drone), why.clone());
                }
            }
            waiting = waiting.or(Some(why));
        }
        match waiting {
            None => self.begin(time),
            Some(why) if time - self.since >= self.rules.climb_timeout_s => self.abort(time, &why),
            Some(_) => {}
        }
    }

    fn begin(&mut self, time: f64) {
        let stations =
            self.aircraft.iter_mut().map(|aircraft| Ok(Station::holding(aircraft.pose()?)));
        let stations: Result<Vec<Station>, A::Error> = stations.collect();
        match stations {
            // They have all been up a moment ago; a place that is missing now comes again.
            Err(_) => {}
            Ok(stations) => match self.hunt.start(time, stations) {
                Ok(()) => self.enter(time, FlightStage::Hunting, "all are up".into()),
                Err(error) => self.abort(time, &error.to_string()),
            },
        }
    }

    /// Lets the hunt go on. An aircraft that has stopped taking our orders is asked to take them again
    /// when it is in the mode in which it took them: its link is back, or the pilot has given it back.
    /// A mode that the pilot has chosen is never changed.
    fn fly(&mut self, time: f64, states: &[Option<AircraftState>]) {
        for (drone, state) in states.iter().enumerate() {
            let Some(state) = state else { continue };
            let lost = state.airborne && !state.commanded && state.mode == self.ours[drone];
            if lost && time - self.ordered[drone] >= ORDER_AGAIN_S {
                self.ordered[drone] = time;
                // What is in the way stands in its state, which was told.
                let _ = self.aircraft[drone].take_over();
            }
        }
        let driven = drive(&mut self.hunt, &mut self.sources, self.aircraft.as_mut_slice(), time);
        if let Err(error) = driven {
            self.abort(time, &error.to_string());
        } else if self.hunt.is_finished() {
            self.end(time, self.rules.at_end, "the hunt is over".into());
        }
    }

    /// Tells all that are in our hands how to come down, until they are: those in the air, and those that
    /// are about to leave the ground. One that does not say what it does is told all the same.
    fn leave(&mut self, time: f64, states: &[Option<AircraftState>]) {
        let mut waited_for = Vec::new();
        for (drone, state) in states.iter().enumerate() {
            let down = state.as_ref().is_some_and(|state| !state.airborne && !state.armed);
            let ours = state.as_ref().is_none_or(|state| self.is_ours(drone, state));
            if self.ending == Ending::Hold && !ours {
                continue;
            }
            if (!down || !self.told_to_leave[drone]) && ours {
                self.order_down(time, drone);
            }
            if !down {
                waited_for.push(self.names[drone].clone());
            }
        }
        if waited_for.is_empty() {
            self.enter(time, FlightStage::Over, "nobody is left to be brought down".into());
        } else if time - self.since >= self.rules.leaving_timeout_s {
            let why = format!("not known to be down: {}", waited_for.join(", "));
            self.failure.get_or_insert_with(|| why.clone());
            self.enter(time, FlightStage::Over, why);
        }
    }

    /// Whether an aircraft is in our hands: it takes our orders, or is in the mode in which it took them
    /// last, or has never been anybody else's. One that is coming down by our order has another mode.
    fn is_ours(&self, drone: usize, state: &AircraftState) -> bool {
        let mode = &self.ours[drone];
        state.commanded || !state.airborne || mode.is_empty() || *mode == state.mode
    }

    fn order_down(&mut self, time: f64, drone: usize) {
        if time - self.ordered[drone] < ORDER_AGAIN_S {
            return;
        }
        self.ordered[drone] = time;
        let aircraft = &mut self.aircraft[drone];
        let taken = match self.ending {
            Ending::Return => aircraft.return_to_launch(),
            Ending::Land => aircraft.land(),
            Ending::Hold if self.told_to_leave[drone] => Ok(()),
            Ending::Hold => aircraft.spin(None).and_then(|()| {
                let position = aircraft.pose()?.position;
                aircraft.go_to(&Waypoint { position })
            }),
        };
        match taken {
            Ok(()) => self.told_to_leave[drone] = true,
            Err(error) => self.hunt.device_failed(time, Some(drone), error.to_string()),
        }
    }

    fn end(&mut self, time: f64, ending: Ending, reason: String) {
        self.ending = ending;
        self.ordered.fill(f64::NEG_INFINITY);
        self.told_to_leave.fill(false);
        self.enter(time, FlightStage::Leaving, reason);
    }

    fn enter(&mut self, time: f64, stage: FlightStage, reason: String) {
        (self.stage, self.since) = (stage, time);
        self.events.push_back(Event::FlightStage { time, stage, reason });
    }
}

/// Why a flight cannot begin.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MissionError {
    /// There is nobody to fly.
    #[error("a flight needs at least one drone")]
    Nobody,
    /// A rule is out of its range.
    #[error("flight.{field} is {value}; it must be a positive number")]
    Field {
        /// Which field.
        field: &'static str,
        /// What it held.
        value: f64,
    },
}
