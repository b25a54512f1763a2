use std::{collections::BTreeSet, fmt, mem};

use foxhunt_core::{
    BeaconId, BearingExtractor, ByQuantity, Correction, Decision, Estimate, EstimatorError,
    FormationPlanner, Intake, NoBearing, NoReading, Outcome, PlanError, Pose, Quantity, Reception,
    Stage, Station, SteadyMotion, Sweep, Target,
};
use foxhunt_filters::consistency::NisHealth;
use foxhunt_formation::{Phase, PhaseError, Phases, Progress, Signal, StopWatch};
use nalgebra::{Vector2, Vector3};

use super::{
    Command, Event, Fix, HuntConfig, HuntError, LearnedReceiver, Track, TrackStep,
    cloud::{LOGGED_PLACES, cloud},
    flight::{Flight, Outbox, Recall},
};

mod resume;

/// Search that an estimator of a hunt is made for.
#[derive(Clone, Copy, Debug)]
pub struct Search<'a> {
    /// Beacon that is searched for.
    pub beacon: BeaconId,
    /// Name of the beacon.
    pub name: &'a str,
    /// Belief of its place before the first reception.
    pub prior: Estimate<2>,
}

/// Makes a hunt's estimators: one track for each beacon.
///
/// Every `FnMut(&Search<'_>) -> Result<Track, EstimatorError>` is one.
///
/// ```
/// use foxhunt_core::RandomWalk;
/// use foxhunt_filters::Ukf;
/// use foxhunt_hunt::hunt::{Search, Track, TrackConfig, Tracks};
/// use foxhunt_sensors::{LogDistance, RssBearing};
///
/// let model = RssBearing::new(LogDistance::new(-29.06, 2.765)?);
/// let tracks = move |search: &Search<'_>| {
///     let filter = Ukf::new(RandomWalk::uniform(0.02), model, search.prior)?;
///     Ok(Track::new(filter, TrackConfig::default()))
/// };
/// let _: Box<dyn Tracks> = Box::new(tracks);
/// # Ok::<(), foxhunt_sensors::ParameterError>(())
/// ```
pub trait Tracks {
    /// Makes the track of a beacon.
    ///
    /// # Errors
    ///
    /// [`EstimatorError`] when the prior or a parameter does not make one.
    fn begin(&mut self, search: &Search<'_>) -> Result<Track, EstimatorError>;
}

impl<F: FnMut(&Search<'_>) -> Result<Track, EstimatorError>> Tracks for F {
    fn begin(&mut self, search: &Search<'_>) -> Result<Track, EstimatorError> {
        self(search)
    }
}

/// The parts of a hunt.
pub struct Parts {
    /// Makes a level and a bearing of a turn.
    pub extractor: Box<dyn BearingExtractor>,
    /// Decides where to listen.
    pub planner: Box<dyn FormationPlanner>,
    /// Makes the estimators.
    pub tracks: Box<dyn Tracks>,
    /// Quantities that the receptions of its drones may hold. An estimator that measures anything
    /// else is refused when the hunt is made.
    pub quantities: Vec<Quantity>,
}

impl Parts {
    /// Parts whose receptions hold level and bearing.
    pub fn new(
        extractor: impl BearingExtractor + 'static,
        planner: impl FormationPlanner + 'static,
        tracks: impl FnMut(&Search<'_>) -> Result<Track, EstimatorError> + 'static,
    ) -> Self {
        Self {
            extractor: Box::new(extractor),
            planner: Box::new(planner),
            tracks: Box::new(tracks),
            quantities: vec![Quantity::RSS, Quantity::BEARING],
        }
    }

    /// Adds quantities that the sources measure besides level and bearing.
    #[must_use]
    pub fn with_quantities(mut self, quantities: &[Quantity]) -> Self {
        self.quantities.extend_from_slice(quantities);
        self
    }
}

impl fmt::Debug for Parts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Parts").field("quantities", &self.quantities).finish_non_exhaustive()
    }
}

/// A hunt for one beacon after the other with a formation of drones; where turns are
/// [shared](HuntConfig::shared_turns), every turn measures all of them, and the planner may weigh
/// them.
///
/// It does no I/O and reads no clock: [`start`](Self::start), [`located`](Self::located),
/// [`advance`](Self::advance) and [`sweep`](Self::sweep) take what happened, or
/// [`reception`](Self::reception) where the drones make their own of their sweeps;
/// [`poll_command`](Self::poll_command) and [`poll_event`](Self::poll_event) give what is to be
/// done and what is to be logged. So the same code runs simulated, replayed and flown;
/// [`drive`](super::drive) moves data between it and devices.
///
/// A drone that delivers nothing, does not move or is not located drops out of the formation and
/// never stops the hunt; one that comes back is taken in again. A hunt that was broken off
/// [goes on](Self::resume) from its log.
pub struct Hunt {
    extractor: Box<dyn BearingExtractor>,
    /// True if its estimators take the samples of a turn one by one.
    by_sample: bool,
    planner: Box<dyn FormationPlanner>,
    tracks: Box<dyn Tracks>,
    config: HuntConfig,
    targets: Vec<SearchedTarget>,
    /// Absent until the hunt has begun.
    flight: Option<Flight>,
    /// Drones that never go anywhere.
    rooted: BTreeSet<usize>,
    phases: Phases,
    since: f64,
    /// The beacon that is searched for.
    current: usize,
    /// Number of measurements at the present position without any reception.
    attempts: u32,
    fixes: Vec<Fix>,
    outbox: Outbox,
    /// Errors of each receiver as the last reception's estimator had learned them, with the drone's
    /// number.
    learned: Vec<(usize, LearnedReceiver)>,
    /// Receptions that were fused: drone, beacon, and the bits of the time.
    fused: BTreeSet<(usize, BeaconId, u64)>,
}

/// A beacon that is to be found.
#[derive(Debug)]
struct SearchedTarget {
    name: String,
    state: SearchState,
}

/// State of the search for a beacon.
#[derive(Debug)]
enum SearchState {
    /// It has not begun.
    Waiting,
    /// It is on.
    Active(Box<ActiveSearch>),
    /// There is a fix.
    Done,
}

/// The search for one beacon.
#[derive(Debug)]
struct ActiveSearch {
    track: Track,
    /// Formation positions, before the present one, at which it was received.
    measured: u32,
    /// Receptions fused at the present position.
    received: u32,
    /// Number of times that it was not received where others were.
    put_off: u32,
    watch: StopWatch,
    /// Time when the search began, in seconds.
    began: f64,
    /// Distance that all drones had flown by then, in metres.
    flown_before_m: f64,
}

impl ActiveSearch {
    /// Returns the progress of the search at a time when all drones have flown `flown_m` together.
    fn progress(&self, time: f64, flown_m: f64) -> Progress {
        Progress {
            time_s: time - self.began,
            path_m: flown_m - self.flown_before_m,
            positions: self.measured,
            estimate: self.track.position(),
        }
    }
}

impl SearchedTarget {
    fn waiting(name: String) -> Self {
        Self { name, state: SearchState::Waiting }
    }

    fn is_done(&self) -> bool {
        matches!(self.state, SearchState::Done)
    }

    fn search(&self) -> Option<&ActiveSearch> {
        match &self.state {
            SearchState::Active(search) => Some(search),
            _ => None,
        }
    }

    fn search_mut(&mut self) -> Option<&mut ActiveSearch> {
        match &mut self.state {
            SearchState::Active(search) => Some(search),
            _ => None,
        }
    }
}

impl Hunt {
    /// A hunt for `beacons`, in their order, that has not begun.
    ///
    /// # Errors
    ///
    /// If there is no beacon, a field of the configuration is out of its range, no estimator can
    /// be made, or it measures what the receptions do not hold.
    pub fn new(parts: Parts, beacons: Vec<String>, config: HuntConfig) -> Result<Self, HuntError> {
        config.check()?;
        let Parts { extractor, planner, mut tracks, quantities } = parts;
        let Some(name) = beacons.first().filter(|_| u16::try_from(beacons.len()).is_ok()) else {
            return Err(HuntError::Nothing { missing: "beacon" });
        };
        let centre = config.prior_centre_m.map_or(Vector2::zeros(), Vector2::from);
        let prior = Estimate::isotropic(centre, config.prior_sigma_m);
        let search = Search { beacon: BeaconId(0), name, prior };
        let trial = tracks
            .begin(&search)
            .map_err(|source| HuntError::Estimator { beacon: name.clone(), source })?;
        let fed = |quantity: &Quantity| quantities.contains(quantity);
        if let Some(&quantity) = trial.quantities().iter().find(|quantity| !fed(quantity)) {
            return Err(HuntError::NotMeasured { quantity, measured: quantities });
        }
        Ok(Self {
            extractor,
            by_sample: trial.quantities().contains(&Quantity::BORESIGHT),
            planner,
            tracks,
            config,
            targets: beacons.into_iter().map(SearchedTarget::waiting).collect(),
            flight: None,
            rooted: BTreeSet::new(),
            phases: Phases::default(),
            since: 0.0,
            current: 0,
            attempts: 0,
            fixes: Vec::new(),
            outbox: Outbox::default(),
            learned: Vec::new(),
            fused: BTreeSet::new(),
        })
    }

    /// Begins with the first beacon from where the drones stand, which is their home.
    ///
    /// # Errors
    ///
    /// If there is no drone, the hunt has begun before (it goes on as it was), two drones are
    /// nearer to each other than the separation, one is where it may not fly, or there is no plan
    /// or estimator.
    pub fn start(&mut self, time: f64, stations: Vec<Station>) -> Result<(), HuntError> {
        if stations.is_empty() {
            return Err(HuntError::Nothing { missing: "drone" });
        }
        let phase = self.phases.phase();
        if phase != Phase::Idle {
            return Err(PhaseError { phase, signal: Signal::Begin }.into());
        }
        self.flight = Some(Flight::new(&self.config, time, stations, &self.rooted)?);
        self.begin_beacon(time).inspect_err(|_| self.reset())
    }

    /// As if it had not begun.
    fn reset(&mut self) {
        self.flight = None;
        self.outbox = Outbox::default();
        self.phases = Phases::default();
        self.since = 0.0;
        self.current = 0;
        self.fixes.clear();
        self.fused.clear();
        for target in &mut self.targets {
            target.state = SearchState::Waiting;
        }
    }

    /// Takes note of where a drone is; to be called as often as that is known. One that is not
    /// located for a while is lost.
    pub fn located(&mut self, time: f64, drone: usize, pose: Pose) {
        if let Some(flight) = &mut self.flight {
            flight.located(time, drone, pose);
        }
    }

    /// Sets whether a drone takes orders; each does at first. One that does not, because its pilot
    /// has it, it flies by its own rules or it is on the ground, has no place in the formation and
    /// is sent nowhere, and what it receives is not used. While none does, the hunt waits.
    pub fn set_away(&mut self, drone: usize, away: bool) {
        if let Some(flight) = &mut self.flight {
            flight.set_away(drone, away);
        }
    }

    /// Sets whether a drone never goes anywhere, such as a station; each does at first. One that is
    /// rooted listens where it is, and no formation waits for it. Before the start it allows the
    /// drone to stand above the airspace.
    pub fn set_rooted(&mut self, drone: usize, rooted: bool) {
        if rooted {
            self.rooted.insert(drone);
        } else {
            self.rooted.remove(&drone);
        }
        if let Some(flight) = &mut self.flight {
            flight.set_rooted(drone, rooted);
        }
    }

    /// Lets time pass: drones fly on, arrive and drop out, and drones that deliver nothing are
    /// given up.
    ///
    /// # Errors
    ///
    /// If there is no estimator for the next beacon.
    pub fn advance(&mut self, time: f64) -> Result<(), HuntError> {
        let all_found = self.all_found();
        let listens = matches!(self.phases.phase(), Phase::Measuring(_));
        let turn_timeout_s = if listens { self.turn_timeout_s() } else { f64::INFINITY };
        let Some(flight) = &mut self.flight else { return Ok(()) };
        flight.pass(time, &mut self.outbox);
        if !all_found && let Some(reason) = flight.must_return(time) {
            return self.recall(time, reason);
        }
        if flight.is_deserted() {
            self.since = time;
            return Ok(());
        }
        self.stop_by_budget(time)?;
        let Some(flight) = &mut self.flight else { return Ok(()) };
        let waited_s = time - self.since;
        match self.phases.phase() {
            Phase::Start | Phase::Moving(_) => {
                if flight.is_formed() || waited_s >= self.config.move_timeout_s {
                    self.signal(time, Signal::Arrived)?;
                    self.attempts = 0;
                    self.listen(time);
                }
                Ok(())
            }
            Phase::Measuring(_) => {
                if waited_s >= turn_timeout_s {
                    flight.give_up_turns(time, waited_s, &mut self.outbox);
                }
                if flight.is_waiting() { Ok(()) } else { self.position_done(time) }
            }
            Phase::Idle | Phase::Finished(_) => Ok(()),
        }
    }

    /// The next time at which [`advance`](Self::advance) does anything, in seconds, as long as no
    /// drone delivers anything and all are located and go on as they do at `time`, when they were
    /// located last; `None` where that is not known. It may be too early, and is never too late.
    #[must_use]
    pub fn next_event(&self, time: f64, motions: &[SteadyMotion]) -> Option<f64> {
        let flight = self.flight.as_ref().filter(|_| self.outbox.is_empty())?;
        let timeout_s = match self.phases.phase() {
            Phase::Measuring(_) if flight.is_waiting() => self.turn_timeout_s(),
            // How far all have flown is known where they are located alone.
            Phase::Start | Phase::Moving(_) if self.config.stop.path_m.is_none() => {
                self.config.move_timeout_s
            }
            _ => return None,
        };
        let searches = self.targets.iter().filter_map(SearchedTarget::search);
        let budgets = searches.filter_map(|search| Some(search.began + self.config.stop.time_s?));
        let event = flight.next_event(time, motions)?.min(self.since + timeout_s);
        Some(budgets.fold(event, f64::min))
    }

    /// Returns true if every sweep that is owed is waited for: no drone that has not delivered is
    /// sent anywhere or has to listen again before the [next event](Self::next_event).
    #[must_use]
    pub fn waits_for_all(&self) -> bool {
        self.flight.as_ref().is_some_and(Flight::waits_for_all)
    }

    /// Returns the time that the sweeps of a turn are waited for, in seconds.
    fn turn_timeout_s(&self) -> f64 {
        let beacons = u32::try_from(self.beacons_of_turn().count()).unwrap_or(u32::MAX);
        self.config.turn_timeout_s * f64::from(beacons)
    }

    /// Notes that a device failed; the hunt goes on. The same failure is one event in each phase.
    pub fn device_failed(&mut self, time: f64, drone: Option<usize>, reason: String) {
        self.outbox.failed(time, drone, reason);
    }

    /// Notes that a drone did not take its order to fly somewhere; the order is repeated.
    pub fn not_sent(&mut self, time: f64, drone: usize, reason: String) {
        if let Some(flight) = &mut self.flight {
            flight.not_sent(drone);
        }
        self.device_failed(time, Some(drone), reason);
    }

    /// Notes that a drone did not take its order to land; the order is repeated for a while.
    pub fn not_landed(&mut self, time: f64, drone: usize, reason: String) {
        if let Some(flight) = &mut self.flight {
            flight.not_landed(time, drone);
        }
        self.device_failed(time, Some(drone), reason);
    }

    /// The next thing to be done, each once.
    pub fn poll_command(&mut self) -> Option<Command> {
        self.outbox.next_command()
    }

    /// The next thing to be logged, each once, in the order in which it happened.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.outbox.next_event()
    }

    /// Returns true if a drone still owes a sweep, awaited or late.
    #[must_use]
    pub fn awaits(&self, drone: usize) -> bool {
        !self.owed_by(drone).is_empty()
    }

    /// Returns the beacons of which a drone still owes a sweep, awaited or late.
    #[must_use]
    pub fn owed_by(&self, drone: usize) -> &[BeaconId] {
        self.flight.as_ref().map_or(&[], |flight| flight.owed_by(drone))
    }

    /// Returns the number of drones; 0 before the start.
    #[must_use]
    pub fn drone_count(&self) -> usize {
        self.flight.as_ref().map_or(0, Flight::drone_count)
    }

    /// Returns the places and goals of the drones; empty before the start.
    #[must_use]
    pub fn stations(&self) -> Vec<Station> {
        self.flight.as_ref().map_or_else(Vec::new, Flight::stations)
    }

    /// Returns the phase of the formation.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phases.phase()
    }

    /// Returns true if every beacon is done, and the drones are home if they were to go there.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.all_found() && self.flight.as_ref().is_none_or(Flight::is_over)
    }

    /// Returns the fixes so far, in the order in which the searches ended.
    #[must_use]
    pub fn fixes(&self) -> &[Fix] {
        &self.fixes
    }

    /// Returns the number of beacons to be found, finished ones included.
    #[must_use]
    pub fn beacon_count(&self) -> usize {
        self.targets.len()
    }

    /// Returns the belief of the beacon that is searched for now.
    #[must_use]
    pub fn estimate(&self) -> Option<Estimate<2>> {
        Some(self.targets.get(self.current)?.search()?.track.position())
    }

    /// Returns the belief of every beacon that is searched for, and the fix of every one that is
    /// done.
    #[must_use]
    pub fn believed(&self) -> Vec<Believed<'_>> {
        let mut believed = Vec::new();
        for (index, target) in self.targets.iter().enumerate() {
            let beacon = beacon_id(index);
            let fix = || self.fixes.iter().find(|fix| fix.beacon == beacon).map(|fix| fix.estimate);
            let estimate = target.search().map(|search| search.track.position()).or_else(fix);
            let name = &target.name;
            believed.extend(estimate.map(|estimate| Believed { beacon, name, estimate }));
        }
        believed
    }

    /// Errors that were learned of each receiver at the search that received last, with the drone's
    /// number; empty for an estimator that takes all receivers for alike.
    #[must_use]
    pub fn learned_receivers(&self) -> &[(usize, LearnedReceiver)] {
        &self.learned
    }

    /// Returns true if there is a fix of every beacon.
    fn all_found(&self) -> bool {
        self.fixes.len() == self.targets.len()
    }

    /// Returns the beacons of a turn: the beacon of the present search, and all that are not done
    /// where turns are shared.
    fn beacons_of_turn(&self) -> impl Iterator<Item = BeaconId> {
        let shared = self.config.shared_turns;
        let open = move |(index, target): &(usize, &SearchedTarget)| {
            (shared || *index == self.current) && !target.is_done()
        };
        self.targets.iter().enumerate().filter(open).map(|(index, _)| beacon_id(index))
    }

    fn signal(&mut self, time: f64, signal: Signal) -> Result<(), HuntError> {
        let phase = self.phases.signal(signal)?;
        self.since = time;
        self.outbox.emit(Event::PhaseChanged { time, phase });
        Ok(())
    }

    /// Has every drone that is in the air turn its antenna.
    fn listen(&mut self, time: f64) {
        self.since = time;
        let beacons: Vec<_> = self.beacons_of_turn().collect();
        if let Some(flight) = &mut self.flight {
            flight.listen(time, &beacons, &mut self.outbox);
        }
    }

    /// Returns the belief of a beacon before the first reception.
    fn prior(&self) -> Estimate<2> {
        let centre = self.config.prior_centre_m.map(Vector2::from);
        let centre = centre.unwrap_or_else(|| centroid(&self.stations()));
        Estimate::isotropic(centre, self.config.prior_sigma_m)
    }

    /// Takes a drone's sweep. One that cannot be used is an event, never an error; one that comes
    /// late, when it is no longer awaited, is used as long as its beacon is still searched for.
    pub fn sweep(&mut self, time: f64, drone: usize, sweep: &Sweep<'_>) {
        if !self.is_searched(sweep.beacon) {
            self.note_delivery(time, drone, sweep.beacon, sweep.time);
            return;
        }
        if self.by_sample {
            return self.samples(time, drone, sweep);
        }
        match self.read(sweep) {
            Ok((reception, lack)) => self.fuse(time, drone, &reception, lack),
            Err(reason) => self.nothing_received(time, drone, sweep.beacon, sweep.time, reason),
        }
    }

    /// Takes the samples of a sweep, and what was missed, one by one.
    fn samples(&mut self, time: f64, drone: usize, sweep: &Sweep<'_>) {
        let receptions = Reception::of_samples(sweep);
        if receptions.is_empty() {
            let reason = NoReading::Empty.to_string();
            return self.nothing_received(time, drone, sweep.beacon, sweep.time, reason);
        }
        let Some(in_time) = self.note_delivery(time, drone, sweep.beacon, sweep.time) else {
            return;
        };
        for reception in receptions {
            if !self.has_fused(drone, &reception) {
                self.take(time, drone, &reception, None, in_time);
            }
        }
    }

    /// Extracts the reception of a sweep with the hunt's extractor; for drones that send
    /// [receptions](Self::reception) rather than sweeps.
    ///
    /// # Errors
    ///
    /// The reason in words, as it is logged.
    pub fn extract(&self, sweep: &Sweep<'_>) -> Result<Reception, String> {
        self.read(sweep).map(|(reception, _)| reception)
    }

    /// The reception of a sweep, and why there is no bearing in it.
    fn read(&self, sweep: &Sweep<'_>) -> Result<(Reception, Option<NoBearing>), String> {
        if !(sweep.time.is_finite() && sweep.receiver.is_finite()) {
            return Err(format!(
                "its end, {} s, or {:?} is not finite",
                sweep.time, sweep.receiver
            ));
        }
        // A source of ranges has no pattern to extract anything of.
        if sweep.samples.is_empty() && !sweep.measured.is_empty() {
            return Ok((Reception::without_pattern(sweep), None));
        }
        let reading = self.extractor.extract(sweep).map_err(|error| error.to_string())?;
        Ok((Reception::new(sweep, &reading), reading.bearing.err()))
    }

    /// Takes a drone's reception of a beacon, extracted on board. It is fused once: the same
    /// drone's reception of the same beacon at the same time, to the bit, makes no difference,
    /// however often it comes. One that cannot be used is an event.
    pub fn reception(&mut self, time: f64, drone: usize, reception: &Reception) {
        self.fuse(time, drone, reception, None);
    }

    fn fuse(&mut self, time: f64, drone: usize, reception: &Reception, lack: Option<NoBearing>) {
        let beacon = reception.beacon;
        if self.has_fused(drone, reception) {
            return;
        }
        let Some(in_time) = self.note_delivery(time, drone, beacon, reception.time) else { return };
        self.take(time, drone, reception, lack, in_time);
    }

    /// Has a beacon's estimator take a reception, which came in time or late.
    fn take(
        &mut self,
        time: f64,
        drone: usize,
        reception: &Reception,
        lack: Option<NoBearing>,
        in_time: bool,
    ) {
        let beacon = reception.beacon;
        let listening = matches!(self.phases.phase(), Phase::Measuring(_));
        let index = usize::from(beacon.0);
        let Some(search) = self.targets.get_mut(index).and_then(SearchedTarget::search_mut) else {
            return;
        };
        if !(reception.time.is_finite() && reception.receiver.is_finite()) {
            let Reception { time: ended, receiver, .. } = reception;
            let reason = format!("its end, {ended} s, or {receiver:?} is not finite");
            return self.outbox.emit(Event::Refused { time, drone, reason });
        }
        // What no observation can be made of, a NaN from another computer, must not stand in the
        // log: it could not be read back.
        let pair = ByQuantity([Quantity::RSS, Quantity::BEARING]);
        if let Err(error) = pair.observation(reception) {
            return self.outbox.emit(Event::Refused { time, drone, reason: error.to_string() });
        }
        let mut reception = *reception;
        let assumed = self.config.receiver_sigma_m.map(Vector3::repeat);
        reception.receiver_sigma_m = reception.receiver_sigma_m.or(assumed);
        self.fused.insert((drone, beacon, reception.time.to_bits()));
        let first_position = search.measured == 0;
        self.outbox.emit(Event::Received { time, drone, first_position, reception });
        let reason = match search.track.heard_by(drone).update(&reception, first_position) {
            Ok(TrackStep::Updated { correction, degrees_of_freedom }) => {
                // A late one is of the place where it was made, and not of this position.
                let counts = in_time && listening && correction != Correction::Empty;
                search.received += u32::from(counts);
                self.outbox.emit(Event::Corrected {
                    time,
                    drone,
                    beacon: Some(beacon),
                    correction,
                    degrees_of_freedom: Some(degrees_of_freedom),
                    estimate: search.track.position(),
                });
                if let Some(NisHealth::Diverged { average, interval }) = search.track.alarm() {
                    let average_nis = average;
                    let event = Event::FilterDiverged { time, beacon, average_nis, interval };
                    self.outbox.emit(event);
                }
                self.learned = search.track.learned_receivers();
                self.planner.observe(&reception);
                return;
            }
            Ok(TrackStep::Skipped) => {
                lack.map_or_else(|| "it has no bearing".to_owned(), |lack| lack.to_string())
            }
            Err(error) => error.to_string(),
        };
        self.outbox.emit(Event::Refused { time, drone, reason });
    }

    /// Takes note that nothing of use was received of a beacon in a drone's turn, which ended at
    /// `ended`.
    pub fn nothing_received(
        &mut self,
        time: f64,
        drone: usize,
        beacon: BeaconId,
        ended: f64,
        reason: String,
    ) {
        let known = self.note_delivery(time, drone, beacon, ended).is_some();
        if known && self.is_searched(beacon) {
            self.outbox.emit(Event::Refused { time, drone, reason });
        }
    }

    /// Returns true if a drone's reception came before: of the same beacon at the same time, to the
    /// bit.
    #[must_use]
    pub fn has_fused(&self, drone: usize, reception: &Reception) -> bool {
        self.fused.contains(&(drone, reception.beacon, reception.time.to_bits()))
    }

    /// Returns true if a beacon's search has not begun, so that receptions of it are of no use yet.
    #[must_use]
    pub fn is_yet_to_come(&self, beacon: BeaconId) -> bool {
        let target = self.targets.get(usize::from(beacon.0));
        target.is_some_and(|target| !target.is_done() && target.search().is_none())
    }

    fn is_searched(&self, beacon: BeaconId) -> bool {
        self.targets.get(usize::from(beacon.0)).is_some_and(|target| target.search().is_some())
    }

    fn note_delivery(
        &mut self,
        time: f64,
        drone: usize,
        beacon: BeaconId,
        ended: f64,
    ) -> Option<bool> {
        self.flight.as_mut()?.delivered(time, drone, beacon, ended)
    }

    /// Adds a beacon that has shown up: the next turn measures it where turns are shared, and
    /// otherwise it is searched for after those before it.
    ///
    /// # Errors
    ///
    /// If the hunt is over, there is no room for another number, or no estimator.
    pub fn add_beacon(&mut self, time: f64, name: String) -> Result<BeaconId, HuntError> {
        let phase = self.phases.phase();
        if self.all_found() {
            return Err(PhaseError { phase, signal: Signal::Begin }.into());
        }
        let index = self.targets.len();
        if u16::try_from(index + 1).is_err() {
            return Err(HuntError::Nothing { missing: "number that is free for another beacon" });
        }
        self.targets.push(SearchedTarget::waiting(name));
        if self.config.shared_turns && phase != Phase::Idle {
            let begun = self.begin_search(time, index);
            begun.inspect_err(|_| self.targets.truncate(index))?;
        }
        Ok(beacon_id(index))
    }

    /// Turns to the first beacon that is not done.
    fn begin_beacon(&mut self, time: f64) -> Result<(), HuntError> {
        let Some(next) = self.targets.iter().position(|target| !target.is_done()) else {
            return Ok(());
        };
        self.current = next;
        let beacons: Vec<_> = self.beacons_of_turn().collect();
        for beacon in beacons {
            self.begin_search(time, usize::from(beacon.0))?;
        }
        let planned = self.plan(time, |planner, targets, stations| match targets {
            // Nothing was received of it yet.
            [] => planner.begin(stations),
            [target, ..] => planner.resume(target.belief, stations),
        });
        if let Err(source) = planned {
            let beacon = self.targets[next].name.clone();
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
        if !matches!(self.targets[index].state, SearchState::Waiting) {
            return Ok(());
        }
        let beacon = beacon_id(index);
        let hunt_prior = self.prior();
        let name = self.targets[index].name.clone();
        let flown_m = self.flight.as_ref().map_or(0.0, Flight::flown_m);
        let search = self.new_search(index, &hunt_prior, time, flown_m)?;
        let prior = search.track.prior();
        let hunt_prior = (prior != hunt_prior).then_some(hunt_prior);
        self.targets[index].state = SearchState::Active(Box::new(search));
        self.outbox.emit(Event::BeaconStarted { time, beacon, name, prior, hunt_prior });
        Ok(())
    }

    /// A search that begins at a time from what the hunt believes of the beacon's place.
    fn new_search(
        &mut self,
        index: usize,
        prior: &Estimate<2>,
        began: f64,
        flown_before_m: f64,
    ) -> Result<ActiveSearch, HuntError> {
        let name = &self.targets[index].name;
        let search = Search { beacon: beacon_id(index), name, prior: *prior };
        let track = self
            .tracks
            .begin(&search)
            .map_err(|source| HuntError::Estimator { beacon: name.clone(), source })?;
        let watch = StopWatch::new(self.config.stop);
        Ok(ActiveSearch {
            track,
            measured: 0,
            received: 0,
            put_off: 0,
            watch,
            began,
            flown_before_m,
        })
    }

    /// Goes on when every drone of the present formation position has delivered or was given up.
    fn position_done(&mut self, time: f64) -> Result<(), HuntError> {
        let received = |target: &SearchedTarget| target.search().is_some_and(|s| s.received > 0);
        let received: Vec<bool> = self.targets.iter().map(received).collect();
        for search in self.targets.iter_mut().filter_map(SearchedTarget::search_mut) {
            search.measured += u32::from(mem::take(&mut search.received) > 0);
        }
        self.stop_by_rule(time, &received)?;
        if self.targets[self.current].is_done() {
            return self.next_beacon(time);
        }
        if !received[self.current] {
            let open = |index: &usize| received[*index] && !self.targets[*index].is_done();
            // A sweep would start over for the other beacon.
            let goes_on = self.planner.goes_on_without_signal();
            return match (0..received.len()).find(open) {
                Some(other) if !goes_on => self.put_off(time, other),
                _ => self.listen_again(time),
            };
        }
        let decided =
            self.plan(time, |planner, targets, stations| planner.plan_together(targets, stations));
        self.decided(time, decided)
    }

    /// Listens once more where nothing was received. After the last attempt goes on with a plan
    /// that needs no signal, or gives the present beacon up.
    fn listen_again(&mut self, time: f64) -> Result<(), HuntError> {
        self.attempts += 1;
        if self.attempts < self.config.attempts {
            self.listen(time);
            return Ok(());
        }
        let reason = format!("nothing was received of it in {} turns", self.attempts);
        if !self.planner.goes_on_without_signal() {
            return self.give_up_without_signal(time, reason);
        }
        self.attempts = 0;
        let decided =
            self.plan(time, |planner, targets, stations| planner.plan_together(targets, stations));
        let search = self.targets[self.current].search();
        let unheard = search.is_some_and(|search| search.measured == 0);
        match decided {
            Ok(Decision::Finish(_)) if unheard => {
                let mut reason = "nothing was received of it on the whole path".to_owned();
                if let Some(explained) = explanation(self.planner.as_ref()) {
                    reason = format!("{reason}: {explained}");
                }
                self.give_up_without_signal(time, reason)
            }
            decided => self.decided(time, decided),
        }
    }

    /// Goes on with another beacon that was received where the present one was not, and comes back
    /// to this one; it is given up when that has happened too often, so that every hunt ends.
    fn put_off(&mut self, time: f64, other: usize) -> Result<(), HuntError> {
        if let Some(search) = self.targets[self.current].search_mut() {
            search.put_off += 1;
            if search.put_off >= self.config.attempts {
                let reason = format!("others were received without it {} times", search.put_off);
                return self.give_up_without_signal(time, reason);
            }
        }
        self.current = other;
        let decided = self.plan(time, |planner, targets, stations| match targets {
            [] => Err(PlanError::NoPlace),
            [target, ..] => planner.resume(target.belief, stations),
        });
        self.decided(time, decided.map(|()| Decision::Listen(Stage::Searching)))
    }

    fn give_up_without_signal(&mut self, time: f64, reason: String) -> Result<(), HuntError> {
        let before = self.targets[self.current].search().is_some_and(|s| s.measured > 0);
        let outcome = if before { Outcome::SignalLost } else { Outcome::NoSignal };
        self.give_up(time, outcome, reason)
    }

    /// Ends the searches whose time or path is used up, wherever the drones are.
    fn stop_by_budget(&mut self, time: f64) -> Result<(), HuntError> {
        let flown_m = self.flight.as_ref().map_or(0.0, Flight::flown_m);
        for index in 0..self.targets.len() {
            let Some(search) = self.targets[index].search() else { continue };
            let Progress { time_s, path_m, .. } = search.progress(time, flown_m);
            let Some(stop) = self.config.stop.budget(time_s, path_m) else { continue };
            if index == self.current {
                return self.give_up(time, stop.outcome, stop.to_string());
            }
            let beacon = beacon_id(index);
            let outcome = stop.outcome;
            let reason = stop.to_string();
            self.outbox.emit(Event::Stopped { time, beacon, outcome, reason });
            self.close(time, index, outcome);
        }
        Ok(())
    }

    /// Ends the searches that a rule of the configuration ends, among those with a reception at
    /// this position.
    fn stop_by_rule(&mut self, time: f64, received: &[bool]) -> Result<(), HuntError> {
        let flown_m = self.flight.as_ref().map_or(0.0, Flight::flown_m);
        for index in (0..received.len()).filter(|index| received[*index]) {
            let Some(search) = self.targets[index].search_mut() else { continue };
            let progress = search.progress(time, flown_m);
            if let Some(stop) = search.watch.check(&progress) {
                let beacon = beacon_id(index);
                let outcome = stop.outcome;
                let reason = stop.to_string();
                self.outbox.emit(Event::Stopped { time, beacon, outcome, reason });
                if index == self.current {
                    self.signal(time, Signal::Decided(Decision::Finish(outcome)))?;
                }
                self.close(time, index, outcome);
            }
        }
        Ok(())
    }

    /// Calls the planner with the belief of the present beacon and then of the others of a shared
    /// turn, or without any while the present one was not received yet, and sends the drones.
    fn plan<T>(
        &mut self,
        time: f64,
        decide: impl FnOnce(
            &mut dyn FormationPlanner,
            &[Target<'_>],
            &mut [Station],
        ) -> Result<T, PlanError>,
    ) -> Result<T, PlanError> {
        let Some(flight) = &mut self.flight else { return Err(PlanError::NoPlace) };
        let others = (0..self.targets.len()).filter(|index| *index != self.current);
        let searched = |index: usize| Some((index, self.targets[index].search()?));
        let current = searched(self.current).filter(|(_, search)| search.track.steps() > 0);
        let others = others.filter_map(searched).filter(|_| current.is_some());
        let targets: Vec<_> = current
            .into_iter()
            .chain(others)
            .map(|(index, search)| Target {
                beacon: beacon_id(index),
                belief: search.track.belief(),
            })
            .collect();
        let planner = &mut self.planner;
        let outbox = &mut self.outbox;
        flight.form(time, &targets, outbox, |stations, outbox| {
            let decision = decide(planner.as_mut(), &targets, stations)?;
            if let Some(reason) = explanation(planner.as_ref()) {
                outbox.emit(Event::Planned { time, beacon: beacon_id(self.current), reason });
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
        self.outbox.emit(Event::Stopped { time, beacon, outcome, reason });
        self.signal(time, Signal::GivenUp(outcome))?;
        self.close(time, self.current, outcome);
        self.next_beacon(time)
    }

    /// Ends all searches, also searches that have not begun, and sends the drones home.
    fn recall(&mut self, time: f64, reason: Recall) -> Result<(), HuntError> {
        let Recall { outcome, reason } = reason;
        if !matches!(self.phases.phase(), Phase::Idle | Phase::Finished(_)) {
            self.signal(time, Signal::GivenUp(outcome))?;
        }
        if let Some(flight) = &mut self.flight {
            flight.go_home(time, reason.clone(), &mut self.outbox);
        }
        for index in 0..self.targets.len() {
            if !self.targets[index].is_done() {
                self.begin_search(time, index)?;
                let beacon = beacon_id(index);
                let reason = reason.clone();
                self.outbox.emit(Event::Stopped { time, beacon, outcome, reason });
                self.close(time, index, outcome);
            }
        }
        Ok(())
    }

    /// Makes a fix of what is believed of a beacon.
    fn close(&mut self, time: f64, index: usize, outcome: Outcome) {
        let target = &mut self.targets[index];
        let SearchState::Active(search) = mem::replace(&mut target.state, SearchState::Done) else {
            return;
        };
        let estimate = search.track.position();
        let axis_m = estimate.ellipse(0.95).map_or(f64::INFINITY, |ellipse| ellipse.semi_major);
        let outcome = match outcome {
            Outcome::Converged if axis_m > self.config.asked_ellipse_m() => Outcome::Settled,
            other => other,
        };
        let fix = Fix {
            beacon: beacon_id(index),
            name: target.name.clone(),
            estimate,
            steps: search.track.steps(),
            formation_positions: search.measured,
            outcome,
            transmitters: search.track.found(),
        };
        if let Some(places) = cloud(search.track.belief(), LOGGED_PLACES) {
            self.outbox.emit(Event::Cloud { time, beacon: fix.beacon, places });
        }
        self.outbox.emit(Event::BeaconFinished { time, fix: fix.clone() });
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

/// The belief about one of a hunt's beacons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Believed<'a> {
    /// The beacon.
    pub beacon: BeaconId,
    /// Name of the beacon.
    pub name: &'a str,
    /// Estimated place.
    pub estimate: Estimate<2>,
}

/// Beacons are counted in sixteen bits, which `new` and `take_in` see to.
/// Returns what a planner says of its last decision, if anything.
fn explanation(planner: &dyn FormationPlanner) -> Option<String> {
    let mut text = String::new();
    planner.explain(&mut text).ok().filter(|()| !text.is_empty()).map(|()| text)
}

fn beacon_id(index: usize) -> BeaconId {
    BeaconId(u16::try_from(index).unwrap_or(u16::MAX))
}

fn centroid(stations: &[Station]) -> Vector2<f64> {
    let count = u32::try_from(stations.len()).unwrap_or(u32::MAX).max(1);
    stations.iter().map(|s| s.pose.position.xy()).sum::<Vector2<f64>>() / f64::from(count)
}

impl fmt::Debug for Hunt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Hunt")
            .field("config", &self.config)
            .field("targets", &self.targets)
            .field("phase", &self.phases.phase())
            .field("fixes", &self.fixes)
            .finish_non_exhaustive()
    }
}
