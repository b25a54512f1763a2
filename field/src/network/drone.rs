//! A drone's node: turning, receiving, and deliveries that are repeated until they are taken.

use std::collections::VecDeque;

use foxhunt_core::{BearingExtractor, PatternSource, Reception, Sweep, Vehicle, Waypoint};
use foxhunt_hardware::link::{
    ClockFilter, ClockOffset, Delivery, DroneLink, Echo, Order, Report, Stage, Status, Taken,
    UnixTime,
};

use super::{DroneNodeConfig, NetworkError};

/// A drone's part of a hunt on several computers: follows orders to fly and to listen, makes
/// receptions of its sweeps, and sends each until it is logged.
///
/// It does no I/O of its own, reads no clock and never waits: [`step`](Self::step) is called in a
/// loop with the time. It keeps nothing that a new one would miss: after a restart the next order
/// holds everything. Without orders it goes on with the last one.
///
/// The drone's clock may be off by any amount: the orders carry the stamps by which the offset is
/// [estimated](ClockFilter), and every time that it reports is corrected to the clock of the fusing
/// node. Until the offset is known well enough it reports no place, so that it takes no part.
#[derive(Debug)]
pub struct DroneNode<S, V, X, L> {
    source: S,
    vehicle: V,
    extractor: X,
    link: L,
    epoch: UnixTime,
    config: DroneNodeConfig,
    order: Order,
    /// Time when the last order came, or the node began.
    ordered_at: Option<f64>,
    clock: ClockFilter,
    /// Echoes that came in the step before, each with when its order was sent: they came before the
    /// present time was read.
    echoes: Vec<(Echo, UnixTime)>,
    stage: Stage,
    /// Goal to which its vehicle was sent last; `landed` if it has accepted the order to land.
    sent: Option<Waypoint>,
    landed: bool,
    /// The last turn that was begun.
    begun: u64,
    deliveries: Deliveries,
    /// Reason why a device did not follow the order.
    refusal: String,
    /// Failures since the last report.
    fault: String,
    /// Time before which nothing that failed is tried again.
    retry_at: f64,
    report_at: f64,
}

impl<S, V, X, L> DroneNode<S, V, X, L>
where
    S: PatternSource,
    V: Vehicle,
    X: BearingExtractor,
    L: DroneLink,
{
    /// A drone without any order yet; `epoch` is when its clock was at 0.
    ///
    /// # Errors
    ///
    /// [`NetworkError::Config`] names the field that is out of its range.
    pub fn new(
        source: S,
        vehicle: V,
        extractor: X,
        link: L,
        epoch: UnixTime,
        config: DroneNodeConfig,
    ) -> Result<Self, NetworkError> {
        config.check()?;
        Ok(Self {
            source,
            vehicle,
            extractor,
            link,
            epoch,
            config,
            order: Order::default(),
            ordered_at: None,
            clock: ClockFilter::default(),
            echoes: Vec::new(),
            stage: Stage::Flying,
            sent: None,
            landed: false,
            begun: 0,
            deliveries: Deliveries::default(),
            refusal: String::new(),
            fault: String::new(),
            retry_at: f64::NEG_INFINITY,
            report_at: f64::NEG_INFINITY,
        })
    }

    /// Moves on at a time in seconds of its own clock: takes orders, follows them, listens and
    /// reports.
    ///
    /// A device that fails is reported and tried again.
    ///
    /// # Errors
    ///
    /// [`NetworkError::Link`] when the link failed, and [`NetworkError::Time`]; it may be called
    /// again.
    pub fn step(&mut self, time: f64) -> Result<(), NetworkError> {
        let received = self.receive(time);
        received.and(self.act(time))
    }

    /// The first half of a step: takes orders.
    pub(super) fn receive(&mut self, time: f64) -> Result<(), NetworkError> {
        let now = self.own(time)?;
        self.ordered_at.get_or_insert(time);
        self.receive_orders(time, now)
    }

    /// The second half of a step: follows orders, listens and reports.
    pub(super) fn act(&mut self, time: f64) -> Result<(), NetworkError> {
        let now = self.own(time)?;
        if self.stage == Stage::Flying && time >= self.retry_at && !self.follow() {
            self.retry_at = time + self.config.retry_after_s;
        }
        self.listen(time, now);
        self.report(time, now)
    }

    /// Sets what its aircraft is doing, and what is in the way; it follows orders while that flies.
    pub(super) fn set_stage(&mut self, stage: Stage, hindrance: &str) {
        if self.stage != stage {
            self.stage = stage;
            // Whoever had it meanwhile has left it somewhere else.
            self.sent = None;
        }
        if stage != Stage::Flying {
            hindrance.clone_into(&mut self.refusal);
        }
    }

    fn own(&self, time: f64) -> Result<UnixTime, NetworkError> {
        self.epoch.after(time).ok_or(NetworkError::Time { time })
    }

    /// Returns the time since the last order came, or the node began, in seconds.
    pub fn silent_s(&self, time: f64) -> f64 {
        self.ordered_at.map_or(0.0, |last| time - last)
    }

    /// Returns its clock's offset at a time of its own; `None` before the first exchange.
    pub fn clock(&self, time: f64) -> Option<ClockOffset> {
        self.clock.offset(self.epoch.after(time)?)
    }

    /// Returns true if it has accepted the order to land.
    pub(super) fn lands(&self) -> bool {
        self.landed
    }

    /// The order that it follows.
    pub fn order(&self) -> &Order {
        &self.order
    }

    /// Returns the number of deliveries that were given up because they were not logged for too
    /// long.
    pub fn given_up(&self) -> u64 {
        self.deliveries.given_up()
    }

    fn receive_orders(&mut self, time: f64, now: UnixTime) -> Result<(), NetworkError> {
        for (echo, answered) in self.echoes.drain(..) {
            self.clock.came_back(echo, answered, now);
        }
        while let Some(order) = self.link.receive()? {
            self.ordered_at = Some(time);
            self.echoes.extend(order.echo.map(|echo| (echo, order.at)));
            // What an old order names as logged is logged, too.
            self.deliveries.forget(&order.taken);
            if order.number >= self.order.number {
                self.order = order;
            }
        }
        Ok(())
    }

    /// Follows the order if it was not followed yet; `false` if a device did not accept it.
    fn follow(&mut self) -> bool {
        let mut failure = String::new();
        if self.order.land && !self.landed {
            match self.vehicle.land() {
                Ok(()) => self.landed = true,
                Err(error) => failure = format!("landing: {error}"),
            }
        } else if let Some(goal) = self.order.goal.filter(|_| !self.order.land)
            && self.sent != Some(goal)
        {
            match self.vehicle.go_to(&goal) {
                Ok(()) => self.sent = Some(goal),
                Err(error) => failure = format!("flying: {error}"),
            }
        }
        let turn = &self.order.turn;
        if turn.number > self.begun && !turn.beacons.is_empty() && !self.order.land {
            match self.source.begin(&turn.beacons) {
                Ok(()) => self.begun = turn.number,
                Err(error) => failure = format!("listening: {error}"),
            }
        }
        let followed = failure.is_empty();
        self.refusal = failure;
        followed
    }

    /// Takes the sweeps that are ready.
    fn listen(&mut self, time: f64, now: UnixTime) {
        let clock = self.certain_clock(now);
        // A source that lends without end is not polled any further.
        for _ in 0..=self.order.turn.beacons.len() {
            match self.source.poll() {
                Ok(Some(sweep)) => {
                    if let Some(delivery) =
                        deliver(&self.extractor, self.epoch, clock.clone(), &sweep)
                    {
                        self.deliveries.put(time, delivery, self.config.most_kept);
                    } else {
                        self.fault =
                            format!("a turn ended at {} s, which is not a valid time", sweep.time);
                    }
                }
                Ok(None) => break,
                Err(error) => {
                    self.fault = format!("listening: {error}");
                    break;
                }
            }
        }
    }

    /// Returns its clock's offset if it is known well enough, else the reason why not.
    fn certain_clock(&self, now: UnixTime) -> Result<ClockOffset, String> {
        let most_s = self.config.clock_uncertainty_s;
        match self.clock.offset(now) {
            Some(clock) if clock.uncertainty_s <= most_s => Ok(clock),
            Some(ClockOffset { uncertainty_s, .. }) => Err(format!(
                "its clock is known to ±{uncertainty_s:.2} s, and ±{most_s} s are allowed"
            )),
            None => Err("its clock has not been compared yet".to_owned()),
        }
    }

    fn report(&mut self, time: f64, now: UnixTime) -> Result<(), NetworkError> {
        if time >= self.report_at {
            self.report_at = time + self.config.report_every_s;
            let known = self.certain_clock(now).ok().and_then(|clock| now.after(clock.offset_s));
            match self.vehicle.pose() {
                Ok(pose) if pose.is_finite() => {
                    if let Some(at) = known {
                        self.link.send(&Report::Pose { at, pose })?;
                    }
                }
                Ok(pose) => self.fault = format!("its place is not finite: {pose:?}"),
                Err(error) => self.fault = format!("where it is: {error}"),
            }
            let fault = std::mem::take(&mut self.fault);
            let failure = if self.refusal.is_empty() { fault } else { self.refusal.clone() };
            self.clock.sent(now);
            self.link.send(&Report::Status(Status {
                at: known.unwrap_or(now),
                sent: now,
                clock: self.clock.offset(now),
                order: self.order.number,
                stage: self.stage,
                failure,
            }))?;
        }
        for delivery in self.deliveries.due(time, self.config.repeat_every_s) {
            self.link.send(&Report::Delivery(Box::new(delivery.clone())))?;
        }
        Ok(())
    }
}

/// The deliveries of a drone that are not known to be logged.
#[derive(Debug, Default)]
struct Deliveries {
    /// The oldest first, each with when it is sent next.
    kept: VecDeque<(f64, Delivery)>,
    given_up: u64,
}

impl Deliveries {
    /// Adds one; past `most` the oldest is given up.
    fn put(&mut self, time: f64, delivery: Delivery, most: usize) {
        if self.kept.len() >= most {
            self.kept.pop_front();
            self.given_up += 1;
        }
        self.kept.push_back((time, delivery));
    }

    /// Forgets the deliveries that are logged.
    fn forget(&mut self, taken: &[Taken]) {
        self.kept.retain(|(_, delivery)| !taken.contains(&delivery.name()));
    }

    /// Returns the deliveries that are to be sent now, and again after `repeat_s`.
    fn due(&mut self, time: f64, repeat_s: f64) -> impl Iterator<Item = &Delivery> + use<'_> {
        self.kept.iter_mut().filter_map(move |(next, delivery)| {
            (*next <= time).then(|| {
                *next = time + repeat_s;
                &*delivery
            })
        })
    }

    /// Returns the number of deliveries that were given up because they were not logged for too
    /// long.
    fn given_up(&self) -> u64 {
        self.given_up
    }
}

/// Builds the delivery of a sweep; `None` if its time cannot be represented. While the clock offset
/// is unknown the delivery carries a refusal instead of a reception.
fn deliver(
    extractor: &impl BearingExtractor,
    epoch: UnixTime,
    clock: Result<ClockOffset, String>,
    sweep: &Sweep<'_>,
) -> Option<Delivery> {
    let own = epoch.after(sweep.time)?;
    let ended = own.after(clock.as_ref().map_or(0.0, |clock| clock.offset_s))?;
    let reception = if let Err(uncertain) = clock {
        Err(uncertain)
    } else if !sweep.receiver.is_finite() {
        Err(format!("{:?} is not finite", sweep.receiver))
    } else if sweep.samples.is_empty() && !sweep.measured.is_empty() {
        // A source of ranges has no pattern to extract anything of.
        Ok(Reception::without_pattern(sweep))
    } else {
        let reading = extractor.extract(sweep).map_err(|error| error.to_string());
        reading.map(|reading| Reception::new(sweep, &reading))
    };
    Some(Delivery { beacon: sweep.beacon, ended, reception })
}

#[cfg(test)]
mod tests {
    use foxhunt_core::{
        BeaconId, Measured, MeasuredList, NoReading, OwnedSweep, Pose, Quantity, Reading, Sample,
    };

    use super::*;

    /// An extractor that finds nothing in any pattern.
    struct Deaf;

    impl BearingExtractor for Deaf {
        fn extract(&self, _: &Sweep<'_>) -> Result<Reading, NoReading> {
            Err(NoReading::Empty)
        }
    }

    #[test]
    fn a_range_without_a_pattern_is_delivered() {
        let range = Measured::new(Quantity::RANGE, 12.0, 0.5).expect("a range");
        let mut sweep = OwnedSweep {
            beacon: BeaconId(1),
            time: 7.0,
            receiver: Pose::at(1.0, 2.0, 3.0),
            measured: MeasuredList::new(&[range]).expect("room for one"),
            ..OwnedSweep::default()
        };
        let epoch = UnixTime::whole(100);
        let clock = ClockOffset { offset_s: -3.0, uncertainty_s: 0.1, jumps: 0 };
        let delivered = |sweep: &OwnedSweep| deliver(&Deaf, epoch, Ok(clock), &sweep.as_sweep());
        let delivery = delivered(&sweep).expect("a time");
        // By the clock of the one that fuses.
        assert_eq!(delivery.ended, UnixTime::whole(104));
        let reception = delivery.reception.expect("a reception");
        assert_eq!(reception.measured.get(Quantity::RANGE), Some(&range));
        assert_eq!((reception.level, reception.bearing), (None, None));
        // With a pattern it is the extractor that decides.
        let receiver = sweep.receiver;
        let sample = Sample { time: 7.0, receiver, boresight: 0.0, position: 0, rss_dbm: -60.0 };
        sweep.samples.push(sample);
        assert!(delivered(&sweep).expect("a time").reception.is_err());
        sweep.receiver.position.x = f64::NAN;
        assert!(delivered(&sweep).expect("a time").reception.is_err());
        sweep.time = f64::INFINITY;
        assert!(delivered(&sweep).is_none());
    }
}
