//! The course of a hunt from one formation position, and one beacon, to the next.

use foxhunt_core::{
    BeaconId, BearingExtractor, BeliefOf, Decision, Estimate, Estimator, EstimatorError,
    FormationPlanner, Observation, ObservationError, Outcome, PlanError, Reception, Stage, Station,
    Target,
};
use foxhunt_formation::{Phase, PhaseError, Progress, Signal, StopWatch};

use super::{
    Event, Fix, Flight, Hunt, HuntError, Track,
    cloud::cloud,
    machine::beacon_id,
    search::{Quarry, Search, Stand},
};

impl<X, P, F, E, const N: usize, const M: usize> Hunt<X, P, F, E, N, M>
where
    X: BearingExtractor,
    P: FormationPlanner,
    F: FnMut(&Estimate<2>) -> Result<E, EstimatorError>,
    E: Estimator<N, M>,
    Observation<M>: for<'a> TryFrom<&'a Reception, Error = ObservationError>,
{
    /// Takes in a beacon that has shown up: it is listened for from the next turn on where turns
    /// are shared, and otherwise has its turn after those before it.
    ///
    /// # Errors
    ///
    /// When the hunt is over, there is no room for another number, or no estimator.
    pub fn take_in(&mut self, time: f64, name: String) -> Result<BeaconId, HuntError> {
        let phase = self.phases.phase();
        if self.all_found() {
            return Err(PhaseError { phase, signal: Signal::Begin }.into());
        }
        let index = self.beacons.len();
        if u16::try_from(index + 1).is_err() {
            return Err(HuntError::Nothing { missing: "number that is free for another beacon" });
        }
        self.beacons.push(Quarry::waiting(name));
        if self.config.shared_turns && phase != Phase::Idle {
            let begun = self.begin_search(time, index);
            begun.inspect_err(|_| self.beacons.truncate(index))?;
        }
        Ok(beacon_id(index))
    }

    /// Turns to the first beacon that is not done.
    pub(super) fn begin_beacon(&mut self, time: f64) -> Result<(), HuntError> {
        let Some(next) = self.beacons.iter().position(|quarry| !quarry.is_done()) else {
            return Ok(());
        };
        self.current = next;
        for beacon in self.asked() {
            self.begin_search(time, usize::from(beacon.0))?;
        }
        let planned = self.plan(time, |planner, targets, stations| match targets {
            // Nothing was heard of it yet.
            [] => planner.begin(stations),
            [target, ..] => planner.resume(target.belief, stations),
        });
        if let Err(source) = planned {
            let beacon = self.beacons[next].name.clone();
            if self.fixes.is_empty() {
                return Err(HuntError::Plan { beacon, source });
            }
            self.signal(time, Signal::Begin)?;
            return self.give_up(time, Outcome::NoPlan, source.to_string());
        }
        self.signal(time, Signal::Begin)?;
        self.recalled_for_cost(time)?;
        Ok(())
    }

    /// Recalls everyone if the formation that was just planned cannot be afforded.
    fn recalled_for_cost(&mut self, time: f64) -> Result<bool, HuntError> {
        let recall = self.flight.as_mut().and_then(Flight::cannot_afford);
        let recalled = recall.is_some();
        if let Some(recall) = recall {
            self.recall(time, recall)?;
        }
        Ok(recalled)
    }

    /// Makes a belief of a beacon, unless there is one.
    fn begin_search(&mut self, time: f64, index: usize) -> Result<(), HuntError> {
        if !matches!(self.beacons[index].stand, Stand::Waiting) {
            return Ok(());
        }
        let (prior, name) = (self.prior(), self.beacons[index].name.clone());
        let estimator = (self.estimators)(&prior)
            .map_err(|source| HuntError::Estimator { beacon: name.clone(), source })?;
        self.beacons[index].stand = Stand::Searched(Box::new(Search {
            track: Track::new(estimator, self.track_config),
            measured: 0,
            heard: 0,
            put_off: 0,
            watch: StopWatch::new(self.config.stop),
            began: (time, self.flight.as_ref().map_or(0.0, Flight::flown_m)),
        }));
        self.outbox.tell(Event::BeaconStarted { time, beacon: beacon_id(index), name, prior });
        Ok(())
    }

    /// Every drone of the present formation position was heard or given up.
    pub(super) fn position_done(&mut self, time: f64) -> Result<(), HuntError> {
        let heard_now = |quarry: &Quarry<E, N, M>| quarry.search().is_some_and(|s| s.heard > 0);
        let heard: Vec<bool> = self.beacons.iter().map(heard_now).collect();
        for search in self.beacons.iter_mut().filter_map(Quarry::search_mut) {
            search.measured += u32::from(std::mem::take(&mut search.heard) > 0);
        }
        self.stop_by_rule(time, &heard)?;
        if self.beacons[self.current].is_done() {
            return self.next_beacon(time);
        }
        if !heard[self.current] {
            let open = |index: &usize| heard[*index] && !self.beacons[*index].is_done();
            return match (0..heard.len()).find(open) {
                Some(other) => self.put_off(time, other),
                None => self.heard_nothing(time),
            };
        }
        let decided =
            self.plan(time, |planner, targets, stations| planner.plan_together(targets, stations));
        self.decided(time, decided)
    }

    /// Listens once more where nothing was heard, or gives the present beacon up: the planner would
    /// take an estimate that did not move for one that has settled.
    fn heard_nothing(&mut self, time: f64) -> Result<(), HuntError> {
        self.attempts += 1;
        if self.attempts < self.config.attempts {
            self.listen(time);
            return Ok(());
        }
        let reason = format!("it was listened for {} times in vain", self.attempts);
        self.give_up_unheard(time, reason)
    }

    /// Goes on with another beacon that was heard where the present one was not, and comes back to
    /// this one; it is given up when that has happened too often, so that every hunt ends.
    fn put_off(&mut self, time: f64, other: usize) -> Result<(), HuntError> {
        if let Some(search) = self.beacons[self.current].search_mut() {
            search.put_off += 1;
            if search.put_off >= self.config.attempts {
                let reason = format!("others were heard without it {} times", search.put_off);
                return self.give_up_unheard(time, reason);
            }
        }
        self.current = other;
        let decided = self.plan(time, |planner, targets, stations| match targets {
            [] => Err(PlanError::NoPlace),
            [target, ..] => planner.resume(target.belief, stations),
        });
        self.decided(time, decided.map(|()| Decision::Listen(Stage::Searching)))
    }

    fn give_up_unheard(&mut self, time: f64, reason: String) -> Result<(), HuntError> {
        let before = self.beacons[self.current].search().is_some_and(|s| s.measured > 0);
        let outcome = if before { Outcome::SignalLost } else { Outcome::NothingHeard };
        self.give_up(time, outcome, reason)
    }

    /// Ends the searches whose time or path is used up, wherever the drones are.
    pub(super) fn stop_by_budget(&mut self, time: f64) -> Result<(), HuntError> {
        let flown_m = self.flight.as_ref().map_or(0.0, Flight::flown_m);
        for index in 0..self.beacons.len() {
            let Some(search) = self.beacons[index].search() else { continue };
            let (time_s, path_m) = (time - search.began.0, flown_m - search.began.1);
            let Some(stop) = self.config.stop.budget(time_s, path_m) else { continue };
            if index == self.current {
                return self.give_up(time, stop.outcome, stop.to_string());
            }
            let (beacon, outcome, reason) = (beacon_id(index), stop.outcome, stop.to_string());
            self.outbox.tell(Event::Stopped { time, beacon, outcome, reason });
            self.close(time, index, outcome);
        }
        Ok(())
    }

    /// Ends the searches that a rule of the configuration ends, among those that were heard.
    fn stop_by_rule(&mut self, time: f64, heard: &[bool]) -> Result<(), HuntError> {
        let flown_m = self.flight.as_ref().map_or(0.0, Flight::flown_m);
        for index in (0..heard.len()).filter(|index| heard[*index]) {
            let Some(search) = self.beacons[index].search_mut() else { continue };
            let progress = Progress {
                time_s: time - search.began.0,
                path_m: flown_m - search.began.1,
                positions: search.measured,
                estimate: search.track.position(),
            };
            if let Some(stop) = search.watch.check(&progress) {
                let (beacon, outcome, reason) = (beacon_id(index), stop.outcome, stop.to_string());
                self.outbox.tell(Event::Stopped { time, beacon, outcome, reason });
                if index == self.current {
                    self.signal(time, Signal::Decided(Decision::Finish(outcome)))?;
                }
                self.close(time, index, outcome);
            }
        }
        Ok(())
    }

    /// Asks the planner with what is believed of the present beacon and then of the others of a
    /// shared turn, none where nothing was heard yet, and sends the drones.
    fn plan<T>(
        &mut self,
        time: f64,
        ask: impl FnOnce(&mut P, &[Target<'_>], &mut [Station]) -> Result<T, PlanError>,
    ) -> Result<T, PlanError> {
        let Some(flight) = &mut self.flight else { return Err(PlanError::NoPlace) };
        let others = (0..self.beacons.len()).filter(|index| *index != self.current);
        let searched = |index: usize| Some((index, self.beacons[index].search()?));
        let current = searched(self.current).filter(|(_, search)| search.track.steps() > 0);
        let others = others.filter_map(searched).filter(|_| current.is_some());
        let beliefs: Vec<_> = current
            .into_iter()
            .chain(others)
            .map(|(index, search)| (beacon_id(index), BeliefOf(search.track.estimator())))
            .collect();
        let targets: Vec<_> =
            beliefs.iter().map(|(beacon, belief)| Target { beacon: *beacon, belief }).collect();
        let (planner, outbox) = (&mut self.planner, &mut self.outbox);
        flight.form(time, &targets, outbox, |stations, outbox| {
            let decision = ask(planner, &targets, stations)?;
            let mut reason = String::new();
            if planner.explain(&mut reason).is_ok() && !reason.is_empty() {
                outbox.tell(Event::Planned { time, beacon: beacon_id(self.current), reason });
            }
            Ok(decision)
        })
    }

    /// Does what the planner decided.
    fn decided(
        &mut self,
        time: f64,
        decision: Result<Decision, PlanError>,
    ) -> Result<(), HuntError> {
        let decision = match decision {
            Ok(decision) => decision,
            Err(error) => return self.give_up(time, Outcome::NoPlan, error.to_string()),
        };
        if matches!(decision, Decision::Listen(_)) && self.recalled_for_cost(time)? {
            return Ok(());
        }
        self.signal(time, Signal::Decided(decision))?;
        if let Phase::Finished(outcome) = self.phases.phase() {
            self.close(time, self.current, outcome);
            return self.next_beacon(time);
        }
        Ok(())
    }

    /// Ends the search for the present beacon for a reason that the planner does not know.
    fn give_up(&mut self, time: f64, outcome: Outcome, reason: String) -> Result<(), HuntError> {
        let beacon = beacon_id(self.current);
        self.outbox.tell(Event::Stopped { time, beacon, outcome, reason });
        self.signal(time, Signal::GivenUp(outcome))?;
        self.close(time, self.current, outcome);
        self.next_beacon(time)
    }

    /// Ends all searches, those that have not begun included, and sends the drones home.
    pub(super) fn recall(&mut self, time: f64, reason: Recall) -> Result<(), HuntError> {
        let Recall { outcome, reason } = reason;
        if !matches!(self.phases.phase(), Phase::Idle | Phase::Finished(_)) {
            self.signal(time, Signal::GivenUp(outcome))?;
        }
        if let Some(flight) = &mut self.flight {
            flight.go_home(time, reason.clone(), &mut self.outbox);
        }
        for index in 0..self.beacons.len() {
            if !self.beacons[index].is_done() {
                self.begin_search(time, index)?;
                let (beacon, reason) = (beacon_id(index), reason.clone());
                self.outbox.tell(Event::Stopped { time, beacon, outcome, reason });
                self.close(time, index, outcome);
            }
        }
        Ok(())
    }

    /// Makes a fix of what is believed of a beacon.
    fn close(&mut self, time: f64, index: usize, outcome: Outcome) {
        let quarry = &mut self.beacons[index];
        let Stand::Searched(search) = std::mem::replace(&mut quarry.stand, Stand::Done) else {
            return;
        };
        let fix = Fix {
            beacon: beacon_id(index),
            name: quarry.name.clone(),
            estimate: search.track.position(),
            steps: search.track.steps(),
            formation_positions: search.measured,
            outcome,
        };
        if let Some(places) = cloud(&BeliefOf(search.track.estimator())) {
            self.outbox.tell(Event::Cloud { time, beacon: fix.beacon, places });
        }
        self.outbox.tell(Event::BeaconFinished { time, fix: fix.clone() });
        self.fixes.push(fix);
    }

    /// Goes on with the next beacon, or home after the last.
    fn next_beacon(&mut self, time: f64) -> Result<(), HuntError> {
        if !self.all_found() {
            return self.begin_beacon(time);
        }
        if let Some(flight) = self.flight.as_mut().filter(|flight| flight.returns()) {
            flight.go_home(time, "every beacon is done".to_owned(), &mut self.outbox);
        }
        Ok(())
    }
}

/// Why all searches end.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Recall {
    pub(super) outcome: Outcome,
    pub(super) reason: String,
}
