//! How a hunt that was broken off goes on from its log.

use foxhunt_core::{
    BeaconId, BearingExtractor, Correction, Estimate, Estimator, EstimatorError, FormationPlanner,
    Observation, ObservationError, Reception, Station,
};
use foxhunt_formation::{Phase, PhaseError, Progress, Signal, StopWatch};
use nalgebra::Vector3;

use super::{
    Command, Event, Fix, Flight, Heard, Hunt, HuntError, Track,
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
    /// Goes on where the log of the same hunt breaks off, instead of [`start`](Self::start).
    ///
    /// What was heard is heard again, so that every estimate is the same to the bit, and is
    /// [taken in](Self::reception) no more. Fixes stay. The planner is told all that was used, and begins anew
    /// around what is believed of the first beacon that is not done; drones that were told to land
    /// are told again. `homes` is where the drones began; where they stand now, unless there is one
    /// for each. `events` are not told again: what follows belongs behind them in the log.
    ///
    /// # Errors
    ///
    /// Those of [`start`](Self::start), and [`HuntError::OtherHunt`]; the hunt has not begun then.
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
        let mut flight = Flight::new(&self.config, time, stations)?;
        flight.began = began;
        if homes.len() == flight.stations.len() {
            flight.homes = flight.traffic.homes(homes);
        }
        self.flight = Some(flight);
        self.relive(events).and_then(|()| self.go_on(time, events)).inspect_err(|_| self.reset())
    }

    /// Makes of the log what was believed and found when it broke off.
    fn relive(&mut self, events: &[Event]) -> Result<(), HuntError> {
        // The planner forms up as it did; where is decided afterwards.
        let mut stations = self.stations().to_vec();
        // One that cannot says so again when it is asked in earnest.
        let _ = self.planner.begin(&mut stations);
        let mut places = self.flight.as_ref().map_or(Vec::new(), |flight| flight.homes.clone());
        let mut flown_m = 0.0;
        let mut listening = None;
        for event in events {
            match event {
                Event::BeaconStarted { time, beacon, name, prior } => {
                    self.search_again(usize::from(beacon.0), name, prior, (*time, flown_m))?;
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
                    self.hear_again(*drone, reception, *first_position, in_time);
                }
                Event::BeaconFinished { fix, .. } => self.found_before(fix),
                _ => {}
            }
        }
        if let Some(flight) = &mut self.flight {
            flight.flown_m = flown_m;
        }
        Ok(())
    }

    /// Flies on from what was believed and found.
    fn go_on(&mut self, time: f64, events: &[Event]) -> Result<(), HuntError> {
        self.outbox.tell(Event::Resumed { time });
        for event in events {
            if let Event::Landed { drone, .. } = event {
                self.land_again(*drone);
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

    fn land_again(&mut self, drone: usize) {
        if let Some(attendance) = self.flight.as_mut().and_then(|f| f.attendance.get_mut(drone)) {
            attendance.landed();
            self.outbox.order(Command::Land { drone });
        }
    }

    fn search_again(
        &mut self,
        index: usize,
        name: &str,
        prior: &Estimate<2>,
        began: (f64, f64),
    ) -> Result<(), HuntError> {
        if index == self.beacons.len() && u16::try_from(index + 1).is_ok() {
            self.beacons.push(Quarry::waiting(name.to_owned()));
        }
        let quarry = self.beacons.get_mut(index).filter(|quarry| quarry.name == name);
        let Some(quarry) = quarry else {
            let expected = self.beacons.get(index).map(|quarry| quarry.name.clone());
            let (logged, expected) = (name.to_owned(), expected.unwrap_or_default());
            return Err(HuntError::OtherHunt { beacon: index, logged, expected });
        };
        let estimator = (self.estimators)(prior)
            .map_err(|source| HuntError::Estimator { beacon: name.to_owned(), source })?;
        quarry.stand = Stand::Searched(Box::new(Search {
            track: Track::new(estimator, self.track_config),
            measured: 0,
            heard: 0,
            put_off: 0,
            watch: StopWatch::new(self.config.stop),
            began,
        }));
        Ok(())
    }

    fn hear_again(
        &mut self,
        drone: usize,
        reception: &Reception,
        first_position: bool,
        in_time: bool,
    ) {
        let BeaconId(index) = reception.beacon;
        self.taken.insert((drone, reception.beacon, reception.time.to_bits()));
        let Some(search) = self.beacons.get_mut(usize::from(index)).and_then(Quarry::search_mut)
        else {
            return;
        };
        // What was refused is refused again.
        if let Ok(Heard::Corrected(correction)) = search.track.hear(reception, first_position) {
            search.heard += u32::from(in_time && correction != Correction::Empty);
            self.planner.hear(reception);
        }
    }

    /// A formation position was over.
    fn count_position(&mut self, time: f64, flown_m: f64) {
        for search in self.beacons.iter_mut().filter_map(Quarry::search_mut) {
            if std::mem::take(&mut search.heard) == 0 {
                continue;
            }
            search.measured += 1;
            let progress = Progress {
                time_s: time - search.began.0,
                path_m: flown_m - search.began.1,
                positions: search.measured,
                estimate: search.track.position(),
            };
            // The rules that look back see what they saw; whether the search ended, the log says.
            let _ = search.watch.check(&progress);
        }
    }

    fn found_before(&mut self, fix: &Fix) {
        if let Some(quarry) = self.beacons.get_mut(usize::from(fix.beacon.0))
            && !quarry.is_done()
        {
            quarry.stand = Stand::Done;
            self.fixes.push(fix.clone());
        }
    }
}
