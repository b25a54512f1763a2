//! Resumption from its log of a hunt that was broken off.

use foxhunt_core::{BeaconId, Correction, Estimate, Reception, Station};
use foxhunt_formation::{Phase, PhaseError, Signal};
use nalgebra::Vector3;

use super::{Event, Fix, Flight, Hunt, HuntError, SearchState, SearchedTarget, TrackStep};

impl Hunt {
    /// Goes on where the log of the same hunt breaks off, instead of [`start`](Self::start).
    ///
    /// The receptions of the log are fused again, so that every estimate is the same to the bit,
    /// and [never after that](Self::has_fused). Fixes stay. The planner observes all that was used,
    /// and restarts around what is believed of the first beacon that is not done; orders to land
    /// are repeated. `homes` is where the drones began; where they stand now, unless there is one
    /// for each. `events` are not emitted again: what follows belongs behind them in the log.
    ///
    /// # Errors
    ///
    /// The errors of [`start`](Self::start), and [`HuntError::OtherHunt`]; the hunt has not begun
    /// then.
    pub fn resume(
        &mut self,
        time: f64,
        stations: Vec<Station>,
        homes: &[Vector3<f64>],
        events: &[Event],
    ) -> Result<(), HuntError> {
        let began = events.iter().find_map(|event| match event {
            Event::BeaconStarted { time, .. } => Some(*time),
            _ => None,
        });
        let Some(began) = began else { return self.start(time, stations) };
        if stations.is_empty() {
            return Err(HuntError::Nothing { missing: "drone" });
        }
        let phase = self.phases.phase();
        if phase != Phase::Idle {
            return Err(PhaseError { phase, signal: Signal::Begin }.into());
        }
        let mut flight = Flight::new(&self.config, time, stations, &self.rooted)?;
        flight.continue_from(began, homes);
        self.flight = Some(flight);
        self.replay(events).and_then(|()| self.go_on(time, events)).inspect_err(|_| self.reset())
    }

    /// Makes of the log what was believed and found when it broke off.
    fn replay(&mut self, events: &[Event]) -> Result<(), HuntError> {
        // The planner forms up as it did; where is decided afterwards.
        let mut stations = self.stations();
        // One that cannot fails again when the hunt goes on.
        let _ = self.planner.begin(&mut stations);
        let mut places = self.flight.as_ref().map_or_else(Vec::new, Flight::homes);
        let mut flown_m = 0.0;
        let mut listening = None;
        for event in events {
            match event {
                Event::BeaconStarted { time, beacon, name, prior, hunt_prior } => {
                    let prior = hunt_prior.as_ref().unwrap_or(prior);
                    self.search_again(usize::from(beacon.0), name, prior, *time, flown_m)?;
                }
                Event::Resumed { .. } => listening = None,
                Event::PhaseChanged { time, phase } => {
                    let measuring = matches!(phase, Phase::Measuring(_));
                    if listening.is_some() && !measuring {
                        self.count_position(*time, flown_m);
                    }
                    listening = measuring.then_some(*time);
                }
                Event::Received { drone, first_position, reception, .. } => {
                    if let Some(place) = places.get_mut(*drone) {
                        flown_m += (reception.receiver.position - *place).norm();
                        *place = reception.receiver.position;
                    }
                    let in_time = listening.is_some_and(|since| reception.time >= since);
                    self.fuse_again(*drone, reception, *first_position, in_time);
                }
                Event::BeaconFinished { fix, .. } => self.found_before(fix),
                _ => {}
            }
        }
        if let Some(flight) = &mut self.flight {
            flight.set_flown_m(flown_m);
        }
        Ok(())
    }

    /// Flies on from what was believed and found.
    fn go_on(&mut self, time: f64, events: &[Event]) -> Result<(), HuntError> {
        self.outbox.emit(Event::Resumed { time });
        for event in events {
            if let Event::Landed { drone, .. } = event
                && let Some(flight) = &mut self.flight
            {
                flight.land_again(*drone, &mut self.outbox);
            }
        }
        if !self.all_found() {
            return self.begin_beacon(time);
        }
        if let Some(fix) = self.fixes.last() {
            self.phases.signal(Signal::Begin)?;
            self.phases.signal(Signal::GivenUp(fix.outcome))?;
        }
        if let Some(flight) = self.flight.as_mut().filter(|flight| flight.returns()) {
            flight.go_home(time, "every beacon is done".to_owned(), &mut self.outbox);
        }
        Ok(())
    }

    fn search_again(
        &mut self,
        index: usize,
        name: &str,
        prior: &Estimate<2>,
        began: f64,
        flown_before_m: f64,
    ) -> Result<(), HuntError> {
        if index == self.targets.len() && u16::try_from(index + 1).is_ok() {
            self.targets.push(SearchedTarget::waiting(name.to_owned()));
        }
        let expected = self.targets.get(index).map(|target| target.name.as_str());
        if expected != Some(name) {
            let expected = expected.unwrap_or_default().to_owned();
            return Err(HuntError::OtherHunt { beacon: index, logged: name.to_owned(), expected });
        }
        let search = self.new_search(index, prior, began, flown_before_m)?;
        self.targets[index].state = SearchState::Active(Box::new(search));
        Ok(())
    }

    fn fuse_again(
        &mut self,
        drone: usize,
        reception: &Reception,
        first_position: bool,
        in_time: bool,
    ) {
        let BeaconId(index) = reception.beacon;
        self.fused.insert((drone, reception.beacon, reception.time.to_bits()));
        let Some(search) =
            self.targets.get_mut(usize::from(index)).and_then(SearchedTarget::search_mut)
        else {
            return;
        };
        // What was refused is refused again.
        let step = search.track.heard_by(drone).update(reception, first_position);
        if let Ok(TrackStep::Updated { correction, .. }) = step {
            search.received += u32::from(in_time && correction != Correction::Empty);
            self.planner.observe(reception);
        }
    }

    /// A formation position was over.
    fn count_position(&mut self, time: f64, flown_m: f64) {
        for search in self.targets.iter_mut().filter_map(SearchedTarget::search_mut) {
            if std::mem::take(&mut search.received) == 0 {
                continue;
            }
            search.measured += 1;
            let progress = search.progress(time, flown_m);
            // The rules that look back need what they saw; whether the search ended is in the log.
            let _ = search.watch.check(&progress);
        }
    }

    fn found_before(&mut self, fix: &Fix) {
        if let Some(target) = self.targets.get_mut(usize::from(fix.beacon.0))
            && !target.is_done()
        {
            target.state = SearchState::Done;
            self.fixes.push(fix.clone());
        }
    }
}
