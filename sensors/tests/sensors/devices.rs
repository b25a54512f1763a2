//! Fake devices on a clock that the test moves.

use std::{cell::RefCell, rc::Rc};

use foxhunt_core::{BeaconId, Pose, Radio, Rotator, Spinner, Vehicle, Waypoint, angle};
use foxhunt_sensors::{
    BodyConfig, BodySource, OmnidirectionalConfig, OmnidirectionalSource, StepperConfig,
    StepperSource,
};
use nalgebra::Vector3;

/// Behaviour of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Health {
    Good,
    /// It never answers.
    Silent,
    /// It fails at every call.
    Broken,
}

/// The state of all devices.
#[derive(Debug)]
pub(crate) struct World {
    pub(crate) now: f64,
    pub(crate) radio: Health,
    pub(crate) rotator: Health,
    pub(crate) vehicle: Health,
    pub(crate) pose: Pose,
    /// Rate at which the body turns, in radians per second.
    pub(crate) rate: f64,
    /// The share of an ordered rate that it follows with.
    pub(crate) follows: f64,
    /// Velocity of its drift.
    pub(crate) drift: Vector3<f64>,
    /// The rates ordered.
    pub(crate) spins: Vec<Option<f64>>,
    /// Seconds from a question to its answer.
    pub(crate) latency: f64,
    /// Seconds from an order to standstill.
    pub(crate) turning: f64,
    /// The angle at which the motor stands in spite of orders.
    pub(crate) stuck_at: Option<f64>,
    /// Every n-th question stays without an answer.
    pub(crate) lose_every: usize,
    /// A beacon that never answers.
    pub(crate) mute: Option<BeaconId>,
    /// Every n-th answer is not a number.
    pub(crate) nan_every: usize,
    /// The angles ordered, and when.
    pub(crate) orders: Vec<(f64, f64)>,
    /// The questions sent: to whom, and when.
    pub(crate) questions: Vec<(BeaconId, f64)>,
    /// Answers given.
    pub(crate) answers: usize,
    pending: bool,
}

/// A device that fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Failed;

impl core::fmt::Display for Failed {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("out of order")
    }
}

impl core::error::Error for Failed {}

/// A handle on the world: one for each device, one for the test.
#[derive(Clone, Debug)]
pub(crate) struct Handle(Rc<RefCell<World>>);

impl Default for Handle {
    fn default() -> Self {
        Self(Rc::new(RefCell::new(World {
            now: 100.0,
            radio: Health::Good,
            rotator: Health::Good,
            vehicle: Health::Good,
            pose: Pose { heading: 0.7, ..Pose::at(3.0, -2.0, 4.0) },
            rate: 0.0,
            follows: 1.0,
            drift: Vector3::zeros(),
            spins: Vec::new(),
            latency: 0.01,
            turning: 0.02,
            stuck_at: None,
            lose_every: usize::MAX,
            mute: None,
            nan_every: usize::MAX,
            orders: Vec::new(),
            questions: Vec::new(),
            answers: 0,
            pending: false,
        })))
    }
}

impl Handle {
    /// Looks at the world or changes it.
    pub(crate) fn with<T>(&self, change: impl FnOnce(&mut World) -> T) -> T {
        change(&mut self.0.borrow_mut())
    }

    pub(crate) fn wait(&self, seconds: f64) {
        self.with(|w| {
            w.now += seconds;
            w.pose.heading = angle::wrap(w.pose.heading + w.rate * seconds);
            w.pose.position += w.drift * seconds;
        });
    }

    fn clock(&self) -> Clock {
        let clock = self.clone();
        Box::new(move || clock.with(|w| w.now))
    }

    /// A body that turns, with these devices on it.
    pub(crate) fn body(&self, config: BodyConfig) -> Body {
        BodySource::new(config, self.clone(), self.clone(), self.clock()).expect("in range")
    }

    /// A source that does not turn, on these devices.
    pub(crate) fn omnidirectional(&self, config: OmnidirectionalConfig) -> Omnidirectional {
        OmnidirectionalSource::new(config, self.clone(), self.clone(), self.clock())
            .expect("in range")
    }

    /// A stepper source on these devices.
    pub(crate) fn source(&self, config: StepperConfig) -> Source {
        StepperSource::new(config, self.clone(), self.clone(), self.clone(), self.clock())
    }
}

type Clock = Box<dyn Fn() -> f64>;
pub(crate) type Source = StepperSource<Handle, Handle, Handle, Clock>;
pub(crate) type Body = BodySource<Handle, Handle, Clock>;
pub(crate) type Omnidirectional = OmnidirectionalSource<Handle, Handle, Clock>;

/// The result of a device of that health for its answer.
fn report<T>(health: Health, answer: Option<T>) -> Result<Option<T>, Failed> {
    match health {
        Health::Good => Ok(answer),
        Health::Silent => Ok(None),
        Health::Broken => Err(Failed),
    }
}

impl Radio for Handle {
    type Error = Failed;

    fn request(&mut self, beacon: BeaconId) -> Result<(), Failed> {
        self.with(|w| {
            report(w.radio, Some(()))?;
            w.questions.push((beacon, w.now));
            w.pending = w.questions.len() % w.lose_every != 0 && w.mute != Some(beacon);
            Ok(())
        })
    }

    fn poll(&mut self) -> Result<Option<f64>, Failed> {
        self.with(|w| {
            let requested = w.questions.last().map_or(f64::INFINITY, |q| q.1);
            let due = w.pending && w.now >= requested + w.latency;
            let reported = report(w.radio, due.then_some(()))?;
            Ok(reported.map(|()| {
                w.pending = false;
                w.answers += 1;
                if w.answers % w.nan_every == 0 { f64::NAN } else { -50.0 }
            }))
        })
    }
}

impl Rotator for Handle {
    type Error = Failed;

    fn turn_to(&mut self, angle: f64) -> Result<(), Failed> {
        self.with(|w| {
            report(w.rotator, Some(()))?;
            w.orders.push((angle, w.now));
            Ok(())
        })
    }

    fn poll(&mut self) -> Result<Option<f64>, Failed> {
        self.with(|w| {
            let stands = w.orders.last().filter(|order| w.now >= order.1 + w.turning);
            report(w.rotator, stands.map(|order| w.stuck_at.unwrap_or(order.0)))
        })
    }
}

impl Vehicle for Handle {
    type Error = Failed;

    fn pose(&mut self) -> Result<Pose, Failed> {
        self.with(|w| if w.vehicle == Health::Good { Ok(w.pose) } else { Err(Failed) })
    }

    fn go_to(&mut self, _: &Waypoint) -> Result<(), Failed> {
        Ok(())
    }
}

impl Spinner for Handle {
    fn spin(&mut self, rate: Option<f64>) -> Result<(), Failed> {
        self.with(|w| {
            report(w.rotator, Some(()))?;
            w.spins.push(rate);
            w.rate = rate.unwrap_or(0.0) * w.follows;
            Ok(())
        })
    }
}
