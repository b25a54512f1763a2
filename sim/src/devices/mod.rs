//! The handles through which a simulated world is met: its devices, with the traits of the
//! hardware.

mod world;

pub use world::World;

use std::{cell::RefCell, collections::VecDeque, fmt, rc::Rc};

use foxhunt_core::{
    BeaconId, Clock, Measured, MeasuredError, MeasuredList, OwnedSweep, PatternSource, Pose,
    Quantity, Radio, Rotator, Spinner, SteadyMotion, Sweep, Vehicle, Waypoint,
};
use foxhunt_sensors::{BodySource, MagneticDipole, OmnidirectionalSource, StepperSource};

use crate::{
    BeaconConfig, RangeDifferenceConfig, SimError, ThreeAxisConfig,
    truth::{Channel, Drone, Free, Port, Truth, beacon_of, is_due},
};

/// A stepped antenna under a simulated drone.
pub type SimStepper = StepperSource<SimRadio, SimRotator, SimVehicle, SimClock>;

/// A simulated drone that turns as a whole, with its antenna.
pub type SimBody = BodySource<SimRadio, SimVehicle, SimClock>;

/// A simulated drone whose antenna has no direction.
pub type SimOmnidirectional = OmnidirectionalSource<SimRadio, SimVehicle, SimClock>;

/// Something that sits on one drone of a world.
#[derive(Clone, Debug)]
pub(crate) struct OnBoard {
    truth: Rc<RefCell<Truth>>,
    /// Below the number of drones, which never falls.
    drone: usize,
}

impl OnBoard {
    fn new(truth: &Rc<RefCell<Truth>>, drone: usize) -> Result<Self, SimError> {
        let drones = truth.borrow().drones.len();
        if drone >= drones {
            return Err(SimError::Drone { drone, drones });
        }
        Ok(Self { truth: Rc::clone(truth), drone })
    }

    /// The drone at the present time of its devices.
    #[inline]
    pub(crate) fn with<T>(&self, act: impl FnOnce(&mut Drone, f64) -> T) -> T {
        let truth = &mut *self.truth.borrow_mut();
        let drone = &mut truth.drones[self.drone];
        let now = drone.time(truth.time);
        act(drone, now)
    }

    /// The drone at the present time, over its link.
    ///
    /// # Errors
    ///
    /// [`SimError::Link`] while there is no link.
    #[inline]
    fn over_link<T>(&self, act: impl FnOnce(&mut Drone, f64) -> T) -> Result<T, SimError> {
        self.with(|drone, now| {
            if drone.is_linked(now) {
                Ok(act(drone, now))
            } else {
                Err(SimError::Link { drone: self.drone })
            }
        })
    }

    /// Returns the drone's clock, which may go ahead of the world's.
    fn clock(&self) -> SimClock {
        SimClock { truth: Rc::clone(&self.truth), drone: Some(self.drone) }
    }

    /// The drone in its world.
    pub(crate) fn with_truth<T>(&self, act: impl FnOnce(&mut Truth, usize) -> T) -> T {
        act(&mut self.truth.borrow_mut(), self.drone)
    }
}

/// A simulated world's clock, or that of one of its drones, which may [go ahead](Clock::go_ahead)
/// as far as the world [allows](crate::World::allow_ahead).
#[derive(Clone, Debug)]
pub struct SimClock {
    truth: Rc<RefCell<Truth>>,
    drone: Option<usize>,
}

impl Clock for SimClock {
    #[inline]
    fn now(&self) -> f64 {
        let truth = self.truth.borrow();
        self.drone.map_or(truth.time, |drone| truth.drones[drone].time(truth.time))
    }

    fn go_ahead(&self, event: f64) -> bool {
        let truth = &mut *self.truth.borrow_mut();
        self.drone.is_some_and(|drone| truth.drones[drone].go_ahead(event, truth.time, truth.free))
    }

    #[inline]
    fn is_ahead(&self) -> bool {
        let truth = self.truth.borrow();
        self.drone.is_some_and(|drone| truth.drones[drone].time(truth.time) > truth.time)
    }
}

/// A simulated drone's radio. An answer's power is that of the moment of the request.
#[derive(Clone, Debug)]
pub struct SimRadio {
    pub(crate) on_board: OnBoard,
    /// True if it is at the antenna of the channel; otherwise it is at an omnidirectional one.
    pub(crate) directional: bool,
}

impl SimRadio {
    fn port(&self) -> Port<'static> {
        if self.directional { Port::Directional } else { Port::Omnidirectional }
    }
}

impl Radio for SimRadio {
    type Error = SimError;

    /// # Errors
    ///
    /// [`SimError::Beacon`] if there is no such beacon; an older request stays then.
    fn request(&mut self, beacon: BeaconId) -> Result<(), SimError> {
        self.on_board.with_truth(|truth, drone| {
            let Truth { time, channel, beacons, drones, .. } = truth;
            let to = beacon_of(beacons, beacon)?;
            let drone = &mut drones[drone];
            let now = drone.time(*time);
            drone.request(channel, beacon, to, self.port(), now);
            Ok(())
        })
    }

    /// # Errors
    ///
    /// The errors of [`request`](Self::request).
    fn interrogate(
        &mut self,
        beacon: BeaconId,
        until: f64,
        answers: &mut [(f64, f64)],
    ) -> Result<usize, SimError> {
        self.on_board.with_truth(|truth, drone| {
            let Truth { time, free, channel, beacons, drones } = truth;
            let to = (beacon, beacon_of(beacons, beacon)?);
            let free = Free { until: free.until.min(until), ..*free };
            Ok(drones[drone].interrogate(channel, to, self.port(), (*time, free), answers))
        })
    }

    #[inline]
    fn poll(&mut self) -> Result<Option<f64>, SimError> {
        Ok(self.on_board.with(|drone, now| drone.receiver.take_answer(now)))
    }

    #[inline]
    fn next_event(&self) -> Option<f64> {
        Some(self.on_board.with(|drone, _| drone.receiver.answers_at()))
    }
}

/// The motor that turns a simulated drone's antenna.
#[derive(Clone, Debug)]
pub struct SimRotator(OnBoard);

impl Rotator for SimRotator {
    type Error = SimError;

    /// # Errors
    ///
    /// [`SimError::Angle`] for an angle that is not finite; the older order stays then.
    fn turn_to(&mut self, angle: f64) -> Result<(), SimError> {
        if !angle.is_finite() {
            return Err(SimError::Angle { angle });
        }
        self.0.with(|drone, now| drone.turn_to(angle, now));
        Ok(())
    }

    #[inline]
    fn poll(&mut self) -> Result<Option<f64>, SimError> {
        Ok(self.0.with(|drone, now| drone.motor.standing(now)))
    }

    #[inline]
    fn next_event(&self) -> Option<f64> {
        Some(self.0.with(|drone, now| drone.motor.stands_at(now)))
    }
}

/// A simulated drone as a vehicle, which can turn while it flies. Its pose and every order fail
/// with [`SimError::Link`] while nobody has a link to it.
#[derive(Clone, Debug)]
pub struct SimVehicle(OnBoard);

impl Vehicle for SimVehicle {
    type Error = SimError;

    #[inline]
    fn pose(&mut self) -> Result<Pose, SimError> {
        self.0.over_link(|drone, _| drone.reported_pose())
    }

    /// # Errors
    ///
    /// [`SimError::Goal`] for a goal that is not finite; the older goal stays then.
    fn go_to(&mut self, goal: &Waypoint) -> Result<(), SimError> {
        self.0.over_link(|drone, now| drone.go_to(goal.position, now))?
    }

    fn steady_motion(&self) -> Option<SteadyMotion> {
        self.0.with(|drone, now| drone.steady_motion(now))
    }
}

impl Spinner for SimVehicle {
    /// # Errors
    ///
    /// [`SimError::SpinRate`] for a rate that is not finite; it goes on as before then.
    fn spin(&mut self, rate: Option<f64>) -> Result<(), SimError> {
        self.0.over_link(|drone, _| drone.body.spin(rate))?
    }
}

/// A simulated receiver whose sweeps hold no samples but quantities of the beacon's next pulse;
/// nothing if it does not reach the receiver.
///
/// One of three axes measures the magnetic field, in [`MagneticDipole::QUANTITIES`], up to its
/// sign; one that shares its clock with a reference receiver the range difference, in
/// [`Quantity::RANGE_DIFFERENCE`]. Several beacons are received one after the other.
#[derive(Clone, Debug)]
pub struct SimInstrument {
    on_board: OnBoard,
    instrument: Instrument,
    /// Reception that is still to come, and its earliest time.
    waiting: VecDeque<BeaconId>,
    since: f64,
}

/// Quantity that a [`SimInstrument`] measures.
#[derive(Clone, Copy, Debug)]
enum Instrument {
    ThreeAxis(ThreeAxisConfig),
    RangeDifference(RangeDifferenceConfig),
}

impl Instrument {
    /// Returns the quantities of a pulse that is sent now.
    fn measure(
        self,
        drone: &mut Drone,
        channel: &Channel,
        beacon: &BeaconConfig,
        now: f64,
    ) -> Result<MeasuredList, MeasuredError> {
        match self {
            Self::ThreeAxis(config) => {
                let Some(field) = drone.magnetic_field(channel, beacon, &config, now) else {
                    return Ok(MeasuredList::default());
                };
                // σ follows from what is measured, as a receiver knows no more.
                let sigma = config.sigma(field.norm());
                let part = |n: usize| Measured::new(MagneticDipole::QUANTITIES[n], field[n], sigma);
                MeasuredList::new(&[part(0)?, part(1)?, part(2)?])
            }
            Self::RangeDifference(config) => {
                let Some(value) = drone.range_difference(channel, beacon, &config, now) else {
                    return Ok(MeasuredList::default());
                };
                let quantity = Quantity::RANGE_DIFFERENCE;
                MeasuredList::new(&[Measured::new(quantity, value, config.sigma_m)?])
            }
        }
    }
}

impl SimInstrument {
    fn new(on_board: OnBoard, instrument: Instrument) -> Self {
        Self { on_board, instrument, waiting: VecDeque::new(), since: 0.0 }
    }

    /// Returns the end of the pulse that is waited for; infinite without one.
    fn due(&self) -> Result<f64, SimError> {
        let Some(beacon) = self.waiting.front() else { return Ok(f64::INFINITY) };
        let due = |truth: &mut Truth, drone: usize| {
            let latency = truth.drones[drone].receiver.latency();
            Ok(beacon_of(&truth.beacons, *beacon)?.answer_after(self.since, latency))
        };
        self.on_board.with_truth(due)
    }
}

impl PatternSource for SimInstrument {
    type Error = SimError;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), SimError> {
        self.waiting = beacons.iter().copied().collect();
        self.since = self.on_board.with(|_, now| now);
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, SimError> {
        let now = self.on_board.with(|_, now| now);
        let due = self.due()?;
        if !is_due(due, now) {
            return Ok(None);
        }
        let Some(beacon) = self.waiting.pop_front() else { return Ok(None) };
        self.since = now;
        let instrument = self.instrument;
        self.on_board.with_truth(|truth, drone| {
            let Truth { time, channel, beacons, drones, .. } = truth;
            let from = beacon_of(beacons, beacon)?;
            let drone = &mut drones[drone];
            let measured = instrument.measure(drone, channel, from, *time);
            Ok(Some(Sweep {
                beacon,
                time: *time,
                receiver: drone.reported_pose(),
                positions: 1,
                measured: measured.expect("places are finite, and there is room for three"),
                ..Sweep::default()
            }))
        })
    }

    fn next_event(&self) -> Option<f64> {
        self.due().ok()
    }
}

/// A source of a drone whose sweeps come later by its
/// [`late_s`](crate::DroneConfig::late_s): what they hold, the time of their end included,
/// stays as it is. A turn that is begun before they came gives them up.
pub struct LateSource<S> {
    on_board: OnBoard,
    source: S,
    /// The delay in seconds.
    delay: f64,
    /// Sweeps on the way, and when each comes.
    under_way: VecDeque<(f64, OwnedSweep)>,
    lent: Option<OwnedSweep>,
}

impl<S: fmt::Debug> fmt::Debug for LateSource<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LateSource")
            .field("source", &self.source)
            .field("delay", &self.delay)
            .field("under_way", &self.under_way.len())
            .finish_non_exhaustive()
    }
}

impl<S> LateSource<S> {
    fn new(on_board: OnBoard, source: S) -> Self {
        let delay = on_board.with(|drone, _| drone.failures.late_s);
        Self { on_board, source, delay, under_way: VecDeque::new(), lent: None }
    }
}

impl<S: PatternSource> PatternSource for LateSource<S> {
    type Error = S::Error;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), S::Error> {
        self.under_way.clear();
        self.source.begin(beacons)
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, S::Error> {
        if self.delay <= 0.0 {
            return self.source.poll();
        }
        let now = self.on_board.with(|_, now| now);
        while let Some(sweep) = self.source.poll()? {
            self.under_way.push_back((now + self.delay, OwnedSweep::from(&sweep)));
        }
        let come = self.under_way.front().is_some_and(|(time, _)| is_due(*time, now));
        self.lent = come.then(|| self.under_way.pop_front()).flatten().map(|(_, sweep)| sweep);
        Ok(self.lent.as_ref().map(OwnedSweep::as_sweep))
    }

    fn next_event(&self) -> Option<f64> {
        let comes = self.under_way.front().map_or(f64::INFINITY, |(time, _)| *time);
        Some(self.source.next_event()?.min(comes))
    }
}
